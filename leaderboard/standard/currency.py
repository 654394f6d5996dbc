"""Which stored results are not what the code of today would give, by the digests that are in their keys."""

from __future__ import annotations

import os
import warnings
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from simnav.estimator import EstimatorError
from simnav.estimator.registry import registered
from simnav.leaderboard.campaign.fingerprint import (
    estimator_source,
    has_recordings,
    recording_digest,
    simulator_version,
    variant,
)
from simnav.leaderboard.campaign.own_scores import changed_code, scoring_code
from simnav.leaderboard.campaign.request import comes_with_simnav
from simnav.leaderboard.results import store
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.leaderboard.results.provenance import BENCHMARK
from simnav.leaderboard.results.result import Result

__all__ = ["Change", "Outdated", "changes", "outdated"]

#: What may have changed: the estimator, the scenario or its simulator; or the scenario is not there any more.
Change = Literal["row", "scenario", "gone"]


@dataclass(frozen=True)
class Outdated:
    """What has to be run again.

    Attributes
    ----------
    rows : tuple of str
        Estimators that have changed, or how they are run.
    scenarios : tuple of str
        Versioned ids of scenarios that have changed, or whose simulator has; each with all its rows.
    scores : tuple of str
        Modules of scores that have changed; all results need them.
    gone : tuple of str
        Versioned ids of scenarios that are not there any more.
    benchmark : str
        Version of the benchmark of the results, where it is not that of today.
    """

    rows: tuple[str, ...] = ()
    scenarios: tuple[str, ...] = ()
    scores: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    benchmark: str = ""

    def __bool__(self) -> bool:
        return any(vars(self).values())

    def sentences(self) -> list[str]:
        """What has changed, and what is to be run again."""
        said = []
        if self.benchmark:
            said.append(f"the results are of {self.benchmark}, and today's is {BENCHMARK}: run everything again")
        if self.scores:
            said.append(f"scores have changed ({', '.join(self.scores)}): run everything again")
        if self.scenarios:
            said.append(f"the simulator or these scenarios have changed: run {', '.join(self.scenarios)} with all rows")
        if self.rows:
            said.append(f"these rows have changed: run {', '.join(self.rows)} on all scenarios")
        if self.gone:
            said.append(f"these scenarios are not there any more: {', '.join(self.gone)}")
        return said

    def to_dict(self) -> dict[str, Any]:
        """Plain."""
        return {**vars(self), "current": not self}


def outdated(folder: str | os.PathLike[str], without: Collection[tuple[str, str]] = ()) -> Outdated:
    """Compare the keys of results with the code of today; nothing is run.

    Of an estimator that does not come with simnav only the scenarios are compared.

    Parameters
    ----------
    folder : path
        Folder of the results.
    without : collection of (str, str)
        Scenarios and estimators whose results do not matter.

    Raises
    ------
    simnav.leaderboard.results.store.StoreError
        If it is no folder of results.
    """
    path = Path(folder)
    version = str(store.described(path).get("benchmark", ""))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", store.StoreWarning)
        results = store.load(path, series=False, scores=())
    if version != BENCHMARK:
        return Outdated(benchmark=version or "no version")
    results = [r for r in results if (r.scenario, r.estimator) not in without]
    found: dict[Change, set[str]] = {"row": set(), "scenario": set(), "gone": set()}
    for (scenario, label), change in changes(results).items():
        found[change].add(label if change == "row" else scenario)
    now, codes = scoring_code(), {r.scoring for r in results if r.scores or r.scoring != "{}"}
    scores = {home for code in codes for home in changed_code(code, now)}
    rows, scenarios, gone = (tuple(sorted(found[change])) for change in ("row", "scenario", "gone"))
    return Outdated(rows, scenarios, tuple(sorted(scores)), gone)


def changes(results: Iterable[Result]) -> dict[tuple[str, str], Change]:
    """What has changed since results were computed, by scenario and estimator; those of today are not in it.

    Of a recorded scenario whose files are not on this machine nothing can be said: it counts as it is.
    """
    one: dict[tuple[str, str], Result] = {}
    for result in results:
        one.setdefault((result.scenario, result.estimator), result)
    simulator = simulator_version()
    recordings = {s: _recording(s, simulator) for s in {scenario for scenario, _ in one}}
    sources: dict[str, str] = {}
    found: dict[tuple[str, str], Change] = {}
    for (scenario, label), result in one.items():
        recording, name = recordings[scenario], label.partition("(")[0]
        if name not in sources:
            sources[name] = _source(name)
        if recording == "":
            continue
        if recording is None:
            found[scenario, label] = "gone"
        elif recording != result.recording:
            found[scenario, label] = "scenario"
        elif sources[name] and variant(recording, label, name, result.parameters, sources[name]) != result.variant:
            found[scenario, label] = "row"
    return found


def _recording(scenario: str, simulator: str) -> str | None:
    """The digest of a scenario's recordings: None where the catalogue does not have it, empty without its files."""
    try:
        found = catalogued_scenario(scenario)
    except (ValueError, OSError):
        return None
    return recording_digest(found, simulator) if has_recordings(found) else ""


def _source(name: str) -> str:
    """The digest of the code of an estimator of simnav; empty for all others."""
    try:
        cls = registered(name)
    except EstimatorError:
        return ""
    return estimator_source(cls) if comes_with_simnav(cls) else ""
