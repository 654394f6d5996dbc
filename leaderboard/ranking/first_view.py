"""The first view of a board: what a reader has to know of it, in one picture, one sentence and four rows to take.

All of it is of one track: the first that has a plain row and kinds of trouble. **Rows worth knowing**: those that are
advised, then those that are significantly better than the plain row in a kind of trouble and have no more error over
all kinds, the best of each kind first, then those with the smallest score.

=============  =========================================================================================================
plain          The row that all others are compared with.
robust         The smallest score among the rows that are significantly better than the plain row, over all troubles.
cheapest       Of the same rows, the one with the smallest processor time.
most honest    Its 95 % region holds the truth nearest to 95 % of the time, of the rows with no more error than the
               plain row.
=============  =========================================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.ratio_map import written_map

from . import tables
from .board import Ranking, TrackRanking, TrackRow
from .stored_costs import cost_of
from .summary import less
from .trouble_profile import GroupRow, TrackProfile, TroubleGroup
from .troubles import within

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["KNOWN", "Advice", "FirstView", "KnownRow", "first_view", "view_figure"]

#: Rows of the picture.
KNOWN = 8
_STATED = 0.95  # share of the epochs that a stated region should hold
_CLEARLY = 1.0  # per cent, from which on a difference is said


@dataclass(frozen=True)
class Advice:
    """A row to take.

    Attributes
    ----------
    what : str
        ``plain``, ``robust``, ``cheapest`` or ``most honest``.
    estimator, reason : str
        Label of the row, and why it is named, in one sentence without a full stop.
    """

    what: str
    estimator: str
    reason: str


@dataclass(frozen=True)
class KnownRow:
    """A row of the picture.

    Attributes
    ----------
    estimator : str
        Label.
    ranks : str
        Interval of its rank on the track; empty where it has none.
    to_plain : float
        Geometric mean of its error over that of the plain row, each kind of trouble counting the same.
    groups : tuple of GroupRow
        Its result in each kind of trouble.
    coverage : float
        Share of the epochs at which the truth lies in its 95 % region, mean over the kinds of trouble; NaN without one.
    cost : float
        Processor time as a multiple of that of the plain row; NaN where it was not measured.
    """

    estimator: str
    ranks: str
    to_plain: float
    groups: tuple[GroupRow, ...]
    coverage: float
    cost: float


@dataclass(frozen=True)
class FirstView:
    """The first view.

    Attributes
    ----------
    track, title, plain : str
        Name and title of the track, and its plain row.
    sentence : str
        What can be repeated: one sentence with at most three numbers.
    groups : tuple of TroubleGroup
        Kinds of trouble of the picture.
    rows : tuple of KnownRow
        Rows worth knowing: the plain row, then the others by their error over all kinds of trouble.
    advice : tuple of Advice
        What to take.
    silence : str
        Which groups separate nobody; empty where each separates somebody.
    """

    track: str
    title: str
    plain: str
    sentence: str
    groups: tuple[TroubleGroup, ...]
    rows: tuple[KnownRow, ...]
    advice: tuple[Advice, ...]
    silence: str


def view_figure(view: FirstView) -> Figure:
    """The picture: rows worth knowing across, kinds of trouble and all of them together down."""
    cells = {(g.title, r.estimator): r.groups[k].to_plain for k, g in enumerate(view.groups) for r in view.rows}
    cells |= {("All kinds alike", r.estimator): r.to_plain for r in view.rows}
    told = {(g.title, r.estimator) for k, g in enumerate(view.groups) for r in view.rows
            if view.plain in (*r.groups[k].better_than, *r.groups[k].worse_than)}  # fmt: skip
    return written_map(
        cells, told, f"Error beside that of {view.plain} on the same runs",
        "Blue: less; orange: more. Bold: a test tells the two apart.",
    )  # fmt: skip


def _main(profiles: Sequence[TrackProfile], ranking: Ranking) -> tuple[TrackProfile, TrackRanking] | None:
    """The track of the first view: the first whose rows are ranked beside one plain row; None without one."""
    for profile in profiles:
        track = ranking.track(profile.track)
        if track.plain and any(r.estimator == track.plain and r.ranked for r in track.rows):
            return profile, track
    return None


def first_view(ranking: Ranking, profiles: Sequence[TrackProfile]) -> FirstView | None:
    """The first view of a board; None where no track has a plain row and kinds of trouble.

    Parameters
    ----------
    ranking : Ranking
        The board.
    profiles : sequence of TrackProfile
        Its tracks by kind of trouble.
    """
    found = _main(profiles, ranking)
    if found is None:
        return None
    profile, track = found
    rows = {r.estimator: known for r in track.rows if r.ranked and (known := _known(r, profile, track)) is not None}
    if track.plain not in rows:
        return None
    advice = tuple(_advice(track, profile, rows))
    harmless = [n for n in _specialists(profile, track.plain) if n in rows and rows[n].to_plain <= 1.0]
    names = [a.estimator for a in advice] + harmless + list(rows)
    chosen = list(dict.fromkeys(n for n in names if n in rows))[:KNOWN]
    chosen.sort(key=lambda n: (n != track.plain, rows[n].to_plain, n))
    return FirstView(
        track.track, track.title, track.plain, _sentence(profile, rows, advice), profile.groups,
        tuple(rows[n] for n in chosen), advice, profile.silence,
    )  # fmt: skip


def _known(row: TrackRow, profile: TrackProfile, track: TrackRanking) -> KnownRow | None:
    """A row of the track with its result in each kind of trouble; None where one lacks."""
    groups = tuple(found for g in profile.groups if (found := g.row(row.estimator)) is not None and found.ranked)
    if len(groups) < len(profile.groups) or row.gain is None:
        return None
    covered = [g.coverage for g in groups if math.isfinite(g.coverage)]
    cost = cost_of(row.estimator, track.plain, track.score)
    multiple = 1.0 if row.estimator == track.plain else math.nan if cost is None else cost.value
    mean = sum(covered) / len(covered) if covered else math.nan
    return KnownRow(row.estimator, row.ranks, row.gain.value, groups, mean, multiple)


def _specialists(profile: TrackProfile, plain: str) -> Iterator[str]:
    """The rows that are significantly better than the plain row in a trouble: the best of each, the second, ..."""
    told = [[r.estimator for r in g.ranked if plain in r.better_than] for g in profile.groups]
    for place in range(max(map(len, told), default=0)):
        yield from (names[place] for names in told if place < len(names))


def _advice(track: TrackRanking, profile: TrackProfile, rows: dict[str, KnownRow]) -> Iterator[Advice]:
    plain = track.plain
    yield Advice("plain", plain, _why_plain(profile, plain))
    told = [r.estimator for r in track.rows if r.estimator in rows and plain in r.better_than]
    if told and not track.insufficient:
        yield Advice("robust", told[0], _why_robust(rows[told[0]], plain))
        costs = [(rows[n].cost, n) for n in told if math.isfinite(rows[n].cost)]
        if costs:
            cost, cheap = min(costs)
            yield Advice("cheapest", cheap, f"{less(rows[cheap].to_plain):.0f} % less error over all kinds of trouble, "
                         f"with {tables.number(cost, 2)} times the processor time of `{plain}`")  # fmt: skip
    honest = [r for r in rows.values() if r.to_plain <= 1.0 and math.isfinite(r.coverage)]
    if honest:
        best = min(honest, key=lambda r: abs(r.coverage - _STATED))
        beside = rows[plain].coverage
        other = f"; with `{plain}` {_percent(beside)}" if best.estimator != plain and beside > 0.0 else ""
        yield Advice("most honest", best.estimator, f"its 95 % region holds the truth {_percent(best.coverage)}"
                     f" of the time{other}")  # fmt: skip


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _why_plain(profile: TrackProfile, plain: str) -> str:
    calm = [g for g in profile.groups if not any(plain in r.better_than for r in g.ranked)]
    if len(calm) == len(profile.groups):
        return "in no kind of trouble a filter is shown to be better"
    if any(g.trouble == "nothing" for g in calm):
        return "where nothing is wrong, no filter is shown to be better"
    return "what all others are compared with"


def _why_robust(row: KnownRow, plain: str) -> str:
    bad = sum(g.bad * g.runs for g in row.groups)
    runs = sum(g.runs for g in row.groups)
    lost = "no run is far worse" if not bad else f"{tables.percent(bad / runs)} of the runs are far worse"
    return f"{less(row.to_plain):.0f} % less error than `{plain}` over all kinds of trouble, and {lost}"


def _sentence(profile: TrackProfile, rows: dict[str, KnownRow], advice: Sequence[Advice]) -> str:
    """What to remember: the plain row where nothing is wrong, the robust one otherwise, and where it gains most."""
    plain = f"the plain filter `{advice[0].estimator}`"
    robust = next((rows[a.estimator] for a in advice if a.what == "robust"), None)
    if robust is None:
        return f"No filter is shown to be better than {plain} over all kinds of trouble: take that one."
    told = [(g.to_plain, group) for g, group in zip(robust.groups, profile.groups, strict=True)
            if advice[0].estimator in g.better_than]  # fmt: skip
    nothing = next((g for g in profile.groups if g.trouble == "nothing"), None)
    calm = nothing is not None and not any(advice[0].estimator in r.better_than for r in nothing.ranked)
    first = f"Where nothing is wrong, no filter is shown to be better than {plain}" if calm else f"Beside {plain}"
    said = f"{first}{'; ' if calm else ', '}over all kinds of trouble `{robust.estimator}` has "
    said += f"{less(robust.to_plain):.0f} % less error"
    if told and less(min(told, key=lambda t: t[0])[0]) > less(robust.to_plain) + _CLEARLY:
        gain, group = min(told, key=lambda t: t[0])
        said += f", and {less(gain):.0f} % less with {within(group.title)}"
    return f"{said}."
