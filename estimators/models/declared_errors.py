"""The errors of an instrument: which states its datasheet asks for, declared here and nowhere else.

An error is a sum of processes, each of them a `simnav.blocks.StateBlock`: the bias of an aid is a constant turn-on bias
plus an in-run bias. Filter, window, full graph, smoother, sigma points, bound and oracle take the rates of their states
from here, in one of the two ways of `simnav.estimators.models.error_states`: merged into one state a component, or
apart. One more process of an error is one more block here, and nothing else.

- aid: ``bias``, with the processes that the datasheet names (`simnav.declared_process`); of a log also ``current``,
  which a reading of the speed through the water depends on
- aid with a scale factor: ``scale``; of a velocity in body axes also ``misalignment``; of a magnetic compass
  ``deviation``, the amplitudes of sine and cosine of the heading
- three gyroscopes or accelerometers: ``bias``, ``scale`` (three) and ``misalignment`` (six: each axis to the others)
- a lasting fault, for estimators that know the faults: its size (`error_of_fault`)

What an instrument needs beyond that it brings along in its datasheet (`Datasheet.blocks`): the error of its lever arm
if ``lever_arm_sigma`` says how well that was measured (`simnav.estimators.models.lever_arms`), and whatever an
instrument of somebody else depends on.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf

import numpy as np

from simnav.blocks import StateBlock
from simnav.types import KINDS, Array, Datasheet, TriadDatasheet

from .equations import equation_of

__all__ = [
    "CURRENT", "CURRENT_TIME", "SHORTEST", "DeclaredError", "bias_of", "bias_of_triad", "error_of_fault", "errors_of",
    "errors_of_triad", "processes_of_bias", "processes_of_triad_bias",
]  # fmt: skip

#: Sigma and correlation time of each component of the current, for a speed log [m/s], [s].
CURRENT, CURRENT_TIME = 0.5, 1800.0
#: An in-run bias of an IMU with a shorter correlation time is white noise [s].
SHORTEST = 1.0


def _sum(parts: Iterable[Array], size: int) -> Array:
    return np.asarray(sum(parts, np.zeros(size)))


@dataclass(frozen=True)
class DeclaredError:
    """One error of an instrument, the sum of processes.

    Attributes
    ----------
    name : str
        Name within the instrument, in snake_case.
    size : int
        Number k of components.
    processes : tuple of StateBlock
        Blocks of k components; empty if the datasheet says that there is no such error.
    shortest : float
        A Gauss-Markov process with a shorter correlation time is white noise [s].
    """

    name: str
    size: int
    processes: tuple[StateBlock, ...] = ()
    shortest: float = 0.0

    @property
    def slow(self) -> tuple[StateBlock, ...]:
        """The processes that can have states."""
        return tuple(p for p in self.processes if not self._is_fast(p))

    @property
    def fast(self) -> tuple[StateBlock, ...]:
        """The processes that are white noise."""
        return tuple(p for p in self.processes if self._is_fast(p))

    def _is_fast(self, process: StateBlock) -> bool:
        return process.process == "gauss_markov" and process.correlation_time < self.shortest

    def white_variance(self) -> Array:
        """(k,) variance of the fast processes in one reading."""
        return _sum((np.square(p.sigma) for p in self.fast), self.size)

    def white_density(self) -> Array:
        """(k,) density of white noise with the same effect at low frequency as the fast processes, ``2 sigma^2 T``."""
        return _sum((2.0 * np.square(p.sigma) * p.correlation_time for p in self.fast), self.size)


def _in_run(units: tuple[str, ...], sigma: tuple[float, ...], correlation_time: float) -> StateBlock:
    """The in-run bias; with an infinite correlation time ``sigma`` is the density of a random walk."""
    if correlation_time == inf:
        return StateBlock("in_run", len(sigma), units, 0.0, "random_walk", sigma)
    return StateBlock.stationary("in_run", len(sigma), units, sigma, correlation_time)


def _constant(name: str, units: str, *sigma: float) -> DeclaredError:
    """A constant error with a sigma for each component; without a process if all are zero."""
    return DeclaredError(name, len(sigma), (StateBlock(name, len(sigma), units, sigma),) if any(sigma) else ())


def processes_of_bias(sheet: Datasheet) -> tuple[StateBlock, ...]:
    """What the bias of an aid consists of: two figures, and the processes that the datasheet declares by name."""
    units = tuple(component.error_unit for component in KINDS[sheet.kind].components)
    found = []
    if any(turn_on := tuple(sheet.bias.tolist())):
        found.append(StateBlock("turn_on", len(units), units, turn_on))
    if any(in_run := tuple(sheet.bias_instability.tolist())):
        found.append(_in_run(units, in_run, sheet.correlation_time))
    found += [process.block for process in sheet.processes]
    return tuple(found)


def bias_of(sheet: Datasheet) -> DeclaredError:
    """The bias of an aid. A part that changes from sample to sample is white noise."""
    return DeclaredError("bias", len(sheet.sigma), processes_of_bias(sheet), 0.5 / sheet.rate)


def errors_of(sheet: Datasheet) -> dict[str, DeclaredError]:
    """The errors that an aid may have, by name. One that is zero in the datasheet has no processes."""
    equation, found = equation_of(sheet), [bias_of(sheet)]
    if equation.through_water:
        current = StateBlock.stationary("current", 2, "m_s", CURRENT, CURRENT_TIME)
        found.append(DeclaredError("current", 2, (current,)))
    if equation.has_scale:
        found.append(_constant("scale", "", sheet.scale))
    if equation.in_body:
        found.append(_constant("misalignment", "deg", *sheet.misalignment.tolist()))
    if "deviation" in sheet.details:
        found.append(_constant("deviation", "deg", *[float(sheet.details["deviation"])] * 2))
    return {error.name: error for error in found}


def processes_of_triad_bias(triad: TriadDatasheet, unit: str) -> tuple[StateBlock, ...]:
    """What the bias of three gyroscopes or accelerometers consists of."""
    found, units = [], (unit,) * 3
    if triad.bias:
        found.append(StateBlock("turn_on", 3, units, triad.bias))
    if triad.bias_instability:
        found.append(_in_run(units, (triad.bias_instability,) * 3, triad.correlation_time))
    if triad.rate_random_walk:
        found.append(StateBlock("walk", 3, units, 0.0, "random_walk", triad.rate_random_walk))
    return tuple(found)


def bias_of_triad(triad: TriadDatasheet, unit: str) -> DeclaredError:
    """The bias of three gyroscopes or accelerometers, whose output has a unit of `simnav.spec.UNITS`."""
    return DeclaredError("bias", 3, processes_of_triad_bias(triad, unit), SHORTEST)


def errors_of_triad(triad: TriadDatasheet, unit: str) -> dict[str, DeclaredError]:
    """The errors of three gyroscopes or accelerometers, by name, as of `errors_of`."""
    scale = _constant("scale", "", *[triad.scale] * 3)
    misalignment = _constant("misalignment", "deg", *[triad.misalignment] * 6)
    return {error.name: error for error in (bias_of_triad(triad, unit), scale, misalignment)}


def error_of_fault(kind: str, size: Array, correlation_time: float = inf) -> StateBlock:
    """The state of a lasting error of a fault.

    Parameters
    ----------
    kind : str
        Kind of the instrument.
    size : (d,) array
        Standard deviation of each component.
    correlation_time : float
        Correlation time [s]; infinite for a constant.
    """
    units = tuple(component.error_unit for component in KINDS[kind].components)
    sigma = tuple(np.abs(size).tolist())
    return StateBlock.stationary("fault", len(sigma), units, sigma, correlation_time)
