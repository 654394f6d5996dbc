"""The factors of a declared process (`simnav.declared_process`) for a model that is linearised about the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from simnav.declared_process import Factor
from simnav.sensors.error_processes import FACTORS, Factors
from simnav.types import Array, NavigationStates, TapStates
from simnav.world import Surroundings

from .inertial import InertialModel, roll_pitch_yaw

__all__ = ["TruthLinearisedFactors"]

_NOWHERE = Surroundings()


class TruthLinearisedFactors:
    """The product of the factors of a process, at the nominal state of the model.

    A factor that depends on earlier states is computed from the truth at the steps of the run, and is linear between
    them. A factor of the surroundings that the datasheet has not taken into its size counts as 1.

    Parameters
    ----------
    factors : sequence of Factor
        The factors.
    truth : NavigationStates
        True states at the steps of the run.
    """

    def __init__(self, factors: Sequence[Factor], truth: NavigationStates):
        known = [factor for factor in factors if factor.name in FACTORS and factor.name != "wave_height"]
        self._now = Factors(factor for factor in known if not FACTORS[factor.name].remembers)
        remembering = Factors(factor for factor in known if FACTORS[factor.name].remembers)
        self._series: tuple[Array, Array] | None = None
        if remembering:
            whole = np.isfinite(np.hstack([truth.position, truth.velocity, truth.attitude])).all(axis=1)
            n = int(whole.sum())
            tap = TapStates(
                truth.time[whole], truth.position[whole], truth.velocity[whole], truth.attitude[whole],
                np.zeros((n, 3)), np.zeros((n, 3)),
            )  # fmt: skip
            self._series = tap.time, remembering.at(tap, np.ones((n, 1)), _NOWHERE)[:, 0]

    def at(self, time: float, nominal: InertialModel, reading: Array) -> Array:
        """The (d,) product for the components of a reading.

        Parameters
        ----------
        time : float
            Time of the reading [s].
        nominal : InertialModel
            The nominal state at this time.
        reading : (d,) array
            What the instrument should read.
        """
        product = np.ones(len(reading))
        if self._now:
            tap = TapStates(
                np.array([time]), nominal.position[None], nominal.velocity[None], roll_pitch_yaw(nominal.dcm)[None],
                nominal.raw_rate[None], np.zeros((1, 3)),
            )  # fmt: skip
            product = product * self._now.at(tap, reading[None], _NOWHERE)[0]
        if self._series is not None:
            product = product * np.interp(time, *self._series)
        return product
