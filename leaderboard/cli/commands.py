"""All commands with their requests, and the options that only the command line has: files that a command writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.calls import option, request
from simnav.leaderboard.claim_requests import ClaimRequest
from simnav.leaderboard.dataset_requests import DatasetRequest
from simnav.leaderboard.error_requests import AllanRequest, RealismRequest
from simnav.leaderboard.log_requests import (
    AlignRequest,
    ExportRequest,
    IdentifyRequest,
    InspectRequest,
    RecordingsRequest,
    ScoreRequest,
    TuneNoiseRequest,
    TwinRequest,
)
from simnav.leaderboard.publishing_requests import (
    AuditRequest,
    BundleOptions,
    CheckStandardRequest,
    DrawRequest,
    PublishRequest,
    SiteRequest,
    StandardRequest,
    SubmitRequest,
)
from simnav.leaderboard.recommend_requests import RecommendRequest
from simnav.leaderboard.requests import (
    BenchRequest,
    BoundRequest,
    CampaignRequest,
    CiteRequest,
    EvaluateRequest,
    MergeRequest,
    Parameters,
    RecordRequest,
    ReproduceRequest,
    RescoreRequest,
    RobustnessRequest,
    RunRequest,
    Scenarios,
    SealRequest,
    SweepRequest,
    TuneRequest,
    VerifyRequest,
)

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.request import Estimators

__all__ = ["COMMANDS", "GROUPS", "HEADINGS", "MOVED", "Features", "Topic"]

_FIGURE = "Write a figure: .png, .svg or .pdf."


class Topic(StrEnum):
    """What is listed."""

    SCENARIOS = "scenarios"
    ESTIMATORS = "estimators"
    INSTRUMENTS = "instruments"
    FAULTS = "faults"
    IMUS = "imus"


class Features(StrEnum):
    """As `simnav.estimators.adaptations.anfis_file.FEATURES`, which the command does not import before it runs."""

    INNOVATION = "innovation"
    MOTION = "motion"
    RECENT = "recent"


@request
class ListCommand:
    """List scenarios, estimators, kinds of instruments, kinds of faults, or IMUs."""

    topic: Topic | None = option(
        default=None,
        cli=Topic | None,
        help="What to list; without it, scenarios and estimators.",
        argument=True,
    )


@request
class ShowCommand:
    """Show all about a scenario, an estimator, a kind of instrument or a kind of fault."""

    name: str = option(help="Its name, as 'simnav list' has it, or its file.", argument=True, metavar="NAME")


@request
class RunCommand(RunRequest):
    """Run estimators once over one scenario and score them."""

    _: KW_ONLY
    plot: Path | None = option(default=None, help=_FIGURE)
    plot_lags: Path | None = option(
        default=None, help="With --lags: draw the error against the delay of the output: .png, .svg or .pdf."
    )
    stanford: Path | None = option(
        default=None, help="Write Stanford diagrams, error beside protection level: .png, .svg or .pdf."
    )
    animate: Path | None = option(default=None, help="Write a moving picture of the run: .gif.")
    alert_limit: float = option(
        default=25.0,
        least=0.01,
        help="Alert limit of the Stanford diagrams in metres; IMO A.915(22): 25, in ports 2.5.",
    )


@request
class ScoreCommand(ScoreRequest):
    """Score estimates that were made elsewhere, with the scores and the page of a run."""

    _: KW_ONLY
    plot: Path | None = option(default=None, help=_FIGURE)


@request
class SimulateCommand(RecordRequest):
    """Write the recording of one run: measurements, labels and truth."""

    _: KW_ONLY
    output: Path = option("--output", "-o", help="Recording to write: .npz, or the ending of a plug-in's format.")
    csv: Path | None = option(default=None, help="Folder for the recording as CSV files, one for each instrument.")


@request
class CheckCommand:
    """Test an estimator against the contract, or the log of a scenario.
    Of an estimator: causality, shapes, determinism, missing instruments. Of a scenario with a log (a TOML file): read
    all recordings, and show what stops or disturbs a run.
    """

    estimator: str = option(
        help="my_filter.py, my_filter.py:MyFilter or a name; or my_log.toml.", argument=True, metavar="FILE"
    )
    parameters: Parameters = option(
        "--set", default=None, metavar="NAME=VALUE", help="Value of a parameter of the estimators."
    )


@request
class BenchCommand(BenchRequest):
    """Measure time and memory of an epoch, and processor time as a multiple of that of the plain row."""

    estimators: Estimators = option(
        default=None, argument=True, metavar="FILE_OR_NAME...", help="my_filter.py, or a name; one or several."
    )
    _: KW_ONLY
    every: bool = option("--all", default=False, help="Multiples of all rows that come with simnav, and nothing else.")
    output: Path | None = option(
        "--output", "-o", default=None, help="File for the multiples, as boards read it; with --all."
    )


@request
class NewEstimatorCommand:
    """Write a small working estimator as a starting point."""

    name: str = option(help="Name of the estimator, such as my-filter.", argument=True, metavar="NAME")
    output: Path | None = option("--output", "-o", default=None, help="File to write. Default: my_filter.py.")


@request
class SweepCommand(SweepRequest):
    """Vary a quantity of a scenario (a dial): the error of estimators against it, and their breaking points."""

    _: KW_ONLY
    plot: Path | None = option(default=None, help=_FIGURE)


@request
class ClaimCommand(ClaimRequest):
    """Under which conditions does a claim hold: one method is better than another by so much?"""

    _: KW_ONLY
    plot: Path | None = option(default=None, help=_FIGURE)


@request
class RobustnessCommand(RobustnessRequest):
    """Compare estimators with the plain row when a datasheet is wrong: robustness profiles."""

    _: KW_ONLY
    plot: Path | None = option(default=None, help=_FIGURE)


@request
class WarmupCommand:
    """Compile every kernel, once; later starts are quick."""


@request
class BoundCommand(BoundRequest):
    """Show the posterior Cramer-Rao bound of a scenario by epoch: without faults, faults known, faults unknown."""

    _: KW_ONLY
    csv: Path | None = option("--csv", default=None, help="Write every epoch to this file.")


@request
class AlignCommand(AlignRequest):
    """Compare every instrument of a log with the reference: delay, lever arm, mounting, offset, scale, with sigmas."""

    _: KW_ONLY
    plot: Path | None = option(default=None, help=_FIGURE)


@request
class IdentifyCommand(IdentifyRequest):
    """Fit the error model of a log's instruments: noise, colour, bias, scale, mounting, lever arm, delay, heading.

    It prints the estimates with 95 % intervals, what the log does not tell, and the figures of the datasheets to use.
    """

    _: KW_ONLY
    plot: Path | None = option(
        default=None, help="Write a figure of the innovations before and after: .png, .svg or .pdf."
    )
    output: Path | None = option("--output", "-o", default=None, help="Write the scenario to use to this TOML file.")


@request
class InspectCommand(InspectRequest):
    """Show what the files of a log hold, and write a scenario to begin with."""

    _: KW_ONLY
    plot: Path | None = option(
        default=None, help="Write a map of the tracks, and when there are data: .png, .svg or .pdf."
    )


@request
class AllanCommand(AllanRequest):
    """Show the Allan deviation of an IMU and its noise coefficients, beside its datasheet."""

    _: KW_ONLY
    plot: Path | None = option(default=None, help=_FIGURE)
    csv: Path | None = option("--csv", default=None, help="Write every averaging time to this file.")


@request
class RealismCommand(RealismRequest):
    """Compare the errors of simulated instruments with those of a recording: can a classifier tell them apart?

    It also prints the processes that would fit the real errors best, as tables of a scenario file.
    """

    _: KW_ONLY
    plot: Path | None = option(default=None, help=_FIGURE)
    fit: Path | None = option("--fit", default=None, help="Write the processes that fit to this TOML file.")


@request
class ReferenceCommand:
    """Run the oracles over many seeds, and store the figures that errors are divided by."""

    scenarios: Scenarios = option(
        "--scenario", "-s", default=None, help="Names, tracks or TOML files, separated by commas. Default: all."
    )
    runs: int = option("--runs", "-n", default=200, least=2, help="Seeds of each scenario.")
    output: Path | None = option(
        "--output", "-o", default=None, help="File of the figures. Default: the one that comes with simnav."
    )
    results: Path = option(
        default="results/reference", help="Keep the runs in this folder; started again, it continues there."
    )
    workers: int = option(default=2, least=1, help="Number of processes.")


@request
class VerifyCommand(VerifyRequest, BundleOptions):
    """Check results or a submission, and repeat some of the runs, bit for bit.
    The exit code is 0 if all holds, 3 if nothing speaks against it but something cannot be checked here, 1 otherwise.
    """


@request
class CiteCommand(CiteRequest):
    """Print how to cite this version of simnav, or the results of a campaign."""

    text: bool = option("--text", default=False, help="Print one line of text instead of BibTeX.")


@request
class TuneCommand(TuneRequest):
    """Choose parameters of an estimator on training families, never on ranked scenarios."""

    _: KW_ONLY
    parameters: Parameters = option(
        "--set", default=None, metavar="NAME=VALUE", help="Value of a parameter that is not varied."
    )
    output: Path | None = option("--output", "-o", default=None, help="Write the chosen values to this file.")
    plot: Path | None = option(default=None, help="Write a figure of the search: .png, .svg or .pdf.")


@request
class TrainAnfisCommand:
    """Train the network of anfis-fgo (a reconstruction of Jiang et al. 2026), and draw the result."""

    features: Features = option(
        default=Features.INNOVATION, cli=Features, help="Inputs of the network; see docs/explanation/anfis.md."
    )
    seeds: int = option(
        "--seeds", "-n", default=3, least=1, help="Seeds of the training voyages; none of them is ever scored."
    )
    passes: int = option(default=200, least=1, help="Most passes over the data.")
    output: Path | None = option(
        "--output", "--out", "-o", default=None, help="Parameter file. Default: anfis_FEATURES.json."
    )


#: Name of a command -> its request, and the module of this package that runs it.
COMMANDS: Mapping[str, tuple[type[Any], str]] = {
    "list": (ListCommand, "list_"),
    "show": (ShowCommand, "show"),
    "recommend": (RecommendRequest, "recommend"),
    "run": (RunCommand, "run"),
    "simulate": (SimulateCommand, "simulate"),
    "dataset": (DatasetRequest, "dataset"),
    "score": (ScoreCommand, "score"),
    "export": (ExportRequest, "export"),
    "check": (CheckCommand, "check"),
    "bench": (BenchCommand, "bench"),
    "new-estimator": (NewEstimatorCommand, "new_estimator"),
    "evaluate": (EvaluateRequest, "evaluate"),
    "campaign": (CampaignRequest, "campaign"),
    "sweep": (SweepCommand, "sweep"),
    "robustness": (RobustnessCommand, "robustness"),
    "leaderboard": (SiteRequest, "leaderboard"),
    "warmup": (WarmupCommand, "warmup"),
    "bound": (BoundCommand, "bound"),
    "submit": (SubmitRequest, "submit"),
    "tune": (TuneCommand, "tune"),
}

#: Heading of the help -> the commands and groups below it.
HEADINGS: Mapping[str, Sequence[str]] = {
    "Every day": ("list", "show", "recommend", "run", "evaluate", "check", "new-estimator", "simulate", "sweep",
                  "campaign", "leaderboard"),
    "Logs and programs of others": ("log", "export", "score"),
    "Study and publish": ("tune", "dataset", "bench", "robustness", "bound", "paper", "submit"),
    "Maintain": ("standard", "warmup"),
}  # fmt: skip

#: Name of a group -> its help, and its commands. A group whose name is in `COMMANDS` runs that command, too.
GROUPS: Mapping[str, tuple[str, Mapping[str, tuple[type[Any], str]]]] = {
    "campaign": (
        "Run estimators on scenarios and seeds; started again, the campaign continues. Merge, check and cite results.",
        {
            "merge": (MergeRequest, "merge"),
            "rescore": (RescoreRequest, "rescore"),
            "verify": (VerifyCommand, "verify"),
            "seal": (SealRequest, "seal"),
            "cite": (CiteCommand, "cite"),
        },
    ),
    "log": (
        "Read logs of real voyages: what they hold, how their instruments fit together, and their noise.",
        {
            "inspect": (InspectCommand, "inspect"),
            "align": (AlignCommand, "align"),
            "tune-noise": (TuneNoiseRequest, "tune_noise"),
            "identify": (IdentifyCommand, "identify"),
            "twin": (TwinRequest, "twin"),
            "allan": (AllanCommand, "allan"),
            "realism": (RealismCommand, "realism"),
            "recordings": (RecordingsRequest, "recordings"),
        },
    ),
    "paper": (
        "Repeat the comparisons of papers, and search for the conditions under which their claims hold.",
        {
            "reproduce": (ReproduceRequest, "reproduce"),
            "claim": (ClaimCommand, "claim"),
            "train-anfis": (TrainAnfisCommand, "train"),
        },
    ),
    "standard": (
        "For maintainers: run, check and publish the result that comes with simnav.",
        {
            "run": (StandardRequest, "standard_run"),
            "check": (CheckStandardRequest, "standard_check"),
            "audit": (AuditRequest, "standard_audit"),
            "draw": (DrawRequest, "standard_draw"),
            "publish": (PublishRequest, "standard_publish"),
            "reference": (ReferenceCommand, "reference"),
        },
    ),
}

#: Former name of a command -> where it is now.
MOVED: Mapping[str, str] = {
    "inspect": "log inspect",
    "align": "log align",
    "tune-noise": "log tune-noise",
    "allan": "log allan",
    "realism": "log realism",
    "recordings": "log recordings",
    "merge": "campaign merge",
    "rescore": "campaign rescore",
    "verify": "campaign verify",
    "seal": "campaign seal",
    "cite": "campaign cite",
    "reproduce": "paper reproduce",
    "claim": "paper claim",
    "train": "paper train-anfis",
    "reference": "standard reference",
}
