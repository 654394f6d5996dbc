"""The places of rows on simulated and on recorded voyages, side by side, with their rank correlation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.plain import as_json

from . import tables
from .agreement import RankCorrelation, rank_correlation
from .lost_runs import LOSS, lost_recordings
from .tracks import RECORDED, RECORDINGS, title

if TYPE_CHECKING:
    from rich.table import Table

    from .board import Ranking, ScenarioRanking, TrackRanking

__all__ = ["VoyageRow", "Voyages", "side_by_side", "voyage_tables"]

#: Tracks whose voyages are recorded, and those of simulated voyages that they are compared with.
_RECORDED = (RECORDED, RECORDINGS)
_SIMULATED = ("aided-ins", "no-imu", "underwater", "generalisation", "generalisation-no-imu")


@dataclass(frozen=True)
class VoyageRow:
    """One estimator on two tracks.

    Attributes
    ----------
    estimator : str
        Label.
    simulated, recorded : int
        Its place by score among the rows that are ranked on both.
    simulated_ranks, recorded_ranks : (int, int) or None
        Interval of its rank on each track, among all rows there; None on a track whose rows cannot be ordered.
    lost : str
        How many recordings of the track it loses against the plain row, and of how many: ``2 of 8``.
    """

    estimator: str
    simulated: int
    recorded: int
    simulated_ranks: tuple[int, int] | None
    recorded_ranks: tuple[int, int] | None
    lost: str = ""


@dataclass(frozen=True)
class Voyages:
    """A track of simulated and one of recorded voyages.

    Attributes
    ----------
    simulated, recorded : str
        Their names.
    rows : tuple of VoyageRow
        The rows that are ranked on both, in the order of the simulated one.
    correlation : RankCorrelation
        Of their scores.
    """

    simulated: str
    recorded: str
    rows: tuple[VoyageRow, ...]
    correlation: RankCorrelation

    @property
    def sentence(self) -> str:
        """What can be quoted."""
        c = self.correlation
        return (
            f"Spearman's rank correlation of {len(self.rows)} rows is {c.value:.2f} (95 % interval {c.low:.2f} to "
            f"{c.high:.2f})"
        )

    def to_dict(self) -> dict[str, Any]:
        """The fields as values that JSON can hold."""
        found: dict[str, Any] = as_json(asdict(self))
        return found


def side_by_side(board: Ranking) -> list[Voyages]:
    """Compare each recorded track of a board with each simulated one.

    Parameters
    ----------
    board : Ranking
        With recorded and simulated tracks.

    Returns
    -------
    list of Voyages
        Of the pairs of tracks with enough ranked rows in common (`simnav.leaderboard.ranking.agreement.LEAST`).
    """
    tracks = {t.track: t for t in board.tracks}
    found = []
    for recorded in filter(None, map(tracks.get, _RECORDED)):
        for simulated in filter(None, map(tracks.get, _SIMULATED)):
            if simulated.score == recorded.score and (c := rank_correlation(simulated, recorded)) is not None:
                voyages = [t for t in board.scenarios if t.track == recorded.track]
                rows = _rows(simulated, recorded, c.rows, voyages)
                found.append(Voyages(simulated.track, recorded.track, rows, c))
    return found


def _rows(
    simulated: TrackRanking, recorded: TrackRanking, names: Sequence[str], voyages: Sequence[ScenarioRanking]
) -> tuple[VoyageRow, ...]:
    here, there = (
        {r.estimator: r for r in track.rows if r.estimator in names and r.ranked} for track in (simulated, recorded)
    )
    first, second = (
        {name: k for k, name in enumerate(sorted(rows, key=lambda n: rows[n].score), 1)} for rows in (here, there)
    )

    def ranks(row: Any) -> tuple[int, int] | None:
        return None if row.rank_low is None or row.rank_high is None else (row.rank_low, row.rank_high)

    return tuple(
        VoyageRow(n, first[n], second[n], ranks(here[n]), ranks(there[n]), lost_recordings(n, voyages).words)
        for n in sorted(first, key=first.__getitem__)
    )


def voyage_tables(found: Sequence[Voyages]) -> list[Table | str]:
    """A table for each pair of tracks, and its rank correlation."""
    shown: list[Table | str] = []
    for pair in found:
        columns = ["estimator", title(pair.simulated), "ranks", title(pair.recorded), "ranks ", "lost"]
        rows = [
            [r.estimator, r.simulated, _interval(r.simulated_ranks), r.recorded, _interval(r.recorded_ranks), r.lost]
            for r in pair.rows
        ]
        shown.append(tables.table("places on simulated and on recorded voyages", columns, rows, numeric=columns[1:]))
        shown.append(
            f"{pair.sentence}. Lost: recordings on which the row failed, or has more than {LOSS:g} times the error of "
            "the plain row."
        )
    return shown


def _interval(ranks: tuple[int, int] | None) -> str:
    if ranks is None:
        return tables.MISSING
    return str(ranks[0]) if ranks[0] == ranks[1] else f"{ranks[0]} to {ranks[1]}"
