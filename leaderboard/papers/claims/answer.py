"""The answer to the question when a claim holds: gains at all values of the dials, with intervals and verdicts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from simnav.leaderboard.papers.comparison import FEWEST, GAIN, as_gain
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.statistics import Interval, mean_ratio
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.shown import Shown

from .claim import Choice

__all__ = ["Answer", "DialAnswer", "Point", "Standing"]

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
class DialAnswer:
    """What was found along one dial.

    Attributes
    ----------
    name, title, unit, ours, why
        As of `simnav.leaderboard.papers.claims.claim.Dial`.
    points : list of Point
        The gain at each value, on the seeds of the search.
    judged : Point or None
        The gain at the value that was judged, on seeds of their own.
    """

    name: str
    title: str
    unit: str
    ours: Choice | None
    why: str
    points: list[Point]
    judged: Point | None

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
        first = last = at
        while first > 0 and good[first - 1]:
            first -= 1
        while last + 1 < len(values) and good[last + 1]:
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


@dataclass(frozen=True, repr=False)
class Answer(Shown):
    """When a claim holds.

    Attributes
    ----------
    claim, paper, sentence, gain, derived
        As of `simnav.leaderboard.papers.claims.claim.Claim`.
    scenario, row, than, score, than_score : str
        Of the comparison with our settings: id of the scenario, labels of the estimators, measures.
    ours : Point
        The gain with our settings, on the seeds of the judgement.
    dials : list of DialAnswer
        What was found along each dial.
    """

    claim: str
    paper: str
    sentence: str
    gain: float
    derived: bool
    scenario: str
    row: str
    than: str
    score: str
    than_score: str
    ours: Point
    dials: list[DialAnswer]

    @property
    def limit(self) -> float:
        """As of `simnav.leaderboard.papers.claims.claim.Claim`."""
        return float((1.0 - self.gain) ** (1.0 / GAIN))

    @property
    def standing(self) -> Standing:
        """Whether the claim holds with our settings."""
        return self.ours.standing(self.limit)

    @property
    def conditions(self) -> list[DialAnswer]:
        """The dials along which it holds at the value that was judged."""
        return [d for d in self.dials if d.judged is not None and d.judged.standing(self.limit) == "holds"]

    @property
    def verdict(self) -> Literal["holds", "holds if", "does not hold", "undecided"]:
        """With our settings, or under a condition, or not under any that was tried."""
        if self.standing == "holds":
            return "holds"
        if self.conditions:
            return "holds if"
        judged = [d.judged for d in self.dials if d.judged is not None]
        if self.standing == "undecided" or any(p.standing(self.limit) == "undecided" for p in judged):
            return "undecided"
        return "does not hold"

    @property
    def sentence_of_verdict(self) -> str:
        """The verdict in words."""
        conditions = "; or if ".join(f"{d.condition(self.limit)} ({gain_text(d.judged)})" for d in self.conditions
                                     if d.judged is not None)  # fmt: skip
        if self.verdict == "holds":
            return "holds with our settings"
        if self.verdict == "holds if":
            return f"holds if {conditions}"
        tried = "; ".join(d.title.rstrip(",") for d in self.dials)
        if self.verdict == "undecided":
            return "undecided: an interval lies across the limit, and more seeds may decide it"
        return f"does not hold; tried: {tried}" if tried else "does not hold with our settings"

    def headline(self) -> str:
        """The claim and the verdict."""
        return f"{self.sentence}: {self.sentence_of_verdict}"

    def shown(self) -> Sequence[tables.Fitted]:
        """A row for each value of each dial; nothing without dials."""
        rows = []
        for dial in self.dials:
            title = dial.title.rstrip(",")
            for point in dial.points:
                judged = dial.judged if dial.judged is not None and dial.judged.value == point.value else None
                other, verdict = ("", "") if judged is None else (gain_text(judged), judged.standing(self.limit))
                ours = "ours" if point.value == dial.ours else ""
                rows.append([title, dial.text(point.value), ours, gain_text(point), other, verdict])
                title = ""
        columns = ["varied", "value", "", "gain (search)", "gain (judgement)", "verdict"]
        order = ["value", "gain (search)", "verdict", "gain (judgement)", "varied", ""]
        title = f"{self.claim}: claimed gain {100.0 * self.gain:.1f} %"
        return [tables.Fitted(title, columns, rows, order, always=2)] if rows else []

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav claim --json`` prints, and what is stored."""
        return {
            **{name: getattr(self, name) for name in (
                "claim", "paper", "sentence", "gain", "derived", "scenario", "row", "than", "score", "than_score",
            )},
            "verdict": self.verdict,
            "words": self.sentence_of_verdict,
            "ours": _point_dict(self.ours, self.limit),
            "dials": [
                {"name": d.name, "title": d.title, "unit": d.unit, "ours": d.ours, "why": d.why,
                 "points": [_point_dict(p, self.limit) for p in d.points],
                 "judged": None if d.judged is None else _point_dict(d.judged, self.limit)}
                for d in self.dials
            ],
        }  # fmt: skip

    @classmethod
    def from_dict(cls, found: dict[str, Any]) -> Answer:
        """The answer of a document; figures are computed from the ratios of the seeds, not read."""
        names = ("claim", "paper", "sentence", "gain", "derived", "scenario", "row", "than", "score", "than_score")
        dials = [
            DialAnswer(d["name"], d["title"], d["unit"], d["ours"], d["why"], [_point(p) for p in d["points"]],
                       None if d["judged"] is None else _point(d["judged"]))
            for d in found["dials"]
        ]  # fmt: skip
        return cls(**{name: found[name] for name in names}, ours=_point(found["ours"]), dials=dials)

    def to_frame(self) -> Any:
        """One line for each value of each dial; see `simnav.leaderboard.results.frame.frame`."""
        rows = [(d.name, "search", p) for d in self.dials for p in d.points]
        rows += [(d.name, "judgement", d.judged) for d in self.dials if d.judged is not None]
        rows.append(("", "judgement", self.ours))
        return frame([
            {"dial": name, "value": str(p.value), "seeds": which, "gain": p.gain.value, "low": p.gain.low,
             "high": p.gain.high, "runs": p.gain.runs, "failed": p.failed, "standing": p.standing(self.limit)}
            for name, which, p in rows
        ])  # fmt: skip

    def plot(self) -> Any:
        """Gain against each dial, with the claim as a line (a matplotlib figure)."""
        from .gain_figure import gain_figure

        return gain_figure(self)


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


def _point_dict(point: Point, limit: float) -> dict[str, Any]:
    gain = point.gain
    return {
        "value": point.value, "gain": gain.value, "low": gain.low, "high": gain.high,
        "standing": point.standing(limit), "seeds": list(point.seeds),
        "ratios": [float(f"{r:.6g}") for r in point.ratios], "failed": point.failed,
    }  # fmt: skip


def _point(found: dict[str, Any]) -> Point:
    return Point(found["value"], list(found["seeds"]), list(found["ratios"]), int(found["failed"]))
