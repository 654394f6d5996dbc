"""Verify results: is their seal that of the published key, and do runs that are repeated give the same bits?"""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.estimator import EstimatorError
from simnav.estimator.registry import registered
from simnav.leaderboard.results import scenario_files, store
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.leaderboard.results.errors import RequestError, sentence
from simnav.leaderboard.results.provenance import here
from simnav.leaderboard.results.scratch import scratch
from simnav.leaderboard.results.versions import declared, is_declared
from simnav.scenario import headers

from .campaign import MEMORY, run_campaign
from .comparison import (
    CLAIMED,
    CLOSE,
    Comparison,
    claims,
    compared,
    differing,
    listed,
    proven,
    too_quick,
)
from .fingerprint import named_files
from .recorder import time_limit
from .request import EstimatorRequest
from .sampling import findable, sample_size
from .seal import PUBLIC, Seal

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result
    from simnav.scenario import Scenario

__all__ = ["CLOSE", "Comparison", "Verification", "compared", "listed", "missing_seeds", "request_of", "verify_results"]

#: A limit of a stranger's results is taken up to this multiple of the default.
_MOST_TIME, _MOST_MEMORY = 10.0, 16


@dataclass(frozen=True)
class Verification:
    """What came of repeating a sample of results.

    Attributes
    ----------
    folder : str
        Folder of the results.
    results : int
        Number of results in the folder, or of the rows that were asked for.
    seal : str
        Hash of the key; empty for public seeds.
    other_seals : int
        Results that were not made under this key.
    repeated, same : int
        Runs that were repeated, and those of them that gave the same to the bit.
    close : tuple of str
        Those of which some scores differ by less than `CLOSE`, and which: as scores do that were computed again from
        a kept trial (`simnav.rescore`).
    different : tuple of str
        Those that gave something else, and what.
    not_repeatable : tuple of str
        Those that could not be repeated or confirmed, and why: other code, an estimator that is not here, a limit of
        time or memory that another machine meets.
    not_here : tuple of str
        Those that cannot be checked here, and why: the scenario or the estimator is missing. That says nothing against
        them.
    unknown : tuple of str
        Scores of the results that are not known in this process, for a plug-in was not loaded; they were not looked at.
    claims : tuple of str
        Versions, commits and kinds of confinement that are not those of the repetition, or do not exist.
    unconfirmed : tuple of str
        What the results say of commit, processor, system and confinement, and cannot be confirmed here.
    unconfirmed_fields : tuple of str
        Names of the fields in ``unconfirmed``.
    claimed : tuple of str
        Fields that no repetition proves, also where they are as here.
    summary : str
        What is proven and what is only claimed, in one sentence.
    set_aside : tuple of str
        Results in the folder that cannot be those of a campaign.
    missing : tuple of str
        Rows that lack seeds which other rows of the scenario have. A board does not rank them.
    finds : str
        What the sample can find.
    """

    folder: str
    results: int
    seal: str
    other_seals: int
    repeated: int
    same: int
    close: tuple[str, ...]
    different: tuple[str, ...]
    not_repeatable: tuple[str, ...]
    unknown: tuple[str, ...]
    claims: tuple[str, ...] = ()
    unconfirmed: tuple[str, ...] = ()
    set_aside: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    finds: str = ""
    unconfirmed_fields: tuple[str, ...] = ()
    claimed: tuple[str, ...] = CLAIMED
    summary: str = ""
    not_here: tuple[str, ...] = ()

    @property
    def refuted(self) -> bool:
        """Whether something that was looked at is not as it should be."""
        return bool(self.other_seals or self.different or self.not_repeatable or self.claims or self.set_aside)

    @property
    def passed(self) -> bool:
        """Whether all that was looked at is as it should be, and something was."""
        return bool(self.repeated) and not self.refuted and not self.not_here

    def to_dict(self) -> dict[str, Any]:
        """The fields as values that JSON can hold."""
        return asdict(self) | {"passed": self.passed}


def verify_results(
    folder: Path,
    seal: Seal = PUBLIC,
    *,
    sample: int | None = None,
    scenarios: Sequence[Scenario] = (),
    estimators: Sequence[EstimatorRequest] = (),
    rows: Collection[str] = (),
    progress: Callable[..., None] | None = None,
) -> Verification:
    """Check the seal of all results, and repeat a sample of them; see `simnav.leaderboard.inspection.verify`."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", store.StoreWarning)
        found = store.load(folder, series=False)
    set_aside = tuple(str(w.message) for w in said if isinstance(w.message, store.SetAsideWarning))
    if not found and not set_aside:
        raise RequestError(f"there are no results in {folder}")
    if unknown_rows := sorted(set(rows) - {r.estimator for r in found}):
        raise RequestError(f"there are no results of {unknown_rows[0]!r} in {folder}")
    missing = missing_seeds(found)
    found = [r for r in found if not rows or r.estimator in rows]
    mine = [r for r in found if r.provenance.seal == seal.hash]
    count = sample_size(len(mine)) if sample is None else min(sample, len(mine))
    chosen = random.SystemRandom().sample(mine, count)
    known = {s.id: s for s in scenarios}
    requests = {e.label: e for e in estimators}
    report = progress or (lambda *_, **__: None)
    close, different, without, absent, unknown, same = [], [], [], [], dict[str, None](), 0
    pairs: list[tuple[Result, Result]] = []
    with scratch("verify") as home:
        for k, result in enumerate(chosen):
            what = f"{result.estimator} on {result.scenario}, run {result.seed}"
            report(k, len(chosen), note=what)
            try:
                scenario = known.get(result.scenario) or _scenario(folder, result.scenario)
                request = requests.get(result.estimator) or request_of(result)
            except (RequestError, ValueError) as error:
                absent.append(f"{what}: {sentence(error)}")
                continue
            try:
                again = _repeat(result, home / "runs", seal, scenario, request)  # one folder: one process
            except (RequestError, ValueError) as error:
                without.append(f"{what}: {sentence(error)}")
                continue
            if not _same_address(result, again):
                without.append(f"{what}: simulator, scenario, estimator or parameters are not those of the result")
                continue
            pairs.append((result, again))
            others, undecided = differing(result, again)
            if again.status == result.status:
                comparison = compared(result, again)
                unknown |= dict.fromkeys(comparison.unknown)
                others += comparison.different
            else:
                comparison = Comparison([], [], [])
            if others:
                different.append(f"{what}: {listed(others)}")
            elif undecided:
                without.append(f"{what}: {listed(undecided)}")
            elif comparison.close:
                close.append(f"{what}: {listed(comparison.close)}")
            else:
                same += 1
        report(len(chosen), len(chosen))
    used = next((a.provenance.confinement for _, a in pairs if a.tried and not a.reference), "")
    said_of = claims(mine, here(used))
    return Verification(
        str(folder), len(found), seal.hash, len(found) - len(mine), len(chosen), same, tuple(close),
        (*different, *too_quick(pairs)), tuple(without), tuple(unknown), tuple(said_of.different),
        tuple(said_of.unconfirmed), set_aside, missing, findable(len(mine), len(chosen)), tuple(said_of.fields),
        summary=proven(same + len(close), said_of.fields), not_here=tuple(absent),
    )  # fmt: skip


def missing_seeds(results: Sequence[Result]) -> tuple[str, ...]:
    """Rows that lack seeds of a scenario that others have, in words."""
    seeds: dict[str, dict[str, set[int]]] = {}
    for r in results:
        seeds.setdefault(r.scenario, {}).setdefault(r.estimator, set()).add(r.seed)
    found = []
    for scenario, by in sorted(seeds.items()):
        every = set().union(*by.values())
        for label, mine in sorted(by.items()):
            if lacking := every - mine:
                found.append(f"{label} lacks {len(lacking)} of {len(every)} runs of {scenario}, such as {min(lacking)}")
    return tuple(found)


def _same_address(stored: Result, again: Result) -> bool:
    """Whether a result is that of a run: by declared versions, if it came with simnav, otherwise by its key."""
    from simnav.estimator.registry import is_own

    if not is_declared(stored.recording) or not is_own(stored.estimator.partition("(")[0]):
        return stored.key == again.key
    return [r.key for r in declared([stored])] == [r.key for r in declared([again])]


def _scenario(folder: Path, identity: str) -> Scenario:
    """The scenario of the catalogue, or the one whose file came with the results."""
    if identity not in {header.id for header in headers()} and (found := scenario_files.load(folder, identity)):
        return found
    return catalogued_scenario(identity)


def _repeat(
    result: Result,
    folder: Path,
    seal: Seal,
    scenario: Scenario,
    request: EstimatorRequest,
) -> Result:
    by_version = is_declared(result.recording) and not seal.secret
    folder = folder / ("by-version" if by_version else "by-digest")
    usual = time_limit(scenario)  # a run that is said to have met a tiny limit is given the usual one
    run_campaign(
        [scenario], [request], [result.seed], folder, workers=1,
        time_limit=min(max(result.time_limit, usual), _MOST_TIME * usual),
        memory_limit=min(max(result.memory_limit / 2**20, MEMORY), _MOST_MEMORY * MEMORY), seal=seal,
        by_version=by_version,
    )  # fmt: skip
    mine = (result.scenario, result.estimator, result.seed)
    found = (r for r in store.load(folder, series=False) if (r.scenario, r.estimator, r.seed) == mine)
    again = next(found, None)
    if again is None:
        raise RequestError("the repeated run gave no result that can be read")
    return again


def request_of(result: Result) -> EstimatorRequest:
    """The registered estimator of a result, with its parameters and its label; never a file that the result names.

    Raises
    ------
    RequestError
        If no estimator of that name is registered, or a parameter names a file of this machine.
    """
    name = result.estimator.partition("(")[0]
    try:
        registered(name)
    except EstimatorError as error:
        raise RequestError(f"{sentence(error)}; give its file with --estimator") from None
    if named_files(result.parameters.values()):
        raise RequestError("a parameter of the result names a file; give the estimator with --estimator")
    return EstimatorRequest(name, dict(result.parameters), result.estimator)
