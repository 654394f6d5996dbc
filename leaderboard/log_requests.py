"""The requests of the calls for logs, and for estimates that were made elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import KW_ONLY
from pathlib import Path

from simnav.leaderboard.campaign.options import PathLike

from .calls import option, request
from .requests import PROGRESS, Bar, ScenarioLike, Scenarios

__all__ = [
    "AlignRequest", "ExportRequest", "IdentifyRequest", "InspectRequest", "RecordingsRequest", "ScoreRequest",
    "TuneNoiseRequest", "TwinRequest",
]  # fmt: skip

_SCENARIO = "Name, versioned id, or path of a TOML file."
_SCENARIO_MORE = "Or the `simnav.scenario.Scenario` itself."
_SEALED_RUNS = "Derive the seeds from the secret in this file, as 'campaign --sealed' does."


@request
class ScoreRequest:
    """Score estimates that were made elsewhere, with the scores and the page of a run."""

    scenario: ScenarioLike = option(help=_SCENARIO, more=_SCENARIO_MORE, argument=True, metavar="SCENARIO")
    files: Iterable[PathLike] = option(
        help="Files of estimates, CSV or TUM; see docs/how-to/connect-a-program.md.",
        argument=True,
        metavar="FILES",
        cli=list[Path],
    )
    _: KW_ONLY
    seed: int = option(default=0, help="Seed of the run; with --sealed, its number.", least=0)
    sealed: PathLike | None = option("--sealed", default=None, metavar="KEYFILE", help=_SEALED_RUNS)


@request
class ExportRequest:
    """Write what an estimator receives, for programs of others: measurements, start and datasheets."""

    scenarios: Scenarios = option(
        help="Names, tracks or TOML files.", argument=True, metavar="SCENARIOS", cli=list[str]
    )
    output: PathLike = option("--output", "-o", help="File or folder to write; of several runs a folder.")
    _: KW_ONLY
    form: str = option(
        "--format", default="csv", help="Format, such as csv, npz, gpx, kml, tum, nmea, mcap, rinex or pd0."
    )
    seed: int = option(default=0, help="Seed of the first run; the others count up.", least=0)
    runs: int = option("--runs", "-n", default=1, help="Seeds of each scenario.", least=1)
    truth: bool = option("--truth", default=False, help="Write truth and fault labels, too.")
    blind: bool = option(
        "--blind",
        default=False,
        help="Neither truth, nor labels, nor seeds: for estimates that 'campaign --external' ranks; with --sealed.",
    )
    sealed: PathLike | None = option("--sealed", default=None, metavar="KEYFILE", help=_SEALED_RUNS)


@request
class AlignRequest:
    """Compare every instrument of a log with the reference: delay, lever arm, offset, scale, each with its sigma."""

    scenario: ScenarioLike = option(help=_SCENARIO, more=_SCENARIO_MORE, argument=True, metavar="SCENARIO")
    seed: int = option(default=0, help="Number of the recording.", least=0)


@request
class RecordingsRequest:
    """List public recordings of real voyages, or make scenarios from their downloaded files."""

    files: Iterable[PathLike] = option(
        default=(),
        help="Downloaded files, or folders with them; told by their checksums. Default: none, list what is known.",
        argument=True,
        metavar="FILES",
        cli=list[Path],
    )
    _: KW_ONLY
    scenarios: Iterable[str] | str | None = option(
        "--scenario", "-s", default=None, metavar="NAMES", help="Only these, separated by commas. Default: all.",
        cli=str | None,
    )  # fmt: skip
    output: PathLike | None = option(
        "--output", "-o", default=None, metavar="FOLDER", help="Data folder. Default: SIMNAV_DATA, or ./data."
    )


@request
class TuneNoiseRequest:
    """Propose noise figures for the datasheets of a log, from its reference and the stillest stretches of its IMU."""

    scenario: ScenarioLike = option(help=_SCENARIO, more=_SCENARIO_MORE, argument=True, metavar="SCENARIO")
    seed: int = option(default=0, help="Number of the recording.", least=0)
    innovations: bool = option(
        "--innovations", default=False, help="Also those with which the innovations of a filter are as it expects."
    )


@request
class IdentifyRequest:
    """Fit the error model of a log's instruments, by maximum likelihood of the innovations of a filter over it."""

    scenario: ScenarioLike = option(help=_SCENARIO, more=_SCENARIO_MORE, argument=True, metavar="SCENARIO")
    seed: int = option(default=0, help="Number of the recording; of a simulated scenario the seed.", least=0)
    until: float | None = option(
        "--until", default=None, cli=float | None, metavar="SECONDS", help="Use the log up to here. Default: 1200 s."
    )


@request
class InspectRequest:
    """Show what the files of a log hold, and write a scenario to begin with."""

    files: Iterable[PathLike] = option(help="Files or folders.", argument=True, metavar="FILES", cli=list[Path])
    _: KW_ONLY
    output: PathLike | None = option(
        "--output", "-o", default=None, help="Write a scenario to begin with to this TOML file."
    )
    run: bool = option(
        "--run", default=False, help="Run a few rows over the scenario, without an edit, or say what it lacks."
    )
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)


@request
class TwinRequest:
    """Write a scenario of simulated voyages with the track of a log and the errors that were found in it."""

    scenario: ScenarioLike = option(help=_SCENARIO, more=_SCENARIO_MORE, argument=True, metavar="SCENARIO")
    _: KW_ONLY
    seed: int = option(default=0, help="Number of the recording; of a simulated scenario the seed.", least=0)
    until: float | None = option(
        "--until",
        default=None,
        cli=float | None,
        metavar="SECONDS",
        help="Identify the errors up to here. Default: 1200 s.",
    )
    output: PathLike | None = option(
        "--output",
        "-o",
        default=None,
        help="Write the scenario to this TOML file, and its track to a .csv beside it. Default: NAME-twin.toml.",
    )
