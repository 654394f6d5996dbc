"""Which stored results are not what the code of today would give, by the digests that are in their keys."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simnav.estimator import EstimatorError, find
from simnav.leaderboard.campaign.fingerprint import estimator_source, recording_digest, simulator_version, variant
from simnav.leaderboard.campaign.own_scores import scoring_code, scoring_differs
from simnav.leaderboard.campaign.request import comes_with_simnav
from simnav.leaderboard.results import store
from simnav.leaderboard.results.provenance import BENCHMARK
from simnav.leaderboard.results.result import Result
from simnav.scenario import load

__all__ = ["Outdated", "outdated"]


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
        Scenarios and estimators that are not there any more.
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
            said.append(f"these are not there any more: {', '.join(self.gone)}")
        return said

    def to_dict(self) -> dict[str, Any]:
        """Plain."""
        return {**vars(self), "current": not self}


def outdated(folder: str | os.PathLike[str]) -> Outdated:
    """Compare the keys of results with the code of today; nothing is run.

    Of an estimator that does not come with simnav only the scenarios are compared.

    Parameters
    ----------
    folder : path
        Of the results.

    Raises
    ------
    simnav.leaderboard.results.store.StoreError
        If it is no folder of results.
    """
    path = Path(folder)
    marker = store.described(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", store.StoreWarning)
        results = store.load(path, series=False, scores=())
    version = str(marker.get("benchmark", ""))
    if version != BENCHMARK:
        return Outdated(benchmark=version or "no version")
    one: dict[tuple[str, str], Result] = {}
    for result in results:
        one.setdefault((result.scenario, result.estimator), result)
    simulator = simulator_version()
    rows, scenarios, gone, scores = set[str](), set[str](), set[str](), set[str]()
    recordings = {s: _recording(s, simulator) for s in {scenario for scenario, _ in one}}
    sources: dict[str, str | None] = {}
    now = scoring_code()
    for (scenario, label), result in one.items():
        recording = recordings[scenario]
        if recording is None:
            gone.add(scenario)
            continue
        if recording != result.recording:
            scenarios.add(scenario)
            continue
        name = label.partition("(")[0]
        if name not in sources:
            sources[name] = _source(name)
        source = sources[name]
        if source is None:
            gone.add(label)
        elif source and variant(recording, label, name, result.parameters, source) != result.variant:
            rows.add(label)
    for text in {r.scoring for r in results if r.scores or r.scoring != "{}"}:
        scores |= _changed(text, now)
    return Outdated(tuple(sorted(rows)), tuple(sorted(scenarios)), tuple(sorted(scores)), tuple(sorted(gone)))


def _recording(scenario: str, simulator: str) -> str | None:
    """The digest of a scenario's recordings; None where the catalogue does not have it."""
    try:
        return recording_digest(load(scenario), simulator)
    except (ValueError, OSError):
        return None


def _source(name: str) -> str | None:
    """The digest of an estimator's code; None where there is none of the name, empty where it is of others."""
    try:
        cls = find(name)
    except EstimatorError:
        return ""
    return estimator_source(cls) if comes_with_simnav(cls) else ""


def _changed(before: str, now: str) -> set[str]:
    import json

    if not scoring_differs(before, now):
        return set()
    old, new = json.loads(before or "{}"), json.loads(now)
    return {home for home, code in old.items() if new.get(home) != code} or {"all"}
