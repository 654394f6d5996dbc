"""Columns of a board for rows that learned: from how many voyages, and how many parameters a network has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking.learning import training_of
from simnav.leaderboard.ranking.tracks import BUDGETS

from .columns import Column

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import TrackRanking
    from simnav.leaderboard.ranking.runs import Runs

__all__ = ["training_cells", "training_columns"]

_MEANINGS = {
    "voyages": ("Training voyages", "Number of simulated voyages that the row learned from, as it says."),
    "parameters": ("Parameters", "Number of parameters of its network, as it says."),
}


def training_columns(track: TrackRanking) -> list[Column]:
    """The columns, where a row of the track learned; shown at first on the tracks of rows that learned."""
    if not any(row.learned for row in track.rows):
        return []
    hidden = track.track not in BUDGETS
    return [Column(key, title, meaning, "text", hidden=hidden) for key, (title, meaning) in _MEANINGS.items()]


def training_cells(row: str, track: TrackRanking, runs: Mapping[str, Mapping[str, Runs]]) -> dict[str, Any]:
    """The cells of a row; empty ones where it learned nothing, or does not say it."""
    told = training_of(r for s in track.scenarios if row in runs[s] for r in runs[s][row].results)
    numbers = {key: told.get(key) for key in _MEANINGS}
    return {key: {"text": str(n), "value": n} if isinstance(n, int) else None for key, n in numbers.items()}
