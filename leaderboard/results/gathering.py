"""The results of several folders in one, as of the parts of one campaign."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from simnav.leaderboard.results import requested, store
from simnav.leaderboard.results.errors import StoreError
from simnav.leaderboard.results.folder import COMPACTED, LOOSE, DamagedError, tables_of
from simnav.leaderboard.results.provenance import BENCHMARK
from simnav.leaderboard.results.versions import is_declared

__all__ = ["gather"]


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
    current: dict[str, Any] = {}
    whence: dict[tuple[str, str], Path] = {}
    for path, marker in (m for m in markers if m[1]):
        if marker["current"] and marker.get("benchmark") != BENCHMARK:
            version = marker.get("benchmark", "a benchmark without a version")
            raise StoreError(f"the results in {path} belong to {version}, not to {BENCHMARK}: they cannot be merged")
        for scenario, entry in marker["current"].items():
            both = current.setdefault(scenario, {"recording": entry["recording"], "estimators": {}})
            first = whence.setdefault((scenario, ""), path)
            if both["recording"] != entry["recording"] and _same_simulator(first, path, scenario):
                both["recording"] = max(both["recording"], entry["recording"], key=is_declared)
            elif both["recording"] != entry["recording"]:
                raise StoreError(
                    f"{scenario}, or the simulator, differs between {first} and {path}: run one of them again"
                )
            for label, variant in entry["estimators"].items():
                first = whence.setdefault((scenario, label), path)
                if both["estimators"].setdefault(label, variant) != variant:
                    raise StoreError(f"{label} on {scenario} differs between {first} and {path}: run one of them again")
    target = store.create(target)
    for path in paths:
        for part in store.FILES:
            for file in sorted((path / part).glob("[!.]*")):
                if file.suffix in (".json", ".parquet") and not (target / part / file.name).exists():
                    (target / part).mkdir(exist_ok=True)
                    with store.atomic(target / part / file.name) as copy, open(file, "rb") as original:
                        shutil.copyfileobj(original, copy)
                    if part in (COMPACTED, LOOSE):
                        _looked_through(target / part / file.name)
    requested.copy(target, paths)
    store.select(target, {s: (e["recording"], e["estimators"]) for s, e in current.items()})
    store.compact(target)
    return target


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
