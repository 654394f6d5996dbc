"""Runs that failed or are lost: how many of each kind, and a table with the first reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from . import tables

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.results.result import Result

__all__ = ["failure_table", "failures"]


def failures(results: Sequence[Result]) -> dict[str, int]:
    """How many results have which status, but for those that are ok or do not suit."""
    return dict(Counter(r.outcome for r in _failed(results)))


def failure_table(results: Sequence[Result]) -> list[Table]:
    """A table with a line for each estimator, scenario and status that is not ok; none where there is none."""
    found: dict[tuple[str, str, str], list[Result]] = {}
    for r in _failed(results):
        found.setdefault((r.estimator, r.scenario, r.outcome), []).append(r)
    rows = [[*key, len(failed), failed[0].why] for key, failed in found.items()]
    columns = ["estimator", "scenario", "status", "runs", "reason of the first"]
    return [tables.table("Failed and lost runs", columns, rows, numeric=["runs"])] if rows else []


def _failed(results: Sequence[Result]) -> list[Result]:
    return [r for r in results if r.outcome not in ("ok", "unsuitable")]
