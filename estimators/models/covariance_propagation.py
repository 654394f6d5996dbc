"""Kernels that carry a covariance, or errors, through a transition matrix and the decay of the states behind it."""

from __future__ import annotations

from math import exp

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.products import list_elements, padded, sparse_product
from simnav.kernel_types import Matrix, Vector

__all__ = ["carry_errors", "propagate_covariance"]


@kernel
def propagate_covariance(
    covariance: Matrix,
    transition: Matrix,
    process_noise: Matrix,
    calibration: Vector,
    rate: Vector,
    density: Vector,
    elapsed: float,
) -> None:
    """Compute ``P = Phi P Phi' + Q`` in place; the states from index m on are independent Gauss-Markov biases.

    Parameters
    ----------
    covariance : (n, n) array
        Covariance P of the errors; overwritten.
    transition, process_noise : (m, m) arrays
        Transition matrix Phi and process noise Q of the first m states.
    calibration : (n - m,) array
        Values of the other states, which decay; updated.
    rate, density : (n - m,) arrays
        Inverse correlation times of the other states [1/s], and their noise densities.
    elapsed : float
        Length of the step [s]. The discretisation is exact, so a stationary state stays stationary in a step of any
        length.
    """
    n, m = covariance.shape[0], transition.shape[0]
    decay, noise = np.empty(n - m), np.empty(n - m)
    for i in range(n - m):
        decay[i] = exp(-rate[i] * elapsed)
        calibration[i] *= decay[i]
        noise[i] = density[i] * elapsed
        if rate[i] > 0.0:
            noise[i] = density[i] * (1.0 - decay[i] * decay[i]) / (2.0 * rate[i])
    value, column, count = np.empty((m, m)), np.empty((m, m), np.uint64), np.empty(m, np.uint64)
    list_elements(transition, value, column, count)
    P, X = np.zeros((m, padded(n))), np.empty((m, padded(n)))
    T, Y = np.zeros((m, padded(m))), np.empty((m, padded(m)))
    for i in range(m):
        for j in range(n):
            P[i, j] = covariance[i, j]
        for j in range(m):
            T[j, i] = transition[i, j]
    sparse_product(value, column, count, P, X)
    for i in range(m):  # X is full
        count[i] = m
        for j in range(m):
            column[i, j] = j
    sparse_product(X, column, count, T, Y)
    for i in range(m):
        for j in range(i + 1):
            x = 0.5 * (Y[i, j] + Y[j, i]) + process_noise[i, j]
            covariance[i, j] = x
            covariance[j, i] = x
        for j in range(m, n):
            x = X[i, j] * decay[j - m]
            covariance[i, j] = x
            covariance[j, i] = x
    for i in range(m, n):
        for j in range(m, n):
            covariance[i, j] *= decay[i - m] * decay[j - m]
        covariance[i, i] += noise[i - m]


@kernel
def carry_errors(transition: Matrix, rate: Vector, elapsed: float, error: Matrix) -> None:
    """Propagate errors, the columns of an (n, k) array, in place; for the arguments see `propagate_covariance`."""
    m, columns = transition.shape[0], error.shape[1]
    X = np.zeros((m, columns))
    for i in range(m):
        for k in range(m):
            x = transition[i, k]
            if x != 0.0:
                for j in range(columns):
                    X[i, j] += x * error[k, j]
    for i in range(m):
        for j in range(columns):
            error[i, j] = X[i, j]
    for i in range(m, error.shape[0]):
        decay = exp(-rate[i - m] * elapsed)
        for j in range(columns):
            error[i, j] *= decay
