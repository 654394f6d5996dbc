"""The gain of a claim at one value of a dial, and along the dial."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from simnav.leaderboard.papers.comparison import FEWEST, as_gain
from simnav.leaderboard.ranking.statistics import Interval, mean_ratio

from .claim import Choice
from .looks import LEVEL, deciding_interval

__all__ = ["DialAnswer", "Judgement", "Point", "Standing", "gain_text"]

#: Of a claim at one setting.
Standing = Literal["holds", "does not hold", "undecided"]


@dataclass(frozen=True)
class Point:
    """A comparison at one value of a dial.

    Attributes
    ----------
    value : float or str
        Value of the dial; empty for our settings.
    seeds : list of int
        Seeds on which both methods ran to the end.
    ratios : list of float
        The score of the method over that of the other one, on these seeds.
    failed : int
        Seeds on which one of them failed.
    """

    value: Choice
    seeds: list[int]
    ratios: list[float]
    failed: int = 0

    @property
    def ratio(self) -> Interval:
        """Geometric mean of the ratios with its 95 % interval (Student's, of the logarithms)."""
        return mean_ratio(dict(zip(self.seeds, self.ratios, strict=True)), dict.fromkeys(self.seeds, 1.0))

    @property
    def gain(self) -> Interval:
        """The gain with its 95 % interval."""
        return as_gain(self.ratio)

    def standing(self, limit: float) -> Standing:
        """Whether a claim holds here, which needs a ratio of at most ``limit``; the whole interval decides."""
        ratio = self.ratio
        if self.failed:
            return "does not hold"
        if ratio.runs < FEWEST or not math.isfinite(ratio.low):
            return "undecided"
        return "holds" if ratio.high <= limit else "does not hold" if ratio.low > limit else "undecided"


@dataclass(frozen=True)
class Judgement(Point):
    """A comparison that decides: its interval allows for all looks that were planned.

    Attributes
    ----------
    first : int
        Number of runs of the first look (`simnav.leaderboard.papers.claims.looks.looks`).
    level : float
        Probability that it is wrong, over all looks.
    """

    first: int = 12
    level: float = LEVEL

    @property
    def ratio(self) -> Interval:
        """Geometric mean of the ratios with the interval that decides at this number of runs."""
        return deciding_interval(self.ratios, self.first, self.level)


@dataclass(frozen=True)
class DialAnswer:
    """What was found along one dial.

    Attributes
    ----------
    name, title, unit, ours, why
        As of `simnav.leaderboard.papers.claims.claim.Dial`.
    points : list of Point
        The gain at each value, on the seeds of the search.
    tried : list of Judgement
        The gain at the values that were judged, in turn, each on seeds of its own; the last one counts.
    """

    name: str
    title: str
    unit: str
    ours: Choice | None
    why: str
    points: list[Point]
    tried: list[Judgement]

    @property
    def judged(self) -> Judgement | None:
        """The value that was judged last; None if there was none to be judged."""
        return self.tried[-1] if self.tried else None

    def text(self, value: Choice) -> str:
        """A value with its unit."""
        return value if isinstance(value, str) else f"{value:g} {self.unit}".rstrip()

    def holding(self, limit: float) -> list[Choice]:
        """The values, in a row from the judged one away from ours, at which the search found that the claim holds."""
        if self.judged is None:
            return []
        values = [p.value for p in self.points]
        good = [p.ratio.value <= limit and not p.failed for p in self.points]
        at = values.index(self.judged.value)
        if not good[at]:
            return []
        place = values.index(self.ours) if self.ours in values else 0
        first = last = at
        while at < place and first > 0 and good[first - 1]:
            first -= 1
        while at >= place and last + 1 < len(values) and good[last + 1]:
            last += 1
        return values[first : last + 1]

    def condition(self, limit: float) -> str:
        """The values at which it holds, in words: ``the delay of the output is 20 s or more``."""
        held = self.holding(limit)
        values = [p.value for p in self.points]
        if isinstance(self.judged, Point) and isinstance(self.judged.value, str):
            return f"{self.title}: {self.judged.value}"
        if not held:
            return self.title
        low, high = held[0], held[-1]
        if low == values[0] and high == values[-1]:
            return f"{self.title} is from {self.text(low)} to {self.text(high)}, all that was tried"
        if high == values[-1]:
            return f"{self.title} is {self.text(low)} or more"
        if low == values[0]:
            return f"{self.title} is {self.text(high)} or less"
        if low == high:
            return f"{self.title} is {self.text(low)}"
        return f"{self.title} is from {self.text(low)} to {self.text(high)}"


def gain_text(point: Point) -> str:
    """A gain with its interval and number of runs: ``12.4 % [9.8, 14.9], 8 runs``."""
    gain = point.gain
    failed = f", {point.failed} failed" if point.failed else ""
    if not gain.runs:
        return f"no run to the end{failed}"
    if not math.isfinite(gain.low):
        return f"{100.0 * gain.value:.1f} %, {gain.runs} run{'s' if gain.runs > 1 else ''}{failed}"
    low, high = (round(100.0 * x, 1) + 0.0 for x in (gain.low, gain.high))
    return f"{round(100.0 * gain.value, 1) + 0.0:.1f} % [{low:.1f}, {high:.1f}], {gain.runs} runs{failed}"
