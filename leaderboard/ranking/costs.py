"""What an epoch of estimators costs: time and memory of several on one scenario, and multiples of the plain row."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.figures.panels import Bar, bars
from simnav.leaderboard.figures.style import Style
from simnav.leaderboard.results.errors import mistakes
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.shown import Shown
from simnav.testing.cost import Cost, measure

from . import tables
from .cost_measurement import Unmeasured
from .stored_costs import CostMultiple

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

    from simnav.recording import Recording

__all__ = ["BESIDE", "CostReport", "MultipleReport", "cost_table", "costs_of", "multiple_table"]

#: The rows that an estimator is measured beside, if no others are asked for: one of each family.
BESIDE = ("dead-reckoning", "gnss-only", "ship-ekf", "ekf", "ukf", "sw-fgo", "ekf-rts")


@dataclass(frozen=True, repr=False)
class MultipleReport(Shown):
    """Processor times as multiples of those of the plain row.

    Attributes
    ----------
    rows : tuple of CostMultiple
        The multiples, with their 95 % intervals over the rounds. An estimator may have several: beside ``ekf``, beside
        ``ship-ekf``, and one that smooths also beside their smoothers.
    unmeasured : tuple of Unmeasured
        The estimators without a multiple, and why.
    file : str
        File that they were written to; empty if they were not.
    """

    rows: tuple[CostMultiple, ...]
    unmeasured: tuple[Unmeasured, ...]
    file: str = ""

    def headline(self) -> str:
        """How many rows were measured."""
        return f"processor times of {len({row.estimator for row in self.rows})} estimators beside the plain row"

    def shown(self) -> Sequence[Table]:
        """A row a multiple."""
        return [multiple_table(self)]

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav bench --all --json`` prints."""
        return asdict(self)

    def to_frame(self) -> Any:
        """A row a multiple; see `simnav.leaderboard.results.frame.frame`."""
        return frame([asdict(row) for row in self.rows])


@dataclass(frozen=True, repr=False)
class CostReport(Shown):
    """What an epoch costs.

    Attributes
    ----------
    scenario : str
        Versioned id.
    seed : int
        Seed of the recording.
    epochs, rounds : int
        Epochs that were run, and how often.
    estimators : tuple of str
        Labels of those in question; the other rows are what they are measured beside.
    costs : tuple of simnav.testing.Cost
        One for each estimator: those in question first.
    multiples : MultipleReport
        Those in question, as multiples of the plain row.
    """

    scenario: str
    seed: int
    epochs: int
    rounds: int
    estimators: tuple[str, ...]
    costs: tuple[Cost, ...]
    multiples: MultipleReport

    def headline(self) -> str:
        """What was measured."""
        return f"{self.scenario}, {self.epochs} epochs: cost of {', '.join(self.estimators)}"

    def shown(self) -> Sequence[Table]:
        """Multiples of the plain row, then times and memory."""
        return [multiple_table(self.multiples), cost_table(self)]

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav bench --json`` prints."""
        return asdict(self)

    def to_frame(self) -> Any:
        """A row an estimator; see `simnav.leaderboard.results.frame.frame`."""
        return frame([asdict(cost) for cost in self.costs])

    def plot(self) -> Figure:
        """Median time and peak memory of each estimator that could be measured."""
        measured = [cost for cost in self.costs if cost.status == "ok"]
        panels = {
            "Median time of an epoch [ms]": [Bar(c.estimator, 1e3 * c.update_median) for c in measured],
            "Peak memory [kB]": [Bar(c.estimator, c.peak_memory / 1024.0) for c in measured],
        }
        title = f"{self.scenario}: what an epoch costs, {self.epochs} epochs"
        return bars(panels, Style([c.estimator for c in measured]), title=title)


def costs_of(
    mine: Sequence[EstimatorRequest],
    beside: Sequence[EstimatorRequest],
    scenario: str,
    recording: Recording,
    epochs: int,
    rounds: int,
    multiples: MultipleReport,
    progress: Callable[..., None] | None = None,
) -> CostReport:
    """Measure the costs; see `simnav.leaderboard.interface.bench`."""
    everyone = {r.label: r.make for r in [*mine, *beside]}
    with mistakes(ValueError):
        costs = measure(everyone, recording, epochs=epochs, rounds=rounds, progress=progress)
        run = min(epochs, sum(1 for _ in recording.steps()))
    labels = tuple(r.label for r in mine)
    return CostReport(scenario, recording.seed, run, rounds, labels, tuple(costs), multiples)


def cost_table(report: CostReport) -> Table:
    """The report for people; times beside the first of the estimators in question."""
    first = report.costs[0].update_median
    rows = []
    for cost in report.costs:
        if cost.status != "ok":
            rows.append([cost.estimator, *5 * [tables.MISSING], cost.status])
            continue
        times = "" if math.isnan(first) else tables.number(cost.update_median / first)
        milliseconds = [tables.number(1e3 * t) for t in (cost.update_median, cost.update_mean, cost.update_p95)]
        growth = cost.memory_growth / 1024.0
        grows = tables.number(growth) if abs(growth) >= 0.05 else "0"
        rows.append([cost.estimator, *milliseconds, times, tables.number(cost.peak_memory / 1024.0), grows])
    heads = ["estimator", "median [ms]", "mean [ms]", "95 % [ms]", "times the first", "peak [kB]", "growth [kB/epoch]"]
    title = f"{report.scenario}: what an epoch costs, {report.epochs} epochs, least of {report.rounds} runs in turns"
    return tables.table(
        title, heads, rows, strong=[i for i, c in enumerate(report.costs) if c.estimator in report.estimators]
    )


def multiple_table(report: MultipleReport) -> Table:
    """The multiples for people."""
    rows = [
        [m.estimator, m.plain, tables.number(m.value), f"{tables.number(m.low)} – {tables.number(m.high)}", m.rounds,
         m.scenario]
        for m in report.rows
    ]  # fmt: skip
    heads = ["estimator", "plain row", "processor time ×", "95 % interval", "rounds", "scenario"]
    return tables.table(
        "Processor time as a multiple of that of the plain row", heads, rows, numeric=("processor time ×", "rounds"),
        caption="95 % interval: over the rounds. Beside a smoother: the time of all epochs and of smooth().",
    )  # fmt: skip
