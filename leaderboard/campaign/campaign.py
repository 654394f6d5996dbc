"""Monte Carlo campaigns: scenarios x estimators x seeds, on several processes, safe to kill.

The unit of work is a run (scenario, seed): it is recorded once, and every estimator is run on that
recording, each in isolation. A result is on disk before the next estimator starts; a campaign that is
started again does what is missing. Runs are taken seed by seed, all scenarios in turn, so that a
campaign that was stopped early is still balanced.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import time
import warnings
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import TypeAlias

from simnav.leaderboard.calls import call, option, request
from simnav.leaderboard.campaign.confinement.attempt import chosen_confinement
from simnav.leaderboard.campaign.confinement.privileges import PrivilegesWarning, kept_rights
from simnav.leaderboard.campaign.confinement.session import Limits, ServerError
from simnav.leaderboard.results import requested, scenario_files, store, trials
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.leaderboard.results.provenance import numerics
from simnav.leaderboard.results.versions import declared_recording, declared_variant, is_declared
from simnav.scenario import Scenario
from simnav.simulation.version import SIMULATOR_VERSION
from simnav.spec import closest

from .cluster import ClusterError, run_on_cluster
from .entrant import Entrant
from .fingerprint import recording_digest, simulator_version
from .options import CampaignOptions, PathLike
from .own_scores import own_scores, scoring_code, scoring_differs
from .plan import Plan
from .recorder import time_limit
from .request import EstimatorRequest
from .rescoring import rescore_results
from .resolution import own_files, resolve, variant_of
from .seal import PUBLIC, Seal
from .training_runs import require_unseen
from .worker import Unit, run_unit, start_worker

__all__ = [
    "MEMORY",
    "RUNS",
    "Campaign",
    "CampaignError",
    "Progress",
    "Summary",
    "combined",
    "require_known",
    "run_campaign",
]

#: Seeds of a campaign, by default.
RUNS = 50
#: Memory that an estimator may take, by default [MiB].
MEMORY = 2048.0

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
        """Results computed now that are failures (an unsuitable scenario and a lost run are none)."""
        return self.computed - sum(self.statuses.get(status, 0) for status in ("ok", "lost", "unsuitable"))


def combined(summaries: Sequence[Summary]) -> Summary:
    """The summary of several campaigns in one folder, one after the other."""
    statuses: Counter[str] = Counter()
    for s in summaries:
        statuses.update(s.statuses)
    total, skipped = sum(s.total for s in summaries), sum(s.skipped for s in summaries)
    return Summary(summaries[0].folder, total, skipped, dict(statuses), sum(s.seconds for s in summaries))


@request
class Campaign(CampaignOptions):
    """Run estimators on scenarios and seeds, and store the results.

    Results that the folder has already are not computed again; those of estimators, scenarios or versions that are not
    part of this campaign stay in it.
    """

    scenarios: Sequence[Scenario] = option(help="Scenarios.")
    estimators: Sequence[EstimatorRequest] = option(help="Every one is run on every scenario with every seed.")
    seeds: Iterable[int] = option(help="Seeds of every scenario.")
    folder: PathLike = option(help="Folder of the results; it is made if it does not exist.")
    _: KW_ONLY
    seal: Seal = option(
        default=PUBLIC, help="May derive the seeds from a secret; ``seeds`` are then the numbers of the runs."
    )
    by_version: bool = option(
        default=False,
        help="True: results are known by their declared versions (`simnav.leaderboard.results.versions`), as what "
        "comes with simnav is; of other estimators a digest of their own files counts, too. False: by digests of the "
        "code, and by the libraries and the processor that computed them.",
    )
    later: bool = option(
        default=False,
        help="True: a later stage of a plan (`simnav.leaderboard.ranking.statistics.stages`), whose seeds were not "
        "asked for by somebody who looked at results.",
    )
    progress: Callable[[Progress], None] | None = option(default=None, help="Called with a `Progress` now and then.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.seeds, range):
            object.__setattr__(self, "seeds", list(dict.fromkeys(self.seeds)))
        for seed in self._ends():
            if not 0 <= seed < 2**63:
                raise RequestError(f"seed {seed} should lie between 0 and 2**63 - 1")
        _unique("scenario", [s.id for s in self.scenarios])
        _unique("estimator", [e.label for e in self.estimators])
        if self.by_version and self.seal.secret:
            raise RequestError("results with sealed seeds are known by digests of the code, not by declared versions")

    @property
    def numbers(self) -> Sequence[int]:
        """The seeds, each once."""
        assert isinstance(self.seeds, Sequence)
        return self.seeds

    def _ends(self) -> tuple[int, ...]:
        """The smallest and the largest seed; of a range its ends, without a look at each seed."""
        if not self.numbers:
            return ()
        if isinstance(self.seeds, range):
            return self.seeds[0], self.seeds[-1]
        return min(self.numbers), max(self.numbers)

    @property
    def alone(self) -> bool:
        """Whether the process that looks at estimators of others runs them, too."""
        return self.workers == 1 and self.effective_backend == "loky"

    def report(self, progress: Progress) -> None:
        """Tell how far the campaign is."""
        if self.progress is not None:
            self.progress(progress)

    def limits(self, scenario: Scenario) -> Limits:
        """Time and memory that an estimator may take for a run."""
        seconds = time_limit(scenario) if self.time_limit is None else self.time_limit
        return Limits(seconds, int(self.memory_limit * 2**20))


@call(Campaign)
def run_campaign(asked: Campaign) -> Summary:
    """Run the campaign of a request.

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
    with mistakes():
        confinement = chosen_confinement(asked.confinement)
    if confinement == "process" and (why := kept_rights()):  # bubblewrap takes them away itself, or does not start
        warnings.warn(
            f"estimators keep capabilities of root ({why}), so one of them may change what belongs to others; run the "
            "campaign as another user, or with confinement = 'bubblewrap'",
            PrivilegesWarning, stacklevel=3,
        )  # fmt: skip
    path = store.create(Path(asked.folder).resolve())
    if not asked.by_version:
        _require_local(path, [s.id for s in asked.scenarios])
    if asked.alone:
        _compile(asked.report)
    entrants = _entrants(asked, confinement, path)
    keyed = _keyed(asked, entrants, path)
    if not asked.later:
        requested.add(path, (s.id for s in asked.scenarios), len(asked.numbers))
    scenario_files.add(path, asked.scenarios)
    plan, again = _planned(asked, path, entrants, keyed)
    total, skipped = plan.total, len(plan.there)
    statuses: Counter[str] = Counter()
    if skipped < total:
        store.drop(path, again)
        for key in again:
            trials.discard(path, key)
        if not asked.alone:
            _compile(asked.report)
        units = _units(asked, plan, keyed, path, confinement)
        if asked.minutes is not None:
            end = started + 60.0 * asked.minutes
            units = itertools.takewhile(lambda _: time.monotonic() < end, units)
        _run_units(asked, plan, units, path, statuses)
        store.select(path, keyed)  # another campaign in the same folder may have had the last word
        store.compact(path)
    else:
        asked.report(Progress("run", total, total))
    return Summary(path, total, skipped, dict(statuses), time.monotonic() - started)


#: Versioned id of a scenario -> key of its recordings, and label of an estimator -> key without the seed.
_Keyed: TypeAlias = dict[str, tuple[str, dict[str, str]]]


def _entrants(asked: Campaign, confinement: str, path: Path) -> list[Entrant]:
    """The estimators that take part, looked at where they can do no harm."""
    hidden = asked.seal.unreadable(path)
    try:
        entrants = [resolve(request, confinement, hidden) for request in asked.estimators]
    except ServerError as error:
        raise CampaignError(str(error)) from None
    if not asked.seal.secret:  # the seeds of a sealed campaign are drawn from 2**63
        require_unseen(entrants, asked.scenarios, asked.numbers)
    if asked.by_version:
        return [replace(e, source=own_files(e) or e.source) for e in entrants]
    return entrants


def _keyed(asked: Campaign, entrants: Sequence[Entrant], path: Path) -> _Keyed:
    """The keys of what is run, which are the current ones of the folder from now on."""
    keyed: _Keyed = {}
    for s in asked.scenarios:
        if asked.by_version:
            recording = declared_recording(SIMULATOR_VERSION)
            variants = {
                e.label: declared_variant(s.id, SIMULATOR_VERSION, e.label, e.version, e.parameters, own_files(e))
                for e in entrants
            }
        else:
            recording = asked.seal.recording(recording_digest(s, simulator_version()))
            variants = {e.label: variant_of(e, recording) for e in entrants}
        keyed[s.id] = recording, variants
    store.select(path, keyed)
    return keyed


def _planned(asked: Campaign, path: Path, entrants: Sequence[Entrant], keyed: _Keyed) -> tuple[Plan, set[str]]:
    """What has to be done, and the keys of the stored results that are computed anew."""
    variants = {scenario: found for scenario, (_, found) in keyed.items()}
    plan = Plan(asked.scenarios, entrants, asked.numbers, variants, shard=asked.shard)
    labels = _forced(asked.force, asked.estimators)
    forced = {found[label] for found in variants.values() for label in labels}
    endings, scoring = store.keys(path), scoring_code()

    def rescored(key: str) -> bool:  # the rules of scoring of what ships are those of the benchmark's version
        return not asked.by_version and scoring_differs(endings[key].scoring, scoring)

    stale = {key for key in filter(plan.asks, endings) if rescored(key) and trials.is_kept(path, key)}
    if stale:  # a score was edited: the trials that were kept have all that it needs
        rescore_results(path, scenarios=asked.scenarios, keys=stale, seal=asked.seal)
        endings = store.keys(path)
    mine = set(filter(plan.asks, endings))
    processors = asked.effective_backend == "loky"
    elsewhere = set[str]() if asked.by_version else _computed_elsewhere(path, processors=processors)
    again = {
        key
        for key in mine
        if _again(endings[key], asked.limits(plan.scenario_of(key)), asked.retry)
        or rescored(key)
        or endings[key].provenance in elsewhere
        or key.rpartition("-")[0] in forced
    }
    return replace(plan, there=mine - again), again


def _units(asked: Campaign, plan: Plan, keyed: _Keyed, path: Path, confinement: str) -> Iterator[Unit]:
    """The runs that are missing, as they are sent to workers."""
    scores, scoring, simulator = own_scores(), scoring_code(), simulator_version()

    def unit(scenario: Scenario, seed: int, missing: tuple[tuple[Entrant, str], ...]) -> Unit:
        return Unit(
            scenario, seed, missing, keyed[scenario.id][0], simulator, path, asked.limits(scenario), scores, scoring,
            asked.keep_trials, asked.covariance_interval, confinement, asked.seal,
        )  # fmt: skip

    return plan.units(unit)


def _run_units(asked: Campaign, plan: Plan, units: Iterator[Unit], path: Path, statuses: Counter[str]) -> None:
    """Run what is missing, count how it ends, and tell how far it is."""
    started = time.monotonic()
    total, skipped = plan.total, len(plan.there)
    weight, left, loose = 0.0, plan.weight, 0
    asked.report(Progress("run", skipped, total))
    with contextlib.closing(
        _outcomes(units, path, asked.workers, asked.effective_backend, asked.scheduler)
    ) as outcomes:
        for unit, outcome in outcomes:
            statuses.update(outcome)
            loose += outcome.total()
            if loose >= _GATHERED:
                store.compact(path)
                loose = 0
            weight, left = weight + unit.weight, left - unit.weight
            elapsed = time.monotonic() - started
            failed = Summary(path, total, skipped, statuses, 0.0).failed
            done = skipped + statuses.total()
            note = f"{unit.scenario.id}, seed {unit.seed}"
            asked.report(Progress("run", done, total, failed, elapsed, elapsed / weight * left, note))


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
            "needs another folder, and 'simnav campaign merge' puts the two together"
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
    """Compile what the runs need and the cache lacks, before several workers would do it at once."""
    from simnav.warmup import warmup

    started = time.monotonic()

    def compiled(done: int, total: int, name: str) -> None:
        report(Progress("compile", done, total, elapsed=time.monotonic() - started, note=name))

    warmup(compiled, load=False, everything=False)


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
