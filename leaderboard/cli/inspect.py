"""``simnav log inspect``: what the files of a log hold, and a scenario to begin with."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.figures.log_figures import coverage_map
from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.log_inspection import innovation_table
from simnav.leaderboard.logs import inspect_log
from simnav.leaderboard.ranking import tables
from simnav.log.check import described
from simnav.log.column_guesses import guesses
from simnav.log.draft_readings import SURE
from simnav.log.inspection import track_of

from .commands import InspectCommand
from .console import FAILED, Output
from .options import absolute, require_figure

__all__ = ["show"]


def show(out: Output, request: InspectCommand) -> None:
    """Show what the files of a log hold, and write a scenario to begin with."""
    require_figure("--plot", request.plot)
    with out.progress("rows over the log") as progress:
        looked = inspect_log.of(replace(request, progress=progress if request.run else None))
    streams, run = looked.streams, looked.run
    found = [list(guesses(stream)) for stream in streams]
    pairs = list(zip(streams, found, strict=True))
    told = [{**s.to_dict(), "guesses": [g.sentence() for g in of]} for s, of in pairs]
    document = {"streams": told, "failed": list(looked.failed)}
    if looked.draft:
        document |= {"missing": looked.missing, "readings": [r.sentence() for r in looked.readings]}
    if request.run:
        document["run"] = None if run is None else run.to_dict()
    out.document(document)
    rows = []
    for stream, of in pairs:
        says = [*(g.sentence() for g in of), *(f"note: {n}" for n in stream.notes)]
        rows.append([stream.name, stream.form, described(stream.time), "\n".join(says)])
    out.print(tables.table("what the files hold", ["stream", "format", "times", "columns, guessed"], rows))
    for sentence in looked.failed:
        out.remark(sentence)
    for sentence in looked.unknown:
        out.remark(sentence)
    for reading in looked.readings:
        so = "read so" if reading.probability >= SURE else "perhaps, and only a comment of the scenario"
        out.remark(f"{so}, against its names and sizes: {reading.what} (probability {reading.shown})")
    if run is not None:
        out.print(*run.shown())
        for e in run.estimators:
            if e.status != "ok":
                out.remark(f"{e.estimator}: {e.status}: {e.reason}")
        innovations = innovation_table(run)
        if innovations is not None:
            out.print(innovations)
    if looked.missing:
        out.remark(f"the scenario cannot be run yet: {looked.missing}")
    if request.output is not None and looked.draft:
        out.print(f"scenario: {absolute(request.output)}",
                  f"next:     look at what is marked 'check', then simnav check {request.output}")  # fmt: skip
    elif run is not None:
        out.print("next:     -o FILE.toml keeps the scenario; look at what is marked 'check' in it")
    if request.plot is not None and streams:
        times = {stream.name: stream.time for stream in streams}
        tracks = {stream.name: track for stream in streams if (track := track_of(stream)) is not None}
        out.print(f"figure: {save_as(coverage_map(tracks, times, 'what the files hold'), absolute(request.plot))}")
    out.code = 0 if streams and (run is not None or not request.run) else FAILED
