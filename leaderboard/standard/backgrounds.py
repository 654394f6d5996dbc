"""What the site of the standard result shows of its recordings and their bounds, so that nothing is simulated for it.

``drawn/backgrounds/`` has a file for each simulated scenario, called by its versioned id, with the versions of the
simulator and of the oracle, whose covariance is the bound. Recorded voyages are read from their logs, which may change.
"""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from simnav.leaderboard.ranking.superseded import version_of
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.versions import is_declared
from simnav.leaderboard.site.background import Background, background
from simnav.leaderboard.site.scenario_page import RUNS_SHOWN
from simnav.simulation.version import SIMULATOR_VERSION

from .drawn import DRAWN

__all__ = ["keep_backgrounds", "stored_backgrounds"]


def stored_backgrounds(results: Iterable[Result], folder: Path = DRAWN) -> dict[str, Background]:
    """By scenario, what comes with simnav; only of results that are known by versions, and of the versions of today."""
    scenarios = sorted({r.scenario for r in results if is_declared(r.recording)})
    return {s: found for s in scenarios if (found := _stored(_file(folder, s))) is not None}


def keep_backgrounds(scenarios: Collection[str], folder: Path = DRAWN, end: float | None = None) -> tuple[int, int]:
    """Make what is missing or of other versions, and delete what is of other scenarios.

    Parameters
    ----------
    scenarios : collection of str
        Versioned ids of simulated scenarios of the catalogue.
    folder : Path
        Folder of what comes with simnav.
    end : float, optional
        Nothing more is made from this time on (`time.monotonic`).

    Returns
    -------
    made, left : int
        How many were made, and how many are left.
    """
    files = {_file(folder, s): s for s in scenarios}
    missing = [file for file in files if _stored(file) is None]
    (folder / "backgrounds").mkdir(parents=True, exist_ok=True)
    made = 0
    for file in missing:
        if end is not None and time.monotonic() > end:
            break
        content = {"versions": _versions(), "background": asdict(background(files[file], range(RUNS_SHOWN)))}
        write_whole(file, json.dumps(content, allow_nan=False, separators=(",", ":")) + "\n")
        made += 1
    for file in set((folder / "backgrounds").glob("*.json")) - files.keys():
        file.unlink()
    return made, len(missing) - made


def _file(folder: Path, scenario: str) -> Path:
    return folder / "backgrounds" / f"{scenario}.json"


def _versions() -> dict[str, Any]:
    return {"simulator": SIMULATOR_VERSION, "oracle": version_of("oracle")}


def _stored(file: Path) -> Background | None:
    """What a file holds, if it is there and of the versions of today."""
    try:
        content = json.loads(file.read_bytes())
        return Background(**content["background"]) if content["versions"] == _versions() else None
    except (OSError, ValueError, TypeError, KeyError):
        return None
