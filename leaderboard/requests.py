"""The requests of all Python calls: what each call takes, with its defaults and what each option means.

`simnav.leaderboard.interface` has the calls, `simnav.leaderboard.cli.commands` the commands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from simnav.leaderboard.campaign.options import CampaignOptions, PathLike, RunOptions

from .calls import numbers, option, request
from .papers import PAPERS

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.leaderboard.campaign.request import EstimatorLike, Estimators
    from simnav.leaderboard.results.result import Result
    from simnav.leaderboard.tuning.space import Range
    from simnav.scenario import Scenario

__all__ = [
    "BenchRequest",
    "BoundRequest",
    "CampaignRequest",
    "CiteRequest",
    "CostsRequest",
    "EvaluateRequest",
    "MergeRequest",
    "RankRequest",
    "RecordRequest",
    "ReproduceRequest",
    "RescoreRequest",
    "RobustnessRequest",
    "RunRequest",
    "SealRequest",
    "SweepRequest",
    "TuneRequest",
    "VerifyRequest",
]

ScenarioLike: TypeAlias = "str | Path | Scenario"
Scenarios: TypeAlias = "ScenarioLike | Iterable[ScenarioLike] | None"
Bar: TypeAlias = "Callable[..., None] | None"
CampaignProgress: TypeAlias = "Callable[[Progress], None] | None"
Parameters: TypeAlias = "Mapping[str, Any] | None"

SCENARIO = "Name, versioned id, or path of a TOML file."
SCENARIO_MORE = "Or the `simnav.scenario.Scenario` itself."
_SCENARIOS = "Names, tracks or TOML files, separated by commas. Default: all."
_ESTIMATORS = "Names or files, separated by commas; 'sw-fgo:window=10' sets a parameter."
_FIVE = "'all': every registered one. Default: five baselines that suit the scenario."
PARAMETERS = "Value of a parameter of the estimators."
_EACH_GETS = "Each estimator gets the parameters that it has."
PROGRESS = "Called with the number of finished parts, the number of all parts, and the next part as ``note=``."
CAMPAIGN_PROGRESS = "Called with a `simnav.leaderboard.campaign.campaign.Progress` from time to time."
FOLDER = "Folder that a campaign wrote."
_PROFILE = "What is run: smoke, quick, standard, full, robustness, or a TOML file of your own."
_OWN_SCENARIOS = "TOML files of scenarios outside the catalogue."
_FIRST_SEED = "Seed of the first run; the others count up."


@request
class RecordRequest:
    """Run a scenario to its end: measurements, labels and truth."""

    scenario: ScenarioLike = option(help=SCENARIO, more=SCENARIO_MORE, argument=True, metavar="SCENARIO")
    seed: int = option(default=0, help="Seed of the run.", least=0)


@request
class RunRequest:
    """Run estimators once over one scenario, in this process, and score them."""

    scenario: ScenarioLike = option(help=SCENARIO, more=SCENARIO_MORE, argument=True, metavar="SCENARIO")
    estimators: Estimators = option("--estimator", "-e", default=None, help=f"{_ESTIMATORS} {_FIVE}")
    _: KW_ONLY
    seed: int = option(default=0, help="Seed of the run.", least=0)
    parameters: Parameters = option("--set", default=None, help=PARAMETERS, more=_EACH_GETS, metavar="NAME=VALUE")
    lags: str | Sequence[float] | None = option(
        "--lags",
        default=None,
        cli=str | None,
        metavar="SECONDS",
        help="Also estimate the times so many seconds before, like 1/5/10/30: the accuracy of an output that is late.",
        more="The parameter ``lags`` of all estimators (`simnav.estimator.looking_back`).",
    )
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)


@request
class EvaluateRequest(RunOptions):
    """Compare estimators with the baselines on the same seeds."""

    estimators: Estimators = option(
        help="my_filter.py, or a name; one or several: the estimators under test.",
        argument=True,
        cli=list[str],
        metavar="FILE_OR_NAME...",
    )
    scenarios: Scenarios = option("--scenario", "-s", help="Names or TOML files, separated by commas.", cli=list[str])
    _: KW_ONLY
    runs: int = option("--runs", "-n", default=20, help="Seeds of each scenario.", least=2)
    seed: int = option("--seed", default=0, help=_FIRST_SEED, least=0)
    against: Estimators = option(default=None, help=f"Rows to compare with, separated by commas. {_FIVE}")
    parameters: Parameters = option(
        "--set", default=None, help=PARAMETERS, more="Of the estimators under test.", metavar="NAME=VALUE"
    )
    results: PathLike | None = option(default=None, help="Keep the results in this folder. Default: they are not kept.")
    progress: CampaignProgress = option(default=None, help=CAMPAIGN_PROGRESS, hidden=True)


@request
class CampaignRequest(CampaignOptions):
    """Run estimators on scenarios and seeds. Started again, the campaign continues.

    A result is computed anew if the code of simnav or of the estimator has changed since, or a numerical library, or if
    it comes from another kind of processor.
    """

    scenarios: Scenarios = option("--scenario", "-s", default=None, help=_SCENARIOS)
    estimators: Estimators = option("--estimator", "-e", default=None, help=f"{_ESTIMATORS} Default: all.")
    _: KW_ONLY
    runs: int | None = option(
        "--runs", "-n", default=None, help="Seeds of each scenario. Default: 50, or as the profile says.", least=1
    )
    seed: int = option("--seed", default=0, help=_FIRST_SEED, least=0)
    output: PathLike = option("--output", "-o", default="results", help="Folder of the results.")
    profile: PathLike | None = option(
        default=None,
        help=_PROFILE,
        more="``scenarios``, ``estimators`` and ``runs`` replace those of the profile.",
        cli=str | None,
    )
    parameters: Parameters = option("--set", default=None, help=PARAMETERS, more=_EACH_GETS, metavar="NAME=VALUE")
    sealed: PathLike | None = option(
        "--sealed",
        default=None,
        metavar="KEYFILE",
        help="Derive the seeds from the secret in this file.",
        more="Results carry its hash, and `verify` repeats them.",
    )
    external: PathLike | None = option(
        "--external",
        default=None,
        metavar="FOLDER",
        help="Also rank estimates that were made elsewhere: FOLDER/NAME/SCENARIO-RUN.csv or .tum.",
        more="They are marked external: not confined, and without cost.",
    )
    oracle: bool = option(
        default=True, help="Run the oracles on simulated scenarios, too: the reference of a board, not ranked."
    )
    by_version: bool = option(
        default=False,
        help="Know results by declared versions of simnav, and by the user's own files, as in a submission.",
        hidden=True,
    )
    progress: CampaignProgress = option(default=None, help=CAMPAIGN_PROGRESS, hidden=True)


@request
class SweepRequest(RunOptions):
    """Vary a quantity of a scenario (a dial): the error of estimators against it, and their breaking points.

    All values use the same seeds, so only the dial differs. Started again, the sweep continues where it stopped.
    """

    scenario: ScenarioLike = option(help=SCENARIO, more=SCENARIO_MORE, argument=True, metavar="SCENARIO")
    dials: Mapping[str, Sequence[float]] | Sequence[str] | str = option(
        "--dial",
        cli=list[str],
        help="A dial with its values, like multipath=0,1,2,4, or a key, like fault[0].sigma_m=1,2. Two make a map.",
        more="Or a mapping, with values in the unit of the key. Default of the values: seven over the range. The clean "
        "value is added.",
    )
    estimators: Estimators = option("--estimator", "-e", help=_ESTIMATORS, cli=list[str])
    _: KW_ONLY
    runs: int = option("--runs", "-n", default=30, help="Seeds of each value.", least=1)
    score: str = option(
        default="horizontal_rmse", help="A score that is better when lower.", more="A key of `simnav.scoring.SCORES`."
    )
    limit: float | None = option(
        default=None, help="Threshold of the error for a second breaking point, in the unit of the score."
    )
    output: PathLike | None = option(
        "--output", "-o", default=None, help="Folder of the results. Default: results/sweep-SCENARIO."
    )
    parameters: Parameters = option("--set", default=None, help=PARAMETERS, more=_EACH_GETS, metavar="NAME=VALUE")
    seed: int = option("--seed", default=0, help=_FIRST_SEED, least=0)
    progress: CampaignProgress = option(default=None, help=CAMPAIGN_PROGRESS, hidden=True)


@request
class RobustnessRequest(RunOptions):
    """Compare estimators with the plain row when a datasheet is wrong: robustness profiles.

    The figures of one instrument after the other are multiplied by each factor, and its true errors stay the same. The
    scenarios are two short ones that come with simnav, of a ship with an IMU and of one without. Started again, the
    sweep continues where it stopped.
    """

    estimators: Estimators = option(
        default=None,
        help="my_filter.py, or a name; one or several. Default: all that come with simnav and are not slow.",
        argument=True,
        metavar="FILE_OR_NAME...",
    )
    factors: Sequence[float] = option(
        "--factors",
        default=(1.0 / 3.0, 3.0, 10.0),
        cli=str | None,
        cli_default=None,
        read=lambda given: (1.0 / 3.0, 3.0, 10.0) if given is None else numbers("--factors", given),
        help="Datasheet over truth, separated by commas. Default: 1/3, 3 and 10.",
        more="The true datasheet is added.",
    )
    _: KW_ONLY
    runs: int = option("--runs", "-n", default=4, help="Seeds of each datasheet.", least=1)
    seed: int = option("--seed", default=0, help=_FIRST_SEED, least=0)
    folder: PathLike = option("--results", default="results/robustness", help="Folder of the results.")
    parameters: Parameters = option("--set", default=None, help=PARAMETERS, more=_EACH_GETS, metavar="NAME=VALUE")
    output: PathLike | None = option(
        "--output",
        "-o",
        default=None,
        help="File that the profiles are written to, with machine, versions and day.",
        more="The one that boards show is ``leaderboard/standard/robustness.json``.",
    )
    progress: CampaignProgress = option(default=None, help=CAMPAIGN_PROGRESS, hidden=True)


@request
class TuneRequest:
    """Choose parameters of an estimator on training families, never on ranked scenarios."""

    estimator: EstimatorLike = option(
        help="A name, or a file like my_filter.py.",
        more="Parameters that are given with it are not varied.",
        argument=True,
        metavar="ESTIMATOR",
    )
    families: Scenarios = option(
        "--family",
        "-f",
        default=("training-voyages", "training-clean"),
        cli_default=None,
        read=lambda given: ",".join(given) if given else ("training-voyages", "training-clean"),
        help="Training families, separated by commas. Default: training-voyages,training-clean.",
        more="Their voyages share no random stream with any other scenario.",
    )
    vary: Sequence[str | Range] | str | None = option(
        default=None,
        metavar="NAME=LOW:HIGH",
        cli=list[str] | None,
        read=lambda given: ",".join(given) if given else None,
        help="A parameter and its bounds; :log or :integer may follow. Default: those of the stored tuning.",
        more='Several are a list, or a text with commas, like ``"dof=2:50:log"``.',
    )
    _: KW_ONLY
    runs: int = option("--runs", "-n", default=20, help="Voyages of each family for the search.", least=2)
    unseen: int = option(default=20, help="Voyages of each family for the comparison.", least=2)
    seed: int = option(
        "--seed",
        default=0,
        help="Seed of the first voyage; the others count up.",
        more="The voyages of the comparison have the seeds after those of the search.",
        least=0,
    )
    evaluations: int = option(default=40, help="Evaluations of the objective.", least=2)
    method: Literal["differential-evolution", "nelder-mead"] = option(
        default="differential-evolution", help="differential-evolution or nelder-mead.", cli=str
    )
    search_seed: int = option(default=0, help="Seed of the search.", least=0)
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)


@request
class BenchRequest:
    """Measure time and memory of an epoch, and processor time as a multiple of that of the plain row.

    The multiples of the plain row are those of `costs`. Then all estimators run in turn on one scenario, in this
    process, so that other work of the machine slows all of them alike; see `simnav.testing.cost`.
    """

    estimators: Estimators = option(
        help="my_filter.py, or a name; one or several: the estimators under test.",
        argument=True,
        metavar="FILE_OR_NAME...",
    )
    _: KW_ONLY
    against: Estimators = option(
        default=None, help="Rows for comparison, separated by commas. Default: one of each family."
    )
    scenario: ScenarioLike | None = option(
        "--scenario",
        "-s",
        default=None,
        help="A name or a TOML file. Default: those of a fixed list that suit.",
        more="The list is `simnav.leaderboard.ranking.cost_measurement.SCENARIOS`; figures of an epoch are of the "
        "first that suits all of the estimators.",
    )
    seed: int = option(default=0, help="Seed of the recording.", least=0)
    epochs: int = option(
        default=120, help="Epochs that are run, from the start; fewer if the scenario has fewer.", least=2
    )
    rounds: int = option(
        default=21, help="Runs; the smallest time of an epoch counts, and the median of the multiples.", least=1
    )
    parameters: Parameters = option(
        "--set", default=None, help=PARAMETERS, more="Of the estimators under test.", metavar="NAME=VALUE"
    )
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)


@request
class CostsRequest(BenchRequest):
    """Measure processor times as multiples of those of the plain row, in this process, each beside the plain row.

    A third of the epochs is run before those that are timed.
    """

    estimators: Estimators = option(default=None, help="The estimators under test. Default: all that come with simnav.")
    _: KW_ONLY
    output: PathLike | None = option(
        default=None,
        help="File that the multiples are written to, with machine, versions and day.",
        more="The one that boards show is ``leaderboard/ranking/costs.json``.",
    )


@request
class RankRequest:
    """Rank estimators by their results."""

    results: PathLike | Iterable[Result] = option(
        help="Folder that a campaign wrote, or results themselves.", argument=True
    )
    _: KW_ONLY
    score: str | None = option(
        default=None,
        help="Key of `simnav.scoring.SCORES`, one that is better when lower. Default: the horizontal error, and for "
        "post-processing the smoothed one.",
    )
    tracks: Mapping[str, str] | None = option(
        default=None, help="Track of scenarios that are not in the catalogue, by versioned id."
    )


@request
class RescoreRequest:
    """Compute new scores, or existing scores again, without running an estimator.

    The trials that a campaign kept are in single precision, so a score that is computed again agrees to about seven
    digits. Therefore existing scores are not changed, unless they are named, or their code has changed.
    """

    results: PathLike = option(
        help="Folder of 'simnav campaign --keep-trials'.",
        more="Its results get the scores.",
        argument=True,
        metavar="RESULTS",
    )
    scores: str | Iterable[str] = option(
        "--score",
        default=(),
        cli=list[str] | None,
        cli_default=None,
        read=lambda given: ",".join(given or ()),
        help="Names of scores, separated by commas. Default: those that are missing.",
        more="And scores of simnav whose code has changed.",
    )
    _: KW_ONLY
    scenarios: Scenarios = option("--scenario", "-s", default=None, help=_OWN_SCENARIOS)
    key: PathLike | None = option(default=None, metavar="KEYFILE", help="Key file, if the seeds are sealed.")
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)


@request
class MergeRequest:
    """Put the results of several folders into one, e.g. of campaigns with --shard.

    A run that several of them hold counts once. The copy of a file that is damaged is set aside, with a warning.
    """

    folders: Iterable[PathLike] = option(
        help="Folders that campaigns wrote.",
        more="They are not changed. Or bundles of `simnav.submit`, which should be verified first.",
        argument=True,
        metavar="FOLDERS",
        cli=list[Path],
    )
    output: PathLike = option(
        "--output", "-o", help="Folder that gets all results.", more="New, empty, or with results, which are kept."
    )


@request
class SealRequest:
    """Make or check a key of sealed seeds, and print the commitment to publish before the campaign."""

    key: PathLike = option(
        help="File of the key; a new one is made.",
        more="It gets 256 random bits. One that exists should be readable by its owner only, and hold what was drawn "
        "at random.",
        argument=True,
        metavar="KEYFILE",
    )
    _: KW_ONLY
    public: str = option(
        default="",
        metavar="TEXT",
        help="Public value to mix in, drawn after the commitment was published.",
        more="A value that nobody can choose and everybody can look up, such as the numbers of a lottery. The seeds "
        "then follow from the key and from this value. It is stored in the file.",
    )


@request
class CiteRequest:
    """How to cite this version of simnav, or the results of a campaign."""

    results: PathLike | None = option(
        default=None, help=f"{FOLDER} Default: simnav itself.", argument=True, metavar="RESULTS"
    )
    _: KW_ONLY
    author: str = option("--author", default="", help="Who made the results. Default: the authors of simnav.")


@request
class BoundRequest:
    """The posterior Cramer-Rao bound of a scenario by epoch: without faults, faults known, faults unknown.

    It is a lower limit of the error.
    """

    scenario: ScenarioLike = option(
        help="A name or a TOML file; a simulated one.", more=SCENARIO_MORE, argument=True, metavar="SCENARIO"
    )
    _: KW_ONLY
    runs: int = option("--runs", "-n", default=12, help="Seeds over which it is averaged.", least=1)
    smoothed: bool = option("--smoothed", default=False, help="Bound of smoothed output, not of real-time output.")
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)


@request
class VerifyRequest:
    """Check results, and repeat a sample of the runs, which should be equal bit for bit.

    Repeated are runs of every status. Scenarios come from the catalogue or from ``scenarios``, estimators from the
    registry or from ``estimators``, and nothing that a result names is imported.
    """

    results: PathLike = option(
        help="Folder of results, or a bundle of 'simnav submit'.",
        more="A bundle is for `verify_bundle`.",
        argument=True,
        metavar="RESULTS",
    )
    _: KW_ONLY
    key: PathLike | None = option(
        "--key", default=None, metavar="KEYFILE", help="Key of sealed seeds: of the results, or for a bundle."
    )
    sample: int | None = option(
        default=None,
        least=1,
        help="Runs that are repeated at most. Default: so many that 5 % of forged runs are found, about 59.",
        more="They are then found with 95 % probability.",
    )
    scenarios: Scenarios = option("--scenario", "-s", default=None, help=_OWN_SCENARIOS)
    estimators: Estimators = option(
        "--estimator", "-e", default=None, help=_ESTIMATORS, more="Those that are not registered."
    )
    rows: str | Iterable[str] = option(
        "--row",
        default=(),
        cli=list[str] | None,
        cli_default=None,
        read=lambda given: given or (),
        help="Of a folder: repeat runs of this row only; repeatable.",
    )
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)


@request
class ReproduceRequest:
    """Repeat the comparison of a paper: our figures beside the paper's, with a verdict on each row.

    Results are kept: started again, the command continues.
    """

    paper: str = option(help=f"{', '.join(PAPERS)}.", more="Or an alias.", argument=True, metavar="PAPER")
    _: KW_ONLY
    runs: int | None = option(
        "--runs", "-n", default=None, help="Runs of each scenario. Default: a few, done in minutes.", least=1
    )
    methods: Sequence[str] = option(
        "--method", "-m", default=(), help="Only the rows about these methods of the paper. Default: all."
    )
    until_decided: bool = option(
        "--until-decided",
        default=False,
        help="More runs for undecided rows, until all are decided.",
        more="See `simnav.leaderboard.papers.sequential`.",
    )
    holds_if: bool = option(
        "--holds-if",
        default=False,
        help="Search for the conditions under which the paper's claims hold.",
        more="All choices that the paper does not print are varied (see `simnav paper claim`), on --runs seeds (6) of "
        "the search; judged on twice as many or more. The tables are those that come with simnav; those of a paper "
        "of your own are run first.",
    )
    limit: int = option(default=200, help="With --until-decided: largest number of runs of a scenario.", least=1)
    minutes: float | None = option(
        default=None, help="With --until-decided: start no run after this time. Default: no limit.", least=0.0
    )
    stored: bool = option("--stored", default=False, help="Show the results that come with simnav; nothing is run.")
    output: PathLike | None = option(
        "--output",
        "-o",
        default=None,
        help="Folder of results, tables, figures, page. Default: reproduced/PAPER.",
        more="Its folder ``results`` keeps the results: a later call continues there.",
    )
    workers: int = option(default=2, help="Number of processes.", least=1)
    progress: Callable[[str, Progress], None] | None = option(
        default=None, help="Called with the name of the scenario and the campaign's progress.", hidden=True
    )
