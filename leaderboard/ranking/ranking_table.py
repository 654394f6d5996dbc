"""The ranking as tables show it, on the terminal and on the site."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking import tables

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = [
    "SCORE_AXIS",
    "SCORE_LEAD",
    "SCORE_TITLE",
    "add_bars",
    "between",
    "ranking_rows",
    "ratio",
    "score_caption",
    "sortable",
]

_WIDEST = 50.0  # largest ratio on the scale of the bars
SCORE_TITLE = "× oracle"
SCORE_AXIS = "Horizontal RMSE, as a multiple of the oracle's"
_CAPTION = (
    "× oracle: ratio of the horizontal RMSE to the oracle's on the same run; interquartile mean over the runs, "
    "each scenario counting the same. Who does not suit all scenarios is adjusted for how hard the others are."
)
_NO_ORACLE = " Where no oracle ran ({}), 1 is the best estimator's median."
SCORE_LEAD = (
    "Ranked is the horizontal error as a multiple of that of an oracle, which knows the true noise and every fault."
)


def score_caption(ranking: Mapping[str, Any]) -> str:
    """What the score is, and what it is a multiple of where that is not the oracle's error."""
    without = [s["scenario"] for s in ranking["scenarios"] if s["baseline"].endswith("no oracle ran")]
    return _CAPTION + (_NO_ORACLE.format(", ".join(without)) if without else "")


def ranking_rows(ranking: Mapping[str, Any], results: Sequence[Result]) -> list[dict[str, Any]]:
    """The overall ranking as tables show it: a row an estimator, references last.

    Parameters
    ----------
    ranking : mapping
        From ``Ranking.to_dict``.
    results : sequence of Result
    """
    coverages: dict[str, list[float]] = {}
    for r in results:
        coverages.setdefault(r.estimator, []).append(r.scores.get("coverage_95", math.nan))
    rows: list[dict[str, Any]] = []
    tier = None
    for row in ranking["rows"]:
        coverage = _median(coverages.get(row["estimator"], []))
        rows.append(
            {
                "label": row["estimator"],
                "reference": row["reference"],
                "rank": row["rank"],
                "tier": row["tier"],
                "starts_tier": bool(rows) and row["tier"] != tier,
                "value": row["score"],
                "low": row["low"],
                "high": row["high"],
                "score": ratio(row["score"]),
                "interval": between(row["low"], row["high"], ratio),
                "sort": sortable(row["score"]),
                "covered": row["covered"],
                "scenarios": row["scenarios"],
                "badge": row["badge"],
                "coverage": tables.percent(coverage),
                "coverage_sort": sortable(coverage),
                "failed": row["failed"],
                "runs": row["runs"],
                "cost": tables.duration(row["update_median"]),
                "cost_sort": sortable(row["update_median"]),
                "memory": tables.size(row["peak_memory"] or None),
                "memory_sort": row["peak_memory"] or "",
            }
        )
        tier = row["tier"]
    return rows


def ratio(value: float | None) -> str:
    """A ratio to the baseline's error; at the cap it stands for failure."""
    from simnav.leaderboard.ranking.ranking import WORST

    return "failed" if value is not None and value >= 0.999 * WORST else tables.number(value)


def _median(values: Sequence[float]) -> float:
    found = sorted(v for v in values if not math.isnan(v))
    return found[len(found) // 2] if found else math.nan


def add_bars(rows: list[dict[str, Any]]) -> None:
    """Place of every value and interval on one logarithmic scale, in percent; it ends at `_WIDEST` times the least."""
    ends = [
        v for r in rows for v in (r["value"], r["low"], r["high"]) if v is not None and v > 0.0 and math.isfinite(v)
    ]
    low = math.log(min(ends, default=1.0))
    high = min(math.log(max(ends, default=math.e)), low + math.log(_WIDEST))
    span = max(high - low, 1e-9)

    def place(value: float) -> float:
        return round(min(2.0 + 96.0 * (math.log(value) - low) / span, 100.0), 2)

    for row in rows:
        value, a, b = row["value"], row["low"], row["high"]
        row["bar"] = None
        if value is None or not value > 0.0 or not math.isfinite(value):
            continue
        known = a is not None and b is not None and a > 0.0 and math.isfinite(b)
        row["bar"] = {
            "point": place(value),
            "beyond": math.log(value) > high,
            "left": place(a) if known else 0.0,
            "width": round(place(b) - place(a), 2) if known else None,
            "title": tables.interval(value, a, b),
            "colour": row["colour"],
            "dark": row["dark"],
        }


def between(low: float | None, high: float | None, write: Callable[[Any], str] = tables.number) -> str:
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return f"{write(low)} – {write(high)}"


def sortable(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else repr(float(value))
