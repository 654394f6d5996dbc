"""The ranking of a track as tables show it: captions, how a ratio is written, the table of the terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any

from simnav.scoring import SCORES

from . import tables
from .statistics import FAILURE
from .stored_costs import NOT_MEASURED, cost_of, not_measured
from .stored_robustness import worst_of
from .summary import sentence

if TYPE_CHECKING:
    from simnav.scoring.verdict import Verdict

    from .board import Ranking, Row, TrackRanking

__all__ = [
    "between",
    "consistency",
    "gain_cell",
    "ranking_tables",
    "ratio",
    "score_caption",
    "score_title",
    "track_table",
]

_CAPTION = (
    "{score}: geometric mean over the runs, each kind of trouble counting the same; a failed run counts {cap:g}. "
    "Rank: rows that share a rank cannot be told apart."
)


#: Column of the largest ratio under a wrong datasheet.
_DATASHEET = "wrong datasheet"
_TITLES = {"oracle": "× oracle", "plain": "× plain row", "figure": "× reference", "": "error [m]"}
_OVER = {
    "oracle": "that of an oracle on the same run",
    "plain": "that of the plain row on the same run",
    "figure": "the scenario's reference figure",
}


def score_title(track: TrackRanking) -> str:
    """Heading of the score: what it is a multiple of, or the error in metres."""
    return _TITLES[track.reference]


def score_caption(track: TrackRanking) -> str:
    """What the score and the rank are."""
    what = f"{SCORES[track.score].title} [{SCORES[track.score].unit}]" if track.score in SCORES else track.score
    what = f"{score_title(track)}: {what} over {_OVER[track.reference]}" if track.relative else f"Error: {what}"
    return _CAPTION.format(score=what, cap=FAILURE)


def gain_cell(row: Row) -> str:
    """The gain of a row over the plain row with its interval over seeds, as a ratio of errors."""
    return "" if row.gain is None else tables.interval(row.gain.value, row.gain.low, row.gain.high)


def ratio(value: float) -> str:
    """A ratio to the reference figure; there is none above that of a failed run."""
    return f"≥ {FAILURE:.0f}" if value >= 0.999 * FAILURE else tables.number(value)


def between(low: float, high: float, write: Callable[[Any], str] = tables.number) -> str:
    """The two ends of an interval; empty where it is not known."""
    return f"{write(low)} – {write(high)}" if math.isfinite(low) and math.isfinite(high) else ""


def consistency(c: Verdict) -> str:
    """A verdict, the NEES that it is from, and of what.

    >>> from simnav.scoring.verdict import Verdict
    >>> consistency(Verdict("optimistic", 7.31, "heading", ("horizontal", "vertical", "velocity", "heading")))
    'optimistic 7.31 (heading)'
    >>> consistency(Verdict())
    '–'
    """
    return tables.MISSING if c.badge == "unknown" else f"{c.badge} {tables.number(c.nees)} ({c.words})"


def ranking_tables(ranking: Ranking, mine: Collection[str] = ()) -> list[tables.Fitted]:
    """A table a track for the terminal; ``mine`` are the labels that stand out."""
    return [track_table(track, mine) for track in ranking.tracks]


def track_table(track: TrackRanking, mine: Collection[str] = ()) -> tables.Fitted:
    """The table of a track for the terminal; the columns of least value go first where it is narrow."""
    title = score_title(track)
    cells = []
    costs = {r.estimator: cost_of(r.estimator, track.plain, track.score) for r in track.rows}
    for r in track.rows:
        cost = costs[r.estimator]
        name = r.estimator + (" *" if r.reference else "")
        failed = f"{r.failed} of {r.runs}" if r.runs else ""
        cells.append([
            r.ranks or tables.MISSING, name, ratio(r.score), between(r.low, r.high, ratio),
            between(r.scenarios_low, r.scenarios_high, ratio), gain_cell(r), _won(r), tables.percent(_worse(r)),
            tables.percent(r.far), ratio(r.p95), ratio(r.worst), failed, f"{r.covered} of {r.scenarios}",
            consistency(r.clean), consistency(r.faulty), tables.percent(r.clean.coverage),
            tables.percent(r.clean.worst_coverage),
            NOT_MEASURED if cost is None else tables.interval(cost.value, cost.low, cost.high),
            _wrong_datasheet(r, track),
            tables.duration(r.update_median), tables.size(r.peak_memory or None),
        ])  # fmt: skip
    gained = f"× {track.plain}" if track.plain else "× plain row"
    cost_title = f"cost × {track.plain}" if track.plain else "cost × plain row"
    columns = ["rank", "estimator", title, "95 % interval", "over scenarios", gained, "scenarios won", "above 1.5 ×",
               "above 10 ×", "95th perc.", "worst run", "failed", "scenarios", "NEES, no fault", "NEES, faults",
               "95 % coverage, no fault", "worst coverage, no fault", cost_title, _DATASHEET, "wall clock",
               "memory"]  # fmt: skip
    value = ["estimator", title, "rank", "95 % interval", gained, "failed", "scenarios won", "above 1.5 ×",
             "over scenarios", "above 10 ×", cost_title, _DATASHEET, "NEES, no fault", "scenarios", "NEES, faults",
             "worst run", "95th perc.", "95 % coverage, no fault", "memory", "worst coverage, no fault",
             "wall clock"]  # fmt: skip
    texts = ("estimator", "95 % interval", "over scenarios", gained, "NEES, no fault", "NEES, faults", cost_title)
    numeric = [c for c in columns if c not in texts]
    notes = [sentence(track), score_caption(track), *track.remarks]
    best = [r.estimator for r in track.rows if r.may_be_best]
    if len(best) > 1 and len(best) < sum(r.ranked for r in track.rows):
        notes.append(f"May be the best (95 %): {', '.join(best)}.")
    if any(r.reference for r in track.rows):
        notes.append("* reference: told the truth, not ranked.")
    others = [r.estimator for r in track.rows if r.standing == "unsuitable"]
    if others:
        notes.append(f"Not ranked, for not all scenarios suit them: {', '.join(others)}.")
    notes += [
        f"Not ranked: {r.estimator} ({r.standing}: {r.why})."
        for r in track.rows
        if r.why and r.standing != "unsuitable"
    ]
    explained = (
        f"{cost_title.capitalize()}: processor time over that of {track.plain or 'the plain row'}, with the 95 % "
        "interval over rounds, measured in turns and not in these runs."
    )
    missing = not_measured(r.estimator for r in track.rows if r.runs and costs[r.estimator] is None)
    scenarios = f"{len(track.scenarios)} scenario{'s' if len(track.scenarios) != 1 else ''}"
    units = f"{track.units} {track.unit}{'s' if track.units != 1 else ''}"
    return tables.Fitted(
        f"{track.title}: {scenarios}, {units}{', provisional' if track.provisional else ''}",
        columns,
        cells,
        value,
        numeric=numeric,
        dim=[i for i, r in enumerate(track.rows) if not r.ranked],
        strong=[i for i, r in enumerate(track.rows) if r.estimator in mine],
        caption=" ".join(notes),
        explained={
            "95 % interval": "95 % interval: over seeds, of the errors of completed runs.",
            "over scenarios": "Over scenarios: 95 % interval over seeds and scenarios.",
            gained: f"{gained}: errors over those of {track.plain or 'the plain row'} on the same runs, with the "
            "interval over seeds.",
            "scenarios won": "Scenarios won: those with a smaller error than the plain row's.",
            "above 1.5 ×": "Above 1.5 ×: share of runs with more than 1.5 times the error of the plain row.",
            cost_title: f"{explained} {missing}".rstrip(),
            _DATASHEET: "Wrong datasheet: largest error over that of the plain row when the datasheet of one "
            "instrument is wrong and the plain row is told the same, from simnav robustness.",
            "wall clock": "Wall clock: median time of an epoch in these runs, whatever else the machine did.",
            "above 10 ×": "Above 10 ×: share of runs with more than ten times the error of the oracle.",
        },
    )


def _wrong_datasheet(row: Row, track: TrackRanking) -> str:
    worst = worst_of(row.estimator, row.version, track.plain, track.score)
    return "" if worst is None else tables.number(worst.ratio)


def _won(row: Row) -> str:
    return "" if row.gain is None else f"{row.gain.won} of {row.gain.scenarios}"


def _worse(row: Row) -> float | None:
    return None if row.gain is None else row.gain.worse
