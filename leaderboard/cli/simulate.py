"""``simnav simulate``: the recording of one run, as files."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.arguments import scenario_of
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.formats import formats, write
from simnav.leaderboard.running import record

from .commands import SimulateCommand
from .console import Output
from .options import absolute

if TYPE_CHECKING:
    from simnav.recording import AidStream

__all__ = ["show"]


def show(out: Output, request: SimulateCommand) -> None:
    """Write the recording of one run: measurements, labels and truth."""
    # "csv" is a folder, and has an option of its own.
    endings = [name for name in formats("recording") if name != "csv"]
    ending = request.output.suffix.removeprefix(".")
    if ending not in endings:
        raise RequestError(f"--output {request.output}: the file should end in {' or '.join('.' + e for e in endings)}")
    chosen = scenario_of(request.scenario)
    recording = record.of(replace(request, scenario=chosen))
    target, *_ = write("recording", ending, recording, absolute(request.output))
    written = [] if request.csv is None else write("recording", "csv", recording, absolute(request.csv))
    data = recording.data
    out.document(
        {
            "scenario": chosen.id,
            "seed": request.seed,
            "duration": recording.duration,
            "imu_samples": 0 if data.imu is None else len(data.imu),
            "measurements": {name: len(stream) for name, stream in data.aids.items()},
            "file": str(target),
            "csv": [str(p) for p in written],
        }
    )
    rows: list[list[Any]] = [[s.name, _kind(s), len(s), len(s.dropped), int((s.faults != 0).sum())]
                             for s in data.aids.values()]  # fmt: skip
    if data.imu is not None:
        rows.insert(0, ["imu", "imu", len(data.imu), 0, 0])
    columns = ["instrument", "kind", "measurements", "dropped", "touched by a fault"]
    table = tables.table(f"{chosen.id}, seed {request.seed}", columns, rows, numeric=columns[2:])
    out.print(table, f"recording: {target}")
    if written:
        out.print(f"CSV: {written[0].parent}")


def _kind(stream: AidStream) -> str:
    """The kind of an instrument, with the number of its channels."""
    return f"{stream.kind} ({len(stream.channels)} channels)" if stream.channels else stream.kind
