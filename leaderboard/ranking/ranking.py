"""The ranking: who is how much worse than the oracle, and how sure we are.

The figure of a run is the logarithm of the ratio of its horizontal RMSE to that of the oracle on the same run (a
reference that knows the true noise and the fault labels). That of an estimator on a scenario is the interquartile mean
over the runs, shown as a ratio: 2 is twice the oracle's error. Rules:

**Baseline.** Where no oracle completed a run of a scenario, the baseline is the median RMSE of the best ranked
estimator there; on a run that the oracle failed, the oracle's median. `ScenarioRanking.baseline` says which it was.

**Failures count.** A failed run (error, timeout, out of memory, diverged, invalid output, or no position at more than
5 % of the epochs) has the ratio `WORST`, a million; no completed run counts for more than that. Nothing is dropped.

**Unsuitable.** An estimator that needs other instruments than a scenario has, or gives no position at all, is listed as
such there: no failure, but no score either.

**Tiers.** `simnav.leaderboard.ranking.statistics.tiers`: paired by run, against the best of a tier, Holm-corrected at
5 %; overall, each scenario counts the same in the test as it does in the score.

**Overall.** Each scenario counts the same. An estimator that covers all of them has the mean of its log ratios. One
that covers fewer is not rewarded for leaving out the hard ones: an additive model, log ratio = estimator + scenario, is
fitted to all there is by least squares, and its score is the estimator's effect plus the mean scenario effect (the
adjusted or least-squares mean of an unbalanced table). Tests use the runs that two estimators have in common. Who
covers less than half of the scenarios is listed with a score but not ranked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.ranking.ranking_figure import ranking_figure
from simnav.leaderboard.ranking.runs import Run, Runs, group
from simnav.leaderboard.ranking.statistics import (
    RESAMPLES,
    Array,
    Place,
    bootstrap_means,
    interquartile_mean,
    interval,
    tiers,
)
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.plain import plain
from simnav.scoring import badge

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from simnav.leaderboard.results.result import Result

__all__ = ["WORST", "OverallRow", "RankedRow", "Ranking", "ScenarioRanking", "ScenarioRow", "rank"]

#: Ratio to the oracle's error that stands for a failed run, and that no completed run exceeds.
WORST = 1e6
#: Least share of the scenarios that an estimator covers to be ranked overall.
MIN_COVERAGE = 0.5

_CAP = math.log(WORST)


@dataclass(frozen=True, kw_only=True)
class RankedRow:
    """One estimator, as it is ranked.

    Attributes
    ----------
    estimator : str
    reference : bool
        Told the truth, not ranked.
    rank, tier : int or None
        None for references, and overall for those that cover too few scenarios.
    score, low, high : float
        Ratio to the baseline's error with its 95 % bootstrap interval (NaN with fewer than two runs).
    p_value : float or None
        Holm-adjusted, against the first; None for the first and for references.
    runs, failed : int
    badge : str
        Consistency of the horizontal position (`simnav.scoring.badge`) over all runs.
    update_median : float
        Median time per epoch [s]; overall, the median over the scenarios.
    peak_memory : int
        Largest [bytes].
    """

    estimator: str
    reference: bool
    rank: int | None
    tier: int | None
    score: float
    low: float
    high: float
    p_value: float | None
    runs: int
    failed: int
    badge: str
    update_median: float
    peak_memory: int


@dataclass(frozen=True, kw_only=True)
class ScenarioRow(RankedRow):
    """One estimator on one scenario.

    Attributes
    ----------
    median : float
        Of the ranked score over the completed runs, in its unit; NaN without any.
    statuses : dict of str to int
        How many runs ended how; ``incomplete`` are those with too few positions.
    nees : float
        Mean over the runs, by degree of freedom; NaN without a covariance.
    """

    median: float
    statuses: dict[str, int]
    nees: float


@dataclass(frozen=True, kw_only=True)
class OverallRow(RankedRow):
    """One estimator over all scenarios; the interval is stratified by scenario.

    Attributes
    ----------
    covered, scenarios : int
        How many scenarios it covers, of how many.
    ratios : dict of str to float
        Score by scenario.
    """

    covered: int
    scenarios: int
    ratios: dict[str, float]


@dataclass(frozen=True)
class ScenarioRanking:
    """The ranking on one scenario.

    Attributes
    ----------
    scenario : str
    baseline : str
        What the ratios are to, in words.
    rows : tuple of ScenarioRow
        In order of rank; then the references.
    unsuitable : dict of str to str
        Estimators that have no score here, and why.
    """

    scenario: str
    baseline: str
    rows: tuple[ScenarioRow, ...]
    unsuitable: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Ranking:
    """The whole ranking.

    Attributes
    ----------
    score : str
        Key of `simnav.scoring.SCORES` that is ranked.
    rows : tuple of OverallRow
        In order of rank; then those not ranked, then the references.
    scenarios : tuple of ScenarioRanking
        In order of their ids.
    """

    score: str
    rows: tuple[OverallRow, ...]
    scenarios: tuple[ScenarioRanking, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dicts and lists for JSON; numbers that are not finite become None."""
        found: dict[str, Any] = plain(vars(self))
        return found

    def to_frame(self) -> Any:
        """A row an estimator, over all scenarios; see `simnav.leaderboard.results.frame.frame`."""
        return frame([{k: v for k, v in vars(row).items() if k != "ratios"} | row.ratios for row in self.rows])

    def plot(self) -> Figure:
        """The scores with their intervals."""
        return ranking_figure(self.rows)


def rank(
    results: Iterable[Result],
    *,
    score: str = "horizontal_rmse",
    oracle: str = "oracle",
    resamples: int = RESAMPLES,
) -> Ranking:
    """Rank estimators by their results.

    Parameters
    ----------
    results : iterable of Result
        In any order; the ranking does not depend on it.
    score : str
        Key of `simnav.scoring.SCORES` to rank by, one whose ``better`` is ``lower``: ``smoothed_horizontal_rmse`` for
        the post-processing track.
    oracle : str
        Label of the reference that is the baseline; if it did not run, the best reference with this in its label.
    resamples : int
        Of the bootstrap.

    Returns
    -------
    Ranking

    Raises
    ------
    ValueError
        If an estimator has two results for one run.
    """
    runs = group(results, score)
    scenarios = [_Scenario(name, runs[name], oracle, resamples, k) for k, name in enumerate(sorted(runs))]
    return Ranking(score, tuple(_overall(scenarios)), tuple(s.ranking() for s in scenarios))


class _Scenario:
    """The runs of one scenario with their log ratios."""

    def __init__(self, name: str, cells: Mapping[str, Runs], oracle: str, resamples: int, index: int):
        self.name = name
        self.unsuitable = {n: why for n in sorted(cells) if (why := cells[n].unsuitable())}
        self.cells = {n: cells[n] for n in sorted(cells) if n not in self.unsuitable}
        self.baseline, errors, constant = self._baseline(oracle)
        self.logs: dict[str, dict[Run, float]] = {}
        for n, cell in self.cells.items():
            good, tried = cell.completed, [(r.seed, r.note) for r in cell.tried]
            self.logs[n] = {
                run: _log_ratio(good[run], errors.get(run, constant)) if run in good else _CAP for run in tried
            }
        self.strata = {n: np.array(list(logs.values())) for n, logs in self.logs.items()}
        self.means = {n: interquartile_mean(x) for n, x in self.strata.items()}
        self.draws = {n: bootstrap_means([x], resamples=resamples, seed=index)[:, 0] for n, x in self.strata.items()}

    def _baseline(self, oracle: str) -> tuple[str, dict[Run, float], float]:
        """In words, by run, and for runs without one."""
        medians = {n: m for n, c in self.cells.items() if math.isfinite(m := _median(c.completed.values()))}
        references = {n: m for n, m in medians.items() if self.cells[n].reference and oracle in n}
        if oracle in references:
            references = {oracle: references[oracle]}
        ranked = {n: m for n, m in medians.items() if not self.cells[n].reference}
        if references:
            name = min(references, key=lambda n: (references[n], n))
            return f"{name}, on the same run", self.cells[name].completed, references[name]
        if ranked:
            name = min(ranked, key=lambda n: (ranked[n], n))
            return f"median of {name}, the best here: no oracle ran", {}, ranked[name]
        return "none: no run was completed", {}, 1.0

    def differences(self, a: str, b: str) -> Array:
        """Paired differences of log ratios over the runs that both have."""
        mine, other = self.logs[a], self.logs[b]
        if mine.keys() == other.keys():
            return np.asarray(self.strata[a] - self.strata[b])
        return np.array([mine[run] - other[run] for run in mine if run in other])

    def ranking(self) -> ScenarioRanking:
        ranked = {n: m for n, m in self.means.items() if not self.cells[n].reference}
        places = tiers(ranked, lambda a, b: [self.differences(a, b)])
        references = sorted((n for n in self.cells if n not in ranked), key=lambda n: (self.means[n], n))
        rows = [self._row(n, k + 1, p) for k, (n, p) in enumerate(places.items())]
        rows += [self._row(n, None, None) for n in references]
        return ScenarioRanking(self.name, self.baseline, tuple(rows), self.unsuitable)

    def _row(self, name: str, position: int | None, place: Place | None) -> ScenarioRow:
        cell, x = self.cells[name], self.strata[name]
        spread = interval(self.draws[name]) if len(x) > 1 else (math.nan, math.nan)
        nees = cell.numbers("nees_horizontal")
        return ScenarioRow(
            **_common([cell], place, self.means[name], spread),
            rank=position,
            update_median=_median(cell.numbers("update_median")),
            median=_median(cell.completed.values()),
            statuses=cell.statuses,
            nees=float(np.mean(nees)) if len(nees) else math.nan,
        )


def _common(cells: Sequence[Runs], place: Place | None, score: float, spread: tuple[float, float]) -> dict[str, Any]:
    """The fields of a row that are the same on one scenario and over all."""
    runs = sum(len(c.tried) for c in cells)
    return {
        "estimator": cells[0].estimator,
        "reference": any(c.reference for c in cells),
        "tier": place.tier if place else None,
        "score": math.exp(score),
        "low": math.exp(spread[0]),
        "high": math.exp(spread[1]),
        "p_value": place.p_value if place else None,
        "runs": runs,
        "failed": runs - sum(c.statuses.get("ok", 0) for c in cells),
        "badge": badge(np.concatenate([c.numbers("nees_horizontal") for c in cells])),
        "peak_memory": max(c.peak_memory for c in cells),
    }


def _median(values: Iterable[float]) -> float:
    found = list(values)
    return float(np.median(found)) if found else math.nan


def _log_ratio(value: float, baseline: float) -> float:
    """Logarithm of a ratio of errors, within the cap on both sides."""
    if value <= 0.0:
        return -_CAP if baseline > 0.0 else 0.0
    return float(np.clip(math.log(value) - math.log(max(baseline, 1e-300)), -_CAP, _CAP))


def _overall(scenarios: Sequence[_Scenario]) -> list[OverallRow]:
    names = sorted({n for s in scenarios for n in s.cells})
    covers = {n: [s for s in scenarios if n in s.cells] for n in names}
    references = [n for n in names if any(s.cells[n].reference for s in covers[n])]
    entries = [n for n in names if n not in references]
    used = [s for s in scenarios if any(n in s.cells for n in entries)]

    pairs = [(n, s) for n in entries for s in covers[n]]
    weights = _adjusted_means([(n, s.name) for n, s in pairs])
    score, draws = {}, {}
    for n in entries:
        parts = [(w, s, m) for w, (m, s) in zip(weights[n].tolist(), pairs, strict=True) if abs(w) > 1e-12]
        score[n] = float(sum(w * s.means[m] for w, s, m in parts))
        draws[n] = np.sum([w * s.draws[m] for w, s, m in parts], axis=0)
    for n in references:  # a plain mean over what they cover
        score[n] = float(np.mean([s.means[n] for s in covers[n]]))
        draws[n] = np.mean([s.draws[n] for s in covers[n]], axis=0)
    several = {n: all(len(s.strata[n]) > 1 for s in covers[n]) for n in names}
    spread = {n: interval(draws[n]) if several[n] else (math.nan, math.nan) for n in names}

    ranked = {n: score[n] for n in entries if len(covers[n]) >= MIN_COVERAGE * len(used)}
    places = tiers(ranked, lambda a, b: [s.differences(a, b) for s in scenarios if {a, b} <= s.cells.keys()])
    order = list(places) + sorted((n for n in entries if n not in places), key=lambda n: (score[n], n))
    order += sorted(references, key=lambda n: (score[n], n))

    def row(name: str, position: int) -> OverallRow:
        mine, place = covers[name], places.get(name)
        seconds = [float(np.median(x)) for s in mine if len(x := s.cells[name].numbers("update_median"))]
        return OverallRow(
            **_common([s.cells[name] for s in mine], place, score[name], spread[name]),
            rank=position if place else None,
            update_median=_median(seconds),
            covered=len(mine),
            scenarios=len(scenarios),
            ratios={s.name: math.exp(s.means[name]) for s in mine},
        )

    return [row(name, k + 1) for k, name in enumerate(order)]


def _adjusted_means(cells: Sequence[tuple[str, str]]) -> dict[str, Array]:
    """Weights of the cells (estimator, scenario) in the adjusted mean of each estimator.

    The additive model estimator + scenario is fitted by least squares; the adjusted mean is the estimator's effect plus
    the mean of the scenario effects. Estimators without a chain of common scenarios cannot be adjusted to each other:
    each such group is adjusted within itself. With full coverage the weights are those of a plain mean.
    """
    weights: dict[str, Array] = {}
    left = list(range(len(cells)))
    while left:
        group, grown = [left[0]], True
        while grown:  # all cells that share an estimator or a scenario with the group
            rows, columns = {cells[i][0] for i in group}, {cells[i][1] for i in group}
            more = [i for i in left if i not in group and (cells[i][0] in rows or cells[i][1] in columns)]
            group += more
            grown = bool(more)
        left = [i for i in left if i not in group]
        estimators = sorted({cells[i][0] for i in group})
        scenarios = sorted({cells[i][1] for i in group})
        # Effects: one an estimator, one a scenario with their sum zero (the last row), so that the mean effect is zero.
        design = np.zeros((len(group) + 1, len(estimators) + len(scenarios)))
        for row, i in enumerate(group):
            design[row, estimators.index(cells[i][0])] = 1.0
            design[row, len(estimators) + scenarios.index(cells[i][1])] = 1.0
        design[-1, len(estimators) :] = 1.0
        solution = np.linalg.pinv(design)[:, :-1]
        for k, name in enumerate(estimators):
            weights[name] = np.zeros(len(cells))
            weights[name][group] = solution[k]
    return weights
