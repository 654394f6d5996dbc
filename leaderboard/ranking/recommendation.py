"""Which row to take, for some instruments and troubles, from stored results: what it costs, and how sure that is.

**Evidence.** The scenarios with these troubles that speak for these instruments
(`simnav.leaderboard.ranking.similar_scenarios`). Rows are compared within a track only, so the evidence for a trouble
is that of one track: the first that has the most of the troubles. What the other tracks have is said beside, and
decides nothing.

**Choice.** All pairs of rows are tested at once. Where no row that may be taken is significantly better than the
plain row, the plain row is taken: nothing more is shown. Otherwise the row with the smallest error among those that
are, and than which no other row is significantly better. Where the plain row takes too long, the row with the smallest
error among the others. A row whose page advises against it
(`simnav.estimator.Estimator.advised_against`) is not taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from simnav.estimator import EstimatorError, find
from simnav.leaderboard.results.plain import as_json
from simnav.leaderboard.results.shown import Shown

from . import tables
from .plain_row import plain_rows
from .recommendation_text import sentences
from .recommended import Answer, Candidate, Confidence, Elsewhere
from .stored_costs import cost_of
from .track_runs import TrackRuns
from .tracks import RECORDED
from .trouble_profile import GroupRow, TroubleGroup, group_of, ranked_group
from .troubles import trouble_of, troubles, within

if TYPE_CHECKING:
    from rich.console import RenderableType

__all__ = ["Recommendation", "recommendation", "recommendations"]

_SHOWN = 10  # rows of the table
_LEADING = 2  # of them, the row and the plain row
_WITH_INTERVALS = 2  # kinds of trouble whose intervals are in the table


@dataclass(frozen=True, repr=False)
class Recommendation(Answer, Shown):
    """Which row to take, in words and tables (`simnav.leaderboard.ranking.recommended.Answer` has the fields)."""

    @property
    def sentences(self) -> list[str]:
        """The answer in words: which row and why, what it costs, how sure that is, and what is not known."""
        return sentences(self)

    def headline(self) -> str:
        """Which row to take."""
        return self.sentences[0]

    def shown(self) -> Sequence[RenderableType]:
        """The sentences, and the errors of the rows by kind of trouble."""
        return [*self.sentences[1:], *([_table(self)] if self.row is not None else [])]

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav recommend --json`` prints."""
        found: dict[str, Any] = as_json(vars(self))
        return found | {"sentences": self.sentences}


def recommendation(
    every: Sequence[TrackRuns],
    instruments: Sequence[str],
    speaks: Callable[[str], bool],
    asked: Sequence[str] = (),
    limit: float | None = None,
) -> Recommendation:
    """Choose a row.

    Parameters
    ----------
    every : sequence of TrackRuns
        The runs, in the order of the tracks.
    instruments : sequence of str
        Kinds of instruments of the vessel, for the answer.
    speaks : callable
        Whether a scenario, by its versioned id, speaks for them.
    asked : sequence of str
        Kinds of trouble. Default: those of the track that has the most of them.
    limit : float, optional
        Milliseconds that an epoch may take.
    """
    return recommendations(every, instruments, speaks, asked, (limit,))[0]


def recommendations(
    every: Sequence[TrackRuns],
    instruments: Sequence[str],
    speaks: Callable[[str], bool],
    asked: Sequence[str],
    limits: Sequence[float | None],
) -> list[Recommendation]:
    """Choose a row for each of several times of an epoch; the evidence is the same. As `recommendation`."""
    fitting = [runs for runs in (r.only(lambda s: bool(trouble_of(s)) and speaks(s)) for r in every) if runs.tables]
    chosen = _evidence(fitting, asked)
    known = {trouble_of(t.name) for runs in fitting for t in runs.tables}
    without = tuple(t for t in asked or troubles() if t not in known)
    others = tuple(t for t in troubles() if not asked and t in known and t not in chosen)
    groups = tuple(filter(None, (group_of(runs, t) for t, runs in chosen.items())))
    over = None if not groups else groups[0] if len(groups) == 1 else _together(chosen)
    beside: dict[str, tuple[tuple[Elsewhere, ...], tuple[Elsewhere, ...]]] = {}
    answers = []
    for limit in limits:
        made = Recommendation(
            tuple(instruments), tuple(chosen), without, others, limit, "none", "", None, None, (), 0, groups, (), ()
        )
        if over is None:
            made = replace(made, why="no scenario of the results has these troubles and instruments")
        else:
            made = _chosen(made, over, next(iter(chosen.values())).track.score)
        if made.row is not None:
            name = made.row.estimator
            if name not in beside:
                wanted = [t for t in troubles() if not asked or t in chosen]
                beside[name] = _elsewhere(fitting, chosen, name, wanted), _worse(fitting, chosen, name)
            made = replace(made, elsewhere=beside[name][0], worse=beside[name][1])
        answers.append(made)
    return answers


def _chosen(asked: Recommendation, over: TroubleGroup, score: str) -> Recommendation:
    """The answer from all of the evidence together."""
    if not over.plain or " or " in over.plain or (found := over.row(over.plain)) is None:
        return replace(asked, why="the scenarios with these troubles have no plain row in common")
    epoch, limit = 1000.0 * found.update_median, asked.limit
    candidates = {r.estimator: _candidate(r, over.plain, score, epoch) for r in over.ranked}
    plain = candidates.get(over.plain) or _candidate(found, over.plain, score, epoch)
    left = {n: c for n, c in candidates.items() if not _advised_against(n)}
    allowed = {n: c for n, c in left.items() if limit is None or c.milliseconds <= limit}
    if not allowed:
        why = "no row is ranked" if limit is None else f"no row with a stored cost takes {limit:g} ms or less"
        return replace(asked, why=why)
    best = [c for c in allowed.values() if not allowed.keys() & set(c.result.worse_than)]
    better = [c for c in best if over.plain in c.result.better_than and not over.insufficient]
    decided = bool(better) or over.plain not in allowed
    row = min(better or best, key=lambda c: c.result.to_reference) if decided else plain
    confidence: Confidence = "undecided" if not better else "in these scenarios"
    if better and row.result.scenarios_high < 1.0:
        confidence = "beyond these scenarios"
    rest = [c for c in better or best if c is not row]
    rest.sort(key=lambda c: (math.isnan(c.cost), c.cost) if better else (False, c.result.to_reference))
    return replace(
        asked, confidence=confidence, why=over.insufficient, row=row, plain=plain, as_good=tuple(rest),
        compared=len(candidates),
    )  # fmt: skip


def _advised_against(name: str) -> bool:
    """Whether a row says so of itself; one that is not known here says nothing."""
    try:
        return find(name).advised_against
    except EstimatorError:
        return False


def _evidence(fitting: Sequence[TrackRuns], asked: Sequence[str]) -> dict[str, TrackRuns]:
    """The track that each kind of trouble is judged on, in the order of the kinds; only those of which there is one."""
    there = {id(runs): {trouble_of(t.name) for t in runs.tables} for runs in fitting}
    wanted = set(asked or troubles())
    chosen: dict[str, TrackRuns] = {}
    while wanted and any(there[id(runs)] & wanted for runs in fitting):
        most = max(fitting, key=lambda runs: len(there[id(runs)] & wanted))  # the first of those with the most
        chosen |= dict.fromkeys(there[id(most)] & wanted, most)
        wanted -= there[id(most)]
        if not asked:
            break
    return {name: chosen[name] for name in troubles() if name in chosen}


def _together(chosen: Mapping[str, TrackRuns]) -> TroubleGroup:
    """All of the evidence, each kind of trouble counting the same."""
    pieces = [
        t.in_stratum(name) for name, runs in chosen.items() for t in runs.tables if trouble_of(t.name) == name
    ]  # fmt: skip
    first = next(iter(chosen.values())).track
    apart = {name: family for runs in chosen.values() for name, family in runs.apart.items()}
    track = replace(first, scenarios=tuple(t.name for t in pieces))
    return ranked_group(TrackRuns(track, pieces, apart), "", "All of them")


def _candidate(row: GroupRow, plain: str, score: str, epoch: float) -> Candidate:
    cost = cost_of(row.estimator, plain, score)
    multiple = 1.0 if row.estimator == plain else math.nan if cost is None else cost.value
    return Candidate(row.estimator, multiple, multiple * epoch, row)


def _elsewhere(
    fitting: Sequence[TrackRuns], chosen: Mapping[str, TrackRuns], row: str, wanted: Sequence[str]
) -> tuple[Elsewhere, ...]:
    """The row on the other tracks with the wanted troubles, and on all recorded voyages with these instruments."""
    found = []
    for runs in fitting:
        rest = _undecided(runs, chosen, wanted).of_rows({row, *plain_rows(runs.track.score)})
        if rest.tables and (result := ranked_group(rest, "", "").row(row)) is not None:
            found.append(Elsewhere(runs.track.title, tuple(t.name for t in rest.tables), result))
    return tuple(found)


def _undecided(runs: TrackRuns, chosen: Mapping[str, TrackRuns], wanted: Sequence[str]) -> TrackRuns:
    """The scenarios of a track that decide nothing."""
    allowed = list(troubles()) if runs.track.name == RECORDED else wanted
    return runs.only(lambda s: trouble_of(s) in allowed and chosen.get(trouble_of(s)) is not runs)


def _worse(fitting: Sequence[TrackRuns], chosen: Mapping[str, TrackRuns], row: str) -> tuple[Elsewhere, ...]:
    """The other kinds of trouble in which the row is significantly worse than the plain row, each on its best track."""
    names = [name for name in troubles() if name not in chosen]
    found = []
    for name, runs in _evidence(fitting, names).items() if names else ():
        group = group_of(runs.of_rows({row, *plain_rows(runs.track.score)}), name)  # a test of two rows
        if group is not None and (result := group.row(row)) is not None and group.plain in result.worse_than:
            found.append(Elsewhere(group.title, group.scenarios, result))
    return tuple(found)


def _table(answer: Recommendation) -> tables.Fitted:
    """The chosen row, the plain one and those that may be as good, by kind of trouble."""
    assert answer.row is not None
    assert answer.plain is not None
    few = len(answer.groups) <= _WITH_INTERVALS
    named = {c.estimator: c for c in (answer.row, answer.plain, *answer.as_good[: _SHOWN - _LEADING])}
    columns = ["estimator", "cost ×", *(g.title for g in answer.groups), "bad runs", "95 % coverage"]
    cells = [
        [n, tables.number(c.cost), *(_cell(g, n, few) for g in answer.groups), tables.percent(c.result.bad),
         tables.percent(c.result.coverage)]
        for n, c in named.items()
    ]  # fmt: skip
    silent = [within(g.title) for g in answer.groups if not g.separates]
    interval = ", with the 95 % interval over seeds of each row by itself" if few else ""
    notes = [f"Error over that of {answer.plain.estimator} in the same runs{interval}."]
    if len(named) > _LEADING:
        order = "smallest error" if answer.confidence == "undecided" else "cheapest"
        notes.append(f"After the first {_LEADING}, the row with the {order} is first.")
    if silent:
        notes.append(f"No two rows differ significantly in these groups: {', '.join(silent)}.")
    if len(answer.as_good) > _SHOWN - _LEADING:
        notes.append("The document of --json has the other rows.")
    value = ["estimator", *columns[2:-2], "cost ×", "bad runs", "95 % coverage"]
    return tables.Fitted(
        "The row, the plain row, and those that may be as good", columns, cells, value,
        numeric=columns[1:], strong=[0], caption=" ".join(notes),
    )  # fmt: skip


def _cell(group: TroubleGroup, estimator: str, with_interval: bool) -> str:
    row = group.row(estimator)
    if row is None or not with_interval:
        return tables.number(None if row is None else row.to_plain)
    return tables.interval(row.to_plain, row.to_plain_low, row.to_plain_high)
