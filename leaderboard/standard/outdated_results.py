"""Which stored results are out of date: those whose declared versions are not the versions of today.

Nothing is run, and no code is digested: whoever changes a number raises a version, and ``tests/golden`` demands it.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from simnav.leaderboard.ranking.superseded import version_of
from simnav.leaderboard.results import store
from simnav.leaderboard.results.provenance import BENCHMARK
from simnav.leaderboard.results.result import Result
from simnav.scenario import headers
from simnav.simulation.version import SIMULATOR_VERSION

__all__ = ["Change", "Outdated", "changes", "outdated"]

#: What has another version: the estimator or the simulator; or the scenario is not there any more.
Change = Literal["row", "simulator", "gone"]


@dataclass(frozen=True)
class Outdated:
    """What has to be run again.

    Attributes
    ----------
    rows : tuple of str
        Estimators that have another version.
    scenarios : tuple of str
        Versioned ids of scenarios whose results are of another version of the simulator; each with all its rows.
    gone : tuple of str
        Versioned ids of scenarios that are not there any more, or have another version.
    benchmark : str
        Version of the benchmark of the results, where it is not that of today.
    """

    rows: tuple[str, ...] = ()
    scenarios: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    benchmark: str = ""

    def __bool__(self) -> bool:
        return any(vars(self).values())

    def sentences(self) -> list[str]:
        """What has changed, and what is to be run again."""
        said = []
        if self.benchmark:
            said.append(f"the results are of {self.benchmark}, and today's is {BENCHMARK}: run everything again")
        if self.scenarios:
            said.append(
                f"the simulator now has version {SIMULATOR_VERSION}: run {', '.join(self.scenarios)} with all rows"
            )
        if self.rows:
            said.append(f"these rows have another version: run {', '.join(self.rows)} on all scenarios")
        if self.gone:
            said.append(f"these scenarios have another version or are not there any more: {', '.join(self.gone)}")
        return said

    def to_dict(self) -> dict[str, Any]:
        """The fields as values that JSON can hold."""
        return {**vars(self), "current": not self}


def outdated(folder: str | os.PathLike[str], without: Collection[tuple[str, str]] = ()) -> Outdated:
    """Compare the declared versions of results with those of today; nothing is run.

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
    if version != BENCHMARK:
        return Outdated(benchmark=version or "no version")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", store.StoreWarning)
        results = store.load(path, series=False, scores=())
    found: dict[Change, set[str]] = {"row": set(), "simulator": set(), "gone": set()}
    for (scenario, label), change in changes(results).items():
        if (scenario, label) not in without:
            found[change].add(label if change == "row" else scenario)
    rows, scenarios, gone = (tuple(sorted(found[change])) for change in ("row", "simulator", "gone"))
    return Outdated(rows, scenarios, gone)


def changes(results: Iterable[Result]) -> dict[tuple[str, str], Change]:
    """What has another version than results, by scenario and estimator; those of today are not in it.

    The version of an estimator that does not come with simnav is not compared.
    """
    there = {header.id for header in headers()}
    versions: dict[str, int | None] = {}
    found: dict[tuple[str, str], Change] = {}
    for result in results:
        scenario, label = result.scenario, result.estimator
        if label not in versions:
            versions[label] = version_of(label.partition("(")[0])
        if scenario not in there:
            found[scenario, label] = "gone"
        elif result.simulator_version != SIMULATOR_VERSION:
            found[scenario, label] = "simulator"
        elif versions[label] not in (None, result.estimator_version):
            found.setdefault((scenario, label), "row")
    return found
