"""The columns of the site's tables, with what each means: shown on hover, and in the glossary."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

__all__ = ["SCORES_SHOWN", "Column", "column_dicts", "glossary"]


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    key, title, help : str
        ``help`` is shown on hover.
    kind : str
        How a value is written, as ``write`` in ``core.js`` has it; or ``name``, ``bar``, ``badge``,
        ``interval``; ``words`` is text that may take several lines.
    hidden : bool
        Shown when the reader chooses it.
    fixed : bool
        Cannot be hidden.
    filter : bool
        The reader can choose one of its values.
    descending : bool
        The first click sorts the largest to the top.
    wide : bool
        Hidden at first on a phone.
    scale : tuple of float, optional
        Ends of the logarithmic scale of a bar.
    factor : float
        From the unit of the score, in SI, to that of the column.
    """

    key: str
    title: str
    help: str
    kind: str = "number"
    hidden: bool = False
    fixed: bool = False
    filter: bool = False
    descending: bool = False
    wide: bool = False
    scale: tuple[float, float] | None = None
    factor: float = 1.0

    def to_dict(self) -> dict[str, Any]:
        """For the page; what is not set is left out."""
        found: dict[str, Any] = {"key": self.key, "title": self.title, "help": self.help, "kind": self.kind}
        found |= {n: True for n in ("hidden", "fixed", "filter", "descending", "wide") if getattr(self, n)}
        if self.scale:
            found["scale"] = {"low": self.scale[0], "high": self.scale[1]}
        return found


def column_dicts(columns: Iterable[Column]) -> list[dict[str, Any]]:
    """Columns for the page."""
    return [c.to_dict() for c in columns]


#: Scores that pages show, as columns: the median over the runs that ended well.
SCORES_SHOWN = (
    Column("horizontal_rmse", "Horizontal RMSE [m]", "Root mean square of the horizontal position error of a run."),
    Column("r95", "R95 [m]", "Radius that 95 % of the horizontal errors of a run do not exceed."),
    Column(
        "vertical_rmse", "Vertical RMSE [m]", "Root mean square of the vertical position error of a run.", hidden=True
    ),
    Column(
        "velocity_horizontal_rmse", "Velocity RMSE [m/s]", "Root mean square of the error of the horizontal velocity."
    ),
    Column(
        "heading_rmse", "Heading RMSE [°]", "Root mean square of the error of the heading.", factor=math.degrees(1.0)
    ),
    Column("outage_end_error", "At outage end [m]", "Horizontal error at the end of the outages."),
    Column("recovery_time", "Recovery [s]", "Time after an outage until the error is small again.", hidden=True),
    Column(
        "nees_horizontal",
        "NEES / dof",
        "Normalised estimation error squared of the horizontal position, by degree of freedom. 1: the covariance "
        "agrees with the errors. More: the estimator is optimistic.",
    ),
    Column(
        "coverage_95",
        "95 % coverage",
        "Share of the epochs at which the truth lies in the stated 95 % ellipse. 95 % is ideal.",
        "percent",
    ),
    Column(
        "inconsistent",
        "Says inconsistent",
        "Share of the epochs at which the estimator reports that its measurements contradict it.",
        "percent",
        hidden=True,
    ),
    Column(
        "detection_rate",
        "Faults detected",
        "Share of the faulty measurements that the estimator flags or gives little weight.",
        "percent",
        descending=True,
    ),
    Column(
        "false_alarm_rate",
        "False alarms",
        "Share of the measurements without a fault that the estimator flags or gives little weight.",
        "percent",
    ),
    Column(
        "smoothed_horizontal_rmse",
        "Smoothed RMSE [m]",
        "Horizontal RMSE of the smoothed trajectory, which knows all measurements of the run.",
    ),
    Column(
        "update_median",
        "Wall clock per epoch",
        "Median wall-clock time of one epoch in these runs. It depends on what else the machine did.",
        "duration",
        hidden=True,
    ),
)

#: Terms of the pages, besides the columns.
_GLOSSARY: tuple[tuple[str, str], ...] = (
    ("Estimator", "A program that turns measurements into position, velocity and attitude."),
    ("Row", "An estimator with its parameters, as it was run."),
    ("Scenario", "A simulated or recorded voyage with its instruments and faults."),
    ("Seed", "The number that fixes everything random of a run. All estimators run on the same seeds."),
    ("Track", "Scenarios that the same estimators can do. There are ranks within a track only."),
    (
        "Reference",
        "What the errors of a scenario are divided by: the errors of an oracle on the same runs; without these a fixed "
        "figure of the scenario, and on recorded voyages the errors of the plain row.",
    ),
    (
        "Oracle",
        "An estimator that is told the true noise and every fault. It is shown for comparison and is not ranked.",
    ),
    (
        "Rank interval",
        "The ranks that an estimator may have. The intervals of all rows hold together with 95 % probability.",
    ),
    ("May be the best", "The set of rows that holds the best one with 95 % probability."),
    ("Plain row", "The simplest filter that suits the scenario. Gains are over its errors on the same runs."),
    ("Incomplete", "The row lacks seeds or scenarios that the track asks. It has a score, and no rank."),
    ("Variant", "One of more than three rows that differ in parameters only, or agree in nearly every run."),
    ("Provisional", "Fewer than ten seeds or recordings: the rank may still change much."),
    (
        "Failed run",
        "A run with an exception, an invalid output, a timeout, too much memory or divergence. It counts as the worst.",
    ),
    ("Cramer-Rao bound", "A lower limit of the error that no estimator with the same model can beat on average."),
    ("Pareto front", "The estimators that no other estimator beats in both accuracy and processor time."),
    ("p-value", "How often a difference at least as large would be seen if the two rows did not differ."),
)


def glossary(columns: Iterable[Column]) -> list[tuple[str, str]]:
    """All terms with what they mean, in alphabetical order: those of the pages, and the columns."""
    terms = dict(_GLOSSARY)
    for column in (*columns, *SCORES_SHOWN):
        if column.help:
            terms.setdefault(column.title, column.help)
    return sorted(terms.items(), key=lambda item: item[0].lower().lstrip("× "))
