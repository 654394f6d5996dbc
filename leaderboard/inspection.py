"""Calls that run no estimator of the user: rankings, bounds, scores, seals, citations, the papers' comparisons.

`simnav.leaderboard.interface` has these calls, too.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.request import requests
from simnav.leaderboard.results.errors import RequestError, StoreError, mistakes
from simnav.leaderboard.results.scratch import scratch

from .arguments import absolute, results_of, scenario_of, scenarios_of
from .calls import call, finite_number, require_unused, whole_number
from .error_requests import AllanRequest, RealismRequest
from .requests import (
    BoundRequest,
    CiteRequest,
    MergeRequest,
    RankRequest,
    ReproduceRequest,
    RescoreRequest,
    SealRequest,
    VerifyRequest,
)
from .results import requested, scenario_files

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.rescoring import Rescored
    from simnav.leaderboard.campaign.seal import Seal
    from simnav.leaderboard.campaign.verification import Verification
    from simnav.leaderboard.papers.reproduction import Reproduction
    from simnav.leaderboard.ranking.board import Ranking
    from simnav.leaderboard.ranking.bounds import BoundReport
    from simnav.leaderboard.results.citation import Citation
    from simnav.leaderboard.results.result import Result

    from .allan import AllanReport
    from .realism.report import RealismReport

__all__ = ["allan", "bound", "cite", "merge", "rank", "realism", "reproduce", "rescore", "seal", "verify"]


@call(RankRequest)
def rank(request: RankRequest) -> Ranking:
    """Rank estimators by their results.

    Returns
    -------
    simnav.leaderboard.ranking.board.Ranking

    Raises
    ------
    RequestError
        If the score is unknown or not better when lower, or no result has it.
    """
    from simnav.leaderboard.ranking.ranking import RANKED_SCORES, rank, require_lower, require_score
    from simnav.leaderboard.results.result import Result

    if request.score is not None:
        require_lower(request.score, "a ranking is by errors")
    wanted = RANKED_SCORES | ({request.score} if request.score else set())
    asked: Mapping[str, Sequence[int]] = {}
    results, tracks = request.results, dict(request.tracks or {})
    if results is None or isinstance(results, (str, os.PathLike)):
        given = results_of(results, scores=wanted)
        asked = requested.read(results)
        tracks = {**scenario_files.tracks(results), **tracks}
    else:
        given = list(results)
    if not all(isinstance(r, Result) for r in given):
        raise RequestError("a folder of results is wanted, or results; 'simnav.merge' puts several folders together")
    require_score(request.score, given)
    return rank(given, score=request.score, tracks=tracks, requested=asked)


@call(RescoreRequest)
def rescore(request: RescoreRequest) -> Rescored:
    """Compute scores from the trials that a campaign kept; no estimator runs.

    Returns
    -------
    Rescored
    """
    from simnav.leaderboard.campaign.rescoring import rescore_results
    from simnav.leaderboard.campaign.seal import read_seal

    names = request.scores.split(",") if isinstance(request.scores, str) else [str(s) for s in request.scores]
    given = [] if request.scenarios is None else scenarios_of(request.scenarios)
    with mistakes(StoreError):
        return rescore_results(
            absolute(request.results), [n.strip() for n in names if n.strip()], given, request.progress,
            seal=read_seal(request.key, secret=False),
        )  # fmt: skip


@call(MergeRequest)
def merge(request: MergeRequest) -> list[Result]:
    """Put the results of several folders into one, e.g. of the shards of a campaign.

    Returns
    -------
    list of Result
        All results in the output folder.

    Raises
    ------
    RequestError
        If the folders belong to different versions of the benchmark, or if a scenario, the simulator or an estimator
        differs between them. Then the output is as it was.
    """
    from simnav.leaderboard.results.gathering import gather
    from simnav.leaderboard.submission.bundle import open_bundle

    with scratch("merge") as home, mistakes(StoreError):
        given = request.folders
        paths = [absolute(folder) for folder in ([given] if isinstance(given, (str, os.PathLike)) else given)]
        if not paths:
            raise RequestError("no folder was named whose results should be merged")
        places = [open_bundle(path, home / str(k)).results if path.is_file() else path for k, path in enumerate(paths)]
        for path, place in zip(paths, places, strict=True):
            if path.is_file():  # how many seeds a submission asked says nothing of the campaigns of a board
                (place / requested.FILE).unlink(missing_ok=True)
        target = gather(absolute(request.output), places)
    return results_of(target)


@call(SealRequest)
def seal(request: SealRequest) -> Seal:
    """Make or check the key of sealed seeds, for the commitment that is published before a campaign.

    Returns
    -------
    simnav.leaderboard.campaign.seal.Seal
        Its ``commitment`` is to be published before the campaign. Its ``hash`` stands in the results: the same without
        a public value.

    Raises
    ------
    RequestError
        If the key is no secret, or has another public value already.
    """
    from simnav.leaderboard.campaign.seal import make_key, mix_public, read_seal

    file = absolute(request.key)
    made = read_seal(file) if file.exists() else make_key(file)
    return mix_public(file, request.public) if request.public else made


@call(CiteRequest)
def cite(request: CiteRequest) -> Citation:
    """How to cite this version of simnav, or results.

    Returns
    -------
    Citation

    Examples
    --------
    >>> print(cite().bibtex.splitlines()[0])
    @software{simnav,
    """
    from simnav.leaderboard.results.citation import citation

    found = None if request.results is None else [r.provenance for r in results_of(request.results) if r.tried]
    return citation(found, request.author)


@call(BoundRequest)
def bound(request: BoundRequest) -> BoundReport:
    """The posterior Cramer-Rao bound of a simulated scenario: a lower limit of the error.

    Returns
    -------
    BoundReport
    """
    from simnav.leaderboard.ranking.bounds import bounds_of

    return bounds_of(
        scenario_of(request.scenario), whole_number("runs", request.runs, 1), request.smoothed, request.progress
    )


@call(AllanRequest)
def allan(request: AllanRequest) -> AllanReport:
    """The Allan deviation of an IMU and its noise coefficients, beside its datasheet.

    Returns
    -------
    simnav.leaderboard.allan.AllanReport

    Raises
    ------
    RequestError
        If there is no IMU, or there are too few samples.
    """
    from .allan import allan_of_file, allan_of_scenario

    seed, start = whole_number("seed", request.seed, 0), finite_number("start", request.start)
    end = None if request.end is None else finite_number("end", request.end)
    given = request.scenario
    with mistakes():
        if isinstance(given, (str, Path)) and str(given).endswith(".npz"):
            return allan_of_file(absolute(given), start, end)
        scenario = scenario_of(given)
        return allan_of_scenario(scenario, seed, finite_number("duration", request.duration), start, end)


@call(RealismRequest)
def realism(request: RealismRequest) -> RealismReport:
    """Compare the errors of simulated instruments with those of a recording.

    Returns
    -------
    simnav.leaderboard.realism.report.RealismReport

    Raises
    ------
    RequestError
        If scikit-learn is not installed, the log is absent, or there is no instrument that both have.
    """
    from .realism.report import realism_of

    runs, seed = whole_number("runs", request.runs, 3), whole_number("seed", request.seed, 0)
    given = request.instrument
    names = given.split(",") if isinstance(given, str) else [n for part in given or () for n in part.split(",")]
    with mistakes():
        return realism_of(scenario_of(request.scenario), scenario_of(request.log), names, runs, seed)


@call(VerifyRequest)
def verify(request: VerifyRequest) -> Verification:
    """Check the seal of results, and repeat a sample of them, which should be equal bit for bit.

    Returns
    -------
    Verification
    """
    from simnav.leaderboard.campaign.seal import read_seal
    from simnav.leaderboard.campaign.verification import verify_results

    given = [] if request.scenarios is None else scenarios_of(request.scenarios)
    with mistakes(StoreError):
        return verify_results(
            absolute(request.results), read_seal(request.key, secret=False), scenarios=given,
            sample=None if request.sample is None else whole_number("sample", request.sample, 1),
            estimators=requests(request.estimators) if request.estimators else [],
            rows=[request.rows] if isinstance(request.rows, str) else list(request.rows), progress=request.progress,
        )  # fmt: skip


@call(ReproduceRequest)
def reproduce(request: ReproduceRequest) -> Reproduction:
    """Repeat the comparison of a paper: our figures beside the paper's, with a verdict on each row.

    Returns
    -------
    Reproduction

    Raises
    ------
    RequestError
        If there is no such paper or method, or options contradict each other; one sentence.
    """
    from simnav.leaderboard.papers.reproduction import reproduce

    from .papers import PAPERS, key_of, reading, sequential
    from .papers import stored as shipped

    if request.holds_if and (request.methods or request.until_decided or request.stored):
        raise RequestError("'holds_if' is about all claims of a paper: 'methods', 'until_decided' and 'stored' do not "
                           "go with it")  # fmt: skip
    if request.stored and (request.until_decided or request.runs is not None):
        raise RequestError("stored results have a fixed number of runs: 'runs' and 'until_decided' do not go with them")
    if request.until_decided and request.runs is not None:
        raise RequestError("'until_decided' chooses the number of runs itself: give 'limit' in place of 'runs'")
    if not request.until_decided:
        require_unused(request, ["limit", "minutes"], "they belong to 'until_decided'")
    if request.stored:
        require_unused(request, ["workers"], "stored results are shown, and nothing is run")
    with mistakes(ValueError):
        chosen = reading.paper_of(str(request.paper))
        if request.methods:
            names = request.methods.split(",") if isinstance(request.methods, str) else request.methods
            chosen = chosen.only([name.strip() for name in names])
        if request.stored:
            return shipped.shipped_reproduction(chosen)
    workers, limit = whole_number("workers", request.workers, 1), whole_number("limit", request.limit, 1)
    folder = absolute(request.output or Path("reproduced") / chosen.key) / "results"
    if request.holds_if:
        from .papers.claims.declared import claims_of
        from .papers.claims.search import search

        count = 6 if request.runs is None else whole_number("runs", request.runs, 1)
        with mistakes(ValueError, StoreError):
            claims = claims_of(str(request.paper))
            if not claims:
                raise RequestError(f"{request.paper} has no claim: a table [[claim]] declares one")
            if key_of(str(request.paper)) in PAPERS:
                tables = shipped.shipped_reproduction(chosen)
            else:  # nothing of it comes with simnav
                tables = reproduce(chosen, chosen.runs, folder, workers=workers, progress=request.progress)
            answers = [
                search(claim, claim.dials, folder.with_name("claims"), runs=count, judged=2 * count, workers=workers,
                       progress=request.progress)
                for claim in claims
            ]  # fmt: skip
        return replace(tables, answers=answers)
    with mistakes(StoreError):
        if request.until_decided:
            return sequential.decide(
                chosen, folder, limit=limit, minutes=request.minutes, workers=workers, progress=request.progress
            )
        count = chosen.runs if request.runs is None else whole_number("runs", request.runs, 1)
        return reproduce(chosen, count, folder, workers=workers, progress=request.progress)
