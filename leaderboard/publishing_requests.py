"""The requests of the calls for published results: sites, submissions and the standard result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY
from pathlib import Path

from simnav.leaderboard.campaign.options import PathLike, part_of
from simnav.leaderboard.results.web_addresses import BUILT

from .calls import option, request
from .requests import (
    CAMPAIGN_PROGRESS,
    FOLDER,
    PARAMETERS,
    PROGRESS,
    Bar,
    CampaignProgress,
    Parameters,
)

__all__ = [
    "AuditRequest",
    "BundleOptions",
    "CheckStandardRequest",
    "DrawRequest",
    "PublishRequest",
    "SiteRequest",
    "StandardRequest",
    "SubmitRequest",
    "VerifyBundleRequest",
]

_WORKING = "results/standard"


@request
class BundleOptions:
    """How the runs of a bundle are repeated."""

    _LAST = True
    _: KW_ONLY
    present: bool = option(
        "--present",
        default=False,
        help="For a bundle: use the installed packages, not a new environment.",
        more="That is quick and needs no network.",
    )
    tolerance: float | None = option(
        default=None,
        least=0.0,
        help="For a bundle: relative difference that is accepted. [1e-6]",
        more="Differences of bits are counted.",
    )


@request
class VerifyBundleRequest(BundleOptions):
    """Check a submission, and repeat a sample of its runs in confined processes."""

    bundle: PathLike = option(help="Bundle that `submit` wrote.", argument=True)
    _: KW_ONLY
    key: PathLike | None = option(
        default=None,
        help="File of a secret key. The estimators also run on seeds that are derived from it, which the submission "
        "cannot know, and should be no worse there.",
    )
    sample: int | None = option(default=None, help="As for `verify`.")
    progress: Bar = option(default=None, help=PROGRESS)


@request
class SiteRequest:
    """Rank the results of a campaign, and write the site."""

    results: PathLike = option(help=FOLDER, argument=True, metavar="RESULTS")
    _: KW_ONLY
    output: PathLike = option(
        "--output", "-o", default="site", help="Folder of the site.", more="An older site there is replaced."
    )
    papers: PathLike = option(
        default="reproduced", help="Folder that 'simnav paper reproduce' wrote; its papers get pages."
    )
    sweeps: PathLike = option(
        default="results", help="Folder with the folders of sweeps; the pages of scenarios show them."
    )
    docs: str = option(
        default=BUILT,
        help="Documentation that the pages link to: a web address, or the folder that 'make docs' built.",
        more="Without that folder, the pages link to the address that this installation of simnav names, if any.",
    )
    runs_shown: int = option(default=1, help="Runs of each scenario of which the site has track and errors.", least=1)
    figures: bool = option("--print", default=False, help="Write the charts as SVG and PNG, too.")
    against: PathLike | None = option(
        default=None, metavar="FOLDER", help="Results of another campaign, for the rank correlation."
    )
    workers: int = option(default=2, help="Number of processes.", least=1)
    progress: Bar = option(default=None, help="Called with how many of how many pages are done.", hidden=True)


@request
class SubmitRequest:
    """Run an estimator on a profile, and write its source and results as a bundle."""

    estimator: str = option(
        help="my_filter.py, or an installed package with estimators.",
        more="Or the name of one of its estimators.",
        argument=True,
        metavar="FILE_OR_PACKAGE",
    )
    _: KW_ONLY
    profile: PathLike = option(default="standard", help="What is run: a profile of simnav.", cli=str)
    parameters: Parameters = option("--set", default=None, help=PARAMETERS, metavar="NAME=VALUE")
    requires: Sequence[str] = option(
        default=(),
        help="Package that a file needs beside simnav; repeatable.",
        more="As pip takes them. Those of a package are known.",
    )
    output: PathLike | None = option("--output", "-o", default=None, help="The bundle. Default: NAME.simnav.zip.")
    results: PathLike | None = option(
        default=None,
        help="Keep the results in this folder. Default: results/submit-NAME.",
        more="The same call continues there.",
    )
    workers: int = option(default=2, help="Number of processes.", least=1)
    minutes: float | None = option(
        default=None, least=0.0, help="Start no run after so many minutes. The same command continues."
    )
    progress: CampaignProgress = option(default=None, help=CAMPAIGN_PROGRESS, hidden=True)


@request
class StandardRequest:
    """Run the missing and outdated parts of the standard result. The same command continues.

    A new folder starts with the results that come with simnav. So only rows and scenarios with a new version are run.
    Results are known by their declared versions: an edit without a new version runs nothing, but for ``force``.
    """

    _: KW_ONLY
    minutes: float | None = option(
        default=110.0, least=0.0, help="Start no run after so many minutes. The same command continues."
    )
    profile: PathLike = option(default="standard", help="What is run: a profile of simnav, or a file.", cli=str)
    results: PathLike = option("--results", default=_WORKING, help="Folder to work in.")
    shipped: PathLike | None = option(default=None, help="Folder of the packed results. Default: that of simnav.")
    workers: int = option(default=2, help="Number of processes.", least=1)
    force: Sequence[str] = option(
        default=(), metavar="NAME", help="Run this estimator anew; several are separated by commas."
    )
    shard: tuple[int, int] = option(
        default=(1, 1),
        metavar="K/N",
        cli=str,
        cli_default="1/1",
        read=part_of,
        help="Do part K of N of the runs; 'simnav campaign merge' puts the parts together.",
    )
    progress: CampaignProgress = option(default=None, help=CAMPAIGN_PROGRESS, hidden=True)


@request
class CheckStandardRequest:
    """Say which rows and scenarios have another version than the standard result; nothing is run."""

    results: PathLike | None = option("--results", default=None, help="Folder of results. Default: those of simnav.")


@request
class DrawRequest:
    """Run what the site of the standard result draws: a few rows in two runs of each scenario, and sweeps.

    What comes with simnav and has the versions of today is not run again. The same command continues. Further rows get
    the distribution of their errors from the results in the folder of `standard run`, where they have series.
    """

    _: KW_ONLY
    minutes: float | None = option(
        default=30.0, least=0.0, help="Start no run after so many minutes. The same command continues."
    )
    results: PathLike = option("--results", default="results/standard-drawn", help="Folder to work in.")
    standard: PathLike = option(default=_WORKING, help="Folder in which 'simnav standard run' worked, if it is there.")
    profile: PathLike | None = option(
        default=None, help="What is run: a file like ``leaderboard/standard/drawn.toml``, the default.", cli=str
    )
    shipped: PathLike | None = option(default=None, help="Folder of what is drawn. Default: that of simnav.")
    workers: int = option(default=2, help="Number of processes.", least=1)
    progress: CampaignProgress = option(default=None, help=CAMPAIGN_PROGRESS, hidden=True)


@request
class AuditRequest:
    """Repeat a random sample of the standard result with the code of today, and compare the scores.

    Declared versions alone say which results are up to date. The audit tests whether they are.
    """

    _: KW_ONLY
    sample: int = option(
        default=20,
        help="Results that are repeated, drawn at random.",
        more="The audit says which share of wrong results such a sample would find.",
        least=1,
    )
    results: PathLike | None = option("--results", default=None, help="Folder of results. Default: those of simnav.")
    progress: Bar = option(default=None, help=PROGRESS, hidden=True)


@request
class PublishRequest:
    """Pack the standard result, and make its site, the README's tables and the history of rows from it.

    Results that the profile does not name, as those of submissions, are published as long as they are not out of date.
    """

    _: KW_ONLY
    results: PathLike = option(
        "--results",
        default=_WORKING,
        help="Folder to work in.",
        more="If it is not there, the results that come with simnav are taken.",
    )
    profile: PathLike = option(
        default="standard",
        help="What is run: a profile of simnav, or a file.",
        more="The results should contain it completely.",
        cli=str,
    )
    shipped: PathLike | None = option(default=None, help="Folder of the packed results. Default: that of simnav.")
    history: PathLike | None = option(default=None, help="File of the editions. Default: that of simnav.")
    readme: PathLike | None = option(
        default=None,
        help="Whose first answer is written. Default: of the command, README.md, if it is here; of the call, none.",
        more="It stands between the marks of `simnav.leaderboard.standard.readme`, as do the tables of docs/board.md "
        "beside it, if that is there.",
    )
    site: PathLike | None = option(
        default=None,
        cli=Path,
        cli_default="site",
        help="Folder of the site.",
        more="Default: no site is drawn.",
    )
    workers: int = option(default=2, help="Number of processes.", least=1)
    preliminary: bool = option(
        "--preliminary",
        default=False,
        help="Publish also if runs are missing, or of an older version of their rows.",
        more="The tables then say how many are there, and there is no edition, or which rows are older.",
    )
    progress: Bar = option(default=None, help="Called with how many of how many pages are done.", hidden=True)
