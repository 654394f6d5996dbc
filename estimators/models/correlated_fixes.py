"""Models with states for the time-correlated errors of position fixes.

The error of a GNSS fix is white noise plus a slow part: orbits, clocks, ionosphere and mild multipath, correlated over
minutes. If the slow part is modelled as white noise, a hundred fixes with the same error count as a hundred independent
ones, and the covariance becomes too small. With a first-order Gauss-Markov state for each component the filter does not
average this error (P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2013,
section 14.2; A. Gelb (ed.), *Applied Optimal Estimation*, 1974, section 3.6).

If a datasheet gives the size and the correlation time of the slow part (``bias_instability``, ``correlation_time``),
every model of simnav has these states. Here every fix has them, with at least a given size of the slow error, because
datasheets do not include multipath. A datasheet that declares its coloured processes by name is taken as it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simnav.types import Array, Datasheet, InitialState, Instruments

from .base import ErrorModel
from .inertial import InertialModel
from .ship import ShipModel
from .suitable import Suitable

__all__ = ["CorrelatedFixes", "with_correlated_fixes"]


def with_correlated_fixes(instruments: Instruments, slow: float, slow_time: float) -> Instruments:
    """The datasheets, with a slow error of a certain size or more for every fix.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of the run's instruments.
    slow : float
        Smallest sigma of the slow error, as a multiple of that of the white noise.
    slow_time : float
        Correlation time of the slow error, if the datasheet gives none [s].
    """

    def change(sheet: Datasheet) -> Datasheet:
        if sheet.role != "fix" or sheet.processes:
            return sheet
        return replace(
            sheet,
            bias_instability=np.maximum(sheet.bias_instability, slow * sheet.sigma),
            correlation_time=sheet.correlation_time if np.any(sheet.bias_instability) else slow_time,
        )

    return instruments.changed(change)


class _Correlated(ErrorModel):
    """A model that is begun with the datasheets of `with_correlated_fixes`."""

    slow: float
    slow_time: float

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario where the model lacks an instrument."""
        own = with_correlated_fixes(instruments, self.slow, self.slow_time)
        return super().begin(start, own)  # type: ignore[safe-super]


class _Inertial(_Correlated, InertialModel):
    """The inertial model."""


class _Ship(_Correlated, ShipModel):
    """The ship model."""


class CorrelatedFixes(Suitable):
    """The inertial model where there is an IMU, else the ship model, with states for the slow error of every fix.

    Parameters
    ----------
    slow : float
        Smallest sigma of the slow error, as a multiple of the datasheet's white noise, which is not changed. A larger
        slow error of the datasheet is used as it is. 0: the plain filter.
    slow_time : float
        Correlation time of the slow error, if the datasheet gives none [s].
    """

    def __init__(self, slow: float = 0.5, slow_time: float = 120.0):
        if not 0.0 <= slow < np.inf:
            raise ValueError(f"slow = {slow:g}: it must be 0 or more, and finite")
        if not 0.0 < slow_time < np.inf:
            raise ValueError(f"slow_time = {slow_time:g} s: it must be above 0 and finite")
        self.slow, self.slow_time = slow, slow_time

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """A new model; UnsuitableScenario where neither will do."""
        model: _Correlated = _Ship() if instruments.imu is None else _Inertial()
        model.slow, model.slow_time = self.slow, self.slow_time
        return model.choose(instruments, name)
