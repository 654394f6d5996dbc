"""Places of the names beside points of a chart, so that they do not cover each other.

Vega-Lite sets each name for itself. So the shifts are computed here, for a chart as wide as it is on a desk and for one
on a phone; the chart takes those that are nearer to its width.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["GAP", "LETTER", "WIDE", "shifts"]

#: From a point to its name, and a letter of it [pixels].
GAP, LETTER = 7.0, 6.5
#: Width from which on a chart is wide, and the widths for which the shifts are computed [pixels].
WIDE = 400.0
_WIDTHS = {"shift": 500.0, "shift_narrow": 280.0}

_LINE = 13.0  # height of a name [pixels]
_POINT = 4.0  # half the size of a point [pixels]
_ABOVE = -4.0  # where the foot of a name is, below its point [pixels]
_PADDING = (14.0, 26.0)  # of the two axes [pixels]
_TRIES = [_ABOVE + side * step * _LINE for step in range(9) for side in ((-1.0, 1.0) if step else (1.0,))]


def shifts(
    names: Sequence[str],
    x: Sequence[float],
    y: Sequence[float],
    shown: Sequence[bool],
    height: float,
    *,
    log: tuple[bool, bool] = (True, True),
) -> dict[str, list[float]]:
    """How far each name is to be set below its point, on a chart that is wide and on one that is narrow.

    Parameters
    ----------
    names : sequence of str
        Names of the points.
    x, y : sequence of float
        Places of the points.
    shown : sequence of bool
        Whether the name of a point is shown.
    height : float
        Height of the chart [pixels].
    log : (bool, bool)
        Whether the axes are logarithmic.

    Returns
    -------
    dict of str to list of float
        ``shift`` and ``shift_narrow`` [pixels], down positive.

    Examples
    --------
    >>> found = shifts(["ekf", "ukf", "far"], [1.0, 1.0, 10.0], [2.0, 2.0, 4.0], [True, True, True], 300.0)
    >>> found["shift"]
    [-4.0, -17.0, -4.0]
    """
    across, up = ([math.log(v) if by_log else v for v in values] for values, by_log in zip((x, y), log, strict=True))
    return {key: _places(names, across, up, shown, width, height) for key, width in _WIDTHS.items()}


def _places(
    names: Sequence[str], x: Sequence[float], y: Sequence[float], shown: Sequence[bool], width: float, height: float
) -> list[float]:
    right = _pixels(x, width, _PADDING[0])
    down = [height - v for v in _pixels(y, height, _PADDING[1])]
    found = [_ABOVE] * len(names)
    named = sorted((k for k, is_named in enumerate(shown) if is_named), key=lambda k: (down[k], right[k]))
    taken = [(right[k] - _POINT, right[k] + _POINT, down[k] - _POINT, down[k] + _POINT) for k in named]
    for k in named:
        long = GAP + LETTER * len(names[k])
        to_left = right[k] > width / 2 and right[k] + long > width
        sides = (right[k] - long, right[k] - GAP) if to_left else (right[k] + GAP, right[k] + long)
        for shift in _TRIES:
            foot = down[k] + shift
            box = (*sides, foot - _LINE, foot)
            inside = _LINE <= foot <= height
            if inside and not any(_meet(box, other) for other in taken):
                found[k] = shift
                taken.append(box)
                break
    return found


def _pixels(values: Sequence[float], length: float, padding: float) -> list[float]:
    low, high = min(values, default=0.0), max(values, default=1.0)
    scale = (length - 2.0 * padding) / (high - low) if high > low else 0.0
    return [padding + scale * (v - low) if scale else length / 2.0 for v in values]


def _meet(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[1] and b[0] < a[1] and a[2] < b[3] and b[2] < a[3]
