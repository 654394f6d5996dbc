"""Tracks: scenarios that the same estimators can do. There are ranks within a track only.

A scenario names its track in its file. The track ``post-processing`` is made of the scenarios of `POST_PROCESSED`,
ranked by the smoothed trajectory. The tracks of `BUDGETS` are made of the scenarios of `LEARNED_ON`, for the rows that
learned from no more voyages than that, so that methods are compared and not data.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from simnav.scenario.catalogue import headers

if TYPE_CHECKING:
    from simnav.scenario.catalogue import Header

__all__ = [
    "BUDGETS", "LEARNED_ON", "POST_PROCESSED", "RECORDED", "RECORDINGS", "SMOOTHED", "Track", "catalogued",
    "is_derived", "title", "tracks_of",
]  # fmt: skip

RECORDED = "recorded"
#: Public recordings that are no part of the catalogue (`simnav.leaderboard.recordings`).
RECORDINGS = "recordings"
#: The score of the track of smoothed trajectories.
SMOOTHED = "smoothed_horizontal_rmse"
#: The tracks whose scenarios are ranked for smoothed output, too.
POST_PROCESSED = ("aided-ins", "underwater")
#: The largest number of training voyages, by the name of the track.
BUDGETS = {"learned-1000": 1000, "learned-20000": 20_000}
#: The tracks whose scenarios are ranked for learned rows alone, too.
LEARNED_ON = ("generalisation", "generalisation-no-imu")

_TITLES = {
    "aided-ins": "Aided INS",
    "no-imu": "Without an IMU",
    "underwater": "Under water",
    "long": "An hour and more",
    "post-processing": "Post-processing",
    "generalisation": "Generalisation",
    "generalisation-no-imu": "Generalisation without an IMU",
    "learned-1000": "Learned from 1 000 voyages at most",
    "learned-20000": "Learned from 20 000 voyages at most",
    "robustness": "Beyond the datasheets",
    "coloured": "Errors as they are at sea",
    "satellites": "Satellites, tightly and loosely coupled",
    "acoustic": "Beams and ranges of sound",
    "terrain": "Soundings and a chart",
    "cooperative": "Messages of other vessels",
    "recorded": "Recorded voyages",
    "recordings": "Public recordings",
    "papers": "Scenarios of papers",
    "other": "Other scenarios",
}


@dataclass(frozen=True)
class Track:
    """A track with its scenarios.

    Attributes
    ----------
    name, title : str
        Name in scenario files, and title in tables.
    score : str
        Key of `simnav.scoring.SCORES` that is ranked.
    scenarios : tuple of str
        Versioned ids, sorted.
    """

    name: str
    title: str
    score: str
    scenarios: tuple[str, ...]


def catalogued() -> dict[str, Header]:
    """What the catalogue says of each of its scenarios, by versioned id."""
    return {h.id: h for h in headers()}


def tracks_of(scenarios: Iterable[str], track: Mapping[str, str], score: str | None = None) -> list[Track]:
    """The tracks of some scenarios, in the order in which they are shown.

    Parameters
    ----------
    scenarios : iterable of str
        Versioned ids.
    track : mapping of str to str
        Their tracks.
    score : str, optional
        Rank all tracks by this score. Default: by the horizontal error, and post-processing by the smoothed one.

    Examples
    --------
    >>> [(t.name, t.score) for t in tracks_of(["a-v1", "b-v1"], {"a-v1": "aided-ins", "b-v1": "no-imu"})]
    [('aided-ins', 'horizontal_rmse'), ('no-imu', 'horizontal_rmse'), ('post-processing', 'smoothed_horizontal_rmse')]
    """
    members: dict[str, list[str]] = {}
    for scenario in sorted(set(scenarios)):
        members.setdefault(track.get(scenario, "other"), []).append(scenario)
    found = [Track(n, title(n), score or "horizontal_rmse", tuple(members[n])) for n in members]
    smoothed = tuple(s for n in POST_PROCESSED for s in members.get(n, ()))
    if smoothed and score is None:
        found.append(Track("post-processing", title("post-processing"), SMOOTHED, smoothed))
    order = list(_TITLES)
    return sorted(found, key=lambda t: (order.index(t.name) if t.name in order else len(order), t.name))


def is_derived(track: str) -> bool:
    """Whether a track is made of the scenarios of others."""
    return track == "post-processing" or track in BUDGETS


def title(track: str) -> str:
    """The title of a track.

    >>> title("aided-ins"), title("my-fjords")
    ('Aided INS', 'My fjords')
    """
    return _TITLES.get(track) or track.replace("-", " ").capitalize()
