"""``simnav inspect``: what the files of a log hold, and a scenario to begin with."""

from __future__ import annotations

from simnav.leaderboard.log_requests import InspectRequest
from simnav.leaderboard.logs import inspect_log
from simnav.leaderboard.ranking import tables
from simnav.log.check import described
from simnav.log.draft import guesses

from .console import FAILED, Output
from .options import absolute

__all__ = ["show"]


def show(out: Output, request: InspectRequest) -> None:
    """Show what the files of a log hold, and write a scenario to begin with."""
    streams, failed = inspect_log.of(request)
    found = [list(guesses(stream)) for stream in streams]
    pairs = list(zip(streams, found, strict=True))
    told = [{**s.to_dict(), "guesses": [g.sentence() for g in of]} for s, of in pairs]
    out.document({"streams": told, "failed": failed})
    rows = []
    for stream, of in pairs:
        says = [*(g.sentence() for g in of), *(f"note: {n}" for n in stream.notes)]
        rows.append([stream.name, stream.form, described(stream.time), "\n".join(says)])
    out.print(tables.table("what the files hold", ["stream", "format", "times", "columns, guessed"], rows))
    for sentence in failed:
        out.remark(sentence)
    if request.output is not None and streams:
        out.print(f"scenario: {absolute(request.output)}",
                  f"next:     look at what is marked 'check', then simnav check {request.output}")  # fmt: skip
    out.code = 0 if streams else FAILED
