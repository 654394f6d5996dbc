"""From the series of results to the columns of charts: bands over the runs, quantiles, and one run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.site.charts import short

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["QUANTITIES", "band", "one_run", "quantiles"]

Array = NDArray[np.float64]

#: Errors over time: key of the series, title, unit, factor from SI.
QUANTITIES = (
    ("horizontal", "Horizontal error", "m", 1.0),
    ("vertical", "Vertical error", "m", 1.0),
    ("velocity", "Velocity error", "m/s", 1.0),
    ("heading", "Heading error", "°", math.degrees(1.0)),
)

_POINTS = 120  # of a curve: more cannot be seen
_RUN_POINTS = 150
_RUNS = 50  # of a band: its percentiles are known well enough


def _has(result: Result, name: str) -> bool:
    values = result.series.get(name)
    return result.status == "ok" and values is not None and len(values) > 0 and bool(np.isfinite(values).any())


def _thinned(n: int, points: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, n - 1, min(n, points)).round().astype(np.int64))


def axis(results: Iterable[Result]) -> Array:
    """The common time of the curves of a scenario [s]: that of its longest run, thinned."""
    times = [r.series["time"] for r in results if _has(r, "time")]
    if not times:
        return np.zeros(0)
    longest = max(times, key=lambda t: float(t[-1])).astype(np.float64)
    return np.asarray(longest[_thinned(len(longest), _POINTS)])


def band(results: Sequence[Result], name: str, factor: float, time: Array) -> dict[str, list[float | None]] | None:
    """Median of the magnitude of an error over the runs that ended well, with its 5th and 95th percentile.

    Parameters
    ----------
    results : sequence of Result
        Of one estimator on one scenario; the first 50 are taken.
    name : str
        Of the series.
    factor : float
    time : (n,) array
        Where it is wanted [s].

    Returns
    -------
    dict or None
        ``low``, ``middle``, ``high``; None where no run has the series.
    """
    found = [r.series for r in results if _has(r, name)][:_RUNS]
    if not found or not len(time):
        return None
    rows = np.array([np.interp(time, s["time"], np.abs(s[name]), right=np.nan) for s in found])
    low, middle, high = factor * np.percentile(rows, (5.0, 50.0, 95.0), axis=0)
    gaps = np.flatnonzero(np.isnan(middle) & np.isfinite(rows).any(axis=0))  # some runs have a value, others none
    if len(gaps):
        low[gaps], middle[gaps], high[gaps] = factor * np.nanpercentile(rows[:, gaps], (5.0, 50.0, 95.0), axis=0)
    return {"low": _list(low), "middle": _list(middle), "high": _list(high)}


def quantiles(results: Sequence[Result]) -> dict[str, list[float | None]] | None:
    """Error at each percent of the epochs of all runs that ended well."""
    rows = [r.series["quantiles"] for r in results if _has(r, "quantiles")]
    if not rows:
        return None
    values = np.sort(np.concatenate([np.asarray(r, dtype=np.float64) for r in rows]))
    values = values[np.isfinite(values)]
    share = np.linspace(0.0, 100.0, 101)
    return {"error": _list(np.percentile(values, share)), "share": share.tolist()}


def one_run(result: Result) -> dict[str, dict[str, list[float | None]]] | None:
    """Track, errors and stated uncertainty of one run; None where it has none."""
    if not _has(result, "time"):
        return None
    s = {name: np.asarray(values, dtype=np.float64) for name, values in result.series.items()}
    keep = _thinned(len(s["time"]), _RUN_POINTS)
    found: dict[str, dict[str, list[float | None]]] = {}
    for name, _, _, factor in QUANTITIES:
        if name in s and np.isfinite(s[name]).any():
            found[name] = {"time": _list(s["time"][keep]), "middle": _list(factor * np.abs(s[name][keep]))}
            if name == "horizontal" and np.isfinite(s.get("three_sigma", np.zeros(0))).any():
                found[name]["bound"] = _list(s["three_sigma"][keep])
    if "estimate_north" in s:
        track = {"time": s["time"], "east": s["estimate_east"], "north": s["estimate_north"]}
        found["track"] = {name: _list(v[keep]) for name, v in track.items()}
    return found


def _list(values: Array) -> list[float | None]:
    return [short(x) for x in values]


def columns_of(items: Iterable[dict[str, Any]]) -> dict[str, list[Any]]:
    """A list of objects with the same keys, as columns."""
    rows = list(items)
    return {key: [row[key] for row in rows] for key in rows[0]} if rows else {}
