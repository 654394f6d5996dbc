"""The claims of a paper as tables and figures of its page, and their count for the index."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.papers.report import Column, Sheet, SheetRow

from .points import gain_text

if TYPE_CHECKING:
    from .answer import Answer

__all__ = ["ClaimFigure", "claim_count", "claim_figures", "claim_sheets"]

_PIXELS = 96  # of an inch, in CSS
#: Verdict of a claim -> the words of the count for one and for several, and the class of its mark on a page.
_VERDICTS = {
    "holds": ("holds", "hold", "agrees"),
    "holds if": ("holds under a named condition", "hold under a named condition", "undecided"),
    "does not hold": ("does not hold", "do not hold", "differs"),
    "undecided": ("is undecided", "are undecided", "undecided"),
}


def claim_count(answers: Sequence[Answer]) -> str:
    """How many claims hold, hold under a condition, or do not: ``2 hold, 1 does not hold``; empty without answers."""
    counts = {verdict: sum(a.verdict == verdict for a in answers) for verdict in _VERDICTS}
    return ", ".join(f"{n} {_VERDICTS[verdict][n != 1]}" for verdict, n in counts.items() if n)


def claim_sheets(answers: Sequence[Answer]) -> list[Sheet]:
    """Two tables: the claims with their conditions, and the gain at each value; none without answers."""
    if not answers:
        return []
    head = [("claim", False), ("as printed", True), ("with our settings [deciding interval]", True), ("verdict", False),
            ("condition", False)]  # fmt: skip
    rows = []
    for a in answers:
        printed = f"{'~ ' if a.derived else ''}{100.0 * a.gain:.1f} %"
        words = "with our settings" if a.verdict == "holds" else a.sentence_of_verdict.removeprefix("holds if ")
        rows.append(
            SheetRow([f"{a.sentence[0].upper()}{a.sentence[1:]}", printed, gain_text(a.ours), a.verdict, words],
                     _VERDICTS[a.verdict][2])
        )  # fmt: skip
    notes = [
        "A claim holds if the whole interval of our gain is at least as large as the printed one, within the tolerance "
        "of all gains (the logarithm of the ratio divided by 1.5). The interval allows for all looks, so it "
        "is wider than one of 95 %. One choice is varied at a time.",
        "A condition was found on seeds of a search, and its gain is of other seeds. It is sufficient, and does not "
        "say what the authors did.",
    ]
    firsts = sorted({min(a.ours.seeds) for a in answers if a.ours.seeds})
    notes.append(f"The judgement is on seeds from {' and '.join(map(str, firsts))} on.")
    if any(a.derived for a in answers):
        notes.insert(0, "~ follows from other figures of the paper or from its text")
    first = Sheet("When do the claims hold?", "", [Column(t, n) for t, n in head], rows, notes)
    return [first, _values(answers)]


def _values(answers: Sequence[Answer]) -> Sheet:
    """The gain at each value of each dial."""
    head = [("claim", False), ("varied", False), ("value", False), ("gain on the seeds of the search", True),
            ("gain on the seeds of the judgement", True), ("verdict", False)]  # fmt: skip
    rows, whys = [], list(dict.fromkeys(d.why for a in answers for d in a.dials if d.why))
    for a in answers:
        name = a.claim
        for d in a.dials:
            mark = f" ({chr(ord('a') + whys.index(d.why))})" if d.why else ""
            title = d.title.rstrip(",") + mark
            for p in d.points:
                judged = next((j for j in d.tried if j.value == p.value), None)
                if p.value == d.ours:
                    judged = a.ours
                value = d.text(p.value) + (" (ours)" if p.value == d.ours else "")
                standing = "" if judged is None else judged.standing(a.limit)
                shown = "" if judged is None else gain_text(judged)
                rows.append(SheetRow([name, title, value, gain_text(p), shown, standing],
                                     _VERDICTS[standing][2] if standing else "ours"))  # fmt: skip
                name = title = ""
    notes = [f"({chr(ord('a') + i)}) {why}" for i, why in enumerate(whys)]
    return Sheet("The gain at each value of the choices", "", [Column(t, n) for t, n in head], rows, notes)


@dataclass(frozen=True)
class ClaimFigure:
    """A figure of a claim.

    Attributes
    ----------
    title, caption : str
        The claim, and what is to be seen.
    path : Path
        The file.
    width, height : int
        Size in CSS pixels.
    """

    title: str
    caption: str
    path: Path
    width: int
    height: int


def claim_figures(answers: Sequence[Answer], folder: Path) -> list[ClaimFigure]:
    """Draw gain against dial for each claim, as ``claim-NAME.png`` in an existing folder."""
    made = []
    for answer in answers:
        if not answer.dials:
            continue
        fig = answer.plot()
        path = save_as(fig, folder / f"claim-{answer.claim}.png")
        width, height = (round(_PIXELS * inches) for inches in fig.get_size_inches())
        caption = f"The claim {answer.sentence_of_verdict}."
        made.append(ClaimFigure(f"{answer.sentence[0].upper()}{answer.sentence[1:]}", caption, path, width, height))
    return made
