"""A sweep: campaigns over the settings of one dial or two, and what came out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.figures.sweep_figure import Line, Map, error_against_dial, error_maps
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking_table import between
from simnav.leaderboard.ranking.statistics import Interval, median
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.shown import Shown
from simnav.scenario import Dial
from simnav.scoring import SCORES

from .breaking import BreakingPoint, breaking_point, goes_down
from .settings import clean_value

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from simnav.leaderboard.campaign.campaign import Summary
    from simnav.leaderboard.results.result import Result

    from .settings import Setting

__all__ = ["Sweep", "SweepPoint"]


@dataclass(frozen=True)
class SweepPoint:
    """One estimator at one setting.

    Attributes
    ----------
    estimator : str
        Label of the estimator.
    values : tuple of float
        Values of the dials, in their units.
    error : Interval
        Median over the runs, of which a failed one counts as infinite.
    runs, failed : int
        Number of runs, and how many of them failed.
    """

    estimator: str
    values: tuple[float, ...]
    error: Interval
    runs: int
    failed: int


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Shown):
    """Errors against a dial, or two.

    Attributes
    ----------
    scenario : str
        Versioned id of the scenario whose dials were turned.
    dials : tuple of Dial
        Dials that were varied, one or two.
    values : tuple of tuple of float
        Values of each dial, ascending.
    estimators : tuple of str
        Labels of the estimators.
    score : str
        Key of `simnav.scoring.SCORES`.
    limit : float or None
        Absolute limit of the score, in its unit.
    results : sequence of Result
        All results of the sweep.
    settings : tuple of Setting
        Values of the dials, with the scenario that each setting gives.
    summary : Summary
        Summary of the campaign.
    """

    scenario: str
    dials: tuple[Dial, ...]
    values: tuple[tuple[float, ...], ...]
    estimators: tuple[str, ...]
    score: str
    limit: float | None
    results: Sequence[Result]
    settings: tuple[Setting, ...]
    summary: Summary

    def headline(self) -> str:
        """What was varied, and who took part."""
        dials = " and ".join(axis_label(d) for d in self.dials)
        return f"{self.scenario} over {dials}, {len(self.settings)} settings, {', '.join(self.estimators)}"

    def shown(self) -> Sequence[tables.Fitted]:
        """The errors at each setting, and where each estimator breaks."""
        return self._error_table(), self._breaking_table()

    def _error_table(self) -> tables.Fitted:
        """A row an estimator and setting."""
        at = {(p.estimator, p.values): p for p in self.points}
        rows = []
        for e in self.estimators:
            for setting in self.settings:
                p = at[e, setting.values]
                failed = f"{p.failed} of {p.runs}" if p.failed else ""
                error = "failed" if math.isinf(p.error.value) else tables.number(p.error.value)
                dials = [f"{v:g}" for v in setting.values]
                rows.append([e, *dials, error, between(p.error.low, p.error.high), failed])
        score, dials = SCORES[self.score], [axis_label(d) for d in self.dials]
        columns = ["estimator", *dials, f"error [{score.unit}]", "95 % interval", "failed"]
        return tables.Fitted(
            f"{self.scenario}: {score.title}, median of the runs",
            columns,
            rows,
            columns,
            always=2 + len(dials),
            numeric=[*dials, f"error [{score.unit}]"],
        )

    def _breaking_table(self) -> tables.Fitted:
        """Where each estimator breaks."""
        beyond = f"beyond {self._last:g}"

        def figure(x: float) -> str:
            return "–" if math.isnan(x) else beyond if math.isinf(x) else f"{x:.3g}"

        rows = []
        for b in self.breaking_points:
            words = "twice its clean error" if b.criterion == "twice-clean" else "the limit"
            interval = f"{figure(b.value.low)} to {figure(b.value.high)}" if not math.isnan(b.value.low) else ""
            passes = f"{words}, {tables.number(b.threshold)}"
            rows.append(
                [b.estimator, *([] if b.at is None else [f"{b.at:g}"]), passes, figure(b.value.value), interval]
            )
        second = [axis_label(self.dials[1])] if len(self.dials) == 2 else []
        at = f"at: {axis_label(self.dials[0])}"
        columns = ["estimator", *second, "passes", at, "95 % interval"]
        value = ["estimator", at, *second, "95 % interval", "passes"]
        return tables.Fitted("Breaking points", columns, rows, value, always=2 + len(second), numeric=[*second, at])

    @property
    def _clean(self) -> int:
        """Number of the clean value of the first dial."""
        return self.values[0].index(clean_value(self.dials[0]))

    @property
    def _last(self) -> float:
        """The value of the first dial at which the search for a breaking point ends."""
        return self.values[0][0 if goes_down(self.values[0], self._clean) else -1]

    @cached_property
    def _errors(self) -> dict[tuple[str, tuple[float, ...]], dict[int, float]]:
        """(estimator, values) -> seed -> error; infinite where the run failed. Unsuitable runs are left out."""
        where = {s.scenario.id: s.values for s in self.settings}
        found: dict[tuple[str, tuple[float, ...]], dict[int, float]] = {
            (e, s.values): {} for e in self.estimators for s in self.settings
        }
        for r in self.results:
            if r.tried:
                value = float(r.scores.get(self.score, math.nan)) if r.status == "ok" else math.inf
                found[r.estimator, where[r.scenario]][r.seed] = math.inf if math.isnan(value) else value
        return found

    @cached_property
    def points(self) -> tuple[SweepPoint, ...]:
        """Every estimator at every setting."""
        return tuple(
            SweepPoint(e, values, median(errors.values()), len(errors), sum(map(math.isinf, errors.values())))
            for (e, values), errors in self._errors.items()
        )

    @cached_property
    def breaking_points(self) -> tuple[BreakingPoint, ...]:
        """Of every estimator along the first dial: by twice its clean error, and by the limit where there is one.

        With two dials there is one for each value of the second. Only seeds that were run at every value count.
        """
        found = []
        values, clean = self.values[0], self._clean
        for e in self.estimators:
            for at in self.values[1] if len(self.dials) == 2 else (None,):
                rest = () if at is None else (at,)
                columns = [self._errors[e, (v, *rest)] for v in values]
                seeds = sorted(set.intersection(*map(set, columns)))
                errors = np.array([[c[s] for c in columns] for s in seeds]).reshape(len(seeds), len(values))
                for limit in (None, self.limit) if self.limit is not None else (None,):
                    found.append(breaking_point(e, values, errors, limit, clean=clean, at=at))
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav sweep --json`` prints, but for the figure; infinite figures are null there."""
        score = SCORES[self.score]
        return {
            "scenario": self.scenario,
            "score": {"name": self.score, "title": score.title, "unit": score.unit},
            "limit": self.limit,
            "dials": [
                {"name": d.name, "key": d.key, "unit": d.unit, "title": d.title, "values": list(v)}
                for d, v in zip(self.dials, self.values, strict=True)
            ],
            "points": [
                {"estimator": p.estimator, "values": list(p.values), "failed": p.failed, "error": asdict(p.error)}
                for p in self.points
            ],
            "beyond": self._last,
            "breaking_points": [
                {"estimator": b.estimator, "criterion": b.criterion, "threshold": b.threshold, "at": b.at,
                 "value": asdict(b.value)}
                for b in self.breaking_points
            ],
            "results": str(self.summary.folder),
        }  # fmt: skip

    def to_frame(self) -> Any:
        """A row an estimator and setting; see `simnav.leaderboard.results.frame.frame`."""
        names = [d.name if d.name != "value" else d.key for d in self.dials]
        return frame([
            {"estimator": p.estimator, **dict(zip(names, p.values, strict=True)), "error": p.error.value,
             "low": p.error.low, "high": p.error.high, "runs": p.runs, "failed": p.failed}
            for p in self.points
        ])  # fmt: skip

    def plot(self) -> Figure:
        """Error against the dial with intervals, or a map an estimator for two dials."""
        score = SCORES[self.score]
        label = score.title if score.unit == "-" else f"{score.title} [{score.unit}]"
        at = {(p.estimator, p.values): p for p in self.points}
        if len(self.dials) == 1:
            lines = [
                Line(e, np.array(self.values[0]), *np.array([
                    (p.error.value, p.error.low, p.error.high) for v in self.values[0] for p in (at[e, (v,)],)
                ]).T)
                for e in self.estimators
            ]  # fmt: skip
            marks = {b.estimator: b.value.value for b in self.breaking_points if b.criterion == "twice-clean"}
            return error_against_dial(lines, axis_label(self.dials[0]), label, self.scenario, self.limit, marks)
        maps = [
            Map(e, np.array([[at[e, (a, b)].error.value for a in self.values[0]] for b in self.values[1]]))
            for e in self.estimators
        ]
        return error_maps(maps, self.values[0], self.values[1], axis_label(self.dials[0]), axis_label(self.dials[1]),
                          label, self.scenario)  # fmt: skip


def axis_label(dial: Dial) -> str:
    """Title and unit of a dial."""
    return f"{dial.title} [{dial.unit}]" if dial.unit else dial.title
