"""Data of the site, so that pages stay small: figures with few digits, enough to be rounded again, and few points."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["short", "shorts", "spaced"]


def short(value: Any, digits: int = 4) -> float | None:
    """A figure with a few digits, so that pages stay small; None where there is none.

    Pages round it a second time. A figure that ends in 5 because it was rounded could then go the wrong way (12.3504 to
    12.35, and that to 12.3), so that it keeps more digits.

    >>> short(12.3449), short(12.3504), short(12.35)
    (12.34, 12.3504, 12.35)
    """
    x = math.nan if value is None else float(value)
    if not math.isfinite(x):
        return None
    found = float(f"{x:.{digits}g}")
    while found != x and digits < _MOST_DIGITS and _ends_in_five(found):
        digits += 1
        found = float(f"{x:.{digits}g}")
    return found


_MOST_DIGITS = 12  # beyond them, equal figures of two computations differ


def _ends_in_five(x: float) -> bool:
    """Whether 5 is the last digit of a figure that is not 0.

    >>> [_ends_in_five(x) for x in (12.35, 1250.0, 0.05, 5.01)]
    [True, True, True, False]
    """
    digits, _, _ = f"{x:.{_MOST_DIGITS - 1}e}".partition("e")
    return digits.rstrip("0.").endswith("5")


def shorts(values: Any, digits: int = 4) -> list[float | None]:
    """`short` of an array.

    >>> shorts([0.123416, float("nan"), 12345.6, 0.0])
    [0.1234, None, 12346.0, 0.0]
    """
    x = np.asarray(values, dtype=np.float64)
    known = np.isfinite(x)
    size = np.where(known & (x != 0.0), np.abs(x), 1.0)
    places = np.clip(digits - 1 - np.floor(np.log10(size)), -22.0, 22.0)
    up, down = 10.0 ** np.maximum(places, 0.0), 10.0 ** np.maximum(-places, 0.0)  # one of them is 1: both are exact
    whole = np.rint(np.where(known, x, 0.0) * up / down)
    rounded = whole / up * down
    found = rounded.tolist()
    if digits < _MOST_DIGITS:
        five = np.any([whole % (10.0 * m) == 5.0 * m for m in 10.0 ** np.arange(digits)], axis=0)
        again = np.flatnonzero(five & known & (rounded != x))
        if len(again):
            for k, value in zip(again.tolist(), shorts(x[again], digits + 1), strict=True):
                found[k] = value
    if not known.all():
        for k in np.flatnonzero(~known).tolist():
            found[k] = None
    return found  # type: ignore[no-any-return]


@lru_cache(maxsize=64)
def spaced(n: int, points: int) -> NDArray[np.int64]:
    """Places of at most so many points, at even steps, of a curve of n points.

    >>> spaced(7, 3).tolist(), spaced(3, 7).tolist()
    ([0, 3, 6], [0, 1, 2])
    """
    return np.unique(np.linspace(0, n - 1, min(n, points)).round().astype(np.int64))
