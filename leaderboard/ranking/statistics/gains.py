"""What a row gains over another on the same runs, with intervals over seeds and over scenarios."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .intervals import LEVEL, Interval, codes, score

__all__ = ["FEWEST_SCENARIOS", "WORSE", "Gain", "gain", "scenario_interval"]

#: Fewest scenarios of which an interval over scenarios is given.
FEWEST_SCENARIOS = 3
#: A run is clearly worse from this multiple of the plain row's error on.
WORSE = 1.5


@dataclass(frozen=True)
class Gain:
    """The errors of a row beside those of the plain row on the same runs.

    Attributes
    ----------
    value : float
        Geometric mean of the ratio of the errors, each stratum counting the same; below 1 the row is better.
    low, high : float
        Its 95 % interval over seeds: for other runs of the same scenarios. NaN where there is none.
    scenarios_low, scenarios_high : float
        Its 95 % interval over seeds and scenarios: for other scenarios of the same kind. NaN where there is none.
    won, scenarios : int
        Number of scenarios on which the row has the smaller error, and number of all.
    worse : float
        Share of the runs in which its error is more than `WORSE` times that of the plain row.
    """

    value: float
    low: float = math.nan
    high: float = math.nan
    scenarios_low: float = math.nan
    scenarios_high: float = math.nan
    won: int = 0
    scenarios: int = 0
    worse: float = math.nan


def gain(
    mine: ArrayLike,
    plain: ArrayLike,
    strata: Sequence[Hashable],
    clusters: Sequence[Hashable],
    excess: float = 0.0,
    scenarios: Sequence[Hashable] | None = None,
) -> Gain:
    """The gain of a row over the plain row.

    Parameters
    ----------
    mine, plain : (n,) array_like
        Logarithms of the errors of the two rows in the same runs.
    strata, clusters : sequence of n
        What counts the same, and the independent unit (seed or recording) of each run.
    excess : float
        As for `simnav.leaderboard.ranking.statistics.intervals.score`.
    scenarios : sequence of n, optional
        The scenario of each run. Default: its stratum.

    Examples
    --------
    >>> found = gain([0.0, 0.0], [math.log(2.0)] * 2, ["one", "two"], [0, 0])
    >>> found.value, found.won, found.scenarios, found.worse
    (0.5, 2, 2, 0.0)
    """
    difference: NDArray[np.float64] = np.asarray(mine, dtype=np.float64) - np.asarray(plain, dtype=np.float64)
    seeds = score(difference, strata, clusters, excess=excess)
    named = strata if scenarios is None else scenarios
    every = scenario_interval(difference, named, strata)
    scenario = codes(named)
    means = np.bincount(scenario, difference) / np.bincount(scenario)
    return Gain(
        seeds.value, seeds.low, seeds.high, every.low, every.high, int(np.count_nonzero(means < 0.0)), len(means),
        float(np.mean(difference > math.log(WORSE))),
    )  # fmt: skip


def scenario_interval(
    values: ArrayLike, scenarios: Sequence[Hashable], strata: Sequence[Hashable] | None = None
) -> Interval:
    """The geometric mean over scenarios, with its interval for other scenarios of the same kind.

    The scenarios are taken for a sample. The means of the scenarios hold the scatter of the seeds, so Student's
    interval of these means covers both. Where the scenarios have weights, because each stratum of them counts the
    same, the standard error is that of a weighted mean: the root of n / (n - 1) sum(w^2 (x - mean)^2) (Cochran, 1977,
    Sampling Techniques, as a ratio estimate).

    Parameters
    ----------
    values : (n,) array_like
        Logarithms.
    scenarios : sequence of n
        The scenario of each run.
    strata : sequence of n, optional
        The stratum of each run; each counts the same. Default: each scenario is one.

    Examples
    --------
    >>> scenario_interval([0.0, 0.1], ["one", "two"]).low
    nan
    >>> found = scenario_interval([0.0, 0.1, 0.2], ["one", "two", "three"])
    >>> found.low < math.exp(0.1) < found.high
    True
    >>> round(math.log(scenario_interval([0.0, 0.0, 0.3], ["one", "two", "three"], ["calm", "calm", "rough"]).value), 3)
    0.15
    """
    x: NDArray[np.float64] = np.asarray(values, dtype=np.float64)
    stratum = codes(scenarios if strata is None else strata)
    scenario = codes(scenarios)
    weight = 1.0 / (np.count_nonzero(np.bincount(stratum)) * np.bincount(stratum)[stratum])  # of a run
    weights = np.bincount(scenario, weight)
    means = np.bincount(scenario, weight * x) / weights
    middle = float(weights @ means)
    count = len(means)
    if count < FEWEST_SCENARIOS:
        return Interval(math.exp(middle), runs=count)
    from scipy.special import stdtrit

    error = math.sqrt(count / (count - 1) * float(weights**2 @ (means - middle) ** 2))
    half = float(stdtrit(count - 1.0, 0.5 + 0.5 * LEVEL)) * error
    return Interval(math.exp(middle), math.exp(middle - half), math.exp(min(middle + half, 700.0)), count)
