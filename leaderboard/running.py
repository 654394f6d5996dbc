"""Calls that run estimators: once, on many seeds, against a dial, and for a search of parameters."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.estimator.looking_back import LAGS, lags_of
from simnav.leaderboard.campaign.options import RunOptions, shared
from simnav.leaderboard.campaign.request import EstimatorLike, EstimatorRequest, Estimators, requests, together
from simnav.leaderboard.campaign.request import request as one_request
from simnav.leaderboard.campaign.suitability import require_suitable, suited, with_long_windows
from simnav.leaderboard.results.errors import RequestError, StoreError, mistakes
from simnav.leaderboard.results.scratch import scratch

from .arguments import absolute, require_folder, results_of, scenario_of, scenarios_of, seeds_of, split_names
from .baselines import baselines_or
from .calls import call, whole_number
from .estimator_output import first_lines
from .requests import (
    CampaignRequest,
    EvaluateRequest,
    RecordRequest,
    RobustnessRequest,
    RunRequest,
    Scenarios,
    SweepRequest,
    TuneRequest,
)

if TYPE_CHECKING:
    from simnav.estimator import Estimator
    from simnav.leaderboard.campaign.campaign import Summary
    from simnav.leaderboard.campaign.seal import Seal
    from simnav.leaderboard.ranking.reports import CampaignReport, EvaluationReport
    from simnav.leaderboard.sweep.datasheets import Robustness
    from simnav.leaderboard.sweep.report import Sweep
    from simnav.leaderboard.tuning.tuning import Tuning
    from simnav.recording import Recording
    from simnav.scenario import Scenario
    from simnav.testing.contract_check import Report

    from .single_run import RunReport

__all__ = ["campaign", "check", "evaluate", "make", "record", "robustness", "run", "sweep", "tune"]


def make(estimator: EstimatorLike, **parameters: Any) -> Estimator:
    """Make an estimator.

    Parameters
    ----------
    estimator : str, Path, type or pair
        Name, file or class, also with parameters.
    **parameters
        Parameters of its constructor; texts are converted as on the command line.

    Raises
    ------
    ValueError
        If the estimator or a parameter is unknown, or a value is not valid: one sentence.

    Examples
    --------
    >>> make("gnss-only").name
    'gnss-only'
    """
    with mistakes():
        return one_request(estimator, parameters).make()


@call(RecordRequest)
def record(request: RecordRequest) -> Recording:
    """Record a run.

    Raises
    ------
    ValueError
        If there is no such scenario, or its log is absent or cannot be used.

    Examples
    --------
    >>> len(record("harbour-multipath", seed=1).data.truth) > 100
    True
    """
    from simnav.source import record

    with mistakes(ValueError, FileNotFoundError):
        return record(scenario_of(request.scenario), whole_number("seed", request.seed))


def check(estimator: EstimatorLike, **parameters: Any) -> Report:
    """Test an estimator against the contract: causality, shapes, units, determinism, missing instruments.

    Parameters
    ----------
    estimator, **parameters
        The estimator and its parameters, as for `make`.

    Returns
    -------
    simnav.testing.contract_check.Report
        It calls the estimator as all tables do (`EstimatorRequest.label`).

    Raises
    ------
    ValueError
        If there is no such estimator, or it cannot be constructed.
    """
    from simnav.testing.contract_check import check

    asked = one_request(estimator, parameters)
    with mistakes(ValueError), first_lines(asked.label):
        return replace(check(asked.make), estimator=asked.label)


@call(RunRequest)
def run(request: RunRequest) -> RunReport:
    """Run estimators once.

    Returns
    -------
    RunReport
        The recording, all trials and their scores.
    """
    from .single_run import run_once

    chosen, seed = scenario_of(request.scenario), whole_number("seed", request.seed)
    asked = baselines_or(request.estimators, [chosen], request.parameters)
    if request.lags is not None:
        with mistakes():
            lags = "/".join(f"{lag:g}" for lag in lags_of(request.lags))
        asked = requests([one_request(r, {LAGS: lags}) for r in asked])
        if request.estimators is None:
            asked = with_long_windows(chosen, asked)
        else:
            require_suitable(chosen, asked, lags_only=True)
    return run_once(chosen, asked, seed, request.progress)


@call(EvaluateRequest)
def evaluate(request: EvaluateRequest) -> EvaluationReport:
    """Compare estimators with the baselines.

    A scenario on which none of the estimators can run is left out.

    Returns
    -------
    EvaluationReport
        The place of each estimator, and its differences from the baselines.

    Raises
    ------
    RequestError
        If one of the estimators can run on no scenario: before anything is run.
    """
    from simnav.leaderboard.ranking.ranking import rank
    from simnav.leaderboard.ranking.reports import EvaluationReport
    from simnav.leaderboard.ranking.runs import group
    from simnav.leaderboard.ranking.standing import standing

    if not request.estimators:
        raise RequestError("no estimator was asked for; name those that should be evaluated")
    mine = requests(request.estimators, request.parameters)
    seeds = seeds_of(request.seed, request.runs)
    chosen, left_out = suited(scenarios_of(request.scenarios), mine)
    everyone = together([*mine, *baselines_or(request.against, chosen)])
    with _folder(request.results) as folder:
        _run(request, chosen, everyone, seeds, folder)
        found = results_of(folder)
    wanted, known = {s.id for s in chosen}, {r.label for r in everyone}
    found = [r for r in found if r.scenario in wanted and r.estimator in known and r.seed in seeds]
    by_scenario = group(found)
    return EvaluationReport(
        found,
        rank(found, tracks={s.id: s.track for s in chosen}),
        tuple(r.label for r in mine),
        tuple(s.id for s in chosen),
        seeds,
        tuple(standing(by, r.label, s) for r in mine for s, by in by_scenario.items()),
        None if request.results is None else folder,
        left_out,
    )


@call(CampaignRequest)
def campaign(request: CampaignRequest) -> CampaignReport:
    """Run a campaign.

    Returns
    -------
    CampaignReport
        A summary of all results in the folder.
    """
    from simnav.leaderboard.campaign.campaign import combined, require_known
    from simnav.leaderboard.campaign.external import add_external, external_files
    from simnav.leaderboard.campaign.oracles import beside_oracles
    from simnav.leaderboard.campaign.seal import read_seal
    from simnav.leaderboard.ranking.ranking import rank
    from simnav.leaderboard.ranking.reports import CampaignReport

    from .results import requested

    parts = _parts(request)
    folder, summaries, seal = absolute(request.output), [], read_seal(request.sealed)
    tracks: dict[str, str] = {}
    end = None if request.minutes is None else time.monotonic() + 60.0 * request.minutes
    asked = [requests(estimators, request.parameters) for _, estimators, _ in parts]
    request = replace(request, force=split_names(request.force))
    require_known(request.force, asked)
    for (scenarios, _, runs), everyone in zip(parts, asked, strict=True):
        chosen = scenarios_of(scenarios, optional=request.profile is not None)
        tracks |= {s.id: s.track for s in chosen}
        seeds = seeds_of(request.seed, runs)
        if request.external is not None:  # what is missing is said before hours of runs
            external_files(absolute(request.external), chosen, seeds)
        for some, beside in beside_oracles(chosen, everyone) if request.oracle else [(chosen, everyone)]:
            left = None if end is None else max(0.0, (end - time.monotonic()) / 60.0)
            summaries.append(_run(request, some, beside, seeds, folder, seal=seal, minutes=left))
        if request.external is not None:
            add_external(folder, absolute(request.external), chosen, seeds, seal)
    if (
        request.profile is not None
        and request.runs is None
        and request.shard == (1, 1)
        and not any(s.left for s in summaries)
    ):
        summaries += _further(request, asked, folder, seal, end)
    results = results_of(folder)
    ranking = rank(results, tracks=tracks, requested=requested.read(folder))
    return CampaignReport(results, ranking, combined(summaries))


def _further(
    request: CampaignRequest, asked: Sequence[Sequence[EstimatorRequest]], folder: Path, seal: Seal, end: float | None
) -> list[Summary]:
    """More seeds for the rows that may be the best, in the parts of a profile that ask for them."""
    from simnav.leaderboard.campaign.oracles import beside_oracles
    from simnav.leaderboard.ranking.further import run_further

    from .profiles import read_profile

    found: list[Summary] = []
    assert request.profile is not None
    for part, mine in zip(read_profile(request.profile).parts, asked, strict=True):
        if not part.more:
            continue
        chosen = scenarios_of(part.scenarios if request.scenarios is None else request.scenarios, optional=True)
        beside = [e for _, some in beside_oracles(chosen, mine) for e in some] if request.oracle else mine
        rows = {e.label: e for e in beside}

        def further(
            scenario: Scenario,
            names: Collection[str],
            runs: int,
            minutes: float | None,
            rows: Mapping[str, EstimatorRequest] = rows,
        ) -> Summary:
            return _run(request, [scenario], [rows[name] for name in names], seeds_of(request.seed, runs), folder,
                        seal=seal, minutes=minutes, force=(), later=True)  # fmt: skip

        found += run_further(folder, chosen, rows, further, end, most=part.more)
    return found


def _parts(request: CampaignRequest) -> list[tuple[Scenarios, Estimators, int]]:
    """Scenarios, estimators and number of runs of each part of a profile; what was asked for replaces them."""
    from simnav.leaderboard.campaign.campaign import RUNS

    from .profiles import read_profile

    scenarios, estimators, runs = request.scenarios, request.estimators, request.runs
    if request.profile is None:
        return [(scenarios, estimators, RUNS if runs is None else runs)]
    return [
        (
            p.scenarios if scenarios is None else scenarios,
            p.estimators if estimators is None else estimators,
            p.runs if runs is None else runs,
        )
        for p in read_profile(request.profile).parts
    ]


@call(SweepRequest)
def sweep(request: SweepRequest) -> Sweep:
    """Vary dials.

    Returns
    -------
    Sweep
        Errors at all values, and the breaking points.
    """
    from simnav.leaderboard.site.sweeps import write
    from simnav.leaderboard.sweep.report import Sweep
    from simnav.leaderboard.sweep.settings import checked_score, chosen_dials, parse_dials, settings

    if not request.estimators:
        raise RequestError("no estimator was asked for; name those whose error should be seen against the dial")
    chosen, mine = scenario_of(request.scenario), requests(request.estimators, request.parameters)
    checked_score(request.score, request.limit)
    require_suitable(chosen, mine)
    turned = chosen_dials(chosen, parse_dials(request.dials))
    found, seeds = settings(chosen, turned), seeds_of(request.seed, request.runs)
    folder = absolute(request.output or Path("results") / f"sweep-{chosen.name}")
    summary = _run(request, [s.scenario for s in found], mine, seeds, folder)
    ids, labels = {s.scenario.id for s in found}, tuple(r.label for r in mine)
    results = [r for r in results_of(folder) if r.scenario in ids and r.estimator in labels and r.seed in seeds]
    made = Sweep(chosen.id, tuple(d for d, _ in turned), tuple(tuple(v) for _, v in turned), labels, request.score,
                 request.limit, results, tuple(found), summary)  # fmt: skip
    write(made)
    return made


@call(RobustnessRequest)
def robustness(request: RobustnessRequest) -> Robustness:
    """Compare with the plain row under wrong datasheets.

    Returns
    -------
    Robustness
        A profile of each estimator and plain row.

    Raises
    ------
    RequestError
        If an estimator is unknown, a factor makes no sense, or the file cannot be written.
    """
    from simnav.estimator import describe, find, names
    from simnav.leaderboard.campaign.request import comes_with_simnav
    from simnav.leaderboard.ranking.plain_row import plain_rows
    from simnav.leaderboard.ranking.stored_robustness import save
    from simnav.leaderboard.results.provenance import here
    from simnav.leaderboard.sweep.datasheets import SCORE, Robustness, bases, checked_factors, profiles, settings

    asked, output = request.estimators, request.output
    if asked is None:
        own = (describe(name) for name in names() if comes_with_simnav(find(name)))
        asked = [d.name for d in own if not d.slow and not d.reference]
    if output is not None:
        require_folder(f"output = {os.fspath(output)!r}", absolute(output))
    factors, seeds = checked_factors(request.factors), seeds_of(request.seed, request.runs)
    mine = requests(asked, request.parameters)
    everyone = together([*mine, *requests(list(plain_rows(SCORE)))])
    found = [s for table in bases() for s in settings(table, factors)]
    measured, folder = here(), absolute(request.folder)  # before, for the code may be edited meanwhile
    summary = _run(request, [s.scenario for s in found], everyone, seeds, folder)
    ids, known = {s.scenario.id for s in found}, {r.label for r in everyone}
    results = [r for r in results_of(folder) if r.scenario in ids and r.estimator in known and r.seed in seeds]
    rows = profiles(found, results, [r.label for r in mine])
    unsuitable = tuple(r.label for r in mine if r.label not in {row.estimator for row in rows})
    if output is None:
        return Robustness(tuple(rows), unsuitable, summary)
    with mistakes(OSError):
        return Robustness(tuple(rows), unsuitable, summary, str(save(rows, absolute(output), measured)))


@call(TuneRequest)
def tune(request: TuneRequest) -> Tuning:
    """Choose parameters.

    Returns
    -------
    Tuning
        The chosen values, and the objective before and after, on the voyages of the search and on unseen ones.

    Raises
    ------
    RequestError
        If a scenario is not for training, or a parameter cannot be varied.
    """
    from simnav.leaderboard.tuning.space import what_to_vary
    from simnav.leaderboard.tuning.tuning import TUNED, ranges_of, read, tune_row

    estimator, vary = one_request(request.estimator), request.vary
    with mistakes():
        estimator.make()
    chosen = scenarios_of(request.families)
    if vary is None:
        path = TUNED / f"{estimator.name}.json"
        if not path.is_file():
            raise RequestError(what_to_vary(estimator))
        vary = ranges_of(read(path))
    ranges = [text for text in vary.split(",") if text.strip()] if isinstance(vary, str) else list(vary)
    return tune_row(
        estimator, chosen, ranges, runs=whole_number("runs", request.runs, 2),
        unseen=whole_number("unseen", request.unseen, 2), seed=whole_number("seed", request.seed),
        evaluations=whole_number("evaluations", request.evaluations, 2), method=request.method,
        search_seed=whole_number("search_seed", request.search_seed), progress=request.progress,
    )  # fmt: skip


@contextlib.contextmanager
def _folder(keep: str | os.PathLike[str] | None) -> Iterator[Path]:
    """The folder that was named, or one that is deleted afterwards."""
    if keep is not None:
        yield absolute(keep)
        return
    with scratch("evaluate") as home:
        yield home / "results"


def _run(
    request: RunOptions,
    scenarios: Sequence[Scenario],
    estimators: Sequence[EstimatorRequest],
    seeds: range,
    folder: Path,
    **more: Any,
) -> Summary:
    """Run a campaign with those options of a request that campaigns have."""
    from simnav.leaderboard.campaign.campaign import Campaign, run_campaign
    from simnav.leaderboard.results.store import create

    with mistakes(StoreError):
        create(folder)
    options = shared(request, Campaign)
    given = {"scenarios": scenarios, "estimators": estimators, "seeds": seeds, "folder": folder}
    return run_campaign(**(options | given | more))
