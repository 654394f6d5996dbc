"""``simnav log inspect``: what the files of a log hold, and a scenario to begin with."""

from __future__ import annotations

from simnav.leaderboard.figures.log_figures import coverage_map
from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.logs import inspect_log
from simnav.leaderboard.ranking import tables
from simnav.log.check import described
from simnav.log.draft import guesses
from simnav.log.inspection import track_of

from .commands import InspectCommand
from .console import FAILED, Output
from .options import absolute, require_figure

__all__ = ["show"]


def show(out: Output, request: InspectCommand) -> None:
    """Show what the files of a log hold, and write a scenario to begin with."""
    require_figure("--plot", request.plot)
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
    if request.output is not None and streams and not any(g.quantity == "position" for of in found for g in of):
        out.remark(f"{request.output}: no scenario yet, since no columns with latitude and longitude were found")
    elif request.output is not None and streams:
        out.print(f"scenario: {absolute(request.output)}",
                  f"next:     look at what is marked 'check', then simnav check {request.output}")  # fmt: skip
    if request.plot is not None and streams:
        times = {stream.name: stream.time for stream in streams}
        tracks = {stream.name: track for stream in streams if (track := track_of(stream)) is not None}
        out.print(f"figure: {save_as(coverage_map(tracks, times, 'what the files hold'), absolute(request.plot))}")
    out.code = 0 if streams else FAILED
