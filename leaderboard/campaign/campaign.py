"""Monte Carlo campaigns: scenarios x estimators x seeds, on several processes, safe to kill.

The unit of work is a run (scenario, seed): it is recorded once, and every estimator is run on that
recording, each in isolation. A result is on disk before the next estimator starts; a campaign that is
started again does what is missing. Runs are taken seed by seed, all scenarios in turn, so that a
campaign that was stopped early is still balanced.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import itertools
import math
import os
import time
import warnings
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.cluster import ClusterError, run_on_cluster
from simnav.leaderboard.campaign.confinement.attempt import chosen_confinement
from simnav.leaderboard.campaign.confinement.privileges import PrivilegesWarning, kept_rights
from simnav.leaderboard.campaign.confinement.session import Limits, ServerError
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.fingerprint import recording_digest, simulator_version
from simnav.leaderboard.campaign.own_scores import own_scores, scoring_code, scoring_differs
from simnav.leaderboard.campaign.plan import Plan
from simnav.leaderboard.campaign.recorder import time_limit
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.rescoring import rescore_results
from simnav.leaderboard.campaign.resolution import own_files, resolve, variant_of
from simnav.leaderboard.campaign.seal import PUBLIC, Seal
from simnav.leaderboard.campaign.training_runs import require_unseen
from simnav.leaderboard.campaign.worker import Unit, run_unit, start_worker
from simnav.leaderboard.results import requested, store, trials
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.leaderboard.results.provenance import numerics
from simnav.leaderboard.results.versions import declared_recording, declared_variant, is_declared
from simnav.simulation.version import SIMULATOR_VERSION
from simnav.spec import closest

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["MEMORY", "RUNS", "CampaignError", "Progress", "Summary", "combined", "require_known", "run_campaign"]

#: Seeds of a campaign, by default.
RUNS = 50
#: Memory that an estimator may take, by default [bytes].
MEMORY = 2 << 30

#: How often the workers are started again, where one died.
RESTARTS = 3
_GATHERED = 5000  # results that are gathered into one file meanwhile, so that a killed campaign is soon read again


class CampaignError(RuntimeError):
    """A campaign that cannot go on; the message is one sentence."""


@dataclass(frozen=True)
class Progress:
    """How far a campaign is.

    Attributes
    ----------
    stage : str
        ``compile`` (kernels) or ``run`` (results).
    done, total : int
        Results that are there already count as done.
    failed : int
        Number of failures among the results computed now.
    elapsed : float
        Time since the stage began [s].
    left : float or None
        Time left [s]; None while it is not known.
    note : str
        Name of the kernel or run that was finished last.
    """

    stage: str
    done: int
    total: int
    failed: int = 0
    elapsed: float = 0.0
    left: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Summary:
    """Summary of what a campaign computed.

    Attributes
    ----------
    folder : Path
        Folder of the results.
    total : int
        Number of results that were requested.
    skipped : int
        Number of these results that existed already.
    statuses : mapping of str to int
        Number of results computed now, by status.
    seconds : float
        Wall-clock time of the campaign [s].
    """

    folder: Path
    total: int
    skipped: int
    statuses: Mapping[str, int]
    seconds: float

    @property
    def computed(self) -> int:
        """Results computed now."""
        return sum(self.statuses.values())

    @property
    def left(self) -> int:
        """Results that are still missing, because the time was up."""
        return self.total - self.skipped - self.computed

    @property
    def failed(self) -> int:
        """Results computed now that are failures (an unsuitable scenario is none)."""
        return self.computed - self.statuses.get("ok", 0) - self.statuses.get("unsuitable", 0)


def combined(summaries: Sequence[Summary]) -> Summary:
    """The summary of several campaigns in one folder, one after the other."""
    statuses: Counter[str] = Counter()
    for s in summaries:
        statuses.update(s.statuses)
    total, skipped = sum(s.total for s in summaries), sum(s.skipped for s in summaries)
    return Summary(summaries[0].folder, total, skipped, dict(statuses), sum(s.seconds for s in summaries))


def run_campaign(
    scenarios: Sequence[Scenario],
    estimators: Sequence[EstimatorRequest],
    seeds: Iterable[int],
    folder: str | os.PathLike[str],
    *,
    workers: int = 2,
    timeout: float | None = None,
    memory: int = MEMORY,
    retry: bool = False,
    force: Sequence[str] = (),
    keep_trials: bool = False,
    covariance_interval: float = 0.0,
    progress: Callable[[Progress], None] | None = None,
    backend: str = "loky",
    scheduler: str | None = None,
    shard: tuple[int, int] = (1, 1),
    confinement: str = "auto",
    seal: Seal = PUBLIC,
    minutes: float | None = None,
    by_version: bool = False,
) -> Summary:
    """Run estimators on scenarios and seeds, and store the results.

    Results that the folder has already are not computed again; those of estimators, scenarios or
    versions that are not part of this campaign stay in it.

    Parameters
    ----------
    scenarios, estimators, seeds
        What is run: every estimator on every scenario with every seed.
    folder : path
        Folder of the results; it is made if it does not exist.
    workers, retry, keep_trials, covariance_interval, confinement, minutes
        As for `simnav.leaderboard.interface.campaign`.
    force : sequence of str
        Labels or names of estimators that are run anew, where they are among those that are run.
    timeout : float, optional
        Wall-clock time that an estimator may take for a run [s]; default: `time_limit`.
    memory : int
        Memory that an estimator may take beyond the recording [bytes].
    progress : callable, optional
        Called with a `Progress` now and then.
    backend : {"loky", "dask"}
        Processes of this machine, or a Dask cluster (extra ``distributed``). Its workers need no common disk: the
        results travel through the scheduler.
    scheduler : str, optional
        Address of the Dask scheduler; default: a cluster on this machine.
    shard : pair of int
        Which of how many parts of the runs to do, from 1. All parts together are the campaign; `simnav.merge` puts
        their folders together.
    seal : Seal
        May derive the seeds from a secret; ``seeds`` are then the numbers of the runs.
    by_version : bool
        True: results are known by their declared versions (`simnav.leaderboard.results.versions`), as what comes with
        simnav is; of other estimators a digest of their own files counts, too. False: by digests of the code, and by
        the libraries and the processor that computed them.

    Returns
    -------
    Summary

    Warns
    -----
    PrivilegesWarning
        If root runs the campaign, and the system does not let estimators give their capabilities up.

    Raises
    ------
    RequestError
        On a request that makes no sense: one sentence; nothing was run.
    CampaignError
        If workers die again and again; what is there stays valid.
    StoreError
        If the folder cannot be used, or the disk is full. What is there stays valid.
    KeyboardInterrupt
        If the user stops the campaign; all finished results are on disk.
    """
    started = time.monotonic()
    report = progress or (lambda p: None)
    if not isinstance(seeds, range):
        seeds = list(dict.fromkeys(seeds))
    if workers < 1:
        raise RequestError(f"workers = {workers}: at least one is wanted")
    if timeout is not None and not timeout > 0.0:
        raise RequestError(f"timeout = {timeout:g} s should be greater than 0")
    if memory < 16 << 20:
        raise RequestError(f"memory = {memory} bytes is too little for any estimator; at least 16 MiB is wanted")
    if minutes is not None and not minutes >= 0.0:
        raise RequestError(f"minutes = {minutes:g} should not be negative")
    if not covariance_interval >= 0.0:
        raise RequestError(f"covariance_interval = {covariance_interval:g} s should not be negative")
    if isinstance(seeds, range):  # its ends say it, without a look at each seed
        ends = (seeds[0], seeds[-1]) if seeds else ()
    else:
        ends = (min(seeds), max(seeds)) if seeds else ()
    for seed in ends:
        if not 0 <= seed < 2**63:
            raise RequestError(f"seed {seed} should lie between 0 and 2**63 - 1")
    _unique("scenario", [s.id for s in scenarios])
    _unique("estimator", [e.label for e in estimators])
    forced = _forced(force, estimators)
    if by_version and seal.secret:
        raise RequestError("results with sealed seeds are known by digests of the code, not by declared versions")
    if not (isinstance(shard, Sequence) and len(shard) == 2 and all(isinstance(k, int) for k in shard)):
        raise RequestError(f"shard = {shard!r} should be a pair (k, n): part k of n")
    part, parts = shard
    if not 1 <= part <= parts:
        raise RequestError(f"shard = {part}/{parts} should be k/n, with k from 1 to n")
    if backend not in ("loky", "dask"):
        raise RequestError(f"backend = {backend!r} is unknown; there are 'loky' and 'dask'")
    if backend == "dask" and importlib.util.find_spec("distributed") is None:
        raise RequestError("backend = 'dask' needs the extra 'distributed': pip install 'simnav[distributed]'")

    with mistakes():
        chosen = chosen_confinement(confinement)
    if chosen == "process" and (why := kept_rights()):  # bubblewrap takes them away itself, or does not start
        warnings.warn(
            f"estimators keep capabilities of root ({why}), so one of them may change what belongs to others; run the "
            "campaign as another user, or with confinement = 'bubblewrap'",
            PrivilegesWarning, stacklevel=2,
        )  # fmt: skip
    path = store.create(Path(folder).resolve())
    if not by_version:
        _require_local(path, [s.id for s in scenarios])
    endings = store.keys(path)
    simulator = simulator_version()
    alone = workers == 1 and backend == "loky"
    if alone:  # the process that looks at estimators of others runs them, too, and loads all kernels
        _compile(report)
    try:
        entrants = [resolve(request, chosen, seal.unreadable(path), alone) for request in estimators]
    except ServerError as error:
        raise CampaignError(str(error)) from None
    if not seal.secret:  # the seeds of a sealed campaign are drawn from 2**63
        require_unseen(entrants, scenarios, seeds)
    if by_version:
        entrants = [replace(e, source=own_files(e) or e.source) for e in entrants]
        recordings = dict.fromkeys((s.id for s in scenarios), declared_recording(SIMULATOR_VERSION))
    else:
        recordings = {s.id: seal.recording(recording_digest(s, simulator)) for s in scenarios}

    def variant(entrant: Entrant, scenario: str) -> str:
        if by_version:
            return declared_variant(
                scenario, SIMULATOR_VERSION, entrant.label, entrant.version, entrant.parameters, own_files(entrant)
            )
        return variant_of(entrant, recordings[scenario])

    variants = {s.id: {e.label: variant(e, s.id) for e in entrants} for s in scenarios}
    current = {s.id: (recordings[s.id], variants[s.id]) for s in scenarios}
    store.select(path, current)
    requested.add(path, (s.id for s in scenarios), len(seeds))

    scores, scoring = own_scores(), scoring_code()
    plan = Plan(scenarios, entrants, seeds, variants, shard=shard)
    forced_keys = frozenset(variants[s.id][label] for s in scenarios for label in forced)

    def rescored(key: str) -> bool:  # the rules of scoring of what ships are those of the benchmark's version
        return not by_version and scoring_differs(endings[key].scoring, scoring)

    stale = {key for key in filter(plan.asks, endings) if rescored(key) and trials.is_kept(path, key)}
    if stale:  # a score was edited: the trials that were kept have all that it needs
        rescore_results(path, scenarios=scenarios, keys=stale, seal=seal)
        endings = store.keys(path)

    def limits(scenario: Scenario) -> Limits:
        return Limits(time_limit(scenario) if timeout is None else timeout, memory)

    mine = set(filter(plan.asks, endings))
    elsewhere = set[str]() if by_version else _computed_elsewhere(path, processors=backend == "loky")
    again = {
        key
        for key in mine
        if _again(endings[key], limits(plan.scenario_of(key)), retry)
        or rescored(key)
        or endings[key].provenance in elsewhere
        or key.rpartition("-")[0] in forced_keys
    }
    plan = replace(plan, there=mine - again)

    def unit(scenario: Scenario, seed: int, missing: tuple[tuple[Entrant, str], ...]) -> Unit:
        return Unit(
            scenario, seed, missing, recordings[scenario.id], simulator, path, limits(scenario), scores, scoring,
            keep_trials, covariance_interval, chosen, seal,
        )  # fmt: skip

    total, skipped = plan.total, len(plan.there)
    statuses: Counter[str] = Counter()
    if skipped < total:
        if again:
            store.drop(path, again)
            for key in again:
                trials.discard(path, key)
        if not alone:
            _compile(report)
        run_started = time.monotonic()
        weight, left, loose = 0.0, plan.weight, 0
        report(Progress("run", skipped, total))
        end = math.inf if minutes is None else started + 60.0 * minutes
        units = itertools.takewhile(lambda _: time.monotonic() < end, plan.units(unit))
        with contextlib.closing(_outcomes(units, path, workers, backend, scheduler)) as outcomes:
            for done_unit, outcome in outcomes:
                statuses.update(outcome)
                loose += outcome.total()
                if loose >= _GATHERED:
                    store.compact(path)
                    loose = 0
                weight, left = weight + done_unit.weight, left - done_unit.weight
                elapsed = time.monotonic() - run_started
                failed = Summary(path, total, skipped, statuses, 0.0).failed
                done = skipped + statuses.total()
                note = f"{done_unit.scenario.id}, seed {done_unit.seed}"
                report(Progress("run", done, total, failed, elapsed, elapsed / weight * left, note))
        store.select(path, current)  # another campaign in the same folder may have had the last word
        store.compact(path)
    else:
        report(Progress("run", total, total))
    return Summary(path, total, skipped, dict(statuses), time.monotonic() - started)


def _again(ending: store.Ending, limits: Limits, retry: bool) -> bool:
    """Whether a run that is stored should be run again, under these limits."""
    if ending.status == "no-recording":
        return True
    if retry and ending.status not in ("ok", "unsuitable"):
        return True
    return (ending.status == "timeout" and ending.time_limit < limits.timeout) or (
        ending.status == "out-of-memory" and ending.memory_limit < limits.memory
    )


def require_known(names: Sequence[str], parts: Iterable[Sequence[EstimatorRequest]]) -> None:
    """RequestError where an estimator that is to be run anew is in no part of what is run."""
    everyone = [request for part in parts for request in part]
    for name in names:
        if not _forced([name], everyone):
            known = sorted({e.label for e in everyone})
            raise RequestError(f"force = {name!r}: no such estimator is run here{closest(name, known)}")


def _forced(names: Sequence[str], estimators: Sequence[EstimatorRequest]) -> set[str]:
    """Labels of the estimators that are run anew, by label, or by name with whatever parameters."""
    return {e.label for e in estimators if {e.label, e.name, e.label.partition("(")[0]} & set(names)}


def _require_local(path: Path, scenarios: Sequence[str]) -> None:
    """Refuse a folder of what comes with simnav: its numbers are known by versions, not by the code of today."""
    current = store.described(path).get("current", {})
    shipped = [s for s in scenarios if is_declared(current.get(s, {}).get("recording", ""))]
    if shipped:
        raise RequestError(
            f"{path} holds results that came with simnav, of {shipped[0]} and others: a campaign of the code of today "
            "needs another folder, and 'simnav merge' puts the two together"
        )


def _computed_elsewhere(path: Path, *, processors: bool) -> set[str]:
    """Ids of the provenances whose numerical libraries, or processor, are not those of this process."""
    now = numerics(processor=processors)
    return {
        identity for identity, other in store.provenances(path).items() if numerics(other, processor=processors) != now
    }


def _unique(what: str, labels: list[str]) -> None:
    if not labels:
        raise RequestError(f"no {what} was asked for")
    twice = [label for label, count in Counter(labels).items() if count > 1]
    if twice:
        hint = "; give each its own label" if what == "estimator" else ""
        raise RequestError(f"the {what} {twice[0]!r} was asked for twice{hint}")


# --- before the run -----------------------------------------------------------------------------------


def _compile(report: Callable[[Progress], None]) -> None:
    """Compile what is not in the cache, before several workers would do it at once."""
    from simnav.warmup import warmup

    started = time.monotonic()

    def compiled(done: int, total: int, name: str) -> None:
        report(Progress("compile", done, total, elapsed=time.monotonic() - started, note=name))

    warmup(compiled, load=False)


# --- spreading the work -------------------------------------------------------------------------------


def _outcomes(
    units: Iterator[Unit], folder: Path, workers: int, backend: str, scheduler: str | None
) -> Generator[tuple[Unit, Counter[str]], None, None]:
    """Run the units and yield what became of them, in the order in which they end."""
    from joblib.externals.loky.process_executor import BrokenProcessPool

    source = enumerate(units)
    left: dict[int, Unit] = {}  # those that a worker has, or had

    def dispatched() -> Iterator[tuple[int, Unit]]:
        yield from list(left.items())
        for index, unit in source:
            left[index] = unit
            yield index, unit

    for _ in range(1 + RESTARTS):
        try:
            for index, outcome in _parallel(dispatched(), workers, backend, scheduler):
                yield left.pop(index), outcome
            return
        except ServerError as error:
            raise CampaignError(f"{error}; what is done is on disk") from None
        except BrokenProcessPool:
            endings = store.keys(folder)  # some of it was finished, and could not be told any more
            for index, unit in list(left.items()):
                finished = tuple(entrant for entrant in unit.entrants if entrant[1] in endings)
                if finished:
                    yield replace(unit, entrants=finished), Counter(endings[key].status for _, key in finished)
                    left[index] = replace(unit, entrants=tuple(e for e in unit.entrants if e not in finished))
                    if not left[index].entrants:
                        del left[index]
    raise CampaignError(
        f"worker processes died {1 + RESTARTS} times, as they do when the machine has no memory left; what is done is "
        "on disk, so try again with fewer workers"
    )


def _parallel(
    units: Iterator[tuple[int, Unit]], workers: int, backend: str, scheduler: str | None
) -> Iterator[tuple[int, Counter[str]]]:
    from joblib import Parallel, delayed, parallel_config

    if backend == "dask":
        try:
            yield from run_on_cluster(units, scheduler, workers)
        except ClusterError as error:
            raise CampaignError(str(error)) from error
        return
    with contextlib.ExitStack() as stack:
        # A folder that holds a random.py must not be searched by a worker that starts in it.
        stack.enter_context(_environment(PYTHONSAFEPATH="1"))
        stack.enter_context(parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1))
        if workers > 1:
            stack.callback(_stop_workers)
        # Joblib's advice to whoever stops early, or whose worker was replaced, is not for the user.
        stack.enter_context(warnings.catch_warnings())
        for message in (".*tasks which were still being processed.*", "A worker stopped while some jobs.*"):
            warnings.filterwarnings("ignore", message, UserWarning)
        parallel = Parallel(
            return_as="generator_unordered",
            batch_size=1,
            pre_dispatch="2*n_jobs",
            initializer=start_worker,
            initargs=(os.getpid(),),
        )
        outcomes = parallel(delayed(run_unit)(index, unit) for index, unit in units)
        stack.callback(outcomes.close)
        yield from outcomes


def _stop_workers() -> None:
    from joblib.externals.loky import reusable_executor

    executor = reusable_executor._executor
    if executor is not None:
        executor.shutdown(wait=True, kill_workers=True)


@contextlib.contextmanager
def _environment(**values: str) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
