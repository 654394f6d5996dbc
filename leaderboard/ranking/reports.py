"""What campaigns and evaluations give: results with their ranking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.export import table
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.plain import as_json
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.shown import Shown

from . import tables
from .board import Ranking
from .confinement import confined
from .failures import failures
from .ranking_table import ranking_tables
from .standing import Standing, standing_table
from .trouble_profile import TrackProfile, profiles

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from simnav.leaderboard.campaign.campaign import Summary

__all__ = ["CampaignReport", "EvaluationReport", "StandardReport"]


@dataclass(frozen=True, eq=False, repr=False)
class _Report(Shown):
    """Results with their ranking.

    Attributes
    ----------
    results : sequence of Result
        The results that the report is made from.
    ranking : Ranking
        Ranking of these results.
    """

    results: Sequence[Result]
    ranking: Ranking

    @cached_property
    def profiles(self) -> tuple[TrackProfile, ...]:
        """The results by kind of trouble, of each track that has scenarios of the catalogue."""
        return profiles(self.results)

    def headline(self) -> str:
        """How much was run."""
        scenarios, labels = ({getattr(r, name) for r in self.results} for name in ("scenario", "estimator"))
        runs = sum(r.tried for r in self.results)
        return f"{runs} runs of {len(labels)} estimators on {len(scenarios)} scenarios"

    def shown(self) -> Sequence[RenderableType]:
        """A table for each track."""
        return ranking_tables(self.ranking)

    def to_frame(self) -> Any:
        """A row a run, a column a score (SI units, radians); see `simnav.leaderboard.results.frame.frame`."""
        return frame(table(self.results).to_pylist())

    def plot(self) -> Figure:
        """The ranking of the first track with its intervals."""
        return self.ranking.plot()


@dataclass(frozen=True, eq=False, repr=False)
class StandardReport(_Report):
    """The result that comes with simnav."""

    def shown(self) -> Sequence[RenderableType]:
        """The table of the first track, and where the others are."""
        first, *others = ranking_tables(self.ranking)
        names = ", ".join(t.track for t in self.ranking.tracks[1:])
        return [first, f"In .ranking.tracks, too: {names}."] if others else [first]


@dataclass(frozen=True, eq=False, repr=False)
class CampaignReport(_Report):
    """A campaign and all that is in its folder.

    Attributes
    ----------
    summary : Summary
        What this campaign did.
    """

    summary: Summary

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav campaign --json`` prints."""
        return {
            "results": str(self.summary.folder),
            "seconds": self.summary.seconds,
            "asked": self.summary.total,
            "computed": self.summary.computed,
            "runs": sum(r.tried for r in self.results),
            "failed": failures(self.results),
            "confinement": confined(self.results),
            "ranking": self.ranking.to_dict(),
        }


@dataclass(frozen=True, eq=False, repr=False)
class EvaluationReport(_Report):
    """Where estimators stand among others.

    Attributes
    ----------
    estimators : tuple of str
        Labels of those in question.
    scenarios : tuple of str
        Versioned ids.
    seeds : sequence of int
        Seeds of the runs.
    standings : tuple of Standing
        One for each estimator in question and scenario.
    folder : Path or None
        Folder of the results, if they were kept.
    left_out : sequence of str
        Sentences on scenarios that were asked for, and on which none of the estimators in question can run.
    """

    estimators: tuple[str, ...]
    scenarios: tuple[str, ...]
    seeds: Sequence[int]
    standings: tuple[Standing, ...]
    folder: Path | None
    left_out: Sequence[str] = ()

    def headline(self) -> str:
        """The verdict on each estimator and scenario."""
        return " ".join(self.verdicts)

    def shown(self) -> Sequence[tables.Fitted]:
        """A table for each estimator and scenario; with several scenarios, first those of the tracks."""
        tracks = ranking_tables(self.ranking, self.estimators) if len(self.scenarios) > 1 else []
        return [*tracks, *map(standing_table, self.standings)]

    @property
    def verdicts(self) -> list[str]:
        """A sentence on each estimator and scenario: its places, and its error beside the plain row's."""
        plain = {s: t.plain for t in self.ranking.tracks for s in t.scenarios}
        return [*(stand.verdict(plain.get(stand.scenario, "")) for stand in self.standings), *self.left_out]

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav evaluate --json`` prints."""
        return {
            "estimator": self.estimators[0],
            "estimators": list(self.estimators),
            "scenarios": list(self.scenarios),
            "seeds": list(self.seeds),
            "left_out": list(self.left_out),
            "ranking": self.ranking.to_dict(),
            "comparisons": as_json(self.standings),
            "results": None if self.folder is None else str(self.folder),
        }
