"""Structures: numbers with names in one array of float64, as the settings and the memory of a rule are kept.

A function that is handed over to a loop has one type, whichever it is. So what such functions keep has one type, too: a
plain array. A structure gives names to its numbers. It is a data type of NumPy, and a kernel reads and writes an array
through it::

    MEMORY = structure(count=int, level=float, limits=4)

    own = memory.view(MEMORY)[0]
    own.count += 1
    own.level = own.limits[2]

The same lines do the same in Python and in compiled code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["filled", "length", "structure"]


def structure(**fields: type | int | tuple[int, ...]) -> np.dtype[Any]:
    """The data type of a structure.

    Parameters
    ----------
    **fields : type, int or tuple of int
        By name: ``float``, ``int``, or the length or the shape of an array of float64.

    Raises
    ------
    ValueError
        If a record of NumPy has an attribute of that name: in Python it would be read in place of the field.

    Examples
    --------
    >>> structure(count=int, limits=4).names
    ('count', 'limits')
    """
    for name in fields:
        if hasattr(np.record, name):
            raise ValueError(
                f"field {name!r} of a structure: a record of NumPy has an attribute of that name; rename it"
            )
    named: list[Any] = [
        (name, np.dtype(kind)) if isinstance(kind, type) else (name, np.float64, kind) for name, kind in fields.items()
    ]
    return np.dtype((np.record, named))


def length(kind: np.dtype[Any]) -> int:
    """Number of elements of an array that holds a structure."""
    return kind.itemsize // 8


def filled(kind: np.dtype[Any], /, **values: Any) -> NDArray[np.float64]:
    """An array that holds a structure with these values; what is not named is zero.

    Examples
    --------
    >>> array = filled(structure(count=int, limits=2), limits=[1.0, 3.0])
    >>> array.view(structure(count=int, limits=2))[0].limits.tolist()
    [1.0, 3.0]
    """
    array = np.zeros(1, kind)
    for name, value in values.items():
        array[name] = value
    return np.asarray(array.view(np.float64))
