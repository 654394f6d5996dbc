"""Our figure against a paper's: the rule by which the two agree.

A paper gives one figure, mostly without its scatter, from instruments and tracks that are only partly known. So the
question is not whether the two are equal but whether they tell the same story:

- **Figures.** Ours is the mean over the runs with Student's 95 % interval. It agrees where it is within `TOLERANCE`
  (25 %) of the paper's, or where the paper's lies inside the interval. Where the interval is too wide to tell (a half
  width of more than `VAGUE`, 50 % of the mean) and touches the 25 % around the paper's, the row is undecided.
- **Bounds** ("within 20 m"). Ours agrees where its mean keeps the bound; it is undecided where only part of the
  interval does.
- **Claims of improvement.** Ours is the geometric mean of the ratios of the two scores, run by run on the same seed,
  with Student's 95 % interval of its logarithm. It agrees where it has the paper's sign for certain (the interval
  excludes "no difference") and the paper's size: the logarithm of the ratio within a factor of `GAIN` (1.5) of the
  paper's, so that 28 % agrees with 20 to 39 %, or the paper's ratio inside the interval. It is undecided where the
  interval holds both "no difference" and the paper's ratio.
- Fewer than `FEWEST` runs decide nothing.
- A method that failed in any run differs, whatever the mean of its other runs.
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
    "VAGUE",
    "Verdict",
    "judge",
    "judge_gain",
]

TOLERANCE = 0.25
GAIN = 1.5
VAGUE = 0.5
FEWEST = 3

#: The rule in short, for the command and the pages.
RULES = (
    "Intervals are Student's 95 % over the runs. A figure agrees within 25 % of the paper's, or where the paper's "
    "lies in the "
    "interval; a bound, where our mean keeps it; a gain, where its sign is certain and the logarithm of its ratio "
    "within a "
    "factor of 1.5 of the paper's. Too wide an interval, or fewer than three runs, decide nothing. What differs has "
    "a note."
)


@dataclass(frozen=True)
class Verdict:
    """What the rule says.

    Attributes
    ----------
    word : str
    side : int
        -1 where ours is lower than the paper's, +1 where it is higher; 0 where they agree or it is not known.
    """

    word: Literal["agrees", "differs", "undecided"]
    side: int = 0


def judge(ours: Interval, paper: Range, rule: Rule = "equal") -> Verdict:
    """Whether a figure agrees with the paper's.

    Examples
    --------
    >>> judge(Interval(1.2, 1.1, 1.3, 10), 1.0).word, judge(Interval(1.3, 1.2, 1.4, 10), 1.0).word
    ('agrees', 'differs')
    """
    if ours.runs < FEWEST:
        return Verdict("undecided")
    least, most = paper if isinstance(paper, tuple) else (paper, paper)
    if rule == "at-most":
        least, tolerance = -math.inf, 0.0
    elif rule == "at-least":
        most, tolerance = math.inf, 0.0
    else:
        tolerance = TOLERANCE
    low, high = least / (1.0 + tolerance), most * (1.0 + tolerance)
    near = low <= ours.value <= high
    side = 0 if near else -1 if ours.value < low else 1
    if rule != "equal":
        touches = ours.low <= high and ours.high >= low
        return Verdict("agrees") if near else Verdict("undecided" if touches else "differs", side)
    vague = ours.high - ours.low > 2.0 * VAGUE * abs(ours.value)
    if vague and ours.low <= high and ours.high >= low:
        return Verdict("undecided")
    inside = ours.low <= most and ours.high >= least
    return Verdict("agrees") if near or inside else Verdict("differs", side)


def judge_gain(ours: Interval, paper: float) -> Verdict:
    """Whether a ratio of scores agrees with the paper's; the side is that of our ratio.

    Examples
    --------
    The paper's method makes 0.7 of the other's error:

    >>> [judge_gain(Interval(v, v - d, v + d, 10), 0.7).word for v, d in ((0.75, 0.1), (0.97, 0.01), (0.9, 0.3))]
    ['agrees', 'differs', 'undecided']
    """
    if ours.runs < FEWEST:
        return Verdict("undecided")
    side = -1 if ours.value < paper else 1
    near = 1.0 / GAIN <= math.log(ours.value) / math.log(paper) <= GAIN
    inside = ours.low <= paper <= ours.high
    nothing = ours.low <= 1.0 <= ours.high
    if nothing and inside:
        return Verdict("undecided")
    same_sign = not nothing and (ours.value < 1.0) == (paper < 1.0)
    return Verdict("agrees") if same_sign and (near or inside) else Verdict("differs", side)
