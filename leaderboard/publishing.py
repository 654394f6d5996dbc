"""Calls for published results: sites, submissions, and the standard result that comes with simnav.

`simnav.leaderboard.running` and `simnav.leaderboard.inspection` have the calls that compute and compare.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.request import EstimatorRequest, file_of
from simnav.leaderboard.results.errors import RequestError, StoreError, mistakes
from simnav.leaderboard.results.scratch import scratch

from .arguments import absolute, results_of, split_names
from .calls import call, whole_number
from .inspection import rank
from .publishing_requests import (
    AuditRequest,
    CheckStandardRequest,
    DrawRequest,
    PublishRequest,
    SiteRequest,
    StandardRequest,
    SubmitRequest,
    VerifyBundleRequest,
)
from .running import campaign, sweep

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.reports import CampaignReport, StandardReport
    from simnav.leaderboard.site.report import SiteReport
    from simnav.leaderboard.standard.auditing import Audit
    from simnav.leaderboard.standard.drawing import Drawing
    from simnav.leaderboard.standard.outdated_results import Outdated
    from simnav.leaderboard.standard.publication import Published
    from simnav.leaderboard.submission.bundle import Row
    from simnav.leaderboard.submission.verifying import SubmissionReport

__all__ = [
    "Submission",
    "audit_standard",
    "check_standard",
    "draw_standard",
    "publish_standard",
    "run_standard",
    "site",
    "standard",
    "submit",
    "verify_bundle",
]


@call(SiteRequest)
def site(request: SiteRequest) -> SiteReport:
    """Rank the results of a campaign, and write the site.

    Returns
    -------
    SiteReport

    Raises
    ------
    RequestError
        If there are no results, or the site cannot be written.
    """
    from simnav.leaderboard.papers.page import pages_in
    from simnav.leaderboard.ranking.agreement import rank_correlations
    from simnav.leaderboard.ranking.ranking import rank_tracks
    from simnav.leaderboard.ranking.track_runs import runs_of_tracks
    from simnav.leaderboard.ranking.trouble_profile import profiles_of
    from simnav.leaderboard.results.web_addresses import linked_from
    from simnav.leaderboard.site.report import SiteReport
    from simnav.leaderboard.site.site import build
    from simnav.leaderboard.standard.backgrounds import stored_backgrounds
    from simnav.leaderboard.standard.drawn import attached, stored_sweeps

    from .results import requested, scenario_files
    from .site import sweeps as swept

    shown, processes = whole_number("runs_shown", request.runs_shown, 1), whole_number("workers", request.workers, 1)
    found, seeds = attached(results_of(request.results, series=True))
    tracks = list(runs_of_tracks(found, tracks=scenario_files.tracks(request.results)))
    ranking = rank_tracks(tracks, requested.read(request.results), processes)
    correlations = () if request.against is None else tuple(rank_correlations(ranking, rank(request.against)))
    output = absolute(request.output)
    by_trouble = profiles_of(tracks, processes)
    index = build(
        found, ranking, output, home=linked_from(output, request.docs), progress=request.progress, workers=processes,
        papers=pages_in(Path(request.papers)), runs_shown=shown, figures=request.figures, seeds=seeds,
        sweeps=[*swept.sweeps_in(Path(request.sweeps)), *stored_sweeps(found)], tracks=tracks,
        backgrounds=stored_backgrounds(found),
    )  # fmt: skip
    return SiteReport(index, found, ranking, correlations, by_trouble)


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
        """The fields as values that JSON can hold."""
        return {**vars(self), "path": str(self.path)}


@call(SubmitRequest)
def submit(request: SubmitRequest) -> Submission:
    """Run an estimator on a profile, and write its source and results as a bundle.

    Returns
    -------
    Submission

    Raises
    ------
    RequestError
        If there is no such estimator or profile, the estimator cannot be passed on, or runs are left after ``minutes``.
    """
    from simnav.leaderboard.campaign.confinement.attempt import chosen_confinement
    from simnav.leaderboard.results.packing import pack
    from simnav.leaderboard.results.provenance import BENCHMARK
    from simnav.leaderboard.submission.bundle import SUFFIX, write_bundle
    from simnav.leaderboard.submission.source import source_of
    from simnav.leaderboard.submission.verifying import runs_of

    from .profiles import read_profile

    name = read_profile(request.profile).name
    with mistakes(ValueError):
        confinement = chosen_confinement("auto")
    with scratch("submit") as home:
        source = source_of(str(request.estimator), dict(request.parameters or {}), home, tuple(request.requires))
        folder = absolute(request.results or Path("results") / f"submit-{source.title}")
        target = absolute(request.output or f"{source.title}{SUFFIX}")
        if not target.parent.is_dir():
            raise RequestError(f"{target.parent} is no folder")
        report = campaign(
            estimators=list(source.requests), output=folder, profile=request.profile, workers=request.workers,
            minutes=request.minutes, confinement=confinement, oracle=False, by_version=True, progress=request.progress,
        )  # fmt: skip
        if report.summary.left:
            raise RequestError(
                f"{report.summary.left} of {report.summary.total} runs are left after {request.minutes:g} minutes; the "
                "same command continues"
            )
        runs = runs_of(str(request.profile))
        with mistakes(StoreError):  # the folder may also have the runs of another profile
            found = pack(folder, home / "results", [r.label for r in source.requests], runs)
        ran = {r.scenario for r in found}
        runs = {s: n for s, n in runs.items() if s in ran}
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


@call(VerifyBundleRequest)
def verify_bundle(request: VerifyBundleRequest) -> SubmissionReport:
    """Check a submission, and repeat a sample of its runs in confined processes.

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
        absolute(request.bundle), read_seal(request.key), sample=request.sample, present=request.present,
        tolerance=TOLERANCE if request.tolerance is None else request.tolerance, progress=request.progress,
    )  # fmt: skip


def standard() -> StandardReport:
    """The result that comes with simnav, with its ranking: ``simnav.standard().to_frame()``.

    Returns
    -------
    StandardReport

    Raises
    ------
    RequestError
        If this version of simnav comes without one.
    """
    from simnav.leaderboard.ranking.ranking import rank
    from simnav.leaderboard.ranking.reports import StandardReport

    from .results import requested

    folder = _standard_results(None)
    found = results_of(folder)
    return StandardReport(found, rank(found, requested=requested.read(folder)))


@call(StandardRequest)
def run_standard(request: StandardRequest) -> CampaignReport:
    """Run the missing and outdated parts of the standard result, for a limited time. The same call continues.

    Returns
    -------
    CampaignReport
        Its summary says how many runs are left.
    """
    from simnav.leaderboard.ranking.ranking import rank
    from simnav.leaderboard.ranking.reports import CampaignReport
    from simnav.leaderboard.standard.publication import begin, run

    from . import standard
    from .profiles import read_profile
    from .results import requested

    folder = absolute(request.results)
    with mistakes(StoreError):
        begin(folder, standard.RESULTS if request.shipped is None else absolute(request.shipped))
        summary = run(
            read_profile(request.profile), folder, workers=whole_number("workers", request.workers, 1),
            minutes=request.minutes, force=split_names(request.force), shard=request.shard, progress=request.progress,
        )  # fmt: skip
    found = results_of(folder)
    return CampaignReport(found, rank(found, requested=requested.read(folder)), summary)


@call(DrawRequest)
def draw_standard(request: DrawRequest) -> Drawing:
    """Run what the site of the standard result draws beside scores, and keep it where it comes with simnav.

    Returns
    -------
    simnav.leaderboard.standard.drawing.Drawing
        What was kept, and how many runs are left.

    Raises
    ------
    RequestError
        If a folder holds something else.
    """
    from .standard import drawn
    from .standard.drawing import draw

    profile = drawn.PROFILE if request.profile is None else absolute(request.profile)
    folder = drawn.DRAWN if request.shipped is None else absolute(request.shipped)
    with mistakes(StoreError):
        return draw(
            profile, absolute(request.results), absolute(request.standard), folder, sweep=sweep,
            minutes=request.minutes, workers=whole_number("workers", request.workers, 1), progress=request.progress,
        )  # fmt: skip


@call(CheckStandardRequest)
def check_standard(request: CheckStandardRequest) -> Outdated:
    """Whether the standard result has the declared versions of today; nothing is run.

    Returns
    -------
    simnav.leaderboard.standard.outdated_results.Outdated

    Raises
    ------
    RequestError
        If there are no results.
    """
    from simnav.leaderboard.standard.outdated_results import outdated

    folder = _standard_results(request.results)
    with mistakes(StoreError):
        return outdated(folder)


def _standard_results(given: str | os.PathLike[str] | None) -> Path:
    """The folder of a standard result that is there: what was given, or what comes with simnav."""
    from . import standard

    folder = standard.RESULTS if given is None else absolute(given)
    if not standard.shipped(folder):
        raise RequestError(f"there is no standard result in {folder}; 'simnav standard run' makes one")
    return folder


@call(AuditRequest)
def audit_standard(request: AuditRequest) -> Audit:
    """Repeat a random sample of the standard result with the code of today, and compare the scores.

    Returns
    -------
    simnav.leaderboard.standard.auditing.Audit

    Raises
    ------
    RequestError
        If ``sample`` is below 1, or there are no results.
    """
    from simnav.leaderboard.standard.auditing import audit

    folder = _standard_results(request.results)
    with mistakes(StoreError):
        return audit(folder, whole_number("sample", request.sample, 1), request.progress)


@call(PublishRequest)
def publish_standard(request: PublishRequest) -> Published:
    """Make what comes with simnav from the results of `run_standard`: packed results, history, README, and a site.

    Raises
    ------
    RequestError
        If runs are missing or out of date; then nothing is written.
    """
    from simnav.leaderboard.papers.page import pages_in
    from simnav.leaderboard.results.web_addresses import linked_from
    from simnav.leaderboard.site.site import build
    from simnav.leaderboard.standard.backgrounds import stored_backgrounds
    from simnav.leaderboard.standard.drawn import attached, stored_sweeps
    from simnav.leaderboard.standard.editions import pages_of
    from simnav.leaderboard.standard.history import read
    from simnav.leaderboard.standard.publication import publish

    from . import standard
    from .profiles import read_profile

    folder = standard.RESULTS if request.shipped is None else absolute(request.shipped)
    file = standard.HISTORY if request.history is None else absolute(request.history)
    working = absolute(request.results)
    if not working.exists():
        working = folder
    with mistakes(StoreError):
        made = publish(
            working,
            read_profile(request.profile),
            folder,
            file,
            None if request.readme is None else absolute(request.readme),
            preliminary=request.preliminary,
            workers=request.workers,
        )
    if request.site is not None:
        # As everybody makes it of the packed results: with the series that come with simnav, and no others.
        found, seeds = attached([replace(r, series={}) for r in made.results])
        output = absolute(request.site)
        build(found, made.ranking, output, home=linked_from(output), progress=request.progress, workers=request.workers,
              papers=pages_in(Path("reproduced")), editions=pages_of(read(file)), seeds=seeds,
              sweeps=stored_sweeps(found), tracks=made.tracks, backgrounds=stored_backgrounds(found))  # fmt: skip
    return made
