"""The scores of a stored result: a view of the column that was read, so that many results take little memory."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["StoredScores"]


class StoredScores(Mapping[str, float]):
    """The scores of one result, by name.

    A dict of 50 scores takes 4 kB; this takes 60 bytes and the numbers themselves.

    Parameters
    ----------
    place : dict of str to int
        Where each score stands, from the start; results with the same scores share it.
    values : array of float
        Scores of many results.
    start : int
        Of this one.
    """

    __slots__ = ("_place", "_start", "_values")

    def __init__(self, place: dict[str, int], values: array[float], start: int):
        self._place, self._values, self._start = place, values, start

    def __getitem__(self, name: str) -> float:
        return self._values[self._start + self._place[name]]

    def get(self, name: str, default: Any = None) -> Any:
        """The score, or the default."""
        k = self._place.get(name)
        return default if k is None else self._values[self._start + k]

    def __contains__(self, name: object) -> bool:
        return name in self._place

    def __iter__(self) -> Iterator[str]:
        return iter(self._place)

    def __len__(self) -> int:
        return len(self._place)

    def __repr__(self) -> str:
        return repr(dict(self))

    def __reduce__(self) -> tuple[type[dict[str, float]], tuple[dict[str, float]]]:
        return dict, (dict(self),)  # not the scores of all the others
