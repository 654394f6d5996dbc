"""The answer to the question when a claim holds: gains at all values of the dials, with intervals and verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from simnav.leaderboard.papers.comparison import GAIN
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.shown import Shown

from .gain_figure import gain_figure
from .points import DialAnswer, Judgement, Point, Standing, gain_text

__all__ = ["Answer"]


@dataclass(frozen=True, repr=False)
class Answer(Shown):
    """When a claim holds.

    Attributes
    ----------
    claim, paper, sentence, gain, derived
        As of `simnav.leaderboard.papers.claims.claim.Claim`.
    scenario, row, than, score, than_score : str
        Of the comparison with our settings: id of the scenario, labels of the estimators, measures.
    ours : Judgement
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
    ours: Judgement
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
                judged = next((p for p in dial.tried if p.value == point.value), None)
                other, verdict = ("", "") if judged is None else (gain_text(judged), judged.standing(self.limit))
                ours = "ours" if point.value == dial.ours else ""
                rows.append([title, dial.text(point.value), ours, gain_text(point), other, verdict])
                title = ""
        columns = ["varied", "value", "", "gain (search)", "gain (judgement)", "verdict"]
        order = ["value", "gain (search)", "verdict", "gain (judgement)", "varied", ""]
        title = f"{self.claim}: claimed gain {100.0 * self.gain:.1f} %"
        return [tables.Fitted(title, columns, rows, order, always=2)] if rows else []

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav paper claim --json`` prints, and what is stored."""
        return {
            **{name: getattr(self, name) for name in (
                "claim", "paper", "sentence", "gain", "derived", "scenario", "row", "than", "score", "than_score",
            )},
            "verdict": self.verdict,
            "words": self.sentence_of_verdict,
            "ours": _judgement_dict(self.ours, self.limit),
            "dials": [
                {"name": d.name, "title": d.title, "unit": d.unit, "ours": d.ours, "why": d.why,
                 "points": [_point_dict(p, self.limit) for p in d.points],
                 "judged": [_judgement_dict(p, self.limit) for p in d.tried]}
                for d in self.dials
            ],
        }  # fmt: skip

    @classmethod
    def from_dict(cls, found: dict[str, Any]) -> Answer:
        """The answer of a document; figures are computed from the ratios of the seeds, not read."""
        names = ("claim", "paper", "sentence", "gain", "derived", "scenario", "row", "than", "score", "than_score")
        dials = [
            DialAnswer(d["name"], d["title"], d["unit"], d["ours"], d["why"], [_point(p) for p in d["points"]],
                       [_judgement(p) for p in d["judged"]])
            for d in found["dials"]
        ]  # fmt: skip
        return cls(**{name: found[name] for name in names}, ours=_judgement(found["ours"]), dials=dials)

    def to_frame(self) -> Any:
        """One line for each value of each dial; see `simnav.leaderboard.results.frame.frame`."""
        rows = [(d.name, "search", p) for d in self.dials for p in d.points]
        rows += [(d.name, "judgement", p) for d in self.dials for p in d.tried]
        rows.append(("", "judgement", self.ours))
        return frame([
            {"dial": name, "value": str(p.value), "seeds": which, "gain": p.gain.value, "low": p.gain.low,
             "high": p.gain.high, "runs": p.gain.runs, "failed": p.failed, "standing": p.standing(self.limit)}
            for name, which, p in rows
        ])  # fmt: skip

    def plot(self) -> Any:
        """Gain against each dial, with the claim as a line (a matplotlib figure)."""
        return gain_figure(self.sentence, self.gain, self.limit, self.ours, self.dials)


def _point_dict(point: Point, limit: float) -> dict[str, Any]:
    gain = point.gain
    return {
        "value": point.value, "gain": gain.value, "low": gain.low, "high": gain.high,
        "standing": point.standing(limit), "seeds": list(point.seeds),
        "ratios": [float(f"{r:.6g}") for r in point.ratios], "failed": point.failed,
    }  # fmt: skip


def _judgement_dict(judged: Judgement, limit: float) -> dict[str, Any]:
    return {**_point_dict(judged, limit), "first": judged.first, "level": judged.level}


def _judgement(found: dict[str, Any]) -> Judgement:
    point = _point(found)
    return Judgement(
        point.value, point.seeds, point.ratios, point.failed, int(found["first"]), float(found["level"])
    )  # fmt: skip


def _point(found: dict[str, Any]) -> Point:
    return Point(found["value"], list(found["seeds"]), list(found["ratios"]), int(found["failed"]))
