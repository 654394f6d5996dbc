"""Options that several commands have, and their conversion to arguments of a call."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simnav.leaderboard.results.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable

    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.leaderboard.cli.console import ProgressBar

__all__ = [
    "Debug",
    "Estimators",
    "FilesOrNames",
    "FirstSeed",
    "Force",
    "Json",
    "MemoryLimit",
    "Minutes",
    "OwnScenarios",
    "ScenarioName",
    "Scenarios",
    "Seed",
    "Set",
    "Shard",
    "TimeLimit",
    "Workers",
    "absolute",
    "campaign_progress",
    "parameters",
    "part_of",
]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document, for machines.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
FilesOrNames = Annotated[
    list[str], typer.Argument(metavar="FILE_OR_NAME...", help="my_filter.py, or a name; one or several.")
]
OwnScenarios = Annotated[
    list[str] | None, typer.Option("--scenario", "-s", help="TOML files of scenarios outside the catalogue.")
]
ScenarioName = Annotated[str, typer.Argument(metavar="SCENARIO", help="Name, versioned id, or path of a TOML file.")]
Scenarios = Annotated[
    list[str] | None,
    typer.Option("--scenario", "-s", help="Names, tracks or TOML files, separated by commas. Default: all."),
]
Estimators = Annotated[
    list[str] | None,
    typer.Option(
        "--estimator",
        "-e",
        help="Names or files, separated by commas; 'sw-fgo:window=10' sets a parameter. Default: all.",
    ),
]
Set = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Value of a parameter of the estimators.")
]
Force = Annotated[
    list[str] | None,
    typer.Option("--force", metavar="NAME", help="Run this estimator anew; several are separated by commas."),
]
Shard = Annotated[
    str, typer.Option(metavar="K/N", help="Do part K of N of the runs; 'simnav merge' puts the parts together.")
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the run.")]
FirstSeed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the first run; the others count up.")]
Workers = Annotated[int, typer.Option(min=1, help="Processes.")]
Minutes = Annotated[
    float | None, typer.Option(min=0.0, help="Start no run after so many minutes. The same command continues.")
]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit", min=0.1, help="Seconds an estimator may take a run. Default: a fifth of real time, at least 60."
    ),
]
MemoryLimit = Annotated[
    int, typer.Option("--memory-limit", min=16, help="MiB an estimator may take beyond the recording.")
]


def parameters(given: Sequence[str] | None) -> dict[str, str]:
    """The values of ``--set``.

    >>> parameters(["window=10", "spacing = 1"])
    {'window': '10', 'spacing': '1'}
    """
    values = {}
    for text in given or ():
        name, equals, value = text.partition("=")
        if not equals or not name.strip().isidentifier():
            raise RequestError(f"--set {text}: it should be name=value, like --set window=10")
        values[name.strip()] = value.strip()
    return values


def part_of(text: str) -> tuple[int, int]:
    """Which of how many parts.

    >>> part_of("2/8")
    (2, 8)
    """
    part, _, parts = text.partition("/")
    if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
        raise RequestError(f"--shard {text}: it should be K/N with K from 1 to N, like --shard 2/8")
    return int(part), int(parts)


def absolute(path: Path | str) -> Path:
    """The absolute form of a path, for messages."""
    return Path(path).expanduser().resolve()


def campaign_progress(bar: ProgressBar, running: str = "running") -> Callable[[Progress], None]:
    """What shows a campaign's progress on a bar; ``running`` is its text while estimators run."""

    def show(p: Progress) -> None:
        bar.begin("compiling kernels" if p.stage == "compile" else running)
        bar(p.done, p.total, f"{p.failed} failed, {p.note}" if p.failed else p.note, p.left)

    return show
