"""Variants of one row: more than a few are listed apart and tested apart, so that they cost the other rows nothing.

Each row of a board widens the rank intervals of the others, because all pairs are tested at once and rows that are
tied share their ranks. Thirty copies of one row would push everybody else down. Two rows are variants of each other if

- they are one registered row with other parameters (``sw-fgo`` and ``sw-fgo(window=10)``), or
- neither comes with simnav, and their errors agree within `NEAR` in `SHARE` of their common runs: a copy under another
  name.

The first `MOST` of a family are ranked: the row with its default parameters, then the others in the order of their
labels. The order does not depend on any result, so nobody gains by offering many variants and keeping the luckiest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST", "NEAR", "SHARE", "families", "surplus"]

#: Variants of one row that are ranked.
MOST = 3
#: Two errors agree if their ratio is within this of 1.
NEAR = 0.03
#: Share of the common runs in which the errors of two rows agree, from which on one is a copy of the other.
SHARE = 0.8
#: With fewer common runs nothing is said.
_FEWEST = 3


def families(logs: Mapping[str, Mapping[object, float]], of_simnav: Callable[[str], bool]) -> list[list[str]]:
    """The rows that are variants of each other.

    Parameters
    ----------
    logs : mapping of str to mapping
        Label -> logarithm of the error by run; infinite where a run failed.
    of_simnav : callable
        Whether the row of a name comes with simnav.

    Returns
    -------
    list of list of str
        Each family with two rows or more, in the order in which its members are ranked.

    Examples
    --------
    >>> own = {k: 0.1 * k for k in range(10)}
    >>> families({"a": own, "b": own, "ekf": own, "c": {k: -v for k, v in own.items()}}, lambda name: name == "ekf")
    [['a', 'b']]
    """
    parent = {label: label for label in logs}

    def root(label: str) -> str:
        while parent[label] != label:
            label = parent[label]
        return label

    by_name: dict[str, list[str]] = {}
    for label in sorted(logs):
        by_name.setdefault(_name(label), []).append(label)
    for members in by_name.values():
        for label in members[1:]:
            parent[root(label)] = root(members[0])
    foreign = [label for label in sorted(logs) if not of_simnav(_name(label))]
    for a, b in _copies(foreign, logs):
        parent[root(b)] = root(a)
    found: dict[str, list[str]] = {}
    for label in logs:
        found.setdefault(root(label), []).append(label)
    return sorted(sorted(members, key=_order) for members in found.values() if len(members) > 1)


def surplus(found: Sequence[Sequence[str]]) -> dict[str, Sequence[str]]:
    """Of families, the rows beyond the first `MOST`, each with its family."""
    return {label: members for members in found for label in members[MOST:]}


def _name(label: str) -> str:
    return label.partition("(")[0]


def _order(label: str) -> tuple[bool, str]:
    return "(" in label, label


def _copies(labels: Sequence[str], logs: Mapping[str, Mapping[object, float]]) -> list[tuple[str, str]]:
    """Pairs of rows whose errors agree."""
    if len(labels) < 2:
        return []
    runs = {run: k for k, run in enumerate(dict.fromkeys(run for label in labels for run in logs[label]))}
    values: NDArray[np.float64] = np.full((len(labels), len(runs)), np.nan)
    for i, label in enumerate(labels):
        values[i, [runs[run] for run in logs[label]]] = [min(x, 1e3) for x in logs[label].values()]
    pairs = []
    for i in range(len(labels) - 1):
        apart = np.abs(values[i + 1 :] - values[i])
        common = np.isfinite(apart).sum(axis=1)
        near = (apart <= math.log1p(NEAR)).sum(axis=1)
        copies = (common >= _FEWEST) & (near >= SHARE * common)
        pairs += [(labels[i], labels[i + 1 + j]) for j in np.flatnonzero(copies).tolist()]
    return pairs
