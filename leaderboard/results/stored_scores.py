"""The scores of a stored result: a view of the column that was read, so that many results take little memory."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["StoredScores", "score_matrix"]


class StoredScores(Mapping[str, float]):
    """The scores of one result, by name.

    A dict of 50 scores takes 4 kB; this takes 60 bytes and the numbers themselves.

    Parameters
    ----------
    place : dict of str to int
        Offset of each score from `start`; results with the same scores share this mapping.
    values : array of float
        Scores of many results.
    start : int
        Index in `values` of the first score of this result.
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


def score_matrix(scores: Sequence[Mapping[str, float]], names: Sequence[str]) -> NDArray[np.float64]:
    """Some scores of many results, read column by column where they are stored.

    Parameters
    ----------
    scores : sequence of n mappings
        The scores of each result.
    names : sequence of m str
        Names of the scores.

    Returns
    -------
    (n, m) array
        NaN where a result has no such score.
    """
    found = np.full((len(scores), len(names)), np.nan)
    stored: dict[tuple[int, int], list[int]] = {}  # rows whose scores are in one column, in the same order
    for k, one in enumerate(scores):
        if isinstance(one, StoredScores):
            stored.setdefault((id(one._values), id(one._place)), []).append(k)
        else:
            found[k] = [one.get(name, np.nan) for name in names]
    for rows in stored.values():
        first = scores[rows[0]]
        assert isinstance(first, StoredScores)
        known = [j for j, name in enumerate(names) if name in first._place]
        places = np.array([first._place[names[j]] for j in known], dtype=np.int64)
        starts = np.array([scores[k]._start for k in rows], dtype=np.int64)  # type: ignore[attr-defined]
        found[np.ix_(rows, known)] = np.frombuffer(first._values)[starts[:, None] + places]
    return found
