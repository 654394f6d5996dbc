"""The `simnav` command.

Each command imports what it needs when it runs, so that ``simnav list`` answers at once. Results go to
standard output, everything else to standard error; exit code 2 is a user's mistake, 1 a failure.
"""

from __future__ import annotations

import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli import bound as bounds
from simnav.leaderboard.cli import reproduce
from simnav.leaderboard.cli import train as training
from simnav.leaderboard.cli.console import USER, Output, UserError, session

__all__ = ["app", "main"]

app = typer.Typer(
    name="simnav",
    help="The open benchmark for marine integrated navigation: simulate, estimate, score, rank.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document, for machines.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
ScenarioName = Annotated[str, typer.Argument(metavar="SCENARIO", help="Name, versioned id, or path of a TOML file.")]
Scenarios = Annotated[
    list[str] | None, typer.Option("--scenario", "-s", help="Names or TOML files, separated by commas. [all]")
]
Estimators = Annotated[
    list[str] | None,
    typer.Option("--estimator", "-e", help="Names or files, separated by commas; 'ekf:gate=3' sets a parameter. [all]"),
]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the estimators.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the run.")]
FirstSeed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the first run; the others count up.")]
Workers = Annotated[int, typer.Option(min=1, help="Processes.")]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit", min=0.1, help="Seconds an estimator may take a run. [a fifth of real time, at least 60]"
    ),
]
MemoryLimit = Annotated[
    int, typer.Option("--memory-limit", min=16, help="MiB an estimator may take beyond the recording.")
]


class Topic(StrEnum):
    """What `simnav list` knows."""

    SCENARIOS = "scenarios"
    ESTIMATORS = "estimators"
    INSTRUMENTS = "instruments"
    FAULTS = "faults"


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"simnav {version('simnav')}")
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """The open benchmark for marine integrated navigation: simulate, estimate, score, rank."""


@app.command("list")
def list_(
    topic: Annotated[Topic | None, typer.Argument(help="What to list; without it, scenarios and estimators.")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """List scenarios, estimators, kinds of instruments or kinds of faults."""
    with session(json, debug) as out:
        from simnav.leaderboard.cli import listing

        topics = [topic] if topic else [Topic.SCENARIOS, Topic.ESTIMATORS]
        found = {t.value: getattr(listing, t.value)() for t in topics}
        out.document(found)
        for name, entries in found.items():
            out.print(listing.table_of(name, entries))


@app.command()
def run(
    scenario: ScenarioName,
    estimator: Estimators = None,
    seed: Seed = 0,
    plot: Annotated[Path | None, typer.Option(help="Write a figure: .png, .svg or .pdf.")] = None,
    set_: Set = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run estimators once over one scenario and score them."""
    with session(json, debug) as out:
        from simnav.leaderboard.cli import arguments, single

        if plot is not None and plot.suffix not in (".png", ".svg", ".pdf"):
            raise UserError(f"--plot {plot}: the file should end in .png, .svg or .pdf")
        if plot is not None and not plot.expanduser().resolve().parent.is_dir():
            raise UserError(f"--plot {plot}: there is no folder {plot.parent}")
        chosen = arguments.scenario(scenario)
        requests = arguments.requests(estimator, set_)
        out.code = single.run(out, chosen, requests, seed, plot)


@app.command()
def simulate(
    scenario: ScenarioName,
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.npz).")],
    seed: Seed = 0,
    csv: Annotated[Path | None, typer.Option(help="Folder for the same as CSV files, one an instrument.")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write the recording of one run: measurements, labels and truth."""
    with session(json, debug) as out:
        from simnav.leaderboard.cli import arguments, single

        if output.suffix != ".npz":
            raise UserError(f"--output {output}: the file should end in .npz")
        single.simulate(out, arguments.scenario(scenario), seed, output, csv)


@app.command()
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="my_filter.py, my_filter.py:MyFilter or a name.")],
    set_: Set = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Test an estimator against the contract: causality, shapes, determinism, missing instruments."""
    with session(json, debug) as out:
        from simnav.leaderboard.cli import arguments, single

        request = arguments.requests([file], set_)[0]
        out.code = single.check(out, request)


@app.command("new-estimator")
def new_estimator(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the estimator, like my-filter.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write. [my_filter.py]")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write a small estimator that works, to start from."""
    with session(json, debug) as out:
        from simnav.leaderboard.cli import single

        single.scaffold(out, name, output)


@app.command()
def evaluate(
    estimator: Annotated[str, typer.Argument(metavar="FILE_OR_NAME", help="my_filter.py, or a name.")],
    scenario: Annotated[list[str], typer.Option("--scenario", "-s", help="Names or TOML files, separated by commas.")],
    runs: Annotated[int, typer.Option("--runs", "-n", min=2, help="Seeds.")] = 20,
    against: Annotated[
        list[str] | None, typer.Option(help="Baselines, separated by commas. [all that suit the scenario]")
    ] = None,
    set_: Set = None,
    seed: FirstSeed = 0,
    workers: Workers = 2,
    time_limit: TimeLimit = None,
    memory_limit: MemoryLimit = 2048,
    results: Annotated[Path | None, typer.Option(help="Keep the results in this folder. [thrown away]")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run an estimator beside the baselines on the same seeds and show where it stands."""
    with session(json, debug) as out:
        from simnav.leaderboard.cli import arguments, monte_carlo

        mine = arguments.requests([estimator], set_)[0]
        out.code = monte_carlo.evaluate(
            out, mine, arguments.requests(against, None), arguments.scenarios(scenario, out), range(seed, seed + runs),
            monte_carlo.Limits(workers, time_limit, memory_limit), results,
        )  # fmt: skip


@app.command()
def campaign(
    scenario: Scenarios = None,
    estimator: Estimators = None,
    runs: Annotated[int | None, typer.Option("--runs", "-n", min=1, help="Seeds a scenario. [50; quick: 3]")] = None,
    seed: FirstSeed = 0,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("results"),
    quick: Annotated[bool, typer.Option("--quick", help="Within minutes: 3 seeds, nothing long or slow.")] = False,
    set_: Set = None,
    workers: Workers = 2,
    time_limit: TimeLimit = None,
    memory_limit: MemoryLimit = 2048,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run scenarios x estimators x seeds; started again, it goes on where it was."""
    with session(json, debug) as out:
        from simnav.leaderboard.campaign.campaign import QUICK_RUNS, RUNS
        from simnav.leaderboard.cli import arguments, monte_carlo

        seeds = range(seed, seed + (runs or (QUICK_RUNS if quick else RUNS)))
        out.code = monte_carlo.campaign(
            out,
            arguments.scenarios(scenario, out, quick=quick),
            arguments.requests(estimator, set_, quick=out if quick else None),
            seeds,
            monte_carlo.Limits(workers, time_limit, memory_limit), output,
        )  # fmt: skip


@app.command("leaderboard")
def leaderboard_(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder that a campaign wrote.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the site.")] = Path("site"),
    papers: Annotated[Path, typer.Option(help="What 'simnav reproduce' wrote; gets pages.")] = Path("reproduced"),
    workers: Workers = 2,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Rank the results of a campaign and write the site."""
    with session(json, debug) as out:
        from simnav.leaderboard.cli import monte_carlo

        out.code = monte_carlo.leaderboard(out, results, output, workers, papers)


@app.command()
def warmup(json: Json = False, debug: Debug = False) -> None:
    """Compile every kernel, once; later starts are quick."""
    with session(json, debug) as out:
        from simnav.leaderboard.cli import single

        single.warmup(out)


bounds.register(app)
reproduce.register(app)
training.register(app)


def _leave_out_working_directory() -> None:
    """A folder ``estimators/`` or ``scenarios/`` where the user stands must not hide the project's own.

    Console scripts do not search the working directory, but ``python -m`` and an empty entry of PYTHONPATH
    do. The project's own tree, where the command may be started from, stays.
    """
    home = Path(__file__).resolve().parents[2]
    here = Path.cwd()
    if here != home:
        sys.path[:] = [p for p in sys.path if p and not (os.path.isabs(p) and Path(p) == here and p != str(home))]


def main() -> None:
    """Entry point of the console script."""
    _leave_out_working_directory()
    try:
        code = app(standalone_mode=False, prog_name="simnav")
    except Exception as error:  # of the parser: an unknown command or option, a value of the wrong type
        if not hasattr(error, "format_message"):
            raise
        text = " ".join(error.format_message().split())
        Output().note(f"simnav: {text}" if text else "simnav: see simnav --help")
        sys.exit(USER)
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(code if isinstance(code, int) else 0)
