"""Accuracy less that of the reference: what is left of an error against a reference that has an error of its own.

A recorded voyage is scored against a reference, not against the truth. Where its standard deviations are known
(`simnav.types.ReferenceStates.sigma`), and its errors are independent of those of the estimate, the mean square of the
difference is that of the estimate's error plus the variance of the reference; the latter is subtracted.
"""

from __future__ import annotations

import numpy as np

from simnav.scoring.registry import ScoringInput, register_score
from simnav.types import Array, ReferenceStates

__all__ = ["rms_beyond"]


def rms_beyond(error: Array, sigma: Array) -> float:
    """Root mean square of an error, less the mean variance of the reference; 0 where that is larger.

    Parameters
    ----------
    error, sigma : (n, k) array
        Differences of k components from the reference, and its standard deviations; rows with NaN are left out.

    Returns
    -------
    float
        NaN if no row is complete.

    Examples
    --------
    >>> rms_beyond(np.array([[5.0, 0.0], [np.nan, 1.0]]), np.array([[3.0, 0.0], [1.0, 1.0]]))
    4.0
    """
    known = np.isfinite(error).all(axis=1) & np.isfinite(sigma).all(axis=1)
    if not known.any():
        return float("nan")
    square = np.mean(np.sum(error[known] ** 2 - sigma[known] ** 2, axis=1))
    return float(np.sqrt(max(square, 0.0)))


def _beyond(scored: ScoringInput, columns: tuple[int, ...]) -> float:
    truth = scored.recording.data.truth
    if not isinstance(truth, ReferenceStates):
        return float("nan")
    return rms_beyond(scored.held_error[:, columns], truth.sigma[: len(scored.held_error), columns])


@register_score(
    "horizontal_rmse_beyond_reference", title="Horizontal RMSE less that of the reference", unit="m", better="lower"
)
def _horizontal(scored: ScoringInput) -> float:
    return _beyond(scored, (0, 1))


@register_score(
    "vertical_rmse_beyond_reference", title="Vertical RMSE less that of the reference", unit="m", better="lower"
)
def _vertical(scored: ScoringInput) -> float:
    return _beyond(scored, (2,))
