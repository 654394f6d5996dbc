"""Whether a row is better than what is possible.

An oracle knows the true noise of each measurement and which measurements a fault touched. Whoever has clearly smaller
errors has seen the truth, or the figure of the oracle is wrong. Such a row is shown and not ranked.

A recorded voyage has no oracle, and its reference is often public: an estimator can hold it, whatever the seeds are.
There the floor is a part of the error of the plain smoother, which uses all measurements of the voyage, those of the
future included (`below_floor`). This finds a row that reads the reference. It does not find one that reads a little.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from .board import Reference

__all__ = ["FLOORS", "LEAST_ERROR", "MARGIN", "beats", "below_floor", "too_good"]

#: What a row may be better than an oracle: its figure is known to some per cent, and the least mean square error, which
#: the oracle has, does not need to be the least geometric mean.
MARGIN = 0.9
#: Runs of the oracle on the same seeds from which on a row is compared with them, run by run.
LEAST_PAIRS = 5
#: On recorded voyages, the part of a plain row's error below which nobody is believed: of the plain smoother, and of
#: the plain filter where no smoother ran. The first number is for the geometric mean over the recordings, the second
#: one for a single recording. Of the rows of simnav the best has 0.88 of the smoother, and 0.09 of the filter.
FLOORS = {"smoother": (0.25, 0.1), "filter": (0.04, 0.02)}
#: Horizontal error [m] below which nobody is believed on a recorded voyage: references are known to centimetres.
LEAST_ERROR = 0.01
#: Probability that an honest row that is as good as possible is flagged on any scenario of a board.
_ALPHA = 0.001
#: Least spread of the log error from run to run: what a very short list of runs might hide.
_LEAST_SPREAD = 0.05


def too_good(log_ratios: ArrayLike, reference: Reference, scenarios: int = 1) -> bool:
    """Whether the errors of a row on a scenario are below the oracle's by more than chance.

    Parameters
    ----------
    log_ratios : (n,) array_like
        Logarithms of the ratios to the reference figure, of the runs that were completed.
    reference : Reference
        No bound: never too good.
    scenarios : int
        How many scenarios the row is judged on.

    Returns
    -------
    bool
        Whether the geometric mean is below `MARGIN` at a one-sided level of 0.1 % over all scenarios. The spread from
        run to run is taken as the larger one of the oracle's and the row's own.

    Examples
    --------
    >>> from simnav.leaderboard.ranking.board import Reference
    >>> oracle = Reference(1.0, "oracle", 200, 0.3)
    >>> too_good([-13.0, -13.5, -12.8], oracle), too_good([-0.2, 0.1, -0.15], oracle)
    (True, False)
    """
    x = np.asarray(log_ratios, dtype=np.float64)
    if not len(x) or not reference.bounds or reference.runs < 2:
        return False
    own = float(x.std(ddof=1)) if len(x) > 1 else 0.0
    spread = max(reference.spread, own, _LEAST_SPREAD)
    error = spread * math.sqrt(1.0 / len(x) + 1.0 / reference.runs)
    return _below_margin(x, error, reference.runs - 1.0, scenarios)


def beats(differences: ArrayLike, scenarios: int = 1) -> bool:
    """Whether a row is better than an oracle on the same runs by more than chance.

    Parameters
    ----------
    differences : (n,) array_like
        Logarithm of the error of the row less that of the oracle, run by run.
    scenarios : int
        How many scenarios the row is judged on.

    Returns
    -------
    bool
        Whether the geometric mean of the ratio is below `MARGIN` at a one-sided level of 0.1 % over all scenarios.
        Never with fewer than `LEAST_PAIRS` runs. Runs differ in how hard they are, for the row and the oracle alike: so
        this sees more than `too_good` does where a scenario draws its magnitudes.

    Examples
    --------
    >>> beats([-0.6, -0.7, -0.5, -0.65, -0.55]), beats([-0.6, 0.1, -0.2, 0.3, -0.1])
    (True, False)
    """
    x = np.asarray(differences, dtype=np.float64)
    if len(x) < LEAST_PAIRS:
        return False
    error = max(float(x.std(ddof=1)), _LEAST_SPREAD) / math.sqrt(len(x))
    return _below_margin(x, error, len(x) - 1.0, scenarios)


def below_floor(
    errors: Mapping[int, float], others: Mapping[int, float], kind: str, units: Mapping[int, object]
) -> bool:
    """Whether the horizontal errors of a row on recorded voyages are smaller than reference and instruments allow.

    Parameters
    ----------
    errors : mapping of int to float
        Error by seed [m], of the runs that were completed.
    others : mapping of int to float
        Error of the plain row by seed [m]; may lack seeds, or be empty.
    kind : str
        Key of `FLOORS`: what the plain row is.
    units : mapping of int to object
        The recording of each seed.

    Examples
    --------
    >>> units = {0: "a", 1: "b"}
    >>> below_floor({0: 1e-9, 1: 1e-9}, {}, "filter", units)
    True
    >>> below_floor({0: 0.2, 1: 0.2}, {0: 1.0, 1: 1.0}, "smoother", units)
    True
    >>> below_floor({0: 0.9, 1: 0.6}, {0: 1.0, 1: 1.0}, "smoother", units)
    False
    """
    if any(error < LEAST_ERROR for error in errors.values()):
        return True
    by_unit: dict[object, list[float]] = {}
    for seed, error in errors.items():
        if 0.0 < others.get(seed, 0.0) < math.inf:
            by_unit.setdefault(units.get(seed), []).append(math.log(error / others[seed]))
    if not by_unit:
        return False
    means = [math.fsum(logs) / len(logs) for logs in by_unit.values()]
    mean, single = FLOORS[kind]
    return min(means) < math.log(single) or math.fsum(means) / len(means) < math.log(mean)


def _below_margin(logs: NDArray[np.float64], error: float, freedom: float, scenarios: int) -> bool:
    """Whether the mean of logarithms is below that of `MARGIN` by more than chance, given its standard error."""
    from scipy.special import stdtr

    statistic = (float(logs.mean()) - math.log(MARGIN)) / error
    return float(stdtr(freedom, statistic)) < _ALPHA / max(scenarios, 1)
