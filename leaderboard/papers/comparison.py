"""The rule by which our figure agrees with a paper's.

A paper gives one figure, mostly without its scatter, and its instruments and tracks are only partly known. So the
question is not whether two figures are equal, but whether they lie within a tolerance of each other. Ours comes with
Student's 95 % interval over the runs. Each row has a **band** of figures that agree:

- **Figures**: from the paper's figure divided by 1.25 to the figure times 1.25 (`TOLERANCE`).
- **Bounds** ("within 20 m"): everything that keeps the bound.
- **Claims of improvement**: our ratio of the two scores (the geometric mean over the runs, paired by seed) has a
  logarithm between 1/1.5 and 1.5 times that of the paper's (`GAIN`). So 28 % agrees with 20 to 39 %.

The interval decides. If it lies in the band, the row **agrees**. If it lies outside, the row **differs**. If an end of
the band is in the interval, the row is **undecided**: a wide interval never agrees, and more runs decide most rows.

With fewer than `FEWEST` runs a row is undecided. If a method failed in any run, the row differs, whatever the mean of
the other runs is.

That verdict is about our mean. A paper mostly prints **one run**, and single runs scatter. So there is a second
verdict: does the printed figure lie in the range that holds 95 % of our single runs (`single_runs`)? A printed run that
lies inside is one that our simulation gives as well, whatever its mean is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import stdtrit

from simnav.leaderboard.ranking.statistics import Interval

from .paper import Range, Rule

__all__ = [
    "FEWEST",
    "GAIN",
    "MANY",
    "RULES",
    "TOLERANCE",
    "Single",
    "Verdict",
    "as_gain",
    "judge",
    "judge_gain",
    "judge_single",
    "single_runs",
]

TOLERANCE = 0.25
GAIN = 1.5
FEWEST = 3
#: From so many runs on their own quantiles are the ends of the range of single runs.
MANY = 40

#: The rule in short, for the command and the pages.
RULES = (
    "Intervals are Student's 95 % intervals over the runs. A row agrees if the whole interval lies in the band of "
    "figures that agree, and differs if it lies outside. Otherwise it is undecided. The band: within 25 % of the "
    "paper's figure; every figure that keeps a bound; for a gain, a logarithm of the ratio within a factor of 1.5 of "
    "the paper's. Fewer than three runs decide nothing. A method that failed in any run differs. "
    "The column 'a single run' has a second verdict: whether the paper's figure lies in the range that holds 95 % of "
    "our single runs."
)

#: Whether a printed figure can be a single run of ours: in the range, or on which side of it; empty: not known.
Single = Literal["inside", "below", "above", ""]


@dataclass(frozen=True)
class Verdict:
    """A verdict on a row.

    Attributes
    ----------
    word : str
        ``agrees``, ``differs`` or ``undecided``.
    side : int
        -1 if our figure is below the band, +1 if it is above; 0 if it is in the band or not known.
    """

    word: Literal["agrees", "differs", "undecided"]
    side: int = 0


def judge(ours: Interval, paper: Range, rule: Rule = "equal") -> Verdict:
    """Compare our mean with a figure, range or bound of a paper.

    Parameters
    ----------
    ours : Interval
        Mean over the runs with its 95 % interval.
    paper : float or pair of float
        The paper's figure or range, in the same unit.
    rule : str
        ``equal``, ``at-most`` or ``at-least`` (`simnav.leaderboard.papers.paper.Rule`).

    Examples
    --------
    >>> [judge(Interval(v, v - d, v + d, 10), 1.0).word for v, d in ((1.1, 0.1), (1.4, 0.1), (1.2, 0.1))]
    ['agrees', 'differs', 'undecided']
    """
    least, most = paper if isinstance(paper, tuple) else (paper, paper)
    if rule == "at-most":
        return _verdict(ours, -math.inf, most)
    if rule == "at-least":
        return _verdict(ours, least, math.inf)
    return _verdict(ours, least / (1.0 + TOLERANCE), most * (1.0 + TOLERANCE))


def judge_gain(ours: Interval, paper: float) -> Verdict:
    """Compare our ratio of two scores with a paper's.

    Parameters
    ----------
    ours : Interval
        Geometric mean of the ratios with its 95 % interval.
    paper : float
        The paper's ratio; not 1.

    Examples
    --------
    In the paper a method has 0.7 of the other's error:

    >>> [judge_gain(Interval(v, v - d, v + d, 10), 0.7).word for v, d in ((0.7, 0.05), (0.97, 0.01), (0.9, 0.3))]
    ['agrees', 'differs', 'undecided']
    """
    ends = sorted((paper ** (1.0 / GAIN), paper**GAIN))
    return _verdict(ours, *ends)


def single_runs(values: Iterable[float]) -> Interval:
    """The range that holds 95 % of the single runs.

    From `MANY` runs on its ends are the 2.5 % and the 97.5 % quantile, such that one more run lies inside with 95 %
    probability (Weibull's plotting position, i / (n + 1)). With fewer runs they are those of Student's
    prediction interval for one more run, on the logarithmic scale: ``m ± t s sqrt(1 + 1/n)``.

    Parameters
    ----------
    values : iterable of float
        The figure of each run, or the ratio of two methods on each seed. Values that are not finite are left out.

    Returns
    -------
    Interval
        The median and the ends; all NaN with fewer than `FEWEST` runs, or where a figure of few runs is not positive.

    Examples
    --------
    >>> found = single_runs([0.9, 1.0, 1.1])
    >>> round(found.value, 3), round(found.low, 2), round(found.high, 2)
    (1.0, 0.61, 1.64)
    """
    x = np.array([v for v in values if math.isfinite(v)])
    n = len(x)
    if n < FEWEST or (n < MANY and x.min() <= 0.0):
        return Interval(math.nan, runs=n)
    if n >= MANY:
        low, middle, high = np.quantile(x, [0.025, 0.5, 0.975], method="weibull").tolist()
        return Interval(middle, low, high, n)
    logs = np.log(x)
    half = float(stdtrit(n - 1, 0.975)) * float(logs.std(ddof=1)) * math.sqrt(1.0 + 1.0 / n)
    centre = float(logs.mean())
    return Interval(float(np.median(x)), math.exp(centre - half), math.exp(centre + half), n)


def judge_single(runs: Interval, paper: Range) -> Single:
    """Whether a paper's figure can be a single run of ours.

    Parameters
    ----------
    runs : Interval
        From `single_runs`; for a gain, of the ratios.
    paper : float or pair of float
        The paper's figure or range, in the same unit; for a gain, the ratio.

    Returns
    -------
    str
        ``inside``; ``below`` or ``above``: the paper's figure is below or above the range; empty without a range.

    Examples
    --------
    >>> [judge_single(Interval(1.0, 0.6, 1.6, 9), paper) for paper in (1.5, 0.5, (1.5, 1.8), 2.0)]
    ['inside', 'below', 'inside', 'above']
    """
    if math.isnan(runs.low):
        return ""
    least, most = paper if isinstance(paper, tuple) else (paper, paper)
    return "below" if most < runs.low else "above" if least > runs.high else "inside"


def as_gain(ratio: Interval) -> Interval:
    """A ratio of two scores as a gain: a ratio of 0.7 is a gain of 0.3, and a low ratio is a large gain.

    >>> as_gain(Interval(0.75, 0.5, 1.0, 10))
    Interval(value=0.25, low=0.0, high=0.5, runs=10)
    """
    return Interval(1.0 - ratio.value, 1.0 - ratio.high, 1.0 - ratio.low, ratio.runs)


def _verdict(ours: Interval, low: float, high: float) -> Verdict:
    """Verdict on an interval, given the band of figures that agree."""
    side = -1 if ours.value < low else 1 if ours.value > high else 0
    if ours.runs < FEWEST or math.isnan(ours.low) or math.isnan(ours.high):
        return Verdict("undecided", side)
    if low <= ours.low and ours.high <= high:
        return Verdict("agrees")
    outside = ours.high < low or ours.low > high
    return Verdict("differs" if outside else "undecided", side)
