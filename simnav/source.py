"""Where measurements come from: the simulator or a recorded log, with the same interface."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Protocol

from simnav.recording import Block, FaultLabel, Recording
from simnav.types import InitialState, Instruments, NavigationStates

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["Source", "free_memory", "open_source", "record"]


class Source(Protocol):
    """A run that is advanced block by block.

    Attributes
    ----------
    instruments : Instruments
        The datasheets.
    start : InitialState
        What an estimator is told of the state at time 0.
    initial_truth : NavigationStates
        One state: the truth at time 0.
    faults : tuple of FaultLabel
        The faults of the run.
    duration, step : float
        Length of the run, and of one step [s].
    note : str
        What is to be known of the run; empty for a simulated one.
    scenario : Scenario
        That of this run, with nothing left to draw.
    """

    instruments: Instruments
    start: InitialState
    initial_truth: NavigationStates
    faults: tuple[FaultLabel, ...]
    duration: float
    step: float
    note: str
    scenario: Scenario

    def advance(self, until: float) -> Block:
        """The next stretch of the run, up to a time [s]."""
        ...


def open_source(scenario: Scenario, seed: int) -> Source:
    """Open one run of a scenario: the simulator, or a `simnav.log.LogSource` where the scenario is recorded.

    Parameters
    ----------
    scenario : Scenario
        A simulated or a recorded one.
    seed : int
        Seed of the run, non-negative.

    Raises
    ------
    simnav.log.LogError
        If the log of a recorded scenario is absent or cannot be used.
    """
    if scenario.log is not None:
        from simnav.log.source import LogSource

        return LogSource(scenario, seed)
    from simnav.simulation.simulator import Simulator

    return Simulator(scenario, seed)


def record(scenario: Scenario, seed: int) -> Recording:
    """Run a scenario to its end, in one block.

    Parameters
    ----------
    scenario : Scenario
        A simulated or a recorded one.
    seed : int
        Seed of the run, non-negative.

    Raises
    ------
    SpecError
        If the recording would not fit into the memory that is free: nothing is allocated then.

    Returns
    -------
    Recording
        Without the truth it would be what an estimator sees.
    """
    check_cost(scenario)
    source = open_source(scenario, seed)
    return Recording(
        scenario.id,
        seed,
        source.instruments,
        source.initial_truth,
        source.start,
        source.faults,
        source.advance(source.duration),
        source.note,
        source.scenario.draws,
        source.scenario.actual_sheet(),
        source.scenario.initial_error.actual_covariance(),
    )


def check_cost(scenario: Scenario) -> None:
    """Estimate the memory of a simulated recording before anything is allocated.

    Raises
    ------
    SpecError
        If it is more than is free; the message names the scenario, and the key that costs most.
    """
    from simnav.spec import SpecError

    if scenario.log is not None:
        return
    costs = {"step_s": _EPOCH * scenario.epochs}
    for name, spec in scenario.instruments.items():
        costs[f"instruments.{name}.rate_hz = {spec.rate:g}"] = _SAMPLE * spec.rate * scenario.duration
    needed, free = sum(costs.values()), free_memory()
    if needed > free:
        key = max(costs, key=lambda k: costs[k])
        raise SpecError(
            f"{scenario.id}: a recording of duration_s = {scenario.duration:g} with {key} takes about "
            f"{needed / 2**30:.3g} GiB of memory, and {free / 2**30:.3g} GiB are free"
        )


#: Memory of an epoch of the truth, and of a sample of an instrument while it is made [bytes].
_EPOCH, _SAMPLE = 300.0, 150.0


def free_memory() -> float:
    """Memory that a process can have now [bytes]; 64 GiB where it is not known."""
    with contextlib.suppress(OSError, ValueError, IndexError), open("/proc/meminfo") as file:
        for line in file:
            if line.startswith("MemAvailable:"):
                return 1024.0 * int(line.split()[1])
    return float(64 << 30)
