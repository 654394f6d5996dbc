"""A state of a model as a tuple of named arrays: one state, or K of them with the first axis in front of each array."""

from __future__ import annotations

from typing import TypeAlias, TypeVar

from simnav.types import Array

__all__ = ["NamedState", "at_row"]

#: A `typing.NamedTuple` of arrays, such as `simnav.estimators.models.measurements.State`.
NamedState: TypeAlias = tuple[Array, ...]
_State = TypeVar("_State", bound=NamedState)


def at_row(states: _State, row: int | slice | None) -> _State:
    """One or some of K states as views; with None, one state as the only one of K."""
    return type(states)(*(array[row] for array in states))
