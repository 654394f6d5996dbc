"""Where one estimator stands among others on a scenario, paired by seed."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from . import tables
from .statistics import FEWEST, compare, smallest_p_value

if TYPE_CHECKING:
    from .runs import Runs

__all__ = ["Standing", "StandingRow", "standing", "standing_table"]

_LEVEL = 0.05  # p-values below it are differences


@dataclass(frozen=True)
class StandingRow:
    """One of the estimators, and how the one in question compares with it.

    Attributes
    ----------
    estimator : str
        Label of the estimator.
    reference : bool
        Whether it is a reference, which is not ranked.
    runs, failed : int
        Number of runs, and how many of them failed.
    horizontal_rmse, low, high : float
        Median over the runs that ended well, with its 95 % interval [m].
    ratio, ratio_low, ratio_high : float or None
        Geometric mean of the ratio of the error in question to this one's over the same seeds, with its interval;
        None for the estimator in question, and where no seed is common.
    better : float or None
        Share of the seeds on which the estimator in question has the smaller error.
    p_value : float or None
        p-value of the paired test.
    smoothed_horizontal_rmse : float or None
        Median of the smoothed trajectories [m]; None for an estimator that does not smooth.
    """

    estimator: str
    reference: bool
    runs: int
    failed: int
    horizontal_rmse: float
    low: float
    high: float
    ratio: float | None = None
    ratio_low: float | None = None
    ratio_high: float | None = None
    better: float | None = None
    p_value: float | None = None
    smoothed_horizontal_rmse: float | None = None


@dataclass(frozen=True)
class Standing:
    """Where an estimator stands on a scenario.

    Attributes
    ----------
    scenario, estimator : str
        Versioned id of the scenario, and label of the estimator.
    place : int or None
        The best place among the rows that are no references that it may have: one more than there are rows that are
        better with a p-value below 5 %. None where the scenario does not suit the estimator, and of a reference.
    last : int or None
        The last place that it may have: so many rows are not worse with such a p-value.
    of : int
        How many there are.
    rows : tuple of StandingRow
        The smallest error first.
    """

    scenario: str
    estimator: str
    place: int | None
    last: int | None
    of: int
    rows: tuple[StandingRow, ...]

    @property
    def places(self) -> str:
        """The places that it may have among all, in words."""
        if self.place is None or self.last is None:
            ran = any(r.estimator == self.estimator for r in self.rows)
            return "is a reference and has no place" if ran else "cannot run"
        if self.place == self.last:
            return f"is {self.place} of {self.of}"
        return f"may be {self.place} to {self.last} of {self.of}"

    def verdict(self, plain: str = "") -> str:
        """One sentence: its places, and its error beside that of the plain row.

        Where the plain row was not run, or is the one in question, it is the best of the others that are ranked.

        Parameters
        ----------
        plain : str
            Label of the plain row.
        """
        said = f"{self.estimator} {self.places} on {self.scenario}"
        others = [r for r in self.rows if r.ratio is not None and not r.reference]
        beside = next((r for r in others if r.estimator == plain), others[0] if others else None)
        if beside is None or beside.ratio is None:
            return f"{said}."
        between = ""
        if beside.ratio_low is not None and beside.ratio_high is not None and math.isfinite(beside.ratio_low):
            between = f" (95 %: {tables.number(beside.ratio_low)} to {tables.number(beside.ratio_high)} times)"
        chance = "" if _apart(beside) else "; the difference may be chance"
        if smallest_p_value(beside.runs) >= _LEVEL:
            chance = f"; fewer than {FEWEST} seeds cannot show a difference"
        return f"{said}; its error is {tables.number(beside.ratio)} times that of {beside.estimator}{between}{chance}."


def standing(by: Mapping[str, Runs], mine: str, scenario: str) -> Standing:
    """How one estimator compares with each of the others on a scenario, on the horizontal RMSE.

    Parameters
    ----------
    by : mapping of str to Runs
        Label -> runs on the scenario.
    mine : str
        Label of the estimator in question.
    scenario : str
        Versioned id.
    """
    found = (_row(runs, by.get(mine)) for runs in by.values() if runs.tried)
    rows = sorted(found, key=lambda r: math.inf if math.isnan(r.horizontal_rmse) else r.horizontal_rmse)
    ranked = [r for r in rows if not r.reference]
    if mine not in {r.estimator for r in ranked}:
        return Standing(scenario, mine, None, None, len(ranked), tuple(rows))
    apart = [r for r in ranked if _apart(r)]
    better = sum(r.ratio is not None and r.ratio > 1.0 for r in apart)
    return Standing(scenario, mine, 1 + better, len(ranked) - len(apart) + better, len(ranked), tuple(rows))


def _apart(row: StandingRow) -> bool:
    """Whether the one in question differs from a row by more than chance."""
    return row.p_value is not None and row.p_value < _LEVEL


def _row(runs: Runs, mine: Runs | None) -> StandingRow:
    score = runs.score("horizontal_rmse")
    figures = (runs.estimator, runs.reference, len(runs.tried), runs.failed, score.value, score.low, score.high)
    late = runs.score("smoothed_horizontal_rmse").value
    smoothed = late if math.isfinite(late) else None
    if mine is not None and runs is not mine and mine.tried:
        with contextlib.suppress(ValueError):  # no seed in common, or errors of zero
            c = compare(_errors(mine), _errors(runs))
            return StandingRow(*figures, c.ratio, c.low, c.high, c.better, c.p_value, smoothed)
    return StandingRow(*figures, smoothed_horizontal_rmse=smoothed)


def _errors(runs: Runs) -> dict[object, float]:
    """Horizontal RMSE by seed [m]; infinite where the run failed."""
    return {r.seed: r.scores.get("horizontal_rmse", math.nan) if r.status == "ok" else math.inf for r in runs.tried}


def standing_table(stand: Standing) -> tables.Fitted:
    """The table of a standing for the terminal."""
    rows = []
    smoothed = any(r.smoothed_horizontal_rmse is not None for r in stand.rows)
    for r in stand.rows:
        better = "" if r.better is None else tables.percent(r.better)
        to_it = "" if r.ratio is None else tables.interval(r.ratio, r.ratio_low, r.ratio_high)
        p = "" if r.p_value is None else ("< 0.001" if r.p_value < 0.001 else f"{r.p_value:.3f}")
        p = p if r.p_value is None or smallest_p_value(r.runs) < _LEVEL else tables.MISSING  # too few seeds to decide
        rows.append([r.estimator + (" *" if r.reference else ""), f"{r.failed} of {r.runs}",
                     tables.interval(r.horizontal_rmse, r.low, r.high),
                     tables.number(r.smoothed_horizontal_rmse) if smoothed else "", to_it, better, p])  # fmt: skip
    mine = stand.estimator
    with_interval = " with its 95 % interval" if any(math.isfinite(r.low) for r in stand.rows) else ""
    told = any(r.reference for r in stand.rows)
    ratio = f"{mine} ÷ this row"
    columns = ["estimator", "failed", "horizontal RMSE [m]", "smoothed [m]", ratio, f"{mine} better in", "p"]
    return tables.Fitted(
        f"{stand.scenario}: {mine} {stand.places}",
        columns,
        rows,
        ["estimator", ratio, "p", "horizontal RMSE [m]", "smoothed [m]", "failed", f"{mine} better in"],
        numeric=columns[1:],
        dim=[i for i, r in enumerate(stand.rows) if r.reference],
        strong=[i for i, r in enumerate(stand.rows) if r.estimator == mine],
        caption=f"Median over the seeds{with_interval}. Ratio: geometric mean over the same seeds; below 1 "
        "the estimator is better; a run that only one of the two failed counts 1000. p: studentised bootstrap. "
        f"Intervals and p-values need {FEWEST} seeds." + (" * reference: told the truth." if told else ""),
        explained={"smoothed [m]": "Smoothed: the same of the smoothed trajectories; all else is in real time."},
    )
