"""Whitening: what makes the unit covariance of an error's own."""

from __future__ import annotations

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import Matrix

from .cholesky import factorise, invert_factor

__all__ = ["whitening"]


@kernel
def whitening(covariance: Matrix, whitener: Matrix) -> None:
    """The inverse Cholesky factor of a covariance, so that ``whitener`` times an error has unit covariance.

    Parameters
    ----------
    covariance : (n, n) array
        Positive semi-definite; what is zero or depends on the components before it is left out.
    whitener : (n, n) array
        Overwritten: lower triangular, with rows of zeros for components left out.
    """
    n = covariance.shape[0]
    L = covariance.copy()
    factorise(L, n, 1e-13, np.empty(n))
    invert_factor(L, n, whitener)
