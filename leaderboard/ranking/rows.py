"""The rows of a board, and the table of a track: frozen objects that hold what was computed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from simnav.scoring.verdict import Verdict

if TYPE_CHECKING:
    from .statistics import Gain

__all__ = [
    "FIRM_REFERENCE",
    "Consistency",
    "Reference",
    "Row",
    "ScenarioRow",
    "Standing",
    "TrackRow",
    "TrackTable",
]

#: A reference figure of fewer runs is provisional.
FIRM_REFERENCE = 50

#: Whether a row is ranked, and if not, why: a reference is told the truth; one that is unsuitable needs instruments
#: that a scenario of the track lacks; one that is incomplete lacks scenarios or seeds of the track; one that is
#: implausible has smaller errors than are possible; one that is identical is another row in real time, and only smooths
#: beside; a variant is one of many of the same row.
Standing = Literal["ranked", "reference", "unsuitable", "incomplete", "implausible", "identical", "variant"]


@dataclass(frozen=True)
class Consistency(Verdict):
    """How the covariance that an estimator states agrees with its errors, over all its runs.

    The verdict is that of the worst of horizontal position, height, velocity and heading.

    Attributes
    ----------
    coverage, worst_coverage : float
        Share of the epochs at which the truth lies in the stated 95 % ellipse of the horizontal position: mean over the
        runs, and of the run with the smallest.
    """

    coverage: float = math.nan
    worst_coverage: float = math.nan


@dataclass(frozen=True)
class Reference:
    """What the errors of a scenario are divided by: the errors of an oracle on the same runs, or else a fixed figure.

    Attributes
    ----------
    value : float
        In the unit of the score [m]; of paired runs, the geometric mean.
    estimator : str
        Whose error it is; empty where there is none, and the figures are in metres.
    runs : int
        Number of runs in the geometric mean.
    spread : float
        Standard deviation of the logarithm of its error from run to run.
    stored : bool
        Whether it comes with the scenario; otherwise it is of the runs that are ranked.
    content : str
        Digest of the content of the scenario that it was measured on (`simnav.scenario.Scenario.content_hash`); empty
        where it is not stored.
    to_bound, to_bound_error : float
        The oracle's error over the Cramer-Rao bound, and its standard error; NaN where not known.
    nees, nees_error : float
        The oracle's mean normalised error squared of the horizontal position, likewise.
    paired : bool
        Whether the error of each run is divided by that of the reference in the same run.
    """

    value: float = 1.0
    estimator: str = ""
    runs: int = 0
    spread: float = math.nan
    stored: bool = False
    content: str = ""
    to_bound: float = math.nan
    to_bound_error: float = math.nan
    nees: float = math.nan
    nees_error: float = math.nan
    paired: bool = field(default=False, kw_only=True)

    @property
    def standard_error(self) -> float:
        """Of the logarithm of the figure; NaN where it is of one run."""
        return self.spread / math.sqrt(self.runs) if self.runs > 1 else math.nan

    @property
    def provisional(self) -> bool:
        """Whether it is a fixed figure of fewer runs than `FIRM_REFERENCE`."""
        return bool(self.estimator) and not self.paired and self.runs < FIRM_REFERENCE

    @property
    def bounds(self) -> bool:
        """Whether it is the error of an oracle, below which nobody can be."""
        return self.estimator.startswith("oracle")

    @property
    def text(self) -> str:
        """What the ratios are to, in words."""
        if not self.estimator:
            return "1 m: there is no reference figure"
        what = "" if self.bounds else ", a plain filter: no oracle and no bound is known here"
        if self.paired:
            return (
                f"the error of {self.estimator} on the same run (geometric mean {self.value:.4g} m over {self.runs} "
                f"runs){what}"
            )
        origin = "shipped with the scenario" if self.stored else "of this campaign"
        error = f" +- {100.0 * self.standard_error:.2g} %" if math.isfinite(self.standard_error) else ""
        return (
            f"{self.value:.4g} m{error}, the geometric mean of {self.estimator} over {self.runs} runs ({origin}){what}"
        )


@dataclass(frozen=True, kw_only=True)
class Row:
    """One estimator on a board.

    Attributes
    ----------
    estimator : str
        Label.
    standing : Standing
        Whether it is ranked.
    why : str
        Why it is not ranked, in one sentence; empty for those that are, and for references.
    rank_low, rank_high : int or None
        Interval of the rank: the rows above ``rank_low`` are significantly better, those below ``rank_high``
        significantly worse. The intervals of all rows hold together with 95 % probability. None for rows that are
        not ranked, and on a board whose rows cannot be ordered.
    may_be_best : bool
        Whether it belongs to the set that holds the best row with 95 % probability.
    provisional : bool
        Whether it has fewer than ten seeds (recordings) somewhere.
    score, low, high : float
        Geometric mean of the ratio of the error to the reference, with its 95 % interval over seeds (NaN where it is
        not known). The interval takes the share of failures as it was observed.
    scenarios_low, scenarios_high : float
        Interval of the score over seeds and scenarios: what it would be on other scenarios of the same kind; NaN with
        too few scenarios.
    gain : Gain or None
        The row beside the plain row on the same runs; None where there is none.
    far : float
        Share of the runs whose error is more than ten times that of the oracle; NaN without a paired oracle.
    worst, p95 : float
        Largest ratio of a run, and the one that 95 % of the runs do not exceed.
    runs, failed : int
        Number of runs that count, and number of failures among them.
    failed_low, failed_high : float
        95 % interval of the share of runs that fail.
    p_value : float or None
        Adjusted for all pairs, against the row with the best score; None for that row and rows that are not ranked.
    better_than, worse_than : tuple of str
        The rows that are significantly worse, and better.
    clean, faulty : Consistency
        Before the first fault of a run, and from then on.
    update_median : float
        Median wall-clock time per epoch of the runs [s]. What an estimator costs is measured apart from them
        (`simnav.leaderboard.ranking.stored_costs`).
    peak_memory : int
        Largest of all runs [bytes].
    learned : str
        What it says that it learned from; empty where it learned nothing.
    superseded : str
        The version that its results are of, where simnav has a newer one; empty otherwise.
    version : int or None
        Declared version of the estimator in its results; None if they are of several versions.
    """

    estimator: str
    standing: Standing
    why: str = ""
    rank_low: int | None = None
    rank_high: int | None = None
    may_be_best: bool = False
    provisional: bool = False
    score: float
    low: float = math.nan
    high: float = math.nan
    scenarios_low: float = math.nan
    scenarios_high: float = math.nan
    gain: Gain | None = None
    far: float = math.nan
    worst: float = math.nan
    p95: float = math.nan
    runs: int = 0
    failed: int = 0
    failed_low: float = math.nan
    failed_high: float = math.nan
    p_value: float | None = None
    better_than: tuple[str, ...] = ()
    worse_than: tuple[str, ...] = ()
    clean: Consistency = field(default_factory=Consistency)
    faulty: Consistency = field(default_factory=Consistency)
    update_median: float = math.nan
    peak_memory: int = 0
    learned: str = ""
    superseded: str = ""
    version: int | None = None

    @property
    def ranked(self) -> bool:
        """Whether it is compared with the others, and has a rank where the rows can be ordered."""
        return self.standing == "ranked"

    @property
    def reference(self) -> bool:
        """Whether it is told the truth."""
        return self.standing == "reference"

    @property
    def ranks(self) -> str:
        """The rank interval as tables show it: ``1-4``, ``2``, or nothing."""
        if self.rank_low is None or self.rank_high is None:
            return ""
        return str(self.rank_low) if self.rank_low == self.rank_high else f"{self.rank_low}-{self.rank_high}"


@dataclass(frozen=True, kw_only=True)
class ScenarioRow(Row):
    """One estimator on one scenario.

    Attributes
    ----------
    median : float
        Median of the ranked score over the completed runs, in its unit; NaN without completed runs.
    statuses : dict of str to int
        Number of runs, by status.
    ratios : dict of str to float
        Ratio to the reference figure of each unit of the test: by seed, or by recording.
    """

    median: float = math.nan
    statuses: dict[str, int] = field(default_factory=dict)
    ratios: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class TrackRow(Row):
    """One estimator on one track.

    Attributes
    ----------
    covered, scenarios : int
        Number of scenarios of the track that it has run, and number of all.
    ratios : dict of str to float
        Score by scenario, of those that it has run.
    """

    covered: int = 0
    scenarios: int = 0
    ratios: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class TrackTable:
    """The ranking on one track: scenarios that the same estimators can do, each counting the same.

    Attributes
    ----------
    track : str
        Name of the track in kebab-case.
    title : str
        Title of the track, for display.
    score : str
        Key of `simnav.scoring.SCORES` that is ranked.
    reference : str
        What the figures are multiples of: ``oracle`` or ``plain`` (on the same runs, in all scenarios), ``figure``
        (other references), or empty: the figures are in the unit of the score.
    plain : str
        The plain row that gains are over; empty without one.
    unit : str
        ``seed`` or ``recording``: the unit that tests and intervals treat as independent.
    units : int
        How many of them the ranked rows have, at least, in a scenario (all recordings of the track are counted).
    scenarios : tuple of str
        Versioned ids.
    remarks : tuple of str
        Sentences that a table has to show: which conclusions the data do not allow, and why.
    insufficient : str
        Why the rows cannot be ordered, in one sentence; then none has a rank. Empty where they can.
    rows : tuple of TrackRow
        In order of score; then those not ranked, then the references.
    """

    track: str
    title: str
    score: str
    reference: str
    plain: str
    unit: str
    units: int
    scenarios: tuple[str, ...]
    remarks: tuple[str, ...]
    insufficient: str
    rows: tuple[TrackRow, ...]

    @property
    def provisional(self) -> bool:
        """Whether a ranked row has fewer than ten seeds or recordings."""
        return any(r.provisional for r in self.rows if r.ranked)

    @property
    def relative(self) -> bool:
        """Whether the figures are multiples of a reference; otherwise they are in the unit of the score."""
        return bool(self.reference)
