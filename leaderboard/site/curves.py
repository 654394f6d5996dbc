"""From the series of results to the columns of charts: bands over the runs, quantiles, and one run.

Series are read once, file by file, and what charts need of each is kept: a hundred thousand results do not fit into
memory.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.ranking.runs import at_times, has_series
from simnav.leaderboard.results.stored_series import read_ahead
from simnav.scoring.integrity import RISK, Stanford
from simnav.scoring.plot_series import DIAGNOSTICS

from .rounding import shorts, spaced

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result, Series

__all__ = [
    "BAND_RUNS",
    "QUANTITIES",
    "Curves",
    "Gathered",
    "band",
    "gather",
    "integrity",
    "one_run",
    "over_shares",
    "quantiles",
]

Array = NDArray[np.float64]
Thin = NDArray[np.float32]

#: Errors over time: key of the series, title, unit, factor from SI.
QUANTITIES = (
    ("horizontal", "Horizontal error", "m", 1.0),
    ("vertical", "Vertical error", "m", 1.0),
    ("velocity", "Velocity error", "m/s", 1.0),
    ("heading", "Heading error", "°", math.degrees(1.0)),
)

#: Runs of a band: its percentiles are known well enough.
BAND_RUNS = 40

_POINTS = 90  # of a curve: more cannot be seen
_RUN_POINTS = 100
_TRACK_POINTS = 200
_DIGITS = 3  # of what is drawn against time
_SHARES = np.linspace(0.0, 100.0, 51)  # of the epochs, of a distribution [%]
_TRUTH = {"east": "truth_east", "north": "truth_north", "time": "time"}
_FULL = 0.999  # a weight above this is as good as 1
#: From three standard deviations to the protection level that follows from a covariance.
_PROTECTION = math.sqrt(-2.0 * math.log(RISK)) / 3.0


@dataclass(frozen=True, eq=False)
class Curves:
    """What charts over all runs need of one run.

    Attributes
    ----------
    time : (k,) array
        Times of the errors [s].
    values : dict of str to (k,) array
        Magnitudes of the errors, SI units; ``level``: protection level [m].
    quantiles : (101,) array or None
        Quantiles of the horizontal error [m].
    diagnostics : dict of str to (b,) array
        Weights of the instruments over ``diagnostics_time``.
    """

    time: Thin
    values: dict[str, Thin]
    quantiles: Thin | None = None
    diagnostics: dict[str, Thin] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Gathered:
    """What was read of the series of results, by result.

    Attributes
    ----------
    curves : dict of Result to Curves
        Curves for the charts over all runs.
    single : dict of Result to dict of str to array
        Series at as many points as a chart of one run shows; `one_run` makes its data of them.
    """

    curves: dict[Result, Curves]
    single: dict[Result, dict[str, Thin]]


def gather(over_all: Iterable[Result], single: Collection[Result]) -> Gathered:
    """Read series, each part of a file once.

    Parameters
    ----------
    over_all : iterable of Result
        Those whose `Curves` are wanted.
    single : collection of Result
        Those that are shown one by one.
    """
    wanted, alone = set(over_all), set(single)
    times: dict[bytes, Thin] = {}  # nearly all runs of a scenario share theirs
    found = Gathered({}, {})
    every: dict[int, list[Result]] = {}
    for result in wanted | alone:
        every.setdefault(id(result.series), []).append(result)
    for series, read in read_ahead([results[0].series for results in every.values()]):
        if not (has_series(read, "time") or has_series(read, "quantiles")):
            continue
        for result in every[id(series)]:
            if result.status != "ok":
                continue
            if result in wanted:
                found.curves[result] = _curves(read, times)
            if result in alone and "time" in read:
                found.single[result] = _thinned(read)
    return found


def _curves(s: Mapping[str, Series], times: dict[bytes, Thin]) -> Curves:
    if "time" not in s:  # of some rows only the distribution comes with simnav
        return Curves(np.zeros(0, np.float32), {}, s["quantiles"].copy() if has_series(s, "quantiles") else None)
    keep = spaced(len(s["time"]), _POINTS)
    time = s["time"][keep]
    time = times.setdefault(time.tobytes(), time)
    values = {name: np.abs(s[name][keep]) for name, *_ in QUANTITIES if name in s and np.isfinite(s[name]).any()}
    if (level := _level(s)) is not None:
        values["level"] = level[keep].astype(np.float32)
    weights = {n: s[n].copy() for n in s if n.startswith("weight.") and (s[n] < _FULL).any()}
    if weights:
        weights["time"] = times.setdefault(s["diagnostics_time"].tobytes(), s["diagnostics_time"].copy())
    return Curves(time, values, s["quantiles"].copy() if has_series(s, "quantiles") else None, weights)


def _thinned(s: Mapping[str, Series]) -> dict[str, Thin]:
    keep = spaced(len(s["time"]), _RUN_POINTS)
    names = ("time", *(key for key, *_ in QUANTITIES), "three_sigma", "estimate_north", "estimate_east")
    found = {name: s[name][keep] for name in names if name in s}
    if "truth_north" in s:
        known = np.flatnonzero(np.isfinite(s["truth_north"]) & np.isfinite(s["truth_east"]))
        known = known[spaced(len(known), _TRACK_POINTS)] if len(known) else known
        found |= {f"truth_{to}": s[name][known] for to, name in _TRUTH.items()}
    return found | {n: s[n].copy() for n in s if n == "diagnostics_time" or n.partition(".")[0] in DIAGNOSTICS}


def _level(s: Mapping[str, Series]) -> NDArray[Any] | None:
    """Protection level over time: the estimator's own, or that of its covariance."""
    if "protection_level" in s:
        return s["protection_level"]
    return _PROTECTION * s["three_sigma"] if has_series(s, "three_sigma") else None


def axis(curves: Iterable[Curves]) -> Array:
    """The common time of the curves of a scenario [s]: that of its longest run."""
    longest = max((c.time for c in curves if len(c.time)), key=lambda t: float(t[-1]), default=np.zeros(0))
    return np.asarray(longest, dtype=np.float64)


def band(curves: Sequence[Curves], name: str, factor: float, time: Array) -> dict[str, list[float | None]] | None:
    """Median of a magnitude over the runs, with its 5th and 95th percentile.

    Parameters
    ----------
    curves : sequence of Curves
        Curves of one estimator on one scenario.
    name : str
        Name of an error, or of a weight.
    factor : float
        Factor from SI units to the unit of the chart.
    time : (n,) array
        Times of the result [s].

    Returns
    -------
    dict or None
        ``low``, ``middle``, ``high``; None where no run has it.
    """
    pairs = [(c.diagnostics["time"], c.diagnostics[name]) if name in c.diagnostics else (c.time, c.values[name])
             for c in curves if name in c.diagnostics or name in c.values]  # fmt: skip
    if not pairs or not len(time):
        return None
    rows = np.array([at_times(time, t, v) for t, v in pairs], dtype=np.float64)
    low, middle, high = factor * np.percentile(rows, (5.0, 50.0, 95.0), axis=0)
    gaps = np.flatnonzero(np.isnan(middle) & np.isfinite(rows).any(axis=0))  # some runs have a value, others none
    if len(gaps):
        low[gaps], middle[gaps], high[gaps] = factor * np.nanpercentile(rows[:, gaps], (5.0, 50.0, 95.0), axis=0)
    return {"low": shorts(low, _DIGITS), "middle": shorts(middle, _DIGITS), "high": shorts(high, _DIGITS)}


def quantiles(curves: Sequence[Curves]) -> dict[str, list[float | None]] | None:
    """Error that so many of the epochs of all runs do not exceed: at `_SHARES`."""
    rows = [c.quantiles for c in curves if c.quantiles is not None]
    if not rows:
        return None
    values = np.concatenate(rows).astype(np.float64)
    values = values[np.isfinite(values)]
    return {"error": shorts(np.percentile(values, _SHARES), _DIGITS)}


def over_shares(rows: Mapping[str, Any]) -> dict[str, Any]:
    """Distributions by row over the common shares."""
    return {"axis": _SHARES.tolist(), "name": "share", "rows": rows}


def integrity(curves: Sequence[Curves], limit: float) -> dict[str, list[Any]] | None:
    """Cells of a Stanford diagram up to twice the alert limit: how many epochs are in each, by error and level.

    Parameters
    ----------
    curves : sequence of Curves
        Curves of one estimator on one scenario.
    limit : float
        Alert limit [m].
    """
    pairs = [(c.values["horizontal"], c.values["level"]) for c in curves if {"level", "horizontal"} <= c.values.keys()]
    if not pairs:
        return None
    error, level = (np.concatenate(x).astype(np.float64) for x in zip(*pairs, strict=True))
    found = Stanford(np.where(np.isfinite(error), error, np.inf), np.where(np.isfinite(level), level, np.inf), limit)
    edges = np.linspace(0.0, 2.0 * limit, 33)
    counts = found.histogram(edges)
    i, j = np.nonzero(counts)
    sides = {"x": edges[i], "x2": edges[i + 1], "y": edges[j], "y2": edges[j + 1]}
    return {**{name: shorts(values) for name, values in sides.items()}, "epochs": counts[i, j].tolist()}


def one_run(thinned: Mapping[str, Thin]) -> dict[str, Any]:
    """Errors, stated uncertainty, tracks and diagnostics of one run, from what `gather` kept of its series."""
    s = {name: np.asarray(values, dtype=np.float64) for name, values in thinned.items()}
    time = shorts(s["time"])
    found: dict[str, Any] = {}
    for name, _, _, factor in QUANTITIES:
        if name in s and np.isfinite(s[name]).any():
            found[name] = {"time": time, "middle": shorts(factor * np.abs(s[name]), _DIGITS)}
            if name == "horizontal" and np.isfinite(s.get("three_sigma", np.zeros(0))).any():
                found[name]["bound"] = shorts(s["three_sigma"], _DIGITS)
    if "estimate_north" in s:
        found["track"] = {"time": time, "east": shorts(s["estimate_east"]), "north": shorts(s["estimate_north"])}
    if "truth_time" in s:
        found["truth"] = [s[f"truth_{name}"] for name in _TRUTH]
    for name, values in s.items():
        known = np.isfinite(values)
        plain = name.startswith("weight.") and not (values[known] < _FULL).any()  # nothing was ever weighted
        if name.partition(".")[0] in DIAGNOSTICS and known.any() and not plain:
            found[name] = {"time": shorts(s["diagnostics_time"][known]), "middle": shorts(values[known], _DIGITS)}
    return found
