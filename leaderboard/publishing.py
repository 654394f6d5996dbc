"""Calls for published results: sites, submissions, and the standard result that comes with simnav.

`simnav.leaderboard.interface` has the calls that compute and compare; these build on them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.request import EstimatorRequest, file_of
from simnav.leaderboard.given import absolute, results_of, whole
from simnav.leaderboard.inspection import rank
from simnav.leaderboard.interface import CampaignProgress, campaign
from simnav.leaderboard.results.errors import RequestError, StoreError, mistakes
from simnav.leaderboard.results.scratch import scratch

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.reports import CampaignReport
    from simnav.leaderboard.site.report import SiteReport
    from simnav.leaderboard.standard.auditing import Audit
    from simnav.leaderboard.standard.currency import Outdated
    from simnav.leaderboard.standard.publication import Published
    from simnav.leaderboard.submission.bundle import Row
    from simnav.leaderboard.submission.verifying import SubmissionReport

__all__ = [
    "Submission",
    "audit_standard",
    "check_standard",
    "publish_standard",
    "run_standard",
    "site",
    "submit",
    "verify_bundle",
]


def site(
    results: str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] = "site",
    papers: str | os.PathLike[str] = "reproduced",
    sweeps: str | os.PathLike[str] = "results",
    runs_shown: int = 2,
    figures: bool = False,
    against: str | os.PathLike[str] | None = None,
    workers: int = 2,
    progress: Callable[..., None] | None = None,
) -> SiteReport:
    """Rank the results of a campaign, and write the site.

    Parameters
    ----------
    results : path
        Folder that a campaign wrote.
    output : path
        Folder of the site; an older site there is replaced.
    papers : path
        Folder that `simnav.leaderboard.interface.reproduce` wrote; its papers get pages.
    sweeps : path
        Folder with the folders of sweeps, which the pages of scenarios show.
    runs_shown : int
        Runs of each scenario of which the site has track and errors.
    figures : bool
        Write the charts as SVG and PNG, too.
    against : path, optional
        Results of another campaign: how well its order agrees.
    workers : int
        Processes.
    progress : callable, optional
        Called with how many of how many pages are done.

    Returns
    -------
    SiteReport

    Raises
    ------
    RequestError
        If there are no results, or the site cannot be written.
    """
    from simnav.leaderboard.papers.page import find
    from simnav.leaderboard.ranking.agreement import rank_correlations
    from simnav.leaderboard.ranking.ranking import rank as ranked
    from simnav.leaderboard.results import requested
    from simnav.leaderboard.site import sweeps as swept
    from simnav.leaderboard.site.report import SiteReport
    from simnav.leaderboard.site.site import build

    shown, processes = whole("runs_shown", runs_shown, 1), whole("workers", workers, 1)
    found = results_of(results, series=True)
    ranking = ranked(found, requested=requested.read(results))
    correlations = () if against is None else tuple(rank_correlations(ranking, rank(against)))
    index = build(
        found, ranking, absolute(output), progress=progress, workers=processes, papers=find(Path(papers)),
        runs_shown=shown, figures=figures, sweeps=swept.find(Path(sweeps)),
    )  # fmt: skip
    return SiteReport(index, found, ranking, correlations)


@dataclass(frozen=True)
class Submission:
    """A bundle that was written.

    Attributes
    ----------
    path : Path
        Path of the bundle.
    digest : str
        SHA-256 digest of the bundle.
    estimators : tuple of str
        Labels of the estimators in the bundle.
    profile : str
        Name of the profile that was run.
    results, failed : int
        Number of results in the bundle, and number of failures among them.
    remarks : tuple of str
        Weaknesses of the bundle that readers will notice.
    """

    path: Path
    digest: str
    estimators: tuple[str, ...]
    profile: str
    results: int
    failed: int
    remarks: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain."""
        return {**vars(self), "path": str(self.path)}


def submit(
    estimator: str,
    *,
    profile: str | os.PathLike[str] = "standard",
    parameters: Mapping[str, Any] | None = None,
    requires: Sequence[str] = (),
    output: str | os.PathLike[str] | None = None,
    results: str | os.PathLike[str] | None = None,
    workers: int = 2,
    minutes: float | None = None,
    progress: CampaignProgress = None,
) -> Submission:
    """Run an estimator on a profile, and write its source and results as a bundle.

    Parameters
    ----------
    estimator : str
        A file, an installed package that registers estimators, or the name of one of its estimators.
    profile : str or path
        Profile that names the scenarios and seeds.
    parameters : mapping, optional
        Parameters of the estimators.
    requires : sequence of str
        Packages that a file needs beside simnav, as pip takes them. Those of a package are known.
    output : path, optional
        The bundle; default: ``NAME.simnav.zip``.
    results : path, optional
        Folder in which the results are kept; default: ``results/submit-NAME``. The same call continues there.
    workers : int
        Processes.
    minutes : float, optional
        Time after which no further run is started.
    progress : callable, optional
        As for `simnav.leaderboard.interface.campaign`.

    Returns
    -------
    Submission

    Raises
    ------
    RequestError
        If there is no such estimator or profile, the estimator cannot be passed on, or runs are left after ``minutes``.
    """
    from simnav.leaderboard.campaign.confinement.attempt import chosen_confinement
    from simnav.leaderboard.profiles import load
    from simnav.leaderboard.results.packing import pack
    from simnav.leaderboard.results.provenance import BENCHMARK
    from simnav.leaderboard.submission.bundle import SUFFIX, write_bundle
    from simnav.leaderboard.submission.source import source_of
    from simnav.leaderboard.submission.verifying import runs_of

    name = load(profile).name
    with mistakes(ValueError):
        confinement = chosen_confinement("auto")
    with scratch("submit") as home:
        source = source_of(str(estimator), dict(parameters or {}), home, tuple(requires))
        folder = absolute(results or Path("results") / f"submit-{source.title}")
        target = absolute(output or f"{source.title}{SUFFIX}")
        if not target.parent.is_dir():
            raise RequestError(f"{target.parent} is no folder")
        report = campaign(
            estimators=list(source.requests), output=folder, profile=profile, workers=workers, minutes=minutes,
            confinement=confinement, oracle=False, by_version=True, progress=progress,
        )  # fmt: skip
        if report.summary.left:
            raise RequestError(
                f"{report.summary.left} of {report.summary.total} runs are left after {minutes:g} minutes; the same "
                "command continues"
            )
        with mistakes(StoreError):
            found = pack(folder, home / "results", [r.label for r in source.requests])
        ran = {r.scenario for r in found}
        runs = {s: n for s, n in runs_of(str(profile)).items() if s in ran}
        rows = [_row(r) for r in source.requests]
        digest = write_bundle(
            target, title=source.title, benchmark=BENCHMARK, profile=name, runs=runs, main=source.main, estimators=rows,
            requires=source.requires, source=source.files, results=home / "results",
        )  # fmt: skip
    remarks = []
    if any(r.provenance.dirty for r in found):
        remarks.append("the checkout of simnav has changes that no commit holds, so others cannot repeat the results")
    if confinement == "none":
        remarks.append("the results were computed without confinement, which no board accepts")
    tried = [r for r in found if r.tried]
    failed = sum(r.status != "ok" for r in tried)
    return Submission(target, digest, tuple(r.label for r in rows), name, len(found), failed, tuple(remarks))


def _row(request: EstimatorRequest) -> Row:
    """What a bundle says of an estimator: the file without its folder, or the entry point of its package."""
    from simnav.estimator.registry import point_of
    from simnav.leaderboard.submission.bundle import Row

    packaged = not file_of(request.name)
    return Row(
        label=request.label,
        name=request.name if packaged else os.path.basename(request.name),
        point=point_of(request.name) if packaged else "",
        parameters=dict(request.parameters),
    )


def verify_bundle(
    bundle: str | os.PathLike[str],
    *,
    key: str | os.PathLike[str] | None = None,
    sample: int | None = None,
    present: bool = False,
    tolerance: float | None = None,
    progress: Callable[..., None] | None = None,
) -> SubmissionReport:
    """Check a submission, and repeat a sample of its runs in confined processes.

    Parameters
    ----------
    bundle : path
        Bundle that `submit` wrote.
    key : path, optional
        File of a secret key. The estimators also run on seeds that are derived from it, which the submission cannot
        know, and should be no worse there.
    sample : int, optional
        Largest number of runs that are repeated; default: so many that 5 % of forged ones are found with 95 %
        probability (about 59).
    present : bool
        True: use the packages of this environment, which is quick and needs no network. By default a new environment is
        made.
    tolerance : float, optional
        Largest relative difference of a score that counts as the same; default: 1e-6. Differences of bits are counted.
    progress : callable, optional
        Called with how many of how many runs are done, and ``note=`` the next.

    Returns
    -------
    simnav.leaderboard.submission.verifying.SubmissionReport

    Raises
    ------
    RequestError
        If the file is no bundle, was changed, or cannot be run here, as without a new environment.
    """
    from simnav.leaderboard.campaign.seal import read_seal
    from simnav.leaderboard.submission.verifying import TOLERANCE
    from simnav.leaderboard.submission.verifying import verify_bundle as verify

    return verify(
        absolute(bundle), read_seal(key), sample=sample, present=present,
        tolerance=TOLERANCE if tolerance is None else tolerance, progress=progress,
    )  # fmt: skip


def run_standard(
    *,
    minutes: float | None = 110.0,
    profile: str | os.PathLike[str] = "standard",
    results: str | os.PathLike[str] = "results/standard",
    shipped: str | os.PathLike[str] | None = None,
    workers: int = 2,
    force: Sequence[str] = (),
    shard: tuple[int, int] = (1, 1),
    progress: CampaignProgress = None,
) -> CampaignReport:
    """Run the missing and outdated parts of the standard result, for a limited time. The same call continues.

    A new folder starts with the results that come with simnav. So only rows and scenarios with a new version are run.
    Results are known by their declared versions: an edit without a new version runs nothing, but for ``force``.

    Parameters
    ----------
    minutes : float or None
        Time after which no further run is started; None for no end.
    profile : str or path
        Name of a profile, or the file of one.
    results : path
        Folder to work in.
    shipped : path, optional
        The results to start with; default: those that come with simnav.
    workers : int
        Processes.
    force, shard, progress : optional
        As for `simnav.leaderboard.interface.campaign`.

    Returns
    -------
    CampaignReport
        Its summary says how many runs are left.
    """
    from simnav.leaderboard import standard
    from simnav.leaderboard.profiles import load
    from simnav.leaderboard.ranking.ranking import rank
    from simnav.leaderboard.ranking.reports import CampaignReport
    from simnav.leaderboard.results import requested
    from simnav.leaderboard.standard.publication import begin, run

    folder = absolute(results)
    with mistakes(StoreError):
        begin(folder, standard.RESULTS if shipped is None else absolute(shipped))
        summary = run(
            load(profile), folder, workers=whole("workers", workers, 1), minutes=minutes, force=force, shard=shard,
            progress=progress,
        )  # fmt: skip
    found = results_of(folder)
    return CampaignReport(found, rank(found, requested=requested.read(folder)), summary)


def check_standard(results: str | os.PathLike[str] | None = None) -> Outdated:
    """Whether the standard result has the declared versions of today; nothing is run.

    Parameters
    ----------
    results : path, optional
        Folder of results; default: those that come with simnav.

    Returns
    -------
    simnav.leaderboard.standard.currency.Outdated

    Raises
    ------
    RequestError
        If there are no results.
    """
    from simnav.leaderboard.standard.currency import outdated

    folder = _standard_results(results)
    with mistakes(StoreError):
        return outdated(folder)


def _standard_results(given: str | os.PathLike[str] | None) -> Path:
    """The folder of a standard result that is there: what was given, or what comes with simnav."""
    from simnav.leaderboard import standard

    folder = standard.RESULTS if given is None else absolute(given)
    if not standard.shipped(folder):
        raise RequestError(f"there is no standard result in {folder}; 'simnav standard run' makes one")
    return folder


def audit_standard(
    *,
    sample: int = 20,
    results: str | os.PathLike[str] | None = None,
    progress: Callable[..., None] | None = None,
) -> Audit:
    """Repeat a random sample of the standard result with the code of today, and compare the scores.

    Declared versions alone say which results are up to date. The audit tests whether they are.

    Parameters
    ----------
    sample : int
        How many results are repeated. The audit says which share of wrong results such a sample would find.
    results : path, optional
        Folder of results; default: those that come with simnav.
    progress : callable, optional
        Called with how many of how many runs are done, and ``note=`` the next.

    Returns
    -------
    simnav.leaderboard.standard.auditing.Audit

    Raises
    ------
    RequestError
        If ``sample`` is below 1, or there are no results.
    """
    from simnav.leaderboard.standard.auditing import audit

    folder = _standard_results(results)
    with mistakes(StoreError):
        return audit(folder, whole("sample", sample, 1), progress)


def publish_standard(
    *,
    results: str | os.PathLike[str] = "results/standard",
    profile: str | os.PathLike[str] = "standard",
    shipped: str | os.PathLike[str] | None = None,
    history: str | os.PathLike[str] | None = None,
    readme: str | os.PathLike[str] | None = None,
    site: str | os.PathLike[str] | None = None,
    workers: int = 2,
    preliminary: bool = False,
    progress: Callable[..., None] | None = None,
) -> Published:
    """Make what comes with simnav from the results of `run_standard`: packed results, history, README, and a site.

    Results that the profile does not name, as those of submissions, are published as long as they are not out of date.

    Parameters
    ----------
    results : path
        Folder of the results, which may be the one that is written. If it is not there, the results that come with
        simnav are taken.
    profile : str or path
        Profile that the results should contain completely.
    shipped, history : path, optional
        Folder of the packed results, and file of the editions; default: those that come with simnav.
    readme : path, optional
        Whose tables are written, between the marks of `simnav.leaderboard.standard.readme`; default: none.
    site : path, optional
        Folder of a site that is drawn; default: none.
    workers : int
        Number of processes that draw the charts.
    preliminary : bool
        Also if runs are missing. The tables then say how many are there, and there is no edition.
    progress : callable, optional
        Called with how many of how many pages are done.

    Raises
    ------
    RequestError
        If runs are missing or out of date; then nothing is written.
    """
    from simnav.leaderboard import standard
    from simnav.leaderboard.papers.page import find
    from simnav.leaderboard.profiles import load
    from simnav.leaderboard.site.site import build
    from simnav.leaderboard.standard.editions import pages_of
    from simnav.leaderboard.standard.history import read
    from simnav.leaderboard.standard.publication import publish

    folder = standard.RESULTS if shipped is None else absolute(shipped)
    file = standard.HISTORY if history is None else absolute(history)
    working = absolute(results)
    if not working.exists():
        working = folder
    with mistakes(StoreError):
        made = publish(
            working, load(profile), folder, file, None if readme is None else absolute(readme), preliminary=preliminary
        )
    if site is not None:
        published = {(r.scenario, r.estimator, r.seed) for r in made.results}
        found = [r for r in results_of(working, series=True) if (r.scenario, r.estimator, r.seed) in published]
        build(found, made.ranking, absolute(site), progress=progress, workers=workers, papers=find(Path("reproduced")),
              editions=pages_of(read(file)))  # fmt: skip
    return made
