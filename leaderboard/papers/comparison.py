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
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from simnav.leaderboard.papers.paper import Range, Rule
from simnav.leaderboard.ranking.statistics import Interval

__all__ = [
    "FEWEST",
    "GAIN",
    "RULES",
    "TOLERANCE",
    "Verdict",
    "as_gain",
    "judge",
    "judge_gain",
]

TOLERANCE = 0.25
GAIN = 1.5
FEWEST = 3

#: The rule in short, for the command and the pages.
RULES = (
    "Intervals are Student's 95 % intervals over the runs. A row agrees if the whole interval lies in the band of "
    "figures that agree, and differs if it lies outside. Otherwise it is undecided. The band: within 25 % of the "
    "paper's figure; every figure that keeps a bound; for a gain, a logarithm of the ratio within a factor of 1.5 of "
    "the paper's. Fewer than three runs decide nothing. A method that failed in any run differs."
)


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
