"""The overall ranking as tables show it: captions, how a ratio is written, the table of the terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking import WORST

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.ranking.ranking import Ranking
    from simnav.leaderboard.results.result import Result

__all__ = [
    "SCORE_LEAD",
    "SCORE_TITLE",
    "between",
    "coverages",
    "ranking_table",
    "ratio",
    "score_caption",
    "tier_starts",
]

SCORE_TITLE = "× oracle"
_CAPTION = (
    "× oracle: ratio of the horizontal RMSE to the oracle's on the same run; interquartile mean over the runs, "
    "each scenario counting the same. Who does not suit all scenarios is adjusted for how hard the others are."
)
_NO_ORACLE = " Where no oracle ran ({}), 1 is the best estimator's median."
SCORE_LEAD = (
    "Ranked is the horizontal error as a multiple of that of an oracle, which knows the true noise and every fault."
)


def score_caption(ranking: Ranking) -> str:
    """What the score is, and what it is a multiple of where that is not the oracle's error."""
    without = [s.scenario for s in ranking.scenarios if s.baseline.endswith("no oracle ran")]
    return _CAPTION + (_NO_ORACLE.format(", ".join(without)) if without else "")


def coverages(results: Iterable[Result]) -> dict[str, float]:
    """Median 95 % coverage of each estimator over all its runs; NaN without a covariance."""
    found: dict[str, list[float]] = {}
    for r in results:
        values = found.setdefault(r.estimator, [])
        if not math.isnan(value := r.scores.get("coverage_95", math.nan)):
            values.append(value)
    return {label: sorted(values)[len(values) // 2] if values else math.nan for label, values in found.items()}


def tier_starts(tiers: Sequence[int | None]) -> list[bool]:
    """Whether each row begins another tier than the one before.

    >>> tier_starts([1, 1, 2, None])
    [False, False, True, True]
    """
    return [k > 0 and tier != tiers[k - 1] for k, tier in enumerate(tiers)]


def ratio(value: float) -> str:
    """A ratio to the baseline's error; at the cap it stands for failure."""
    return "failed" if value >= 0.999 * WORST else tables.number(value)


def between(low: float, high: float, write: Callable[[Any], str] = tables.number) -> str:
    """The two ends of an interval; empty where it is not known."""
    return f"{write(low)} – {write(high)}" if math.isfinite(low) and math.isfinite(high) else ""


def ranking_table(ranking: Ranking, results: Sequence[Result], mine: Collection[str] = ()) -> Table:
    """The overall ranking for the terminal; ``mine`` are the labels that stand out."""
    coverage = coverages(results)
    cells = [
        [r.rank, r.tier, r.estimator + (" *" if r.reference else ""), ratio(r.score), between(r.low, r.high, ratio),
         r.badge, tables.percent(coverage.get(r.estimator)), f"{r.failed} of {r.runs}",
         tables.duration(r.update_median), tables.size(r.peak_memory or None)]
        for r in ranking.rows
    ]  # fmt: skip
    columns = ["rank", "tier", "estimator", SCORE_TITLE, "95 % interval", "consistency", "95 % coverage", "failed",
               "per epoch", "memory"]  # fmt: skip
    reference = [i for i, r in enumerate(ranking.rows) if r.reference]
    return tables.table(
        "Ranking",
        columns,
        cells,
        numeric=["rank", "tier", SCORE_TITLE, "95 % coverage", "failed", "per epoch", "memory"],
        dim=reference,
        strong=[i for i, r in enumerate(ranking.rows) if r.estimator in mine],
        caption=score_caption(ranking) + (" * reference: told the truth, not ranked." if reference else ""),
    )
