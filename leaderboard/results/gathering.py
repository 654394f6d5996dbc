"""The results of several folders in one, as of the parts of one campaign.

A folder may be of others. So nothing of it is taken that contradicts another folder: a result that differs, a run whose
recording was another one, a name that looks like a known one.
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import warnings
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from . import requested, scenario_files, store
from .admission import is_scenario_id, label_fault, lookalikes
from .errors import StoreError
from .folder import COMPACTED, LOOSE, TRIALS, DamagedError, tables_of
from .provenance import BENCHMARK
from .result import Result
from .versions import is_declared

__all__ = ["contradiction", "gather"]

#: Relative difference of a score that another processor may make.
_CLOSE = 1e-6
_FACTS = ("status", "parameters", "learned", "reference", "scenario_digest", "estimator_digest")


def gather(output: str | os.PathLike[str], folders: Iterable[str | os.PathLike[str]]) -> Path:
    """Put the results of several folders into one, and return its path; see `simnav.leaderboard.inspection.merge`.

    Results that came with simnav go together with those of a local campaign if the declared version of the simulator is
    the same; they are known by it from then on. One estimator on one scenario must come from one sort of folder.

    Raises
    ------
    StoreError
        If a folder cannot be used, or the results do not go together. Then the output is as it was.
    """
    paths, target = [Path(folder) for folder in folders], Path(output)
    markers = [(path, store.described(path)) for path in (target, *paths)]
    for path, marker in markers[1:]:
        if not marker:
            raise StoreError(f"there are no results in {path}; 'simnav campaign' makes some")
    there = [(path, marker) for path, marker in markers if marker]
    current = _current(there)
    first = _checked([path for path, _ in there])
    target = store.create(target)
    for path in paths:
        _copy(path, target, {key for key, whence in first.items() if whence == path})
    requested.copy(target, paths)
    scenario_files.copy(target, paths)
    store.select(target, {s: (e["recording"], e["estimators"]) for s, e in current.items()})
    store.compact(target)
    return target


def _current(markers: Collection[tuple[Path, Mapping[str, Any]]]) -> dict[str, Any]:
    """What is current in the folders together."""
    current: dict[str, Any] = {}
    whence: dict[tuple[str, str], Path] = {}
    for path, marker in markers:
        if marker["current"] and marker.get("benchmark") != BENCHMARK:
            version = marker.get("benchmark", "a benchmark without a version")
            raise StoreError(f"the results in {path} belong to {version}, not to {BENCHMARK}: they cannot be merged")
        for scenario, entry in marker["current"].items():
            if not is_scenario_id(scenario):
                raise StoreError(f"{path}: {scenario!a:.80} is no versioned id of a scenario")
            both = current.setdefault(scenario, {"recording": entry["recording"], "estimators": {}})
            first = whence.setdefault((scenario, ""), path)
            if both["recording"] != entry["recording"] and _same_simulator(first, path, scenario):
                both["recording"] = max(both["recording"], entry["recording"], key=is_declared)
            elif both["recording"] != entry["recording"]:
                raise StoreError(
                    f"{scenario}, or the simulator, differs between {first} and {path}: run one of them again"
                )
            for label, variant in entry.get("estimators", {}).items():
                if why := label_fault(label):
                    raise StoreError(f"{path}: estimator = {label!a:.80}: {why}")
                first = whence.setdefault((scenario, label), path)
                if both["estimators"].setdefault(label, variant) != variant:
                    raise StoreError(f"{label} on {scenario} differs between {first} and {path}: run one of them again")
    alike = lookalikes(label for entry in current.values() for label in entry["estimators"])
    for (_, label), path in whence.items():
        if label in alike:
            raise StoreError(f"{path}: estimator {label!a:.80} can be taken for {alike[label]}; give it another name")
    return current


def _checked(paths: Iterable[Path]) -> dict[str, Path]:
    """The folder that first holds each result, by key.

    Raises
    ------
    StoreError
        If results contradict each other, or one cannot be that of a campaign.
    """
    whence: dict[str, Path] = {}
    known: dict[str, Result] = {}
    runs: dict[tuple[str, int], tuple[Result, Path]] = {}
    for path in dict.fromkeys(paths):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", store.StoreWarning)
            found = store.load(path, series=False)
        for warning in said:
            if isinstance(warning.message, store.SetAsideWarning):
                raise StoreError(str(warning.message))
            warnings.warn(warning.message, stacklevel=2)
        for result in found:
            other = known.setdefault(result.key, result)
            if why := contradiction(other, result):
                what = f"{result.estimator} on {result.scenario}, run {result.seed}"
                raise StoreError(f"{what}: {why}, in {whence[result.key]} and in {path}: keep one of them")
            whence.setdefault(result.key, path)
            if result.status != "no-recording":
                run, home = runs.setdefault((result.scenario, result.seed), (result, path))
                if why := other_recording(run, result):
                    raise StoreError(
                        f"run {result.seed} of {result.scenario}: {why}, for {run.estimator} in {home} and for "
                        f"{result.estimator} in {path}: one of them is not of this run"
                    )
    return whence


def contradiction(a: Result, b: Result) -> str:
    """In what two results of one key differ that should be the same; empty where they agree.

    Wall times and machines may differ, and scores by what another processor rounds.
    """
    if a is b:
        return ""
    for name in _FACTS:
        x, y = getattr(a, name), getattr(b, name)
        if x != y and x != "" and y != "":
            return f"{name} is {x!a:.80} and {y!a:.80}"
    for name, x in a.scores.items():
        y = b.scores.get(name, x)
        if name.startswith("update_") or x == y or (math.isnan(x) and math.isnan(y)):
            continue
        if not abs(x - y) <= _CLOSE * max(abs(x), abs(y)) < math.inf:
            return f"{name} is {x:.9g} and {y:.9g}"
    return other_recording(a, b)


def other_recording(a: Result, b: Result) -> str:
    """In what the recordings of two results of one run differ; empty where they are the same."""
    if a.note != b.note and "no-recording" not in (a.status, b.status):
        return f"note is {a.note!a:.80} and {b.note!a:.80}"
    if a.draws and b.draws and a.draws != b.draws:
        return "other values were drawn"
    return ""


def _copy(path: Path, target: Path, mine: Collection[str]) -> None:
    """Copy the files of a folder; a trial from the folder that first holds its result."""
    for part in store.FILES:
        for file in sorted((path / part).glob("[!.]*")):
            if file.suffix not in (".json", ".parquet") or (part == TRIALS and file.stem not in mine):
                continue
            if file.is_symlink() or not file.is_file():  # what a link of others leads to is none of their results
                continue
            place = target / part / file.name
            if place.exists() and (part not in (COMPACTED, LOOSE) or place.read_bytes() == file.read_bytes()):
                continue
            place = _free(place)
            place.parent.mkdir(exist_ok=True)
            with store.atomic(place) as copy, open(file, "rb") as original:
                shutil.copyfileobj(original, copy)
            if part in (COMPACTED, LOOSE):
                _looked_through(place)


def _free(place: Path) -> Path:
    """A name that no other file has: packed folders call the file of a row alike."""
    count, found = 1, place
    while found.exists():
        count += 1
        found = place.with_name(f"{place.stem}-{count}{place.suffix}")
    return found


def _same_simulator(first: Path, second: Path, scenario: str) -> bool:
    """Whether one folder came with simnav, and the simulator of the other has the same version."""
    if not any(is_declared(store.described(p)["current"][scenario]["recording"]) for p in (first, second)):
        return False
    found = {
        r.simulator_version
        for p in (first, second)
        for r in store.load(p, series=False, scores=())
        if r.scenario == scenario
    }
    return len(found) == 1


def _looked_through(file: Path) -> None:
    """Read a copy as a whole: one that is damaged is set aside, and the original stays as it is."""
    with contextlib.suppress(DamagedError):
        for _ in tables_of(file):
            pass
