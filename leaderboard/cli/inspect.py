"""``simnav inspect``: what the files of a log hold, and a scenario to begin with."""

from __future__ import annotations

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.requests import InspectRequest
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.files import write_whole
from simnav.log import LogError
from simnav.log.check import described
from simnav.log.draft import draft, guesses
from simnav.log.inspection import inspect_log

from .console import FAILED, Output
from .options import absolute

__all__ = ["show"]


def show(out: Output, request: InspectRequest) -> None:
    """Show what the files of a log hold, and write a scenario to begin with."""
    try:
        streams, failed = inspect_log([absolute(path) for path in request.files])
    except LogError as error:
        raise RequestError(str(error)) from None
    target = None if request.output is None else absolute(request.output)
    if target is not None and target.suffix != ".toml":
        raise RequestError(f"--output {request.output}: the file should end in .toml")
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
    if target is not None and streams:
        name = "-".join("".join(c if c.isalnum() else " " for c in target.stem.lower()).split()) or "my-log"
        write_whole(target, draft(streams, name))
        out.print(
            f"scenario: {target}", f"next:     look at what is marked 'check', then simnav check {request.output}"
        )
    out.code = 0 if streams else FAILED
