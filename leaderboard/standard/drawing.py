"""Run what the site of the standard result draws beside scores, and keep it where it comes with simnav."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.campaign import Progress
from simnav.leaderboard.profiles import read_profile
from simnav.leaderboard.ranking.superseded import version_of
from simnav.leaderboard.results import store
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.plain import as_json
from simnav.leaderboard.sweep.report import Sweep
from simnav.simulation.version import SIMULATOR_VERSION

from . import RESULTS, drawn
from .backgrounds import keep_backgrounds
from .drawn import AskedSweep
from .publication import run

__all__ = ["Drawing", "draw"]


@dataclass(frozen=True)
class Drawing:
    """What is drawn beside the scores of the standard result.

    Attributes
    ----------
    folder : Path
        Folder of what comes with simnav.
    results : int
        Number of results whose series are in it.
    sweeps, backgrounds : int
        Number of sweeps in it, and of scenarios whose recordings and bounds are drawn.
    size : int
        Size of its files [bytes].
    computed, left : int
        Number of results and recordings that were computed, and of those, or of sweeps, that are left.
    """

    folder: Path
    results: int
    sweeps: int
    backgrounds: int
    size: int
    computed: int
    left: int

    def to_dict(self) -> dict[str, Any]:
        """The fields as values that JSON can hold."""
        return {**asdict(self), "folder": str(self.folder)}


def draw(
    profile: Path,
    working: Path,
    standard: Path,
    folder: Path,
    *,
    sweep: Callable[..., Sweep],
    minutes: float | None = None,
    workers: int = 2,
    progress: Callable[[Progress], None] | None = None,
) -> Drawing:
    """Run, and keep; see `simnav.leaderboard.publishing.draw_standard`. ``sweep`` is `simnav.sweep`."""
    end = None if minutes is None else time.monotonic() + 60.0 * minutes
    chosen = read_profile(profile)
    drawn.begin(working / "curves", folder)
    done = run(chosen, working / "curves", workers=workers, minutes=minutes, progress=progress)
    computed, left = done.computed, done.left
    there = [standard] if store.described(standard) else []
    kept = drawn.keep([working / "curves", *there], folder, chosen)
    target, asked = folder / "sweeps", drawn.asked_sweeps(profile)
    target.mkdir(parents=True, exist_ok=True)
    for one in asked:
        file = target / f"sweep-{one.scenario}.json"
        if _current(file, one):
            continue
        if end is not None and time.monotonic() > end:
            left += 1
            continue
        place = working / f"sweep-{one.scenario}"
        swept = sweep(one.scenario, list(one.dials), list(one.estimators), runs=one.runs, output=place, workers=workers,
                     progress=progress)  # fmt: skip
        computed += swept.summary.computed
        content = swept.to_dict() | {"results": ""} | _versions(one)
        write_whole(file, json.dumps(as_json(content), indent=1, allow_nan=False) + "\n")
    for file in set(target.glob("*.json")) - {target / f"sweep-{one.scenario}.json" for one in asked}:
        file.unlink()
    shown = store.described(there[0] if there else RESULTS)["current"]
    simulated = [name for name in shown if not catalogued_scenario(name).recorded]
    made, waiting = keep_backgrounds(simulated, folder, end)
    size = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())
    sweeps = len(list(target.glob("*.json")))
    return Drawing(folder, kept, sweeps, len(simulated) - waiting, size, computed + made, left + waiting)


def _versions(one: AskedSweep) -> dict[str, Any]:
    """What decides a sweep: what was asked, and the versions of the simulator and of the rows."""
    versions = {name: version_of(name) for name in one.estimators}
    return {"asked": asdict(one), "simulator": SIMULATOR_VERSION, "versions": versions}


def _current(file: Path, one: AskedSweep) -> bool:
    """Whether a file is of this sweep, by the versions of today."""
    try:
        content = json.loads(file.read_bytes())
    except (OSError, ValueError):
        return False
    wanted = json.loads(json.dumps(_versions(one)))
    return all(content.get(key) == value for key, value in wanted.items())
