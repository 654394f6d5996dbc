"""Scores computed again from the trials that a campaign kept; no estimator runs."""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results import store, trials
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.versions import is_declared
from simnav.scoring import SCORES, score
from simnav.simulation.version import SIMULATOR_VERSION
from simnav.spec import closest

from .fingerprint import recording_digest, simulator_version
from .own_scores import same_code, scoring_code, scoring_differs
from .recorder import record_here
from .seal import PUBLIC, Seal

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result
    from simnav.scenario import Scenario

__all__ = ["Rescored", "rescore_results"]


@dataclass(frozen=True)
class Rescored:
    """What was scored again.

    Attributes
    ----------
    folder : Path
        Folder of the results.
    scores : tuple of str
        Names of those that were computed.
    rescored : int
        Results that were given any of them.
    complete : int
        Results with a trial that had all their scores already.
    without_trial : int
        Results that keep what they had, for there is no trial: none was kept, or the run gave nothing.
    seconds : float
        Wall-clock time [s].
    """

    folder: Path
    scores: tuple[str, ...]
    rescored: int
    complete: int
    without_trial: int
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav campaign rescore --json`` prints."""
        facts = asdict(self)
        return {"results": str(facts.pop("folder")), **facts, "scores": list(self.scores)}


def rescore_results(
    folder: str | os.PathLike[str],
    names: Iterable[str] = (),
    scenarios: Iterable[Scenario] = (),
    progress: Callable[..., None] | None = None,
    keys: Collection[str] | None = None,
    seal: Seal = PUBLIC,
) -> Rescored:
    """Compute scores of the current results of a folder; see `simnav.leaderboard.inspection.rescore`.

    Parameters
    ----------
    folder, names, scenarios, progress
        As there.
    keys : collection of str, optional
        Keys of the results. Default: all results that have a stored trial.
    seal : Seal
        Seal of results with sealed seeds; only these results are then scored.

    Returns
    -------
    Rescored

    Raises
    ------
    RequestError
        If a score or a scenario is unknown, no trial was kept, or a scenario or the simulator has changed since, so
        that the recording cannot be made again, or the key of sealed seeds is missing or another one. The results
        keep what they had.
    StoreError
        If the folder or a trial in it cannot be used.
    """
    started = time.monotonic()
    path = Path(folder).resolve()
    asked = tuple(names)
    for name in asked:
        if name not in SCORES:
            raise RequestError(f"there is no score {name!r}{closest(name, list(SCORES))}")
    results = store.load(path, series=False)
    kept = [r for r in results if (keys is None or r.key in keys) and trials.is_kept(path, r.key)]
    if not kept:
        raise RequestError(f"no trials were kept in {path}; 'simnav campaign --keep-trials' keeps them")
    kept = _sealed_alike(kept, seal)
    code = scoring_code()

    def wanted(result: Result) -> list[str]:
        if asked:
            return list(asked)
        as_now = same_code(result.scoring, code)
        return [
            name
            for name, s in SCORES.items()
            if name not in result.scores or (s.__module__.startswith("simnav.") and s.__module__ not in as_now)
        ]

    by_run: dict[tuple[str, int], list[tuple[Result, list[str]]]] = defaultdict(list)
    for result in kept:
        if (chosen := wanted(result)) or scoring_differs(result.scoring, code):  # or a module of scores is gone
            by_run[result.scenario, result.seed].append((result, chosen))
    known = _scenarios({scenario: found[0][0] for (scenario, _), found in by_run.items()}, scenarios, seal)
    changed: dict[str, Mapping[str, float]] = {}
    computed: dict[str, None] = {}
    for done, ((scenario, seed), found) in enumerate(sorted(by_run.items(), key=lambda item: item[0])):
        if progress is not None:
            progress(done, len(by_run), note=f"{scenario}, seed {seed}")
        recording = record_here(known[scenario], seal.seed(scenario, seed))
        for result, chosen in found:
            trial, thinned = trials.read(path, result.key, recording)
            now = [n for n in chosen if not (thinned and SCORES[n].uses_covariance and n in result.scores)]
            changed[result.key] = {**result.scores, **score(trial, recording, now)}
            computed |= dict.fromkeys(now)
    if progress is not None:
        progress(len(by_run), len(by_run))
    _store(path, kept, changed, "" if asked and not set(asked) >= set(SCORES) else code)
    scores = asked or tuple(name for name in SCORES if name in computed)
    return Rescored(
        path, scores, len(changed), len(kept) - len(changed), len(results) - len(kept), time.monotonic() - started
    )


def _store(path: Path, kept: list[Result], changed: Mapping[str, Mapping[str, float]], code: str) -> None:
    """Write the scores, and with which code all of a result were computed; without ``code`` that stays as it was."""
    by_code: dict[str, dict[str, Mapping[str, float]]] = defaultdict(dict)
    for result in kept:
        if result.key in changed:
            by_code[code or result.scoring][result.key] = changed[result.key]
    for whole, scores in by_code.items():
        store.rescore(path, scores, whole)


def _sealed_alike(kept: list[Result], seal: Seal) -> list[Result]:
    """The results of a key, or those with public seeds; all of the others cannot be recorded again."""
    mine = [r for r in kept if r.provenance.seal == seal.hash]
    if mine:
        return mine
    if not seal.secret:
        raise RequestError("the seeds of these results are sealed; give the key, with --key KEYFILE")
    hashes = sorted({r.provenance.seal for r in kept} - {""})
    raise RequestError(
        f"the hash of this key is {seal.hash}, and the results carry {hashes[0]}: it is another key"
        if hashes
        else "the seeds of these results are public; leave out the key"
    )


def _scenarios(examples: Mapping[str, Result], given: Iterable[Scenario], seal: Seal) -> dict[str, Scenario]:
    """The scenarios of results, by id, as they were when the results were computed."""
    found, simulator = {s.id: s for s in given}, simulator_version()
    for scenario, result in examples.items():
        if scenario not in found:
            found[scenario] = catalogued_scenario(scenario)
        if is_declared(result.recording):
            same = result.simulator_version == SIMULATOR_VERSION
        else:
            same = seal.recording(recording_digest(found[scenario], simulator)) == result.recording
        if not same:
            raise RequestError(
                f"the recordings of {scenario} cannot be made again, for the scenario or the simulator has changed "
                "since; run the campaign again"
            )
    return found
