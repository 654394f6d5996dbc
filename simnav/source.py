"""The sources of measurements: the simulator and recorded logs, with the same interface."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Protocol

from simnav.labels import FaultLabel
from simnav.recording import Block, Recording
from simnav.types import InitialState, Instruments, NavigationStates

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["Source", "free_memory", "open_source", "record"]


class Source(Protocol):
    """A run that is advanced block by block.

    Attributes
    ----------
    instruments : Instruments
        Datasheets of all instruments of the run.
    start : InitialState
        Initial state with errors, which an estimator receives.
    initial_truth : NavigationStates
        One state: the truth at time 0.
    faults : tuple of FaultLabel
        The faults of the run.
    duration, step : float
        Length of the run, and of one step [s].
    note : str
        Remarks on the run; empty for a simulated one.
    scenario : Scenario
        The scenario of this run, with all values drawn.
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
        """Return the next block of the run, up to a time [s]."""
        ...


def open_source(scenario: Scenario, seed: int) -> Source:
    """Open one run of a scenario: the simulator, or a `simnav.log.LogSource` for a recorded scenario.

    Parameters
    ----------
    scenario : Scenario
        A simulated or a recorded scenario.
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
        A simulated or a recorded scenario.
    seed : int
        Seed of the run, non-negative.

    Raises
    ------
    SpecError
        If the recording needs more memory than is free. It is raised before anything is allocated.

    Returns
    -------
    Recording
        The whole run, with truth and labels.
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
        If it is more than the free memory. The message names the scenario, and the key that needs most memory.
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


#: Memory of an epoch of the truth, and of a sample of an instrument during the simulation [bytes].
_EPOCH, _SAMPLE = 300.0, 150.0


def free_memory() -> float:
    """Memory that is available to a process at this time [bytes]; 64 GiB if it is not known."""
    with contextlib.suppress(OSError, ValueError, IndexError), open("/proc/meminfo") as file:
        for line in file:
            if line.startswith("MemAvailable:"):
                return 1024.0 * int(line.split()[1])
    return float(64 << 30)
