"""The first answer of the README, and the tables of the page of the board, made from results, between two marks."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path

from simnav.estimator import EstimatorError, describe
from simnav.estimator.registry import registered
from simnav.leaderboard.ranking.beside_plain import beside_plain, map_figure
from simnav.leaderboard.ranking.board import Ranking, TrackRanking, TrackRow
from simnav.leaderboard.ranking.first_view import FirstView, view_figure
from simnav.leaderboard.ranking.ranking_figure import ranking_figure
from simnav.leaderboard.ranking.ranking_table import gain_cell, ratio
from simnav.leaderboard.ranking.summary import best_rows, gain_text, limits, sentence, spread
from simnav.leaderboard.ranking.superseded import in_words, superseded_by
from simnav.leaderboard.ranking.tables import MISSING
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.provenance import distinct
from simnav.leaderboard.results.result import Result

__all__ = ["BEGIN", "END", "FIRST", "MAP", "PAGE", "PICTURE", "draw", "first_answer", "marked", "replaced", "tables"]

#: Page of the board, from the folder of the README.
PAGE = "docs/board.md"
#: Picture of the board, likewise.
PICTURE = "docs/figures/board.png"
#: Picture of the first view, likewise.
FIRST = "docs/figures/first-view.png"
#: Map of the main track, likewise.
MAP = "docs/figures/map.png"

BEGIN, END = "<!-- standard result: begin -->", "<!-- standard result: end -->"
_MAIN = "aided-ins"
_ROWS = 12  # of the table of the main track
_DRAWN = 24  # of the picture
_FINDINGS = ("no-imu", "underwater")  # tracks whose sentences stand beside that of the main track
_BEST = 4  # rows that a cell names


def first_answer(view: FirstView | None, results: Sequence[Result], of: int | None = None) -> str:
    """The first view of the board as Markdown for the README: one sentence, one picture, and what to take.

    Parameters
    ----------
    view : FirstView or None
        The first view; None where the results have none.
    results : sequence of Result
        Results from which it is made.
    of : int, optional
        How many results there should be: with fewer, the answer is called preliminary.
    """
    parts = [*_preliminary(results, of)]
    if view is not None:
        parts.append(f"**{view.sentence}**")
        parts.append(f"![Error of eight filters beside that of {view.plain}, by kind of trouble]({FIRST})")
        parts.append("\n".join([
            "| take | filter | because |", "|---|---|---|",
            *(f"| {a.what} | `{a.estimator}` | {a.reason} |" for a in view.advice),
        ]))  # fmt: skip
        parts += [view.silence] if view.silence else []
    parts += _older(results)
    parts.append(_origin(results))
    return "\n\n".join(parts)


def tables(ranking: Ranking, results: Sequence[Result], of: int | None = None) -> str:
    """A table of the tracks, and one of the best rows of the main track, as Markdown for the page of the board.

    Parameters
    ----------
    ranking : Ranking
        The board.
    results : sequence of Result
        Results from which the ranking is made.
    of : int, optional
        How many results there should be: with fewer, the tables are called preliminary.
    """
    tracks = [t for t in ranking.tracks if any(r.ranked for r in t.rows)]
    parts = [*_preliminary(results, of)]
    main = _main(ranking)
    if main is not None:
        if beside_plain(main, main.rows):
            parts.append(f"![Error of the best rows beside the plain row's on each scenario]({_from_page(MAP)})")
        parts.append(f"{sentence(main)} {limits(main)}".strip())
    if others := [f"- {sentence(t)}" for t in tracks if t is not main and t.track in _FINDINGS]:
        parts.append("\n".join(others))
    parts.append(
        f"{sum(r.tried for r in results)} runs, all rows of a track on the same seeds. A score is the geometric mean "
        "of the horizontal error over that of an oracle on the same run; the oracle knows the true noise and every "
        "fault. Recorded voyages have no oracle: there the plain filter on the same run is the divisor. Smaller is "
        "better."
    )
    parts += _older(results)
    if tracks:
        parts.append("\n".join([
            "| track | scenarios | seeds | complete rows | may be the best (95 %) | error beside the plain row's "
            "| 95 % over seeds | 95 % over scenarios | × oracle |",
            "|---|---|---|---|---|---|---|---|---|", *map(_track, tracks),
        ]))  # fmt: skip
    if main is not None:
        parts.append(f"![Scores of the track {main.title} with their 95 % intervals]({_from_page(PICTURE)})")
        ranked = [r for r in main.rows if r.ranked]
        parts.append(
            f"The {min(_ROWS, len(ranked))} rows of the track *{main.title}* with the smallest scores, "
            f"of {len(ranked)} complete rows. Rows that share ranks cannot be told apart."
        )
        parts.append("\n".join([
            f"| rank | estimator | description | × oracle, 95 % interval | × `{main.plain}`, 95 % interval "
            "| scenarios won | failed runs |",
            "|---|---|---|---|---|---|---|",
            *(f"| {r.ranks or MISSING} | `{r.estimator}` | {_description(r)} | {ratio(r.score)}{_interval(r)} "
              f"| {gain_cell(r)} | {_won(r)} | {r.failed} of {r.runs} |" for r in ranked[:_ROWS]),
        ]))  # fmt: skip
    parts.append(_origin(results))
    return "\n\n".join(parts)


def _preliminary(results: Sequence[Result], of: int | None) -> list[str]:
    """That results are missing, where they are."""
    return [f"**Preliminary: {len(results)} of {of} results.**"] if of is not None and len(results) < of else []


def _older(results: Sequence[Result]) -> list[str]:
    """Which rows have results of an older version, where there are some."""
    by_row: dict[str, list[Result]] = {}
    for r in results:  # also those that suit no scenario of a track, and are on no board
        by_row.setdefault(r.estimator, []).append(r)
    found = ((f"`{row}`", superseded_by(row.partition("(")[0], own)) for row, own in sorted(by_row.items()))
    older = [(row, versions) for row, versions in found if versions]
    return [f"Until the next edition, some results are of an older version: {in_words(older)}."] if older else []


def _from_page(picture: str) -> str:
    """Path of a picture from the folder of the page."""
    return os.path.relpath(picture, Path(PAGE).parent)


def _origin(results: Sequence[Result]) -> str:
    """Benchmark and days of results, as a sentence; commits are where results are cited."""
    known = distinct(r.provenance for r in results)
    days = sorted({p.date for p in known if p.date})
    when = f", from {days[0]} to {days[-1]}" if len(days) > 1 else f", on {days[0]}" if days else ""
    benchmark = max((p.benchmark for p in known), default="") or "a benchmark without a version"
    return f"Computed with {benchmark}{when}. `leaderboard/standard/results/provenance` names commits and machines."


def _won(row: TrackRow) -> str:
    return "" if row.gain is None else f"{row.gain.won} of {row.gain.scenarios}"


def _main(ranking: Ranking) -> TrackRanking | None:
    """The track whose rows are shown: aided INS, or else the first that has ranks."""
    tracks = [t for t in ranking.tracks if any(r.ranked for r in t.rows)]
    return next((t for t in tracks if t.track == _MAIN), tracks[0] if tracks else None)


def draw(ranking: Ranking, view: FirstView | None, home: Path) -> list[Path]:
    """Draw the pictures of README and board: the first view, the best rows of the main track, and the map of the track.

    Parameters
    ----------
    ranking : Ranking
        The board.
    view : FirstView or None
        Its first view.
    home : Path
        Folder of the README.
    """
    from simnav.leaderboard.figures.style import save

    main = _main(ranking)
    if main is None:
        return []
    drawn = {
        PICTURE: ranking_figure(main, most=_DRAWN),
        MAP: map_figure(main, most=_DRAWN),
        FIRST: None if view is None else view_figure(view),
    }
    made = []
    for name, figure in drawn.items():
        if figure is not None:
            (home / name).parent.mkdir(parents=True, exist_ok=True)
            made += save(figure, home / name, formats=("png",))
    return made


def _description(row: TrackRow) -> str:
    """What a row is, in a few words; empty for one that is not registered by this name."""
    try:
        summary = describe(registered(row.estimator).name).summary
    except EstimatorError:
        return ""
    return summary.partition(": ")[0].rstrip(".")


def _interval(row: TrackRow) -> str:
    return f" [{ratio(row.low)}, {ratio(row.high)}]" if math.isfinite(row.low) and math.isfinite(row.high) else ""


def _track(track: TrackRanking) -> str:
    """A line of the table of tracks: the set that may be the best, and what it gains."""
    ranked = [r for r in track.rows if r.ranked]
    best = best_rows(track)
    shown = best or ranked
    names = ", ".join(f"`{r.estimator}`" for r in best) if len(best) <= _BEST else f"{len(best)} rows"
    gained = [r for r in shown if r.estimator != track.plain]
    cells = [
        track.title, len(track.scenarios), track.units, len(ranked), "not enough data" if track.insufficient else names,
        *(gain_text(gained, part) or MISSING for part in ("value", "seeds", "scenarios")),
        spread((r.score for r in shown), "{:.2f}") if track.reference == "oracle" else "",
    ]  # fmt: skip
    if track.insufficient:
        cells[5:] = [""] * len(cells[5:])
    return f"| {' | '.join(map(str, cells))} |"


def marked(readme: Path) -> str:
    """What stands between the marks.

    Raises
    ------
    RequestError
        If the marks are missing.
    """
    return _split(readme)[1].strip()


def replaced(readme: Path, content: str) -> str:
    """The text of the README with other content between the marks."""
    before, _, after = _split(readme)
    return f"{before}{BEGIN}\n\n{content}\n\n{END}{after}"


def _split(readme: Path) -> tuple[str, str, str]:
    text = readme.read_text(encoding="utf-8")
    found = re.fullmatch(f"(.*?){re.escape(BEGIN)}(.*){re.escape(END)}(.*)", text, re.DOTALL)
    if found is None:
        raise RequestError(f"{readme} lacks the marks of the standard result: {BEGIN} and {END}")
    return found[1], found[2], found[3]
