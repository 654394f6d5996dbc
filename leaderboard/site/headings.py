"""The five headings under which the tracks of the board stand, each a page; a sixth for tracks of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from simnav.leaderboard.ranking.board import TrackRanking
from simnav.leaderboard.ranking.tracks import BUDGETS

__all__ = ["PAGES", "Heading", "headings"]

_TRACKS = {
    "Surface": ("aided-ins", "no-imu"),
    "Under water": ("underwater",),
    "Satellites and sound": ("satellites", "acoustic", "terrain", "cooperative"),
    "Long and smoothed": ("long", "post-processing"),
    "Real and unseen": (
        "recorded", "recordings", "generalisation", "generalisation-no-imu", *BUDGETS, "robustness", "coloured",
        "papers",
    ),
}  # fmt: skip
_OTHER = "Other scenarios"


@dataclass(frozen=True)
class Heading:
    """A heading with its tracks, in the order in which they are shown."""

    title: str
    tracks: tuple[TrackRanking, ...]

    @property
    def data(self) -> str:
        """Name of its page without ending, and of the file of its data."""
        return _named(self.title)

    @property
    def page(self) -> str:
        """Name of its page."""
        return f"{self.data}.html"


def _named(title: str) -> str:
    return f"board-{title.lower().replace(' ', '-')}"


#: Names of all such pages, without ending.
PAGES = frozenset(map(_named, (*_TRACKS, _OTHER)))


def headings(tracks: Sequence[TrackRanking]) -> list[Heading]:
    """The headings that have tracks."""
    by = {t.track: t for t in tracks}
    found = [Heading(title, tuple(by[n] for n in names if n in by)) for title, names in _TRACKS.items()]
    known = {n for names in _TRACKS.values() for n in names}
    found.append(Heading(_OTHER, tuple(t for t in tracks if t.track not in known)))
    return [h for h in found if h.tracks]
