"""All runs of one estimator on one scenario, condensed: what ranking, pages and figures read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.figures.plots import Array, Band
from simnav.leaderboard.results.stored_scores import score_matrix
from simnav.scoring import SCORES

from .statistics import Interval, median

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result, Series

__all__ = ["Runs", "at_times", "group", "has_series"]

_PLACES = {name: k for k, name in enumerate(SCORES)}


class Runs:
    """All runs of one estimator on one scenario.

    Parameters
    ----------
    results : sequence of Result
        At least one.

    Attributes
    ----------
    scenario, estimator : str
        Versioned id of the scenario, and label of the estimator.
    reference : bool
        Whether the estimator is a reference, which is not ranked.
    results : list of Result
        In order of seed.

    Raises
    ------
    ValueError
        If there are two results for one run.
    """

    def __init__(self, results: Sequence[Result]):
        self.results = sorted(results, key=lambda r: r.seed)
        self.scenario, self.estimator = results[0].scenario, results[0].estimator
        self.reference = any(r.reference for r in results)
        self._medians: dict[str, Interval] = {}
        for a, b in pairwise(self.results):
            if a.seed == b.seed:  # whatever their notes say
                what = f"two results of {self.estimator!r} on {self.scenario} for seed {a.seed}"
                raise ValueError(f"{what}; keep one of them")

    @cached_property
    def tried(self) -> list[Result]:
        """Those for which the scenario suits the estimator."""
        return [r for r in self.results if r.tried]

    @cached_property
    def good(self) -> list[Result]:
        """Those that ended well."""
        return [r for r in self.results if r.status == "ok"]

    @property
    def failed(self) -> int:
        """Number of failures."""
        return len(self.tried) - len(self.good)

    @property
    def peak_memory(self) -> int:
        """Largest of all runs [bytes]."""
        return max((int(r.peak_memory) for r in self.tried), default=0)

    def column(self, name: str) -> Array:
        """(n,) one score of all results, in their order; NaN where it does not apply."""
        k = _PLACES.get(name)
        return score_matrix([r.scores for r in self.results], [name])[:, 0] if k is None else self._columns[:, k]

    @cached_property
    def _columns(self) -> Array:
        return score_matrix([r.scores for r in self.results], list(_PLACES))

    @cached_property
    def _tried(self) -> NDArray[np.bool_]:
        return np.array([r.tried for r in self.results], dtype=bool)

    @cached_property
    def _good(self) -> NDArray[np.bool_]:
        return np.array([r.status == "ok" for r in self.results], dtype=bool)

    def scores(self, name: str) -> Array:
        """One score of the runs that ended well; NaN where it does not apply."""
        return self.column(name)[self._good]

    def score(self, name: str) -> Interval:
        """Median of a score over the runs that ended well."""
        if name not in self._medians:
            self._medians[name] = median(self.scores(name))
        return self._medians[name]

    def numbers(self, name: str) -> Array:
        """A score over all runs, those that failed included as far as they went; only where it is finite."""
        x = self.column(name)[self._tried]
        return x[np.isfinite(x)]

    @cached_property
    def statuses(self) -> dict[str, int]:
        """How many runs ended how (`Result.ending`)."""
        return dict(sorted(Counter(r.ending for r in self.tried).items()))

    def unsuitable(self) -> str:
        """Which instrument is lacking, where the scenario does not suit the estimator; otherwise nothing."""
        return min((r.reason or r.status for r in self.results if r.status == "unsuitable"), default="")

    # -- curves --------------------------------------------------------------------------------------

    def band(self, name: str, factor: float = 1.0) -> Band | None:
        """Magnitude of an error over time, a row a run, on the time axis of the longest run; None without any."""
        found = [(r.series["time"], np.abs(r.series[name])) for r in self.good if has_series(r.series, name)]
        if not found:
            return None
        time = max((t for t, _ in found), key=lambda t: float(t[-1])).astype(np.float64)
        rows = [at_times(time, t, v) for t, v in found]
        return Band(self.estimator, time, factor * np.asarray(rows, dtype=np.float64))

    def quantiles(self) -> Band | None:
        """Quantiles of the horizontal error, a row a run: their pooled distribution is that of all epochs."""
        rows = [r.series["quantiles"] for r in self.good if has_series(r.series, "quantiles")]
        if not rows:
            return None
        values = np.asarray(rows, dtype=np.float64)
        return Band(self.estimator, np.arange(values.shape[1], dtype=np.float64), values)


def has_series(series: Mapping[str, Series], name: str) -> bool:
    """Whether the series of a result have one of this name, with a finite value."""
    values = series.get(name)
    return values is not None and len(values) > 0 and bool(np.isfinite(values).any())


def at_times(time: Array, t: NDArray[Any], values: NDArray[Any]) -> NDArray[Any]:
    """Values at the times t (n,), interpolated at others (k,); NaN after the last one. All in seconds."""
    same = len(t) == len(time) and np.array_equal(t, time)
    return values if same else np.interp(time, t, values, right=np.nan)


def group(results: Iterable[Result]) -> dict[str, dict[str, Runs]]:
    """Scenario -> estimator -> runs, both in the order in which they come."""
    lists: dict[str, dict[str, list[Result]]] = {}
    for r in results:
        lists.setdefault(r.scenario, {}).setdefault(r.estimator, []).append(r)
    return {s: {e: Runs(found) for e, found in by.items()} for s, by in lists.items()}
