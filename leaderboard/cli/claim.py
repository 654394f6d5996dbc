"""``simnav paper claim``: under which conditions does a claim hold?"""

from __future__ import annotations

from dataclasses import fields, replace

from simnav.leaderboard.calls import require_unused
from simnav.leaderboard.claiming import claim
from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.papers import ALIASES, PAPERS, key_of
from simnav.leaderboard.papers.claims import stored
from simnav.leaderboard.papers.claims.declared import claims
from simnav.leaderboard.papers.claims.points import gain_text
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import mistakes

from .commands import ClaimCommand
from .console import Output
from .options import absolute, campaign_progress, require_figure

__all__ = ["show"]


def show(out: Output, request: ClaimCommand) -> None:
    """Find out under which conditions a claim holds, or list the claims of the papers."""
    require_figure("--plot", request.plot)
    if not request.claim or request.claim in (*PAPERS, *ALIASES):
        names = [f.name for f in fields(request) if f.name != "claim"]
        require_unused(request, names, "the claims are listed; name one, such as mao-road-east")
        _list(out, key_of(request.claim) if request.claim else "")
        return
    with out.progress("starting") as bar:
        answer = claim.of(replace(request, progress=lambda what, p: campaign_progress(bar, what)(p)))
    written = None
    if request.plot is not None:
        with mistakes(OSError):
            absolute(request.plot).parent.mkdir(parents=True, exist_ok=True)
            written = save_as(answer.plot(), absolute(request.plot))
    out.document({**answer.to_dict(), "figure": None if written is None else str(written)})
    out.print(f"claim: {answer.sentence}", f"       {answer.row} against {answer.than} on {answer.scenario}")
    out.print(*answer.shown())
    for dial in answer.dials:
        if dial.why:
            out.print(f"{dial.name}: {dial.why}")
    out.print(
        f"it holds if the whole interval is a gain of {100.0 * (1.0 - answer.limit):.1f} % or more (the claimed one, "
        "within the tolerance of all gains)",
        f"with our settings: {gain_text(answer.ours)}: {answer.standing}",
        f"verdict: {answer.sentence_of_verdict}",
    )
    if answer.paper and answer.conditions:
        out.print("a condition is sufficient; it does not say what the authors did")
    if not request.holds_if and answer.paper:
        out.print(f"stored, computed on {stored.computed_on(answer.claim)}; "
                  f"again: simnav paper claim {answer.claim} --holds-if all")  # fmt: skip
    if written is not None:
        out.print(f"figure:  {written}")


def _list(out: Output, paper: str) -> None:
    """All claims of the papers, or of one, with their stored answers."""
    rows, found = [], []
    for each in claims():
        if paper and each.paper != paper:
            continue
        with mistakes(ValueError):
            answer = stored.read(each.name)
        words = "not computed yet" if answer is None else answer.sentence_of_verdict
        rows.append([each.name, each.sentence, words, ", ".join(d.name for d in each.dials)])
        found.append({"claim": each.name, "paper": each.paper, "sentence": each.sentence, "gain": each.gain,
                      "verdict": None if answer is None else answer.verdict, "words": words,
                      "conditions": [d.name for d in each.dials]})  # fmt: skip
    out.document({"claims": found})
    columns = ["claim", "as printed", "answer", "conditions"]
    out.print(tables.Fitted("Claims of the papers", columns, rows, ["claim", "answer", "as printed", "conditions"],
                            always=2))  # fmt: skip
    out.print("simnav paper claim NAME shows an answer; simnav paper claim NAME --holds-if CONDITION computes one")
