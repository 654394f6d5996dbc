"""``simnav simulate``: the recording of one run, as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json, ScenarioName, Seed, absolute
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError

if TYPE_CHECKING:
    from simnav.recording import AidStream

__all__ = ["command"]


def command(
    scenario: ScenarioName,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Recording to write: .npz, or the ending of a plug-in's format."),
    ],
    seed: Seed = 0,
    csv: Annotated[
        Path | None, typer.Option(help="Folder for the recording as CSV files, one for each instrument.")
    ] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write the recording of one run: measurements, labels and truth."""
    with session(json, debug) as out:
        from simnav.leaderboard.campaign.single_run import record
        from simnav.leaderboard.interface import scenario_of
        from simnav.leaderboard.results.formats import formats, write

        # "csv" is a folder, and has an option of its own.
        endings = [name for name in formats("recording") if name != "csv"]
        ending = output.suffix.removeprefix(".")
        if ending not in endings:
            raise RequestError(f"--output {output}: the file should end in {' or '.join('.' + e for e in endings)}")
        chosen = scenario_of(scenario)
        recording = record(chosen, seed)
        target, *_ = write("recording", ending, recording, absolute(output))
        written = [] if csv is None else write("recording", "csv", recording, absolute(csv))
        data = recording.data
        out.document(
            {
                "scenario": chosen.id,
                "seed": seed,
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
        table = tables.table(f"{chosen.id}, seed {seed}", columns, rows, numeric=columns[2:])
        out.print(table, f"recording: {target}")
        if written:
            out.print(f"CSV: {written[0].parent}")


def _kind(stream: AidStream) -> str:
    """The kind of an instrument, with the number of its channels."""
    return f"{stream.kind} ({len(stream.channels)} channels)" if stream.channels else stream.kind
