"""``simnav campaign rescore``: scores from the trials that a campaign kept."""

from __future__ import annotations

from dataclasses import replace
from shlex import quote

from simnav.leaderboard.inspection import rescore
from simnav.leaderboard.requests import RescoreRequest

from .console import Output

__all__ = ["show"]


def show(out: Output, request: RescoreRequest) -> None:
    """Compute new scores, or existing scores again, without running an estimator."""
    with out.progress("rescoring") as progress:
        done = rescore.of(replace(request, progress=progress))
    out.document(done.to_dict())
    counts = {"were complete": done.complete, "have no trial": done.without_trial}
    others = "".join(f", {count} {words}" for words, count in counts.items() if count)
    named = "no score" if not done.scores else ", ".join(done.scores[:5]) + (", ..." if done.scores[5:] else "")
    out.print(
        f"results: {done.folder} ({done.rescored} were given {named}{others})",
        f"next:    simnav leaderboard {quote(str(done.folder))}",
    )
