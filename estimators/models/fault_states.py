"""States for lasting errors of faults, after the states of any model: only for estimators that know the faults.

A time-correlated error is not white noise. If it is known to be there, it is a state, and the other instruments make it
observable:

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

from simnav.blocks import StateBlock
from simnav.types import Array, Datasheet, Estimate, ImuSamples, InitialState, Instruments, Measurement

from .base import ErrorModel, Linearised
from .state_blocks import StateBlocks

__all__ = ["FaultState", "FaultStateModel"]


class FaultState(NamedTuple):
    """The error that one fault adds to an instrument, component by component.

    Attributes
    ----------
    instrument : str
        Name of the instrument, or the source of a channel (`simnav.types.Measurement.source`).
    block : StateBlock
        The error; a component of the sigma 0 has no state.
    factor : callable
        Function from the time of a measurement [s] to the factor of the state in it; 0 if the fault does not affect it.
    """

    instrument: str
    block: StateBlock
    factor: Callable[[float], float]


class FaultStateModel(ErrorModel):
    """A model with fault states behind its own.

    Parameters
    ----------
    inner : ErrorModel
        One that can `carry` an error along.
    faults : sequence of FaultState
        The faults that become states.
    """

    def __init__(self, inner: ErrorModel, faults: Sequence[FaultState]):
        self.inner, self.faults = inner, faults

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; the fault states begin with their stationary variance."""
        own = self.inner.begin(start, instruments)
        self.time, n = start.time, len(own)
        self._of: dict[str, list[tuple[FaultState, NDArray[np.intp], int]]] = {}
        self.blocks = StateBlocks(n)
        for j, fault in enumerate(self.faults):
            axes, rates = np.flatnonzero(fault.block.sigma), fault.block.rates()
            at = self.blocks.add(fault.instrument, f"{fault.block.name}_{j}", [rates[axis] for axis in axes])
            self._of.setdefault(fault.instrument, []).append((fault, axes, at))
        self.size = self.blocks.size
        self._variance, self._rate, _ = self.blocks.columns(n)
        self.values = np.zeros(self.size - n)
        covariance = np.zeros((self.size, self.size))
        covariance[:n, :n] = own
        covariance[range(n, self.size), range(n, self.size)] = self._variance
        return covariance

    def observes(self, instrument: Datasheet) -> bool:
        """As the model within."""
        return self.inner.observes(instrument)

    def components(self, instrument: Datasheet) -> int:
        """As the model within."""
        return self.inner.components(instrument)

    def load(self, imu: ImuSamples | None) -> None:
        """Take the IMU samples of the step that follows."""
        self.inner.load(imu)

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the states and their covariance."""
        elapsed, n = until - self.time, self.inner.size
        if elapsed <= 0.0:
            return
        own, cross = covariance[:n, :n].copy(), covariance[:n, n:].copy()
        self.inner.propagate(own, until)
        self.inner.carry(cross, elapsed)
        self.time = until
        decay = np.exp(-self._rate * elapsed)
        self.values *= decay
        cross *= decay
        covariance[:n, :n], covariance[:n, n:], covariance[n:, :n] = own, cross, cross.T
        covariance[n:, n:] *= np.outer(decay, decay)
        index = np.arange(n, self.size)
        covariance[index, index] += self._variance * (1.0 - decay**2)

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        n = self.inner.size
        self.inner.carry(error[:n], elapsed)
        error.T[..., n:] *= np.exp(-self._rate * elapsed)

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement, the errors of its faults included."""
        linearised = self.inner.measure(measurement)
        if linearised is None:
            return None
        n, d = self.inner.size, len(linearised.innovation)
        jacobian = np.zeros((d, self.size))
        jacobian[:, :n] = linearised.jacobian
        innovation = linearised.innovation
        for fault, axes, at in self._of.get(measurement.source, ()):
            factor = fault.factor(measurement.time)
            for k, axis in enumerate(axes.tolist()):
                if factor and axis < d:  # a ship's model has no height
                    jacobian[axis, at + k] = factor
                    innovation[axis] -= factor * self.values[at + k - n]
        return Linearised(innovation, jacobian, linearised.noise)

    def correct(self, dx: Array) -> None:
        """Add a correction to the states."""
        n = self.inner.size
        self.inner.correct(dx[:n])
        self.values += dx[n:]

    def snapshot(self) -> list[Array]:
        """Copies of what `correct` changes."""
        return [*self.inner.snapshot(), self.values.copy()]

    def restore(self, snapshot: list[Array]) -> None:
        """Take corrections back."""
        self.inner.restore(snapshot[:-1])
        self.values[:] = snapshot[-1]

    def estimate(self, covariance: Array) -> Estimate:
        """As the model within, and on request the states of the faults."""
        n = self.inner.size
        self.inner.reports_all = self.reports_all
        estimate = self.inner.estimate(covariance[:n, :n].copy())
        if self.reports_all:
            estimate.states = {**estimate.states, **self.blocks.report(self.values, n, covariance, everything=True)}
        return estimate
