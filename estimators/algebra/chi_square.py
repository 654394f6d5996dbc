"""Limits of the chi-square distribution."""

from __future__ import annotations

__all__ = ["chi_square_limits"]


def chi_square_limits(probability: float) -> list[float]:
    """Limits of chi-square of 0, 1, 2, 3 degrees of freedom that hold with a probability."""
    from scipy.special import chdtri

    return [0.0, *(float(chdtri(m, 1.0 - probability)) for m in (1, 2, 3))]
