"""A ranked board: the frozen objects that tables, pages and JSON documents are made from.

A `Ranking` holds one `TrackRanking` a track, with one `TrackRow` an estimator, and one `ScenarioRanking` a scenario,
with one `ScenarioRow` an estimator. `simnav.leaderboard.ranking.ranking.rank` makes them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NoReturn

from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.plain import as_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure


from .ranking_figure import ranking_figure
from .rows import (
    FIRM_REFERENCE,
    Consistency,
    Reference,
    Row,
    ScenarioRow,
    Standing,
    TrackRow,
    TrackTable,
)
from .stored_costs import cost_of
from .stored_robustness import worst_of
from .summary import sentence

__all__ = [
    "FIRM_REFERENCE",
    "Consistency",
    "Ranking",
    "Reference",
    "Row",
    "ScenarioRanking",
    "ScenarioRow",
    "Standing",
    "TrackRanking",
    "TrackRow",
]


_GAIN = ("value", "low", "high", "scenarios_low", "scenarios_high", "won", "worse")


@dataclass(frozen=True)
class ScenarioRanking:
    """The ranking on one scenario.

    Attributes
    ----------
    scenario : str
        Versioned id.
    track : str
        The track that it belongs to.
    score : str
        Key of `simnav.scoring.SCORES` that is ranked.
    reference : Reference
        Reference, whose error is the denominator of the ratios.
    plain : str
        The plain row that gains are over; empty without one.
    unit : str
        ``seed`` or ``recording``: the unit that tests and intervals treat as independent.
    units : int
        How many of them the ranked rows have, at least.
    remarks : tuple of str
        Sentences that a table has to show: which conclusions the data do not allow, and why.
    insufficient : str
        Why the rows cannot be ordered, in one sentence; then none has a rank. Empty where they can.
    rows : tuple of ScenarioRow
        In order of score; then those not ranked, then the references.
    unsuitable : dict of str to str
        Estimators that need other instruments, and which.
    """

    scenario: str
    track: str
    score: str
    reference: Reference
    plain: str
    unit: str
    units: int
    remarks: tuple[str, ...]
    insufficient: str
    rows: tuple[ScenarioRow, ...]
    unsuitable: dict[str, str] = field(default_factory=dict)

    @property
    def provisional(self) -> bool:
        """Whether a ranked row has fewer than ten seeds or recordings."""
        return any(r.provisional for r in self.rows if r.ranked)


@dataclass(frozen=True, repr=False)
class TrackRanking(TrackTable):
    """The ranking on one track, with its sentence and its figure; the attributes are those of `TrackTable`."""

    def __repr__(self) -> str:
        return f"<TrackRanking: {self.track}, {sum(r.ranked for r in self.rows)} ranked rows>"

    @property
    def sentence(self) -> str:
        """What can be quoted of the track; see `simnav.leaderboard.ranking.summary.sentence`."""
        return sentence(self)

    def plot(self) -> Figure:
        """The scores with their intervals."""
        return ranking_figure(self)


@dataclass(frozen=True, repr=False)
class Ranking:
    """The whole ranking. There are ranks within a track only.

    Attributes
    ----------
    tracks : tuple of TrackRanking
        In the order in which they are shown.
    scenarios : tuple of ScenarioRanking
        In order of their ids, ranked by the score of their own track.
    """

    tracks: tuple[TrackRanking, ...]
    scenarios: tuple[ScenarioRanking, ...]

    def __repr__(self) -> str:
        names = ", ".join(t.track for t in self.tracks)
        return f"<Ranking: {len(self.scenarios)} scenarios in the tracks {names}>"

    def track(self, name: str) -> TrackRanking:
        """The ranking of one track.

        Raises
        ------
        KeyError
            If there is none of this name.
        """
        return next((t for t in self.tracks if t.track == name), None) or _missing("track", name)

    def scenario(self, identity: str) -> ScenarioRanking:
        """The ranking on one scenario.

        Raises
        ------
        KeyError
            If there is none of this id.
        """
        return next((s for s in self.scenarios if s.scenario == identity), None) or _missing("scenario", identity)

    def to_dict(self) -> dict[str, Any]:
        """Plain dicts and lists for JSON; numbers that are not finite become None.

        Each row of a track has its stored cost, and its worst ratio under a wrong datasheet.
        """
        found: dict[str, Any] = as_json(vars(self))
        for board in found["tracks"]:
            for row in board["rows"]:
                row["cost"] = as_json(cost_of(row["estimator"], board["plain"], board["score"]))
                worst = worst_of(row["estimator"], row["version"], board["plain"], board["score"])
                row["wrong_datasheet"] = as_json(worst)
        return found

    def to_frame(self) -> Any:
        """A row an estimator and track, with its ratios; see `simnav.leaderboard.results.frame.frame`."""
        scenarios = [s.scenario for s in self.scenarios]
        worst = {
            (t.track, r.estimator): worst_of(r.estimator, r.version, t.plain, t.score)
            for t in self.tracks for r in t.rows
        }  # fmt: skip
        costs = {(t.track, r.estimator): cost_of(r.estimator, t.plain, t.score) for t in self.tracks for r in t.rows}
        return frame([
            {"track": t.track}
            | {k: v for k, v in vars(row).items() if k != "gain" and not isinstance(v, (Mapping, tuple, Consistency))}
            | {f"gain_{k}": getattr(row.gain, k, math.nan) for k in _GAIN}
            | {"cost_plain": getattr(costs[t.track, row.estimator], "plain", "")}
            | {
                f"cost_{k}".removesuffix("_value"): getattr(costs[t.track, row.estimator], k, math.nan)
                for k in ("value", "low", "high")
            }
            | {"wrong_datasheet": getattr(worst[t.track, row.estimator], "ratio", math.nan)}
            | {f"{part}_{k}": v for part in ("clean", "faulty") for k, v in vars(getattr(row, part)).items()
               if k != "groups"}
            | {s: row.ratios.get(s, math.nan) for s in scenarios}
            for t in self.tracks
            for row in t.rows
        ])  # fmt: skip

    def plot(self) -> Figure:
        """The scores of the first track with their intervals.

        Raises
        ------
        ValueError
            If nothing is ranked.
        """
        if not self.tracks:
            raise ValueError("there is nothing to draw: no track has a row")
        return self.tracks[0].plot()


def _missing(what: str, name: str) -> NoReturn:
    raise KeyError(f"there is no ranking of the {what} {name!r}")
