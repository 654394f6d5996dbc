"""The inertial model with states for the errors that faults make last: only for estimators that are told of the faults.

An error that is correlated in time is no noise. Whoever knows that it is there has it in the state, and the other
instruments tell it apart:

- multipath, a first-order Gauss-Markov process: a state of its stationary sigma and correlation time for each component
- a bias step: a constant of the size of the step, seen while it acts
- a ramp: a constant slope, seen times the time since it began

(Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, Wiley 2001, section 8.2.)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.models.base import Linearised
from estimators.models.inertial import InertialModel
from simnav.types import Array, Measurement

__all__ = ["FaultState", "FaultStateModel"]


class FaultState(NamedTuple):
    """The error that one fault adds to an instrument, component by component.

    Attributes
    ----------
    instrument : str
    sigma : (d,) array
        Of each component; no state where it is zero.
    correlation_time : float
        [s]; infinite for a constant.
    factor : callable
        Time of a measurement [s] to what the state is multiplied by; 0 where the fault does not touch it.
    """

    instrument: str
    sigma: Array
    correlation_time: float
    factor: Callable[[float], float]


class FaultStateModel(InertialModel):
    """`InertialModel` with fault states behind its calibration states.

    Parameters
    ----------
    faults : sequence of FaultState
    """

    def __init__(self, faults: Sequence[FaultState]):
        super().__init__()
        self.faults = faults

    def _more_states(self) -> list[tuple[float, float, float]]:
        states = super()._more_states()
        first = 15 + len(self._states) + len(states)
        self._faults_of: dict[str, list[tuple[FaultState, NDArray[np.intp], int]]] = {}
        for fault in self.faults:
            axes = np.flatnonzero(fault.sigma)
            self._faults_of.setdefault(fault.instrument, []).append((fault, axes, first))
            first += len(axes)
            decay = 1.0 / fault.correlation_time
            states += [(s * s, decay, 2.0 * s * s * decay) for s in fault.sigma[axes].tolist()]
        return states

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement, the errors of its faults included."""
        linearised = super().measure(measurement)
        if linearised is not None:
            for fault, axes, at in self._faults_of.get(measurement.instrument, ()):
                factor = fault.factor(measurement.time)
                columns = np.arange(at, at + len(axes))
                linearised.jacobian[axes, columns] = factor
                linearised.innovation[axes] -= factor * self.calibration[columns - 15]
        return linearised
