"""Verify results: is their seal that of the published key, and do runs that are repeated give the same bits?"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from simnav.leaderboard.campaign.campaign import MEMORY, run_campaign
from simnav.leaderboard.campaign.own_scores import same_code, scoring_code
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.seal import PUBLIC, Seal
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError, sentence
from simnav.leaderboard.results.versions import declared, is_declared
from simnav.scenario import load

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result
    from simnav.scenario import Scenario

__all__ = ["CLOSE", "Comparison", "Verification", "compared", "listed", "request_of", "verify_results"]

#: Relative difference of a score that was computed from a trial in single precision.
CLOSE = 1e-6


@dataclass(frozen=True)
class Verification:
    """What came of repeating a sample of results.

    Attributes
    ----------
    folder : str
        Folder of the results.
    results : int
        Number of results in the folder.
    seal : str
        Hash of the key; empty for public seeds.
    other_seals : int
        Results that were not made under this key.
    repeated : int
        Runs that were repeated.
    close : tuple of str
        Those of which some scores differ by less than `CLOSE`, and which: as scores do that were computed again from
        a kept trial (`simnav.rescore`).
    different : tuple of str
        Those that gave other scores, and which.
    not_repeatable : tuple of str
        Those that could not be repeated, and why: other code, or an estimator that is not here.
    unknown : tuple of str
        Scores of the results that are not known in this process, for a plug-in was not loaded; they were not looked at.
    """

    folder: str
    results: int
    seal: str
    other_seals: int
    repeated: int
    close: tuple[str, ...]
    different: tuple[str, ...]
    not_repeatable: tuple[str, ...]
    unknown: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether all that was looked at is as it should be, and something was."""
        return bool(self.repeated) and not (self.other_seals or self.different or self.not_repeatable)

    def to_dict(self) -> dict[str, Any]:
        """Plain."""
        return asdict(self) | {"passed": self.passed}


def verify_results(
    folder: Path,
    seal: Seal = PUBLIC,
    *,
    sample: int = 10,
    scenarios: Sequence[Scenario] = (),
    estimators: Sequence[EstimatorRequest] = (),
    progress: Callable[..., None] | None = None,
) -> Verification:
    """Check the seal of all results, and repeat a sample of them; see `simnav.leaderboard.inspection.verify`."""
    found = store.load(folder, series=False)
    if not found:
        raise RequestError(f"there are no results in {folder}")
    mine = [r for r in found if r.provenance.seal == seal.hash]
    tried = [r for r in mine if r.status == "ok"]
    chosen = random.SystemRandom().sample(tried, min(sample, len(tried)))
    known = {s.id: s for s in scenarios}
    requests = {e.label: e for e in estimators}
    report = progress or (lambda *_, **__: None)
    close, different, without, unknown = [], [], [], dict[str, None]()
    with tempfile.TemporaryDirectory(prefix="simnav-verify-") as name:
        for k, result in enumerate(chosen):
            what = f"{result.estimator} on {result.scenario}, run {result.seed}"
            report(k, len(chosen), note=what)
            try:
                again = _repeat(result, Path(name) / "runs", seal, known, requests)  # one folder: one process
            except (RequestError, ValueError) as error:
                without.append(f"{what}: {sentence(error)}")
                continue
            if not _same_address(result, again):
                without.append(f"{what}: simulator, scenario, estimator or parameters are not those of the result")
                continue
            if again.status != result.status:
                different.append(f"{what}: {result.status} is stored, {again.status} came out")
                continue
            comparison = compared(result, again)
            unknown |= dict.fromkeys(comparison.unknown)
            if comparison.different:
                different.append(f"{what}: {listed(comparison.different)}")
            elif comparison.close:
                close.append(f"{what}: {listed(comparison.close)}")
        report(len(chosen), len(chosen))
    return Verification(
        str(folder), len(found), seal.hash, len(found) - len(mine), len(chosen), tuple(close), tuple(different),
        tuple(without), tuple(unknown),
    )  # fmt: skip


def _same_address(stored: Result, again: Result) -> bool:
    """Whether a result is that of a run: by declared versions, if it came with simnav, otherwise by its key."""
    if not is_declared(stored.recording):
        return stored.key == again.key
    return [r.key for r in declared([stored])] == [r.key for r in declared([again])]


def _repeat(
    result: Result,
    folder: Path,
    seal: Seal,
    known: Mapping[str, Scenario],
    requests: Mapping[str, EstimatorRequest],
) -> Result:
    scenario = known.get(result.scenario) or load(result.scenario)
    request = requests.get(result.estimator) or request_of(result)
    run_campaign(
        [scenario], [request], [result.seed], folder, workers=1, timeout=result.time_limit or None,
        memory=result.memory_limit or MEMORY, seal=seal,
    )  # fmt: skip
    mine = (result.scenario, result.estimator, result.seed)
    return next(r for r in store.load(folder, series=False) if (r.scenario, r.estimator, r.seed) == mine)


def request_of(result: Result) -> EstimatorRequest:
    """The registered estimator of a result, with its parameters and its label."""
    return EstimatorRequest(result.estimator.partition("(")[0], dict(result.parameters), result.estimator)


class Comparison(NamedTuple):
    """Scores that differ, each with both values in words, and those that are not known here."""

    close: list[str]
    different: list[str]
    unknown: list[str]


def compared(stored: Result, again: Result, close: float = CLOSE) -> Comparison:
    """Compare scores to the bit, wall times aside; NaN is equal to NaN.

    What was stored in single precision (`simnav.leaderboard.results.packing`) is compared with the rounded score. A
    score that came to simnav after the results, or by a plug-in, need not be in them.
    """
    from simnav.scoring import SCORES

    found = Comparison([], [], [])
    homes = same_code(stored.scoring, scoring_code())
    for name in dict.fromkeys((*stored.scores, *again.scores)):
        if name.startswith("update_"):
            continue
        if name not in stored.scores:
            if SCORES[name].__module__ in homes:
                found.different.append(f"{name} is missing")
        elif name not in again.scores:
            found.unknown.append(name)
        else:
            a, b = float(stored.scores[name]), float(again.scores[name])
            if a.hex() in (b.hex(), float(np.float32(b)).hex()):
                continue
            words = f"{name} {a:.9g} is stored, {b:.9g} came out"
            (found.close if abs(a - b) <= close * max(abs(a), abs(b)) else found.different).append(words)
    return found


def listed(scores: Sequence[str]) -> str:
    """The first three of them, and how many more there are."""
    more = f"; and {len(scores) - 3} more" if len(scores) > 3 else ""
    return "; ".join(scores[:3]) + more
