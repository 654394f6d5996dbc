"""What a scenario page shows besides results: the recordings of some runs, what happens in them, and the bound.

It follows from the scenario and the code alone, and takes longer than all else. That of the standard result comes with
simnav (`simnav.leaderboard.standard.backgrounds`). Others are kept in the user's cache: a file for each scenario and
choice of seeds, named after a digest of all that decides it.
"""

from __future__ import annotations

import contextlib
import inspect
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.campaign.fingerprint import recording_digest
from simnav.leaderboard.campaign.sources import code_of, digest
from simnav.leaderboard.figures.run_figure import fixes, innovation_unit, true_track
from simnav.leaderboard.figures.sky_view import sky_view
from simnav.leaderboard.results.user_cache import keep, user_cache

from .charts import NO_BOUND, columns
from .facts import EVENT, catalogued, datasheets, events
from .rounding import short, spaced
from .sky_charts import sky_data

if TYPE_CHECKING:
    from simnav.recording import Recording
    from simnav.scenario import Scenario

__all__ = [
    "BOUND_RUNS",
    "Background",
    "background",
    "background_of",
    "faulty_points",
    "fix_points",
    "track_of",
    "truth_of",
]

#: Seeds over which the bound is averaged.
BOUND_RUNS = 2

_MOST_KEPT = 400  # files in the cache
_TRACK_POINTS = 300


@dataclass(frozen=True)
class Background:
    """Facts of one scenario that its page shows; empty where the scenario is not in the catalogue.

    Attributes
    ----------
    happening : dict
        Faults and manoeuvres of the first run that is shown, as columns.
    instruments : list of dict
        Datasheets of the instruments.
    units : dict of str to list
        By instrument: unit of the length of its innovation, and factor from SI, where its components share them.
    bound : dict
        Columns ``time`` [s] and ``bound`` [m]: the posterior Cramer-Rao bound on the RMS horizontal error, with the
        faults known.
    runs : dict of str to dict
        By seed: ``faults`` as columns, and ``track`` as from `track_of`.
    sky : dict
        Of the first run that is shown, as from `simnav.leaderboard.site.sky_charts.sky_data`.
    """

    happening: dict[str, list[Any]] = field(default_factory=lambda: columns(EVENT, ()))
    instruments: list[dict[str, str]] = field(default_factory=list)
    units: dict[str, list[Any]] = field(default_factory=dict)
    bound: Mapping[str, list[Any]] = field(default_factory=lambda: NO_BOUND)
    runs: dict[str, dict[str, Any]] = field(default_factory=dict)
    sky: dict[str, Any] = field(default_factory=dict)


def background_of(identity: str, seeds: Sequence[int]) -> Background:
    """Of a scenario: from the cache, or made.

    Parameters
    ----------
    identity : str
        Versioned id of the scenario.
    seeds : sequence of int
        Seeds of the runs whose recordings are needed.
    """
    path = _file(identity, seeds)
    if path is not None:
        with contextlib.suppress(OSError, ValueError, TypeError):  # it is not there, or damaged
            return Background(**json.loads(path.read_bytes()))
    made = background(identity, seeds)
    if path is not None:
        keep(path, json.dumps(asdict(made), separators=(",", ":")))
        _forget(path.parent)
    return made


def background(identity: str, seeds: Iterable[int]) -> Background:
    """Make the recordings of a scenario again, and its bound."""
    scenario = catalogued(identity)
    if scenario is None:
        return Background()
    recordings = {seed: found for seed in seeds if (found := _recording(scenario, seed)) is not None}
    first = next(iter(recordings.values()), None)
    if first is None:
        return Background()
    units = {}
    for name, stream in first.data.aids.items():
        if (unit := innovation_unit(stream.kind)) is not None:
            for source in (name, *(f"{name}:{channel}" for channel in stream.channels)):
                units[source] = ["°" if unit[0] == "deg" else unit[0], unit[1]]
    return Background(
        happening=events(scenario, first),
        instruments=datasheets(scenario, first),
        units=units,
        bound=_bound(scenario),
        runs={
            str(seed): {"faults": _faults(recording), "track": track_of(recording)}
            for seed, recording in recordings.items()
        },
        sky=sky_data(sky_view(first, scenario)),
    )


def _recording(scenario: Scenario, seed: int) -> Recording | None:
    """The run, made again; None where that is not possible any more."""
    from simnav.source import record

    try:
        return record(scenario, seed)
    except (ValueError, OSError):
        return None


def _faults(recording: Recording) -> dict[str, list[Any]]:
    """Faults of a run, for shading."""
    found = events(None, recording)
    return {"start": [short(t) for t in found["start"]], "end": [short(t) for t in found["end"]],
            "name": found["group"]}  # fmt: skip


def _bound(scenario: Scenario) -> Mapping[str, list[Any]]:
    from simnav.estimators.bound import bound

    if scenario.recorded:
        return NO_BOUND
    try:
        found = bound(scenario, range(BOUND_RUNS), "flags")
    except (ValueError, OSError, ArithmeticError, np.linalg.LinAlgError):
        return NO_BOUND
    keep = spaced(len(found.time), 120)
    return {"time": [short(t) for t in found.time[keep]], "bound": [short(v) for v in found.horizontal[keep]]}


def track_of(recording: Recording) -> dict[str, Any]:
    """True track of a run with its ends, fixes, and the parts on which faults act, as columns; and its frame."""
    track = true_track(recording)
    time = np.linspace(0.0, recording.duration, len(track.east))
    spots = [
        (short(east), short(north), name)
        for name, fix in fixes(recording, most=_TRACK_POINTS).items()
        for east, north in zip(fix.east, fix.north, strict=True)
    ]
    faulty: list[tuple[Any, ...]] = []
    for part, fault in enumerate(recording.faults):
        inside = np.flatnonzero((time >= fault.start) & (time <= fault.end))
        name = f"{fault.kind.replace('_', ' ')} ({fault.where})"
        faulty += [
            (short(track.east[k]), short(track.north[k]), short(time[k]), name, part)
            for k in inside[:: max(1, len(inside) // 40)]
        ]
    return {
        "faulty": faulty_points(faulty), "fixes": fix_points(spots), **truth_of(track.east, track.north, time)
    }  # fmt: skip


def faulty_points(rows: Iterable[Sequence[Any]]) -> dict[str, list[Any]]:
    """Points of a track on which faults act."""
    return columns(("east", "north", "time", "name", "part"), rows)


def fix_points(rows: Iterable[Sequence[Any]]) -> dict[str, list[Any]]:
    """Fixes beside a track."""
    return columns(("east", "north", "name"), rows)


def truth_of(east: Any, north: Any, time: Any) -> dict[str, Any]:
    """A true track, thinned, with its ends and its frame."""
    if not len(east):
        nothing = columns(("east", "north", "time"), ())
        return {"truth": nothing, "ends": nothing | {"name": []}, "frame": {"x": [0.0, 1.0], "y": [0.0, 1.0]}}
    keep = spaced(len(east), _TRACK_POINTS)
    truth = {"east": [short(x) for x in east[keep]], "north": [short(x) for x in north[keep]],
             "time": [short(x) for x in time[keep]]}  # fmt: skip
    ends = {name: [values[0], values[-1]] for name, values in truth.items()} | {"name": ["start", "end"]}
    frame = {"x": [float(np.nanmin(east)), float(np.nanmax(east))],
             "y": [float(np.nanmin(north)), float(np.nanmax(north))]}  # fmt: skip
    return {"truth": truth, "ends": ends, "frame": frame}


# -- the cache ---------------------------------------------------------------------------------------------


@lru_cache(maxsize=1)
def _code() -> tuple[str, str]:
    """Version of the simulator, and a digest of the other code that makes a background."""
    from simnav.leaderboard.campaign.fingerprint import simulator_version, with_library
    from simnav.leaderboard.results.provenance import numerics

    files = dict.fromkeys(
        inspect.getfile(part) for part in (background, events, columns, short, true_track, sky_view, sky_data)
    )
    return simulator_version(), with_library(digest(*(code_of(Path(file)).digest for file in files), *numerics()))


def _file(identity: str, seeds: Sequence[int]) -> Path | None:
    """Where it is kept; None for what is not in the catalogue, or plays a log, whose files may change."""
    scenario = catalogued(identity)
    if scenario is None or scenario.recorded:
        return None
    simulator, code = _code()
    words = scenario.model_dump_json() + str(BOUND_RUNS) + ",".join(map(str, seeds))
    return user_cache() / "site" / f"{digest(recording_digest(scenario, simulator), code, words)}.json"


def _forget(folder: Path) -> None:
    """Delete the oldest files of the cache, if there are too many."""
    with contextlib.suppress(OSError):
        every = sorted(folder.glob("*.json"), key=lambda p: p.stat().st_mtime)
        for old in every[:-_MOST_KEPT]:
            old.unlink(missing_ok=True)
