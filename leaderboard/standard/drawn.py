"""What the site of the standard result draws beside its scores: series of a few runs, and sweeps.

Results come with simnav without their series, which take most of the space. ``drawn/curves/`` is a packed folder of
results without scores: the rows that ``drawn.toml`` names, in two runs of each scenario, with their series at few
points; and of other rows whose series were at hand, the quantiles of the error. Results have the address of their
versions, so that series of another version stand beside no result. ``drawn/sweeps/`` has what sweeps found, with the
versions of their rows.
"""

from __future__ import annotations

import shutil
import tomllib
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from simnav.leaderboard.profiles import Profile, read_profile
from simnav.leaderboard.ranking.superseded import version_of
from simnav.leaderboard.results import store
from simnav.leaderboard.results.binary_digits import with_bits
from simnav.leaderboard.results.packing import write_packed
from simnav.leaderboard.results.result import Result, Series
from simnav.leaderboard.results.stored_series import read_ahead
from simnav.leaderboard.results.versions import declared, is_declared
from simnav.leaderboard.site.sweeps import SweepFile, sweeps_in
from simnav.simulation.version import SIMULATOR_VERSION

from . import shipped
from .outdated_results import changes

__all__ = ["DRAWN", "PROFILE", "SEEDS", "AskedSweep", "asked_sweeps", "attached", "begin", "keep", "stored_sweeps",
           "thinned"]  # fmt: skip

#: The folder that comes with simnav, and what is run for it.
DRAWN = Path(__file__).with_name("drawn")
PROFILE = Path(__file__).with_name("drawn.toml")

#: Runs of each scenario of which series are kept.
SEEDS = 2

_POINTS, _BINS = 121, 51  # of a curve, and of a diagnostic
_METRES = 8.0  # steps of a track in a metre
_BITS = 10  # of a figure: a part in two thousand
#: Errors on single axes can be computed from others, or are not drawn.
_LEFT_OUT = ("north", "east", "truth_down", "estimate_down")


@dataclass(frozen=True)
class AskedSweep:
    """A sweep of ``drawn.toml``: names of the scenario, dials with their values, rows, and runs."""

    scenario: str
    dials: tuple[str, ...]
    estimators: tuple[str, ...]
    runs: int


def asked_sweeps(profile: Path = PROFILE) -> list[AskedSweep]:
    """The sweeps of a profile."""
    tables = tomllib.loads(profile.read_text(encoding="utf-8")).get("sweep", [])
    return [AskedSweep(t["scenario"], tuple(t["dials"]), tuple(t["estimators"]), int(t["runs"])) for t in tables]


def begin(working: Path, folder: Path = DRAWN) -> None:
    """Let a new folder start with the curves that come with simnav, so that only what is missing is run."""
    if not store.described(working) and shipped(folder / "curves"):
        shutil.copytree(folder / "curves", working, dirs_exist_ok=True)


def keep(sources: Sequence[Path], folder: Path = DRAWN, profile: Profile | None = None) -> int:
    """Take what the site draws from folders of results, and write it where it comes with simnav.

    Parameters
    ----------
    sources : sequence of Path
        Folders of results; of two results for one run the first with series counts. What the folder had stays, as far
        as its versions are those of today.
    folder : Path
        Folder of what comes with simnav.
    profile : Profile, optional
        Names the rows whose curves are kept. Default: ``drawn.toml``.

    Returns
    -------
    int
        Number of results whose series were kept.
    """
    parts = (profile or read_profile(PROFILE)).parts
    curved = {(s, e) for part in parts for s in part.scenarios for e in part.estimators}
    place = folder / "curves"
    kept: dict[str, Result] = {}
    for source in [*sources, *([place] if shipped(place) else [])]:
        for result in _with_series(source):
            whole = (result.scenario.rpartition("-v")[0], result.estimator) in curved
            series = thinned(result.series) if whole else _quantiles(result.series)
            if series and len(series) > len(kept[result.key].series if result.key in kept else ()):
                kept[result.key] = replace(result, scores={}, draws={}, learned={}, scoring="", series=series)
    chosen = sorted(kept.values(), key=lambda r: (r.scenario, r.seed, r.estimator))
    write_packed(chosen, place)
    return len(chosen)


def _with_series(folder: Path) -> Iterator[Result]:
    """The results of the first runs in a folder that have series and the versions of today."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", store.StoreWarning)
        found = declared(r for r in store.load(folder) if r.seed < SEEDS and r.status == "ok")
    old = changes(found)
    by = {id(r.series): r for r in found if (r.scenario, r.estimator) not in old}
    for series, read in read_ahead([r.series for r in by.values()]):
        if read:
            yield replace(by[id(series)], series=dict(read))


def thinned(series: Mapping[str, Series]) -> dict[str, Series]:
    """Series at few points and with few digits.

    Parameters
    ----------
    series : mapping of str to array
        As from `simnav.scoring.plot_series.series`.

    Returns
    -------
    dict of str to array
        The same names, but for errors on single axes and for depths.
    """
    found: dict[str, Series] = {}
    for name, values in series.items():
        if name in _LEFT_OUT or values.ndim != 1:
            continue
        most = len(values) if name == "quantiles" else _BINS if _is_diagnostic(name) else _POINTS
        some = values[np.unique(np.linspace(0, len(values) - 1, min(len(values), most)).round().astype(int))]
        if name.startswith(("truth_", "estimate_")):
            found[name] = (np.round(some * _METRES) / _METRES).astype(np.float32)
        else:
            found[name] = some if name.endswith("time") else _rounded(some)
    return found


def _is_diagnostic(name: str) -> bool:
    return "." in name or name == "diagnostics_time"


def _quantiles(series: Mapping[str, Series]) -> dict[str, Series]:
    values = series.get("quantiles")
    return {} if values is None or not np.isfinite(values).any() else {"quantiles": _rounded(values)}


def _rounded(values: Series) -> Series:
    return np.asarray(with_bits(values, _BITS), dtype=np.float32)


def attached(results: Iterable[Result], folder: Path = DRAWN) -> tuple[list[Result], dict[str, list[int]]]:
    """Results with the series that come with simnav, where they have none of their own.

    Parameters
    ----------
    results : iterable of Result
        Results, their series as they are read.
    folder : Path
        Folder of what comes with simnav.

    Returns
    -------
    results : list of Result
        The same results.
    seeds : dict of str to list of int
        By scenario, the runs whose series come from there.
    """
    every, place = list(results), folder / "curves"
    if not shipped(place) or not any(is_declared(r.recording) for r in every):
        return every, {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", store.StoreWarning)
        known = {r.key: r for r in store.load(place, scores=())}
    asked = [r for r in every if r.key in known]
    empty = {id(series) for series, read in read_ahead([r.series for r in asked]) if not read}
    seeds: dict[str, set[int]] = {}
    for k, r in enumerate(every):
        if r.key in known and id(r.series) in empty:
            every[k] = replace(r, series=known[r.key].series)
            seeds.setdefault(r.scenario, set()).add(r.seed)
    return every, {scenario: sorted(found) for scenario, found in seeds.items()}


def stored_sweeps(results: Iterable[Result], folder: Path = DRAWN) -> list[SweepFile]:
    """The sweeps that come with simnav, of the scenarios of results that are known by versions; rows of today only."""
    scenarios = {r.scenario for r in results if is_declared(r.recording)}
    found = []
    for sweep in sweeps_in(folder):
        versions = sweep.content.get("versions", {})
        current = {name for name, version in versions.items() if version_of(name.partition("(")[0]) in (None, version)}
        if sweep.scenario in scenarios and sweep.content.get("simulator") == SIMULATOR_VERSION and current:
            found.append(sweep.only(current))
    return found
