"""From results of the standard profile to what comes with simnav: packed results, the history of rows, the README."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from simnav.estimator import find
from simnav.leaderboard.arguments import scenarios_of
from simnav.leaderboard.calls import finite_number
from simnav.leaderboard.campaign.campaign import Progress, Summary, combined, require_known, run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest, comes_with_simnav, requests
from simnav.leaderboard.profiles import Profile
from simnav.leaderboard.ranking.board import Ranking
from simnav.leaderboard.ranking.first_view import first_view
from simnav.leaderboard.ranking.further import run_further
from simnav.leaderboard.ranking.next_runs import next_runs
from simnav.leaderboard.ranking.ranking import rank_tracks
from simnav.leaderboard.ranking.track_runs import TrackRuns, runs_of_tracks
from simnav.leaderboard.ranking.trouble_profile import profiles_of
from simnav.leaderboard.results import requested, store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.packing import shortened, write_packed
from simnav.leaderboard.results.provenance import BENCHMARK
from simnav.leaderboard.results.result import SINCE_VERSIONS, Result
from simnav.leaderboard.results.versions import declared, is_declared
from simnav.scenario import Scenario, load

from . import shipped
from .history import append
from .outdated_results import Outdated, changes, outdated
from .readme import PAGE, draw, first_answer, replaced, tables
from .unsuited_results import unsuited

__all__ = ["Published", "begin", "missing", "publish", "run"]


@dataclass(frozen=True)
class Published:
    """What was published.

    Attributes
    ----------
    folder : Path
        Folder of the packed results.
    edition : int
        Number of the edition; 0 for a preliminary result, which is none.
    results : sequence of Result
        All results of the edition.
    tracks : sequence of TrackRuns
        The same results by track.
    ranking : Ranking
        The board that follows from them.
    size : int
        Size of the files in the folder [bytes].
    readme : Path or None
        README that was updated.
    remarks : tuple of str
        What readers should know: results that were left out, or that others cannot repeat.
    """

    folder: Path
    edition: int
    results: Sequence[Result]
    tracks: Sequence[TrackRuns]
    ranking: Ranking
    size: int
    readme: Path | None
    remarks: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav standard publish --json`` prints."""
        return {
            "folder": str(self.folder),
            "edition": self.edition,
            "runs": len(self.results),
            "size": self.size,
            "remarks": list(self.remarks),
            "readme": None if self.readme is None else str(self.readme),
            "ranking": self.ranking.to_dict(),
        }


def begin(working: Path, folder: Path) -> None:
    """Let a new folder start with the results that come with simnav, as far as their versions are those of today.

    Results of rows that do not suit their scenario any more are left out, too; their next run says why.

    Results in a folder that a campaign began before versions were declared get the address of version 1.

    Raises
    ------
    RequestError
        If the folder holds results of a local campaign, which are known by digests of the code.
    """
    before = store.described(working)
    if before:
        _readdress(working, before["current"])
    elif shipped(folder) and store.described(folder).get("benchmark") == BENCHMARK:
        found = store.load(folder, series=False)
        old = changes(found).keys() | unsuited(found)
        write_packed(declared(r for r in found if (r.scenario, r.estimator) not in old), working)
        requested.copy(working, [folder])


def _readdress(working: Path, current: Mapping[str, Any]) -> None:
    """Give results that are known by digests, from before versions were declared, the address of their versions."""
    if all(is_declared(entry["recording"]) for entry in current.values()):
        return
    if store.described(working)["format"] >= SINCE_VERSIONS:
        raise RequestError(
            f"{working} holds results of a local campaign, which are known by digests of the code: name another folder"
        )
    found = store.load(working, series=False, scores=())
    after: dict[str, tuple[str, dict[str, str]]] = {}
    address = dict[str, tuple[str, str]]()
    for old, new in zip(found, declared(found), strict=True):
        address[old.key] = new.key, new.recording
        after.setdefault(new.scenario, (new.recording, {}))[1][new.estimator] = new.variant
    store.readdress(working, address)
    store.select(working, after)


def run(
    profile: Profile,
    working: Path,
    *,
    workers: int = 2,
    minutes: float | None = None,
    force: Sequence[str] = (),
    shard: tuple[int, int] = (1, 1),
    progress: Callable[[Progress], None] | None = None,
) -> Summary:
    """Run what a folder lacks of a profile, by declared versions; see `simnav.leaderboard.publishing.run_standard`."""
    parts = [(scenarios_of(part.scenarios, optional=True), requests(part.estimators), part.runs)
             for part in profile.parts]  # fmt: skip
    require_known(force, [everyone for _, everyone, _ in parts])
    end = None if minutes is None else time.monotonic() + 60.0 * finite_number("minutes", minutes)
    found = [
        run_campaign(
            chosen, everyone, range(runs), working, workers=workers, progress=progress, force=force, shard=shard,
            minutes=None if end is None else max(0.0, (end - time.monotonic()) / 60.0), by_version=True,
        )
        for chosen, everyone, runs in parts
    ]  # fmt: skip
    if shard == (1, 1) and not any(s.left for s in found):  # a shard does not know which rows may be the best
        for part, (chosen, everyone, _) in zip(profile.parts, parts, strict=True):
            rows = {e.label: e for e in everyone}

            def further(
                scenario: Scenario,
                names: Collection[str],
                runs: int,
                minutes: float | None,
                rows: Mapping[str, EstimatorRequest] = rows,
            ) -> Summary:
                return run_campaign([scenario], [rows[name] for name in names], range(runs), working, workers=workers,
                                    minutes=minutes, progress=progress, by_version=True, later=True)  # fmt: skip

            if part.more:
                found += run_further(working, chosen, rows, further, end, most=part.more)
    return combined(found)


def missing(profile: Profile, results: Sequence[Result]) -> dict[str, int]:
    """How many runs of a profile are not there, by scenario and estimator: ``{"ekf on open-sea-v1": 3}``.

    Recorded logs that were not run at all are left out, because their files are not everywhere. Estimators that do not
    come with simnav are left out, too.
    """
    there = {(r.scenario, r.estimator, r.seed) for r in results}
    ran = {r.scenario for r in results}
    found: dict[str, int] = {}
    for part in profile.parts:
        for name in part.scenarios:
            scenario = load(name)
            if scenario.log is not None and scenario.id not in ran:
                continue
            for label in filter(_of_simnav, part.estimators):
                lacking = sum((scenario.id, label, seed) not in there for seed in range(part.runs))
                if lacking:
                    found[f"{label} on {scenario.id}"] = max(lacking, found.get(f"{label} on {scenario.id}", 0))
    return found or _missing_later(profile, results, there)


def _missing_later(
    profile: Profile, results: Sequence[Result], there: Collection[tuple[str, str, int]]
) -> dict[str, int]:
    """As `missing`, of the later stages, where all runs of the first one are there."""
    found: dict[str, int] = {}
    for part in profile.parts:
        if not part.more:
            continue
        chosen, labels = {load(name).id for name in part.scenarios}, set(part.estimators)
        staged = (r for r in results if r.scenario in chosen and r.estimator in labels)
        for each in next_runs(staged, most=part.more):
            for label in each.estimators:
                found[f"{label} on {each.scenario}"] = sum(
                    (each.scenario, label, seed) not in there for seed in range(each.seeds)
                )
    return found


def _of_simnav(label: str) -> bool:
    return comes_with_simnav(find(label.partition("(")[0]))


def publish(
    working: Path,
    profile: Profile,
    folder: Path,
    history: Path,
    readme: Path | None,
    *,
    preliminary: bool = False,
    workers: int = 1,
) -> Published:
    """Pack results, add an edition, and write tables; see `simnav.leaderboard.publishing.publish_standard`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", store.StoreWarning)
        found = store.load(working, series=False)
    named = {(load(s).id, label) for part in profile.parts for s in part.scenarios for label in part.estimators}
    without = changes(found).keys() - named
    old = outdated(working, without)
    only_rows = old == Outdated(rows=old.rows)
    if old and not (preliminary and only_rows):
        also = ", and --preliminary publishes what is there" if only_rows else ""
        raise RequestError(
            f"these results are out of date: {'; '.join(old.sentences())}; 'simnav standard run' does it{also}"
        )
    kept = (replace(r, seconds=round(r.seconds, 3)) for r in found if (r.scenario, r.estimator) not in without)
    results = shortened(declared(kept))  # as others will have them
    lacking = missing(profile, results)
    if lacking and not preliminary:
        first = next(iter(lacking))
        raise RequestError(
            f"{sum(lacking.values())} runs of the profile {profile.name} are missing, such as of {first}; "
            "'simnav standard run' continues, and --preliminary publishes what is there"
        )
    tracks = list(runs_of_tracks(results))
    ranking = rank_tracks(tracks, requested.read(working), workers)
    of = len(results) + sum(lacking.values())
    view = first_view(ranking, profiles_of(tracks, workers))
    texts = {} if readme is None else {readme: replaced(readme, first_answer(view, results, of))}
    if readme is not None and (page := readme.parent / PAGE).is_file():
        texts[page] = replaced(page, tables(ranking, results, of))  # fails before all is written
    same = working.resolve() == folder.resolve() and all(is_declared(r.recording) for r in found)
    if without or not same:
        write_packed(results, folder)
        requested.copy(folder, [working])
    edition = 0 if lacking else append(history, ranking, results)
    for file, text in texts.items():
        write_whole(file, text)
    if readme is not None:
        draw(ranking, view, readme.parent)
    size = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())
    return Published(folder, edition, results, tracks, ranking, size, readme, _remarks(results, without))


def _remarks(results: Sequence[Result], without: Collection[tuple[str, str]]) -> tuple[str, ...]:
    said = [
        f"{label} on {scenario} is left out: it is out of date, and the profile does not name it"
        for scenario, label in sorted(without)
    ]
    tried = [r for r in results if r.tried]
    entrants = [r for r in tried if not r.reference]  # a reference is told the truth, and nothing is kept from it
    if dirty := sum(bool(r.provenance.dirty) for r in tried):
        said.append(f"{dirty} runs were computed with changes that no commit holds, so others cannot repeat them")
    if free := sum(r.provenance.confinement in ("", "none", "external") for r in entrants):
        said.append(f"{free} runs were computed without confinement")
    return tuple(said)
