"""Short forms of common entries: errors of a run, drawings of methods, and figures without a verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from .paper import Figure, NotShown, Value

__all__ = ["DRAWING", "PHOTOGRAPH", "drawings", "error_figures", "measured"]

DRAWING, PHOTOGRAPH = "a drawing of the method", "a photograph"


def measured(scenario: str, methods: Iterable[str], scores: Iterable[str]) -> tuple[Value, ...]:
    """Rows without a figure of the paper: each score of each method."""
    scores = tuple(scores)
    return tuple(Value(scenario, m, s) for m in methods for s in scores)


def error_figures(
    scenario: str, methods: tuple[str, ...], figures: Mapping[str, tuple[str, Mapping[str, str]]], part: str = ""
) -> tuple[Figure, ...]:
    """Figures of one run: errors over time.

    Parameters
    ----------
    scenario : str
        Scenario of the run.
    methods : tuple of str
        Methods whose errors are drawn.
    figures : mapping of str to (str, mapping)
        Number of the figure -> its title and its panels (`simnav.leaderboard.papers.paper.Figure`).
    part : str
        Tells several figures of the same number apart.
    """
    return tuple(Figure(n, what, "run", scenario, methods, series, part) for n, (what, series) in figures.items())


def drawings(figures: Mapping[str, str], why: str = DRAWING) -> tuple[NotShown, ...]:
    """Figures of a paper that hold no results: number -> what it shows."""
    return tuple(NotShown(number, what, why) for number, what in figures.items())
