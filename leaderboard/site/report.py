"""A site that was written, with the ranking that it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.confinement import confined
from simnav.leaderboard.ranking.failures import failures
from simnav.leaderboard.ranking.ranking_table import ranking_tables
from simnav.leaderboard.ranking.trouble_profile import profile_table
from simnav.leaderboard.ranking.voyages import side_by_side
from simnav.leaderboard.results.shown import Shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from simnav.leaderboard.ranking.agreement import RankCorrelation
    from simnav.leaderboard.ranking.board import Ranking
    from simnav.leaderboard.ranking.trouble_profile import TrackProfile
    from simnav.leaderboard.ranking.voyages import Voyages
    from simnav.leaderboard.results.result import Result

__all__ = ["SiteReport"]


@dataclass(frozen=True, eq=False, repr=False)
class SiteReport(Shown):
    """A site and what it was made of.

    Attributes
    ----------
    index : Path
        Its ``index.html``.
    results : sequence of Result
        All results.
    ranking : Ranking
        Of these.
    correlations : tuple of RankCorrelation
        How well the order agrees with that of other results, where there are any.
    profiles : tuple of TrackProfile
        The results by kind of trouble, of the tracks that have scenarios of the catalogue.
    """

    index: Path
    results: Sequence[Result]
    ranking: Ranking
    correlations: tuple[RankCorrelation, ...] = ()
    profiles: tuple[TrackProfile, ...] = ()

    def headline(self) -> str:
        """Where the site is, how many runs it shows, and how large it is."""
        sizes = [path.stat().st_size for path in self.index.parent.rglob("*") if path.is_file()]
        runs = sum(r.tried for r in self.results)
        return f"{self.index}, {runs} runs; {sum(sizes) / 1e6:.1f} MB in {len(sizes)} files"

    def shown(self) -> Sequence[tables.Fitted]:
        """A table for each track, and one for its kinds of trouble where there are several."""
        return [*ranking_tables(self.ranking), *(profile_table(p) for p in self.profiles if len(p.groups) > 1)]

    @property
    def voyages(self) -> list[Voyages]:
        """The places of rows on simulated and on recorded voyages, side by side."""
        return side_by_side(self.ranking)

    def to_dict(self) -> dict[str, Any]:
        """Plain: what the command prints with ``--json``."""
        return {
            "site": str(self.index),
            "runs": sum(r.tried for r in self.results),
            "failed": failures(self.results),
            "ranking": self.ranking.to_dict(),
            "profiles": [p.to_dict() for p in self.profiles],
            "confinement": confined(self.results),
            "correlations": [c.to_dict() for c in self.correlations],
            "voyages": [v.to_dict() for v in self.voyages],
        }

    def to_frame(self) -> Any:
        """The ranking, a row an estimator and track."""
        return self.ranking.to_frame()

    def plot(self) -> Figure:
        """The ranking, drawn."""
        return self.ranking.plot()
