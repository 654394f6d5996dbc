"""When a judgement is looked at, and which interval decides then: alpha spending over planned doublings.

A judgement begins with a first number of runs, and doubles them while it is undecided. Whoever looks several times at
an interval of 95 % is wrong in more than 5 %. So the looks are planned, and the 5 % are divided equally among them
before anything is run (K. K. G. Lan and D. L. DeMets, *Discrete sequential boundaries for clinical trials*, Biometrika
70, 1983). The shares are simply added, so nothing is assumed of how the looks depend on each other.

Logarithms of ratios are skewed: a method is slightly better in most runs, and much worse in a few, of which a short
sample may have none. So each end of the interval has to hold also with one more run that is `UNLUCKY` times as far from
the mean as the farthest of all runs, on the side of this end. ``python -m tests.audit claims`` measures the error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import stdtrit

from simnav.leaderboard.papers.comparison import FEWEST
from simnav.leaderboard.ranking.statistics import Interval

__all__ = ["DOUBLINGS", "LEVEL", "UNLUCKY", "deciding_interval", "looks"]

#: How often the runs of an undecided judgement are doubled at most.
DOUBLINGS = 4
#: Probability that a judgement of one setting is wrong, over all of its looks.
LEVEL = 0.05
#: How far off one more run may be, as a multiple of the farthest run.
UNLUCKY = 1.5


def looks(first: int) -> tuple[int, ...]:
    """The numbers of runs at which a judgement is looked at.

    >>> looks(12)
    (12, 24, 48, 96, 192)
    """
    return tuple(first * 2**k for k in range(DOUBLINGS + 1))


def deciding_interval(ratios: Sequence[float], first: int, level: float = LEVEL) -> Interval:
    """Geometric mean of ratios, with the interval that decides at the look with so many runs.

    Parameters
    ----------
    ratios : sequence of float
        The ratio of two scores in each run.
    first : int
        Number of runs of the first look.
    level : float
        Probability that the judgement is wrong, over all looks.

    Returns
    -------
    Interval
        Without ends for fewer than three runs, and where the number of runs is none of `looks`.

    Examples
    --------
    Each look spends a fifth of the level, so the interval is wider than one of 95 %, from 0.698 to 0.715.

    >>> found = deciding_interval([0.7, 0.72, 0.71, 0.69, 0.7, 0.71, 0.7, 0.72], 4)
    >>> round(found.low, 3), round(found.high, 3)
    (0.689, 0.724)
    """
    logs = np.log(np.asarray(ratios, dtype=np.float64))
    n, planned = len(logs), looks(first)
    if n == 0:
        return Interval(math.nan)
    mean = float(logs.mean())
    if n < FEWEST or n not in planned:
        return Interval(math.exp(mean), runs=n)
    student = float(stdtrit(n - 1.0, 1.0 - 0.5 * level / len(planned)))
    square = float(np.sum((logs - mean) ** 2))
    reach = student * math.sqrt(square / (n * (n - 1)))
    far = UNLUCKY * float(np.abs(logs - mean).max())
    # With one more run at a distance: by how much the mean moves, and the square of its standard error.
    moved, error = far / (n + 1), (square + far**2 * n / (n + 1)) / (n * (n + 1))
    reach = max(reach, moved + student * math.sqrt(error))
    return Interval(math.exp(mean), math.exp(mean - reach), math.exp(mean + reach), n)
