"""Limits of the chi-square and the normal distribution."""

from __future__ import annotations

__all__ = ["chi_square_limits", "normal_quantile"]


def chi_square_limits(probability: float) -> list[float]:
    """The quantiles of chi-square with 0, 1, 2 and 3 degrees of freedom at a probability."""
    from scipy.special import chdtri

    return [0.0, *(float(chdtri(m, 1.0 - probability)) for m in (1, 2, 3))]


def normal_quantile(probability: float) -> float:
    """The quantile of the standard normal distribution at a probability."""
    from scipy.special import ndtri

    return float(ndtri(probability))
