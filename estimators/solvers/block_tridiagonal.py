"""Gauss-Newton steps on a chain of nodes: the block-tridiagonal normal equations, solved by elimination.

A window is a prior on its first node, motion factors between neighbours and aiding factors on single nodes. With dx_k
what is added to node k, the step minimises the sum of

- ``(dx_0 - d)' P_0^-1 (dx_0 - d)``                        prior
- ``w_k (e_k + dx_k+1 - F_k dx_k)' Q_k^-1 (...)``          motion
- ``w_i (r_i - H_i dx_k)' R_i^-1 (r_i - H_i dx_k)``        aiding
- ``lambda dx_k' diag(P_k)^-1 dx_k``                       Levenberg-Marquardt damping, P_k as predicted

whose normal equations are block-tridiagonal. They are eliminated from the oldest node to the newest and solved for
backward. The Schur complement that is left of all nodes before k,
``S_k = Q^-1 - Q^-1 F (F' Q^-1 F + ...)^-1 F' Q^-1``, is kept as its inverse, ``P_k = F (...)^-1 F' + Q``, the same by
Woodbury's identity: as printed it is a small difference of large numbers (Q of a hundredth of a second is 12 orders of
magnitude below P), and a state without process noise has no Q^-1 at all. So

- P_k and d_k before node k's own measurements are the prior that marginalising all nodes before k leaves;
- P at the newest node, after its measurements, is its covariance;
- the backward pass needs no inverse: with a the adjoint after a node's measurements, ``dx = d + P a``, and through them
  ``a <- a + H' S^-1 (v - H P a)``, through the motion ``a <- F' a``.

Sources: B. M. Bell, "The iterated Kalman smoother as a Gauss-Newton method", SIAM J. Optimization 4(3), 1994; for the
backward pass G. J. Bierman, "Fixed interval smoothing with discrete measurements", Int. J. Control 18(1), 1973.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from estimators.solvers.joseph import joseph_update
from simnav.compiled import kernel

__all__ = ["chain_cost", "solve_chain"]

#: A factor of less weight than this counts for nothing.
LEAST_WEIGHT = 1e-9


@kernel()
def _predict(P, F, Q, weight, work, turned, out):  # type: ignore[no-untyped-def]
    """``out = F P F' + Q / weight``; F is sparse."""
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
        for k in range(n):
            x = F[i, k]
            if x != 0.0:
                for j in range(n):
                    work[i, j] += x * P[k, j]
    for i in range(n):
        for j in range(n):
            turned[i, j] = work[j, i]
            out[i, j] = 0.0
    for i in range(n):
        for k in range(n):
            x = F[i, k]
            if x != 0.0:
                for j in range(n):
                    out[i, j] += x * turned[k, j]
    scale = 1.0 / weight
    for i in range(n):
        for j in range(i + 1):
            x = 0.5 * (out[i, j] + out[j, i]) + scale * Q[i, j]
            out[i, j] = x
            out[j, i] = x


@kernel()
def _damp(P, damping, gains):  # type: ignore[no-untyped-def]
    """Measure each component of a step as zero, one by one; gains[i] is ``P e_i / s``, gains[n + i] ``P e_i``."""
    n = P.shape[0]
    variance = np.empty(n)
    for i in range(n):
        variance[i] = P[i, i]
    for i in range(n):
        for j in range(n):
            gains[i, j] = 0.0
            gains[n + i, j] = P[i, j]
        s = P[i, i] + variance[i] / damping
        if s > 0.0:
            for j in range(n):
                gains[i, j] = P[i, j] / s
            for r in range(n):
                for c in range(n):
                    P[r, c] -= gains[i, r] * gains[n + i, c]


@kernel(
    "f8(f8[:, ::1], f8[::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, ::1], f8[::1], i8[::1], i8, i8[::1], f8[:, :, ::1], "
    "f8[:, ::1], f8[:, :, ::1], f8[::1], f8, f8[:, :, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1])"
)
def solve_chain(  # type: ignore[no-untyped-def]
    prior, prior_shift, transition, noise, error, motion_weight,
    node, base, components, jacobian, residual, aid_noise, aid_weight, damping,
    predicted, predicted_shift, filtered, filtered_shift, step,
):  # fmt: skip
    """One step of K nodes of n states with K - 1 motion factors and M aiding factors (equations in the module).

    Parameters
    ----------
    prior : (n, n) array
        Covariance of the first node before its measurements.
    prior_shift : (n,) array
        d, mean of the prior less the first node.
    transition, noise : (K - 1, n, n) array
        F and Q.
    error : (K - 1, n) array
        e, newer node less the motion of the older one.
    motion_weight : (K - 1,) array
    node : (M,) int array
        In ascending order; the first node is number ``base``.
    base : int
    components : (M,) int array
        0 for a factor that says nothing.
    jacobian : (M, 3, n) array
    residual : (M, 3) array
        Measured less predicted.
    aid_noise : (M, 3, 3) array
    aid_weight : (M,) array
    damping : float
        lambda, 0 for a Gauss-Newton step.
    predicted, filtered : (K, n, n) arrays
        Overwritten with the covariances of a node without and with its own measurements, all older ones included.
    predicted_shift, filtered_shift : (K, n) arrays
        Overwritten with their means less the node.
    step : (K, n) array
        Overwritten with dx.

    Returns
    -------
    float
        Largest component of the step, in its filtered sigmas; NaN or infinite where the step is of no use.
    """
    count, n = step.shape
    total = node.size
    work, turned = np.empty((n, n)), np.empty((n, n))
    cross1, cross2, cross3 = np.empty((n, 1)), np.empty((n, 2)), np.empty((n, 3))
    S1, S2, S3 = np.empty((1, 1)), np.empty((2, 2)), np.empty((3, 3))
    v1, v2, v3 = np.empty(1), np.empty(2), np.empty(3)
    correction = np.empty(n)
    crosses = np.empty((total, 3, n))
    spreads = np.empty((total, 3, 3))
    innovations = np.empty((total, 3))
    used = np.zeros(total, dtype=np.bool_)
    damps = damping > 0.0
    gains = np.empty((count if damps else 0, 2 * n, n))
    damped_shift = np.empty((count if damps else 0, n))
    begin = np.empty(count + 1, dtype=np.int64)
    i = 0
    for k in range(count):
        begin[k] = i
        while i < total and node[i] - base == k:
            i += 1
    begin[count] = i

    for k in range(count):
        P, d = predicted[k], predicted_shift[k]
        if k == 0:
            for r in range(n):
                d[r] = prior_shift[r]
                for c in range(n):
                    P[r, c] = prior[r, c]
        else:
            _predict(filtered[k - 1], transition[k - 1], noise[k - 1], motion_weight[k - 1], work, turned, P)
            for r in range(n):
                x = -error[k - 1, r]
                for c in range(n):
                    x += transition[k - 1, r, c] * filtered_shift[k - 1, c]
                d[r] = x
        P, d = filtered[k], filtered_shift[k]
        for r in range(n):
            d[r] = predicted_shift[k, r]
            for c in range(n):
                P[r, c] = predicted[k, r, c]
        if damps:
            _damp(P, damping, gains[k])
            for i in range(n):
                x = d[i]
                damped_shift[k, i] = x
                for r in range(n):
                    d[r] -= gains[k, i, r] * x
        for i in range(begin[k], begin[k + 1]):
            m = components[i]
            if m == 0 or not aid_weight[i] > LEAST_WEIGHT:
                continue
            cross, S, v = (cross1, S1, v1) if m == 1 else ((cross2, S2, v2) if m == 2 else (cross3, S3, v3))
            for a in range(m):
                for r in range(n):
                    crosses[i, a, r] = 0.0
                for c in range(n):  # few are not zero
                    x = jacobian[i, a, c]
                    if x != 0.0:
                        for r in range(n):
                            crosses[i, a, r] += x * P[c, r]
                for r in range(n):
                    cross[r, a] = crosses[i, a, r]
            for a in range(m):
                x = residual[i, a]
                for c in range(n):
                    x -= jacobian[i, a, c] * d[c]
                v[a] = x
                innovations[i, a] = x
                for b in range(a + 1):
                    x = 0.5 * (aid_noise[i, a, b] + aid_noise[i, b, a]) / aid_weight[i]
                    for c in range(n):
                        x += jacobian[i, b, c] * crosses[i, a, c]
                    S[a, b] = x
                    S[b, a] = x
                    spreads[i, a, b] = x
                    spreads[i, b, a] = x
            if joseph_update(P, cross, S, v, correction) >= 0.0:
                used[i] = True
                for r in range(n):
                    d[r] += correction[r]

    adjoint, after = np.zeros(n), np.empty(n)
    largest = 0.0
    for k in range(count - 1, -1, -1):
        if k < count - 1:
            for c in range(n):
                after[c] = 0.0
            for r in range(n):
                x = adjoint[r]
                for c in range(n):
                    after[c] += transition[k, r, c] * x
            adjoint[:] = after
        for r in range(n):
            x = filtered_shift[k, r]
            for c in range(n):
                x += filtered[k, r, c] * adjoint[c]
            step[k, r] = x
            if filtered[k, r, r] > 0.0:
                size = abs(x) / sqrt(filtered[k, r, r])
                if not size <= largest:
                    largest = size
        for i in range(begin[k + 1] - 1, begin[k] - 1, -1):
            if not used[i]:
                continue
            m = components[i]
            # S^-1 (v - H P a) by Cholesky; 3 components at most.
            y0, y1, y2 = innovations[i, 0], 0.0, 0.0
            for c in range(n):
                y0 -= crosses[i, 0, c] * adjoint[c]
            l00 = sqrt(spreads[i, 0, 0])
            y0 /= l00
            l10, l11, l20, l21, l22 = 0.0, 1.0, 0.0, 0.0, 1.0
            if m > 1:
                y1 = innovations[i, 1]
                for c in range(n):
                    y1 -= crosses[i, 1, c] * adjoint[c]
                l10 = spreads[i, 1, 0] / l00
                l11 = sqrt(spreads[i, 1, 1] - l10 * l10)
                y1 = (y1 - l10 * y0) / l11
            if m > 2:
                y2 = innovations[i, 2]
                for c in range(n):
                    y2 -= crosses[i, 2, c] * adjoint[c]
                l20 = spreads[i, 2, 0] / l00
                l21 = (spreads[i, 2, 1] - l20 * l10) / l11
                l22 = sqrt(spreads[i, 2, 2] - l20 * l20 - l21 * l21)
                y2 = (y2 - l20 * y0 - l21 * y1) / l22
                y2 /= l22
            if m > 1:
                y1 = (y1 - l21 * y2) / l11
            y0 = (y0 - l10 * y1 - l20 * y2) / l00
            for c in range(n):
                x = jacobian[i, 0, c] * y0
                if m > 1:
                    x += jacobian[i, 1, c] * y1
                if m > 2:
                    x += jacobian[i, 2, c] * y2
                adjoint[c] += x
        if damps:
            for i in range(n - 1, -1, -1):
                # Innovation -d_i; H P a is P e_i times a; what is left is S^-1 of both, with gain = P e_i / S.
                x = -damped_shift[k, i]
                for c in range(n):
                    x -= gains[k, n + i, c] * adjoint[c]
                if gains[k, n + i, i] > 0.0:
                    adjoint[i] += x * gains[k, i, i] / gains[k, n + i, i]
    return largest


@kernel("f8(f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[::1])")
def chain_cost(error, whitener, whitened, norm):  # type: ignore[no-untyped-def]
    """Whiten N errors of n components; return the sum of their squares.

    Parameters
    ----------
    error : (N, n) array
    whitener : (N, n, n) array
        Lower triangular.
    whitened : (N, n) array
        Overwritten.
    norm : (N,) array
        Overwritten with the norms of the whitened errors.
    """
    total = 0.0
    for k in range(error.shape[0]):
        square = 0.0
        for i in range(error.shape[1]):
            x = 0.0
            for j in range(i + 1):
                x += whitener[k, i, j] * error[k, j]
            whitened[k, i] = x
            square += x * x
        norm[k] = sqrt(square)
        total += square
    return total
