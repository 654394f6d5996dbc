"""The runs on which a row has a much larger error than the plain row: all of them, and the recorded ones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .statistics import FAILURE

if TYPE_CHECKING:
    from .board import ScenarioRanking

__all__ = ["LOSS", "LostRecordings", "beside", "lost_recordings"]

#: A run is lost if the error is more than so many times that of the plain row.
LOSS = 1.5

_FAILED = FAILURE * (1.0 - 1e-9)  # the logarithm of the ratio is what is kept


def beside(table: ScenarioRanking, label: str, other: str) -> Iterator[tuple[str, float, float]]:
    """Run, error over that of another row (infinite where it failed), and error over the reference figure.

    Runs that the other row did not complete are left out.
    """
    by = {row.estimator: row for row in table.rows}
    if label not in by or other not in by:
        return
    for run, ratio in by[label].ratios.items():
        there = by[other].ratios.get(run, math.nan)
        if 0.0 < there < _FAILED:
            yield run, math.inf if ratio >= _FAILED else ratio / there, ratio


@dataclass(frozen=True)
class LostRecordings:
    """How often a row is lost on recorded voyages.

    Attributes
    ----------
    lost, runs : int
        Recordings on which its error is more than `LOSS` times that of the plain row of the scenario, or it failed; and
        all that both have.
    scenarios : tuple of str
        Versioned ids of the scenarios of the lost ones.
    """

    lost: int
    runs: int
    scenarios: tuple[str, ...]

    @property
    def words(self) -> str:
        """``2 of 8``; empty without recordings."""
        return f"{self.lost} of {self.runs}" if self.runs else ""


def lost_recordings(label: str, tables: Iterable[ScenarioRanking]) -> LostRecordings:
    """Count the recordings that a row loses against the plain row of their scenario; no seeds of simulated ones."""
    lost = runs = 0
    where: list[str] = []
    for table in tables:
        if table.unit != "recording":
            continue
        for _, ratio, _ in beside(table, label, table.plain):
            runs += 1
            if ratio > LOSS * (1.0 + 1e-9):
                lost += 1
                where.append(table.scenario)
    return LostRecordings(lost, runs, tuple(dict.fromkeys(where)))
