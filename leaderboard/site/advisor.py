"""The three boxes of the first page: which row to take, for some instruments, a trouble and a time of an epoch.

Each answer is that of ``simnav recommend``, from the results of the site.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking.recommendation import recommendations
from simnav.leaderboard.ranking.similar_scenarios import carried, speaks_for
from simnav.leaderboard.ranking.tracks import catalogued
from simnav.leaderboard.ranking.troubles import trouble_of, troubles

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.track_runs import TrackRuns

__all__ = ["KITS", "LIMITS", "advisor"]

#: Instruments of a vessel that can be chosen: title, and kinds.
KITS: Mapping[str, tuple[str, ...]] = {
    "GNSS, IMU, Doppler log, gyrocompass": ("dvl", "gnss_position", "gnss_velocity", "gyrocompass", "imu"),
    "GNSS and IMU": ("gnss_position", "imu"),
    "GNSS, speed log, compass; no IMU": ("gnss_position", "gyrocompass", "magnetic_compass", "speed_log"),
    "Raw satellites, IMU, gyrocompass": (
        "gnss_raw", "gnss_receiver", "gnss_receiver_velocity", "gyrocompass", "imu",
    ),
    "Under water: IMU, Doppler log, depth, compass": ("depth", "dvl", "gyrocompass", "imu"),
    "Under water, with fixes from terrain": ("depth", "dvl", "gyrocompass", "imu", "magnetic_compass", "terrain_fix"),
    "Under water, with fixes by sound": (
        "acoustic_range", "depth", "dvl", "gyrocompass", "imu", "usbl_fix",
    ),
}  # fmt: skip
#: Milliseconds that an epoch may take; None: any.
LIMITS = (None, 1.0, 0.5, 0.2, 0.1)


def advisor(every: Iterable[TrackRuns]) -> dict[str, Any] | None:
    """What the boxes offer, and the sentences of each answer; None where there is no evidence for anything.

    Parameters
    ----------
    every : iterable of TrackRuns
        The runs of the site, by track.
    """
    headers = {name: carried(h) for name, h in catalogued().items() if trouble_of(name)}
    runs = [r for r in every if r.track.score == "horizontal_rmse"]
    asked = {"": (), **{name: (name,) for name in troubles()}}
    found: dict[str, dict[str, list[list[str]]]] = {}
    for title, mine in KITS.items():
        fitting = {name for name, one in headers.items() if speaks_for(one, mine)}
        answers = {
            name: recommendations(runs, mine, fitting.__contains__, wanted, LIMITS) for name, wanted in asked.items()
        }
        if any(a.row is not None for several in answers.values() for a in several):
            found[title] = {name: [a.sentences for a in several] for name, several in answers.items()}
    if not found:
        return None
    titles = {"": "Any of those that were tested", **{name: t.title for name, t in troubles().items()}}
    limits = ["Any" if x is None else f"At most {x:g} ms" for x in LIMITS]
    commands = {title: ",".join(kind.replace("_", "-") for kind in KITS[title]) for title in found}
    return {"answers": found, "troubles": titles, "limits": limits, "milliseconds": LIMITS, "commands": commands}
