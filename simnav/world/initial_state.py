"""The initial state that an estimator receives: the true state with errors drawn from their covariance."""

from __future__ import annotations

import numpy as np

from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, rpy_from_dcm
from simnav.streams import stream
from simnav.types import Array, InitialState, NavigationStates

__all__ = ["draw_start"]


def draw_start(truth: NavigationStates, covariance: Array, seed: int, factors: Array | float = 1.0) -> InitialState:
    """Draw the initial state of a run.

    Parameters
    ----------
    truth : NavigationStates
        A series of one state: the truth at the start.
    covariance : (9, 9) array
        Covariance of the errors, in the order of `simnav.types.COMPONENTS`. The estimator receives it.
    seed : int
        Seed of the run.
    factors : (9,) array or float
        Factors by which the true errors are larger than the covariance says.

    Returns
    -------
    InitialState
        The state with errors, and ``covariance``.

    Raises
    ------
    ValueError
        If the covariance is not symmetric and positive definite.
    """
    covariance = np.asarray(covariance, dtype=np.float64)
    square = covariance.shape == (9, 9)
    if not square or not (np.array_equal(covariance, covariance.T) or np.allclose(covariance, covariance.T)):
        raise ValueError(f"an initial covariance is a symmetric (9, 9) array, not one of shape {covariance.shape}")
    try:
        root = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        least = float(np.linalg.eigvalsh(covariance)[0])
        raise ValueError(
            f"the initial covariance is not positive definite: its least eigenvalue is {least:.3g}"
        ) from None
    error = factors * (root @ stream(seed, "initial error").standard_normal(9))
    dcm = dcm_from_rotation_vector(error[6:9]) @ dcm_from_rpy(truth.attitude[0])
    return InitialState(
        float(truth.time[0]),
        displace(truth.position[0], error[0:3]),
        truth.velocity[0] + error[3:6],
        rpy_from_dcm(dcm),
        covariance,
    )
