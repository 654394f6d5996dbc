"""All commands of `simnav` as Python calls, which are also attributes of the package: ``simnav.evaluate(...)``.

An **estimator** is a class, a registered name, a file (``my.py``, ``my.py:MyFilter``), any of these with parameters
(``"sw-fgo:window=10"``, ``(MyFilter, {"gain": 0.5})``); several are a list, or a text with commas. A **scenario** is a
`simnav.scenario.Scenario`, a name or a TOML file. An empty list is refused; without one, all are meant. What comes
back is typed. Reports have ``to_dict()`` (what the command prints with ``--json``); those with figures, such as runs,
rankings and bounds, also have ``to_frame()`` (a ``pandas.DataFrame`` where pandas is installed, otherwise a
``pyarrow.Table``) and ``plot()`` (a matplotlib ``Figure``).

Mistakes in arguments raise `RequestError`, a `ValueError` whose message is one sentence.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from simnav.leaderboard.campaign.request import EstimatorLike, EstimatorRequest, Estimators, requests, together
from simnav.leaderboard.campaign.request import request as one_request
from simnav.leaderboard.costing import bench, costs
from simnav.leaderboard.given import (
    ScenarioLike,
    Scenarios,
    absolute,
    positive,
    results_of,
    scenario_of,
    scenarios_of,
    seeds_of,
    whole,
)
from simnav.leaderboard.inspection import bound, cite, merge, rank, reproduce, rescore, seal, verify
from simnav.leaderboard.results.errors import RequestError, StoreError, mistakes
from simnav.leaderboard.results.scratch import scratch

if TYPE_CHECKING:
    from simnav.estimator import Estimator
    from simnav.leaderboard.campaign.campaign import Progress, Summary
    from simnav.leaderboard.campaign.single_run import RunReport
    from simnav.leaderboard.ranking.reports import CampaignReport, EvaluationReport
    from simnav.leaderboard.sweep.report import Sweep
    from simnav.leaderboard.tuning.space import Range
    from simnav.leaderboard.tuning.tuning import Method, Tuning
    from simnav.recording import Recording
    from simnav.scenario import Scenario
    from simnav.testing.contract_check import Report

__all__ = [
    "EstimatorLike",
    "Estimators",
    "RequestError",
    "ScenarioLike",
    "Scenarios",
    "bench",
    "bound",
    "campaign",
    "check",
    "cite",
    "costs",
    "evaluate",
    "make",
    "merge",
    "rank",
    "record",
    "reproduce",
    "rescore",
    "results_of",
    "run",
    "scenario_of",
    "scenarios_of",
    "seal",
    "sweep",
    "tune",
    "verify",
    "whole",
]

CampaignProgress: TypeAlias = "Callable[[Progress], None] | None"


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


def record(scenario: ScenarioLike, seed: int = 0) -> Recording:
    """Run a scenario to its end: measurements, labels and truth.

    Parameters
    ----------
    scenario : str, Path or Scenario
        Name, file or the scenario itself.
    seed : int
        Seed of the run.

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
        return record(scenario_of(scenario), whole("seed", seed))


def check(estimator: EstimatorLike, **parameters: Any) -> Report:
    """Test an estimator against the contract: causality, shapes, units, determinism, missing instruments.

    Parameters
    ----------
    estimator, **parameters
        The estimator and its parameters, as for `make`.

    Returns
    -------
    simnav.testing.contract_check.Report

    Raises
    ------
    ValueError
        If there is no such estimator, or it cannot be constructed.
    """
    from simnav.testing.contract_check import check

    with mistakes(ValueError):
        return check(one_request(estimator, parameters).make)


def run(
    scenario: ScenarioLike,
    estimators: Estimators = None,
    *,
    seed: int = 0,
    parameters: Mapping[str, Any] | None = None,
    progress: Callable[..., None] | None = None,
) -> RunReport:
    """Run estimators once on one scenario, in this process, and score them.

    Parameters
    ----------
    scenario : str, Path or Scenario
        Name, file or the scenario itself.
    estimators : estimators, optional
        The estimators that run; default: all registered ones.
    seed : int
        Seed of the run.
    parameters : mapping, optional
        Parameters of the estimators; each estimator gets the parameters that it has.
    progress : callable, optional
        Called with the number of finished estimators, the number of all, and the label of the next one as ``note=``.

    Returns
    -------
    RunReport
        The recording, all trials and their scores.
    """
    from simnav.leaderboard.campaign.single_run import run_once

    chosen, count = scenario_of(scenario), whole("seed", seed)
    return run_once(chosen, requests(estimators, parameters), count, progress)


def evaluate(
    estimators: Estimators,
    scenarios: Scenarios,
    *,
    runs: int = 20,
    seed: int = 0,
    against: Estimators = None,
    parameters: Mapping[str, Any] | None = None,
    workers: int = 2,
    time_limit: float | None = None,
    memory_limit: float = 2048.0,
    results: str | os.PathLike[str] | None = None,
    progress: CampaignProgress = None,
) -> EvaluationReport:
    """Compare estimators with the baselines on the same seeds.

    Parameters
    ----------
    estimators : estimators
        The estimators under test.
    scenarios : scenarios
        One or several scenarios, by name, file or as objects.
    runs : int
        Number of seeds of each scenario.
    seed : int
        First seed; the others follow it.
    against : estimators, optional
        Baselines; default: all registered ones.
    parameters : mapping, optional
        Parameters of the estimators under test.
    workers : int
        Number of processes.
    time_limit : float, optional
        Longest time of an estimator for a run [s]; default: a fifth of real time, at least a minute.
    memory_limit : float
        Largest memory of an estimator, without the recording [MiB].
    results : path, optional
        Folder in which the results are kept; default: they are not kept.
    progress : callable, optional
        Called with a `simnav.leaderboard.campaign.campaign.Progress` from time to time.

    Returns
    -------
    EvaluationReport
        The place of each estimator, and its differences from the baselines.
    """
    from simnav.leaderboard.ranking.ranking import rank
    from simnav.leaderboard.ranking.reports import EvaluationReport
    from simnav.leaderboard.ranking.runs import group
    from simnav.leaderboard.ranking.standing import standing

    if not estimators:
        raise RequestError("no estimator was asked for; name those that should be evaluated")
    mine = requests(estimators, parameters)
    everyone = together([*mine, *requests(against)])
    chosen, seeds = scenarios_of(scenarios), seeds_of(seed, runs)
    with _folder(results) as folder:
        _run(chosen, everyone, seeds, folder, workers, time_limit, memory_limit, progress)
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
        None if results is None else folder,
    )


def campaign(
    scenarios: Scenarios = None,
    estimators: Estimators = None,
    *,
    runs: int | None = None,
    seed: int = 0,
    output: str | os.PathLike[str] = "results",
    profile: str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    workers: int = 2,
    time_limit: float | None = None,
    memory_limit: float = 2048.0,
    retry: bool = False,
    force: Sequence[str] = (),
    keep_trials: bool = False,
    covariance_interval: float = 0.0,
    backend: str = "loky",
    scheduler: str | None = None,
    shard: tuple[int, int] = (1, 1),
    confinement: str = "auto",
    sealed: str | os.PathLike[str] | None = None,
    oracle: bool = True,
    minutes: float | None = None,
    by_version: bool = False,
    progress: CampaignProgress = None,
) -> CampaignReport:
    """Run estimators on scenarios and seeds. Started again, the campaign continues.

    A result is computed anew if the code of simnav or of the estimator has changed since, or a numerical library, or if
    it comes from another kind of processor.

    Parameters
    ----------
    scenarios, estimators : optional
        The scenarios and estimators that are run; default: all.
    runs : int, optional
        Number of seeds of each scenario; default: 50, or that of the profile.
    output : path
        Folder of the results.
    profile : str or path, optional
        A profile (`simnav.leaderboard.profiles`) with the scenarios, estimators and number of runs. The arguments
        ``scenarios``, ``estimators`` and ``runs`` replace those of the profile.
    seed, parameters, workers, time_limit, memory_limit, progress
        First seed, parameters of the estimators, processes and limits, as for `evaluate`.
    retry : bool
        True: run the failed runs of the folder again (errors, timeouts, out of memory, diverged, invalid output). A
        run that could not be recorded, or that ended because of a shorter time limit or a smaller memory limit, is
        always run again.
    force : sequence of str
        Names or labels of estimators that are run anew, even if the folder has their results.
    keep_trials : bool
        True: keep the estimates, covariances, diagnostics and flags, for `rescore`: about 190 bytes an epoch and run.
    covariance_interval : float
        Smallest time between two kept covariances [s]; 0 keeps all. With fewer, `rescore` does not compute scores that
        use the covariance.
    backend, scheduler, shard
        As for `simnav.leaderboard.campaign.campaign.run_campaign`: processes of this machine or a Dask cluster; address
        of its scheduler; number of a part of the runs, and number of all parts.
    confinement : {"auto", "bubblewrap", "process", "none"}
        How estimators are kept apart from the recording, see docs/explanation/security.md; default: the strongest
        that works here.
    sealed : path, optional
        File of a secret key from which the seeds are derived; results carry its hash, and `verify` repeats them.
    oracle : bool
        True: also run the oracles on simulated scenarios; they are not ranked.
    minutes : float, optional
        Time after which no further run is started. The same call continues.
    by_version : bool
        True: results are known by declared versions of simnav, and by the user's own files, as in a submission.

    Returns
    -------
    CampaignReport
        A summary of all results in the folder.
    """
    from simnav.leaderboard.campaign.campaign import RUNS, combined, require_known
    from simnav.leaderboard.campaign.oracles import beside_oracles
    from simnav.leaderboard.campaign.seal import read_seal
    from simnav.leaderboard.profiles import load
    from simnav.leaderboard.ranking.ranking import rank
    from simnav.leaderboard.ranking.reports import CampaignReport
    from simnav.leaderboard.results import requested

    parts: list[tuple[Scenarios, Estimators, int]] = [(scenarios, estimators, RUNS if runs is None else runs)]
    if profile is not None:
        parts = [
            (p.scenarios if scenarios is None else scenarios, p.estimators if estimators is None else estimators,
             p.runs if runs is None else runs)
            for p in load(profile).parts
        ]  # fmt: skip
    folder, summaries, seal = absolute(output), [], read_seal(sealed)
    tracks: dict[str, str] = {}
    end = None if minutes is None else time.monotonic() + 60.0 * positive("minutes", minutes)
    anew, asked = _names(force), [requests(those, parameters) for _, those, _ in parts]
    require_known(anew, asked)
    for (wanted, _, count), everyone in zip(parts, asked, strict=True):
        chosen = scenarios_of(wanted, optional=profile is not None)
        tracks |= {s.id: s.track for s in chosen}
        for some, beside in beside_oracles(chosen, everyone) if oracle else [(chosen, everyone)]:
            # fmt: off
            summaries.append(_run(some, beside, seeds_of(seed, count), folder, workers, time_limit, memory_limit,
                                  progress, retry=retry, force=anew, keep_trials=keep_trials,
                                  covariance_interval=covariance_interval, confinement=confinement, seal=seal,
                                  backend=backend, scheduler=scheduler, shard=shard, by_version=by_version,
                                  minutes=None if end is None else max(0.0, (end - time.monotonic()) / 60.0)))
    # fmt: on
    results = results_of(folder)
    ranking = rank(results, tracks=tracks, requested=requested.read(folder))
    return CampaignReport(results, ranking, combined(summaries))


def sweep(
    scenario: ScenarioLike,
    dials: Mapping[str, Sequence[float]] | Sequence[str] | str,
    estimators: Estimators,
    *,
    runs: int = 30,
    score: str = "horizontal_rmse",
    limit: float | None = None,
    output: str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    seed: int = 0,
    progress: CampaignProgress = None,
    **options: Any,
) -> Sweep:
    """Vary one or two quantities (dials) of a scenario, and find the breaking point of each estimator.

    All values use the same seeds, so only the dial differs. Started again, the sweep continues where it stopped.

    Parameters
    ----------
    scenario, estimators, parameters
        The scenario, and the estimators with their parameters, as for `run`.
    dials : mapping of str to sequence of float, or str
        A dial of the scenario (``[[dial]]``), or a key path in its file, with values in the unit of the key; or as on
        the command line, ``"multipath=0,1,2,4"``. Default: seven values over the range. The clean value is added.
    runs : int
        Number of seeds of each value.
    score : str
        Name of a score whose lower values are better, a key of `simnav.scoring.SCORES`.
    limit : float, optional
        Threshold of the error for a second breaking point, in the unit of the score.
    output : path, optional
        Folder of the results; default: ``results/sweep-SCENARIO``.
    seed, progress, **options
        First seed, progress, ``workers``, ``time_limit`` and ``memory_limit``, as for `evaluate`.

    Returns
    -------
    Sweep
        Errors at all values, and the breaking points.
    """
    from simnav.leaderboard.site.sweeps import write
    from simnav.leaderboard.sweep.report import Sweep
    from simnav.leaderboard.sweep.settings import checked_score, chosen_dials, parse_dials, settings

    if not estimators:
        raise RequestError("no estimator was asked for; name those whose error should be seen against the dial")
    chosen, mine = scenario_of(scenario), requests(estimators, parameters)
    checked_score(score, limit)
    turned = chosen_dials(chosen, parse_dials(dials))
    found, seeds = settings(chosen, turned), seeds_of(seed, runs)
    folder = absolute(output or Path("results") / f"sweep-{chosen.name}")
    limits = {"workers": 2, "time_limit": None, "memory_limit": 2048.0} | options
    summary = _run([s.scenario for s in found], mine, seeds, folder, progress=progress, **limits)
    ids, labels = {s.scenario.id for s in found}, tuple(r.label for r in mine)
    results = [r for r in results_of(folder) if r.scenario in ids and r.estimator in labels and r.seed in seeds]
    made = Sweep(chosen.id, tuple(d for d, _ in turned), tuple(tuple(v) for _, v in turned), labels, score, limit,
                 results, tuple(found), summary)  # fmt: skip
    write(made)
    return made


def tune(
    estimator: EstimatorLike,
    families: Scenarios = ("training-voyages", "training-clean"),
    vary: Sequence[str | Range] | str | None = None,
    *,
    runs: int = 20,
    unseen: int = 20,
    seed: int = 0,
    evaluations: int = 40,
    method: Method = "differential-evolution",
    search_seed: int = 0,
    progress: Callable[..., None] | None = None,
) -> Tuning:
    """Choose parameters of an estimator on training families.

    Parameters
    ----------
    estimator : str, Path, type or pair
        The estimator. Parameters that are given with it are not varied.
    families : scenarios
        Training families; their voyages share no random stream with any other scenario.
    vary : sequence of str or Range, or str, optional
        Parameters with their bounds, like ``"dof=2:50:log"``; several are a list, or a text with commas. Default: those
        of the stored tuning of the row (``estimators/tuned``).
    runs, unseen : int
        Number of voyages of each family for the search, and for the comparison afterwards.
    seed : int
        Seed of the first voyage; the voyages of the comparison have the seeds after those of the search.
    evaluations : int
        Number of evaluations of the objective.
    method : str
        ``differential-evolution`` or ``nelder-mead``.
    search_seed : int
        Seed of the random numbers of the search.
    progress : callable, optional
        Called with the number of finished parts, the number of all parts, and the next part as ``note=``.

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

    request = one_request(estimator)
    with mistakes():
        request.make()
    chosen = scenarios_of(families)
    if vary is None:
        path = TUNED / f"{request.name}.json"
        if not path.is_file():
            raise RequestError(what_to_vary(request))
        vary = ranges_of(read(path))
    ranges = [text for text in vary.split(",") if text.strip()] if isinstance(vary, str) else list(vary)
    return tune_row(
        request, chosen, ranges, runs=whole("runs", runs, 2), unseen=whole("unseen", unseen, 2),
        seed=whole("seed", seed), evaluations=whole("evaluations", evaluations, 2), method=method,
        search_seed=whole("search_seed", search_seed), progress=progress,
    )  # fmt: skip


@contextlib.contextmanager
def _folder(keep: str | os.PathLike[str] | None) -> Iterator[Path]:
    if keep is not None:
        yield absolute(keep)
        return
    with scratch("evaluate") as home:
        yield home / "results"


def _names(given: Sequence[str] | str) -> tuple[str, ...]:
    """Names, one by one; a text may hold several, separated by commas.

    >>> _names(["ekf, ukf", "sw-fgo"])
    ('ekf', 'ukf', 'sw-fgo')
    """
    texts = [given] if isinstance(given, str) else given
    return tuple(name.strip() for text in texts for name in text.split(",") if name.strip())


def _run(
    scenarios: Sequence[Scenario], everyone: Sequence[EstimatorRequest], seeds: range, folder: Path, workers: int,
    time_limit: float | None, memory_limit: float, progress: CampaignProgress, **options: Any,
) -> Summary:  # fmt: skip
    from simnav.leaderboard.campaign.campaign import run_campaign
    from simnav.leaderboard.results.store import create

    count, memory = whole("workers", workers, 1), positive("memory_limit", memory_limit, 16.0)
    limit = None if time_limit is None else positive("time_limit", time_limit)
    if limit == 0.0:
        raise RequestError("time_limit = 0 s should be greater than 0")
    with mistakes(StoreError):
        create(folder)
    return run_campaign(
        scenarios, everyone, seeds, folder, workers=count, timeout=limit, memory=int(memory * 2**20),
        progress=progress, **options,
    )  # fmt: skip
