"""Figures with fewer binary digits: the zeros at their ends take no space in a compressed file."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["with_bits"]


def with_bits(values: Any, bits: int) -> Any:
    """Figures that are rounded to some binary digits.

    Parameters
    ----------
    values : array of floats
        The figures; NaN and infinities stay.
    bits : int
        Binary digits that are kept: a figure changes by a part in ``2**bits`` at most.

    Returns
    -------
    array
        The figures, in the shape and type of the values.
    """
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.round(np.ldexp(mantissa, bits)), exponent - bits)
