"""Carry results over to code that has changed, but gives the same numbers.

The key of a result names the code that decides it, so a tidied kernel or a clearer message makes all results that it
can reach out of date, and changes none of them. `carry` repeats some of their runs with the code of today. A scenario
and estimator of which every repeated run gives the stored scores, to the last digit that is stored, gets the keys of
today. All others stay out of date, and have to be run again.

A result that is carried over says of itself what it said before: the commit, the versions and the digest of the code
that computed it. What was repeated is recorded in a CSV file, one line for each time.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.campaign import Progress, run_campaign
from simnav.leaderboard.campaign.own_scores import scoring_code, scoring_differs
from simnav.leaderboard.campaign.verification import compared, listed, request_of
from simnav.leaderboard.results import store
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.files import csv_text, write_whole
from simnav.leaderboard.results.packing import write_packed
from simnav.leaderboard.results.provenance import here
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.scratch import scratch
from simnav.leaderboard.standard.currency import changes
from simnav.scenario import Scenario

__all__ = ["LAST_DIGIT", "Carried", "carry"]

#: Relative difference that the last digit in single precision makes. Another processor may round a score to the next.
LAST_DIGIT = 2.0**-23

_Row = tuple[str, str]


@dataclass(frozen=True)
class Carried:
    """What came of repeating runs of results that are out of date.

    Attributes
    ----------
    folder : str
        Folder of the results.
    rows, results : int
        Pairs of a scenario and an estimator that were carried over, and their results.
    repeated : int
        Runs that were repeated.
    different : tuple of str
        Runs that gave other scores, and which: their scenario and estimator have to be run again.
    left : tuple of str
        Scenarios and estimators that were not repeated, and why.
    """

    folder: str
    rows: int
    results: int
    repeated: int
    different: tuple[str, ...] = ()
    left: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain."""
        return asdict(self)


@dataclass(frozen=True)
class _Line:
    """A line of the record."""

    date: str
    commit: str
    rows: int
    results: int
    repeated: int


def carry(
    folder: Path,
    record: Path,
    *,
    runs: int = 1,
    workers: int = 2,
    progress: Callable[[Progress], None] | None = None,
) -> Carried:
    """Repeat runs of results that are out of date; see `simnav.leaderboard.publishing.carry_standard`."""
    if runs < 1:
        raise RequestError(f"runs = {runs}: at least one run of each scenario and estimator has to be repeated")
    provenance = here()
    if provenance.dirty:
        raise RequestError("the code differs from its commit, which the record would name: commit it first")
    found = store.load(folder, series=False)
    of: dict[_Row, list[Result]] = {}
    for result in found:
        of.setdefault((result.scenario, result.estimator), []).append(result)
    now = scoring_code()
    scored = {_row(r): "scores" for r in found if scoring_differs(r.scoring, now)}
    stale, left = _repeatable(of, scored | changes(found))
    today, different, repeated = dict[_Row, Result](), list[str](), 0
    with scratch("carry") as home:
        for k, (rows, seeds) in enumerate(_campaigns(stale, runs)):
            scenarios = list({s: stale[s, label][0] for s, label in rows}.values())
            requests = list({label: request_of(of[s, label][0]) for s, label in rows}.values())
            place = home / str(k)
            run_campaign(scenarios, requests, seeds, place, workers=workers, progress=progress)
            again = {(r.scenario, r.estimator, r.seed): r for r in store.load(place, series=False)}
            for row in rows:
                fresh = [(r, again[*row, r.seed]) for r in of[row] if r.seed in seeds]
                repeated += len(fresh)
                differences = [
                    f"run {stored.seed}: {text}" for stored, new in fresh if (text := _difference(stored, new))
                ]
                if differences:
                    different.append(f"{row[1]} on {row[0]}, {'; '.join(differences)}")
                elif fresh:
                    today[row] = fresh[0][1]
    carried = sum(len(of[row]) for row in today)
    if today:
        write_packed([_rekeyed(r, today[_row(r)]) if _row(r) in today else r for r in found], folder)
        _add(
            record, _Line(datetime.now(UTC).strftime("%Y-%m-%d"), provenance.commit[:12], len(today), carried, repeated)
        )
    return Carried(str(folder), len(today), carried, repeated, tuple(different), tuple(left))


def _row(result: Result) -> _Row:
    return result.scenario, result.estimator


def _repeatable(
    of: Mapping[_Row, Sequence[Result]], changed: Mapping[_Row, str]
) -> tuple[dict[_Row, tuple[Scenario, list[int]]], list[str]]:
    """Scenario and stored seeds of the rows whose code alone has changed; and the others, each with the reason."""
    found, left = dict[_Row, tuple[Scenario, list[int]]](), list[str]()
    known: dict[str, Scenario] = {}
    for row, change in sorted(changed.items()):
        name, label = row
        if change == "gone":
            left.append(f"{label} on {name}: the scenario is not there any more")
            continue
        scenario = known[name] = known.get(name) or catalogued_scenario(name)
        if any(r.scenario_digest != scenario.content_hash() for r in of[row]):
            left.append(f"{label} on {name}: the scenario itself has changed")
            continue
        found[row] = scenario, sorted(r.seed for r in of[row])
    return found, left


def _campaigns(stale: Mapping[_Row, tuple[Scenario, list[int]]], runs: int) -> list[tuple[list[_Row], list[int]]]:
    """What is repeated in one campaign: scenarios with the same estimators, and seeds that all of them have."""
    labels: dict[str, dict[str, list[int]]] = {}
    for (scenario, label), (_, seeds) in stale.items():
        labels.setdefault(scenario, {})[label] = seeds
    groups: dict[tuple[str, ...], list[str]] = {}
    for scenario, by in labels.items():
        groups.setdefault(tuple(sorted(by)), []).append(scenario)
    found = []
    draw = random.SystemRandom().sample
    for estimators, scenarios in groups.items():
        rows = [(s, label) for s in scenarios for label in estimators]
        common = sorted(set.intersection(*(set(labels[s][label]) for s, label in rows)))
        if common:
            found.append((rows, draw(common, min(runs, len(common)))))
        else:  # each by itself
            found += [([row], draw(seeds, min(runs, len(seeds)))) for row in rows for _, seeds in [stale[row]]]
    return found


def _difference(stored: Result, fresh: Result) -> str:
    """What is not the same; empty where all scores are, to the last digit that is stored."""
    if stored.status != fresh.status:
        return f"{stored.status} is stored, {fresh.status} came out"
    return listed(compared(stored, fresh, LAST_DIGIT).different)


def _rekeyed(result: Result, fresh: Result) -> Result:
    return replace(
        result, key=f"{fresh.variant}-{result.seed}", recording=fresh.recording, scoring=fresh.scoring
    )  # fmt: skip


def _add(path: Path, line: _Line) -> None:
    """Add a line to the record; it begins with the names of its columns."""
    facts = asdict(line)
    before = path.read_text(encoding="utf-8") if path.exists() else csv_text([facts.keys()])
    write_whole(path, before + csv_text([facts.values()]))
