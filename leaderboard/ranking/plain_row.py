"""The plain row: the simplest filter that suits a scenario. What a row gains is said against it, on the same seeds.

A plain row is no reference: it is ranked like any other. It is the row that a navigator would take without reading a
paper, so the gain over it is what a method is worth.
"""

from __future__ import annotations

from collections.abc import Container, Mapping

from .tracks import SMOOTHED

__all__ = ["PLAIN", "plain_row", "plain_rows"]

_REAL_TIME = ("ekf", "ship-ekf")

#: The plain rows of scores that are not of the real-time output.
PLAIN: Mapping[str, tuple[str, ...]] = {SMOOTHED: ("ekf-rts", "ship-ekf-rts")}


def plain_row(score: str, there: Container[str]) -> str:
    """The plain row for a score among the rows that are there; empty where none is.

    Examples
    --------
    >>> plain_row("horizontal_rmse", {"ship-ekf", "gnss-only"})
    'ship-ekf'
    """
    return next((name for name in PLAIN.get(score, _REAL_TIME) if name in there), "")


def plain_rows(score: str) -> tuple[str, ...]:
    """The plain rows for a score, whether they are there or not, the one for vessels with an IMU first."""
    return PLAIN.get(score, _REAL_TIME)
