"""Rows that are made of the same sorts of pieces, of which one stands for the others where a test takes long."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from simnav.estimator import make, names

__all__ = ["first_of_each_solver", "first_of_each_sort"]


def _sort(name: str) -> tuple[object, ...]:
    """The classes of solver, model and smoother, and whether there is an adaptation or a weighting."""
    estimator = make(name)
    solver = getattr(estimator, "solver", estimator)  # a row that is no declaration is its own solver
    pieces = (getattr(solver, piece, None) for piece in ("model", "_model_choice", "chain", "smoother", "iteration"))
    there = (getattr(solver, piece, None) is not None for piece in ("adaptation", "weighting"))
    return (type(solver), *map(type, pieces), *there)


@cache
def first_of_each_sort() -> list[str]:
    """The first row of each sort, in the order of the names."""
    return _first_of_each(_sort)


@cache
def first_of_each_solver() -> list[str]:
    """The first row of each class of solver and model: fewer than of sorts."""
    return _first_of_each(lambda name: _sort(name)[:2])


def _first_of_each(sort: Callable[[str], tuple[object, ...]]) -> list[str]:
    found: dict[tuple[object, ...], str] = {}
    for name in names():
        found.setdefault(sort(name), name)
    return list(found.values())
