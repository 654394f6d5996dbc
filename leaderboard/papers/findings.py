"""What the repeated comparison of a paper consists of: its rows with our figures, and the runs behind them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from simnav.leaderboard.ranking.statistics import Interval

from .comparison import Single
from .paper import Paper, Row

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.leaderboard.results.result import Result

    from .claims.answer import Answer

__all__ = ["Finding", "Findings"]


@dataclass(frozen=True)
class Finding:
    """A row of a paper with our figures.

    Attributes
    ----------
    table : str
        Title of its table.
    row : Value or Gain
        The paper's row.
    ours : Interval or None
        Our figure in the unit of the measure; for a `Gain` the ratio. None if there is no figure.
    verdict : str
        ``agrees``, ``differs`` or ``undecided``; ``ours`` if the paper has no comparable figure; ``absent`` if a method
        is not registered; ``failed`` or ``unsuitable`` if it has no successful run.
    why : str
        Reason in one sentence; empty if the row agrees.
    estimators : tuple of str
        Labels of the estimators that stand for the row's methods.
    failed : int
        Number of runs that failed.
    single : Interval or None
        The range that holds 95 % of our single runs, in the unit of ``ours``
        (`simnav.leaderboard.papers.comparison.single_runs`). None where the paper has a bound or no figure.
    single_verdict : str
        Whether the paper's figure lies in this range: ``inside``, ``below`` or ``above``; empty where it is not known.
        For a gain it is the gain that is below or above.
    """

    table: str
    row: Row
    ours: Interval | None
    verdict: str
    why: str = ""
    estimators: tuple[str, ...] = ()
    failed: int = 0
    single: Interval | None = None
    single_verdict: Single = ""


@dataclass(frozen=True, eq=False)
class Findings:
    """What a repeated comparison found: runs and rows.

    Attributes
    ----------
    paper : Paper
        The paper.
    seeds : sequence of int
        Seeds of the runs. Rows may have fewer runs (`Finding.ours`).
    findings : list of Finding
        All rows of all tables, in order.
    stands_for : dict of str to EstimatorRequest or None
        Method of the paper -> the estimator that stands for it.
    results : list of Result
        Results of all runs.
    answers : list of Answer or None
        When the paper's claims hold, if this was searched; None: the answers that come with simnav count.
    """

    paper: Paper
    seeds: Sequence[int]
    findings: list[Finding]
    stands_for: dict[str, EstimatorRequest | None]
    results: list[Result]
    answers: list[Answer] | None = None
