"""Gauss-Newton steps on a chain of nodes: the block-tridiagonal normal equations, solved by elimination.

A window is a prior on its first node, motion factors between neighbours and aiding factors on single nodes. With the
correction dx_k of node k, the step minimises the sum of

- ``(dx_0 - d)' P_0^-1 (dx_0 - d)``                        prior
- ``w_k (e_k + dx_k+1 - F_k dx_k)' Q_k^-1 (...)``          motion (w_k = 1 for the errors of instruments)
- ``w_i (r_i - H_i dx_k)' R_i^-1 (r_i - H_i dx_k)``        aiding
- ``lambda dx_k' diag(P_k)^-1 dx_k``                       Levenberg-Marquardt damping, P_k as predicted

The symbols are: d and P_0 the mean (minus the first node) and covariance of the prior; e_k the residual, F_k the
transition matrix, Q_k the process noise and w_k the weight of the motion from node k to k + 1; r_i the residual, H_i
the Jacobian, R_i the noise and w_i the weight of measurement i on node k; lambda the damping.

The normal equations are block-tridiagonal. Nodes are eliminated from the oldest to the newest, and solved for in a
backward pass. The Schur complement of all nodes before k,
``S_k = Q^-1 - Q^-1 F (F' Q^-1 F + ...)^-1 F' Q^-1``, is stored as its inverse, ``P_k = F (...)^-1 F' + Q``, which is
equal by Woodbury's identity. The first form is a small difference of large numbers (Q of a hundredth of a second is 12
orders of magnitude below P), and for a state without process noise Q^-1 does not exist. So

- P_k and d_k before node k's own measurements are the prior after the marginalisation of all nodes before k;
- P at the newest node, after its measurements, is its covariance;
- the backward pass needs no inverse: with the adjoint a after a node's measurements it is ``dx = d + P a``; a is
updated
  through the measurements by ``a <- a + H' S^-1 (v - H P a)``, with the innovation v and its covariance S, and through
  the motion by ``a <- F' a``;
- damping is a measurement of zero for each component.

Measurements of one instrument on one node are replaced by their mean, weighted by their information: the mean of their
readings and of their Jacobians, and its covariance. If their Jacobians are equal and their noise is proportional, this
is exact. The Jacobians of measurements at intermediate states of a node
(`simnav.estimators.models.chain`) differ by the motion of a fraction of a second.

Sources: B. M. Bell, "The iterated Kalman smoother as a Gauss-Newton method", SIAM J. Optimization 4(3), 1994; for the
backward pass G. J. Bierman, "Fixed interval smoothing with discrete measurements", Int. J. Control 18(1), 1973.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.types import Array, Integers

from .cholesky import factorise
from .factors import AidingFactors, Rows, Window
from .products import Places, add_product, list_elements, padded, sparse_product

__all__ = ["after_step", "error_after_step", "half_squares", "keep_weights", "solve_chain", "whiten", "whiten_one"]

#: A factor with a smaller weight than this is left out.
LEAST_WEIGHT = 1e-9


class Elements(NamedTuple):
    """The elements of a sparse (n, n) matrix: values, their columns, and how many there are in each row."""

    value: Array
    column: Places
    counts: Places


class Room(NamedTuple):
    """Work space (n, w), where w is a multiple of eight."""

    full: Array
    work: Array
    turned: Array


class Measured(NamedTuple):
    """A measurement of m components: its (3, n) Jacobian, (3,) residual, (3, 3) noise, and weight."""

    jacobian: Array
    residual: Array
    noise: Array
    weight: float
    components: int


class Whitened(NamedTuple):
    """What the elimination leaves of a measurement: ``L^-1 H P``, ``L^-1 H`` and ``L^-1 (r - H d)``."""

    cross: Array
    white: Array
    innovation: Array


@helper
def _copy_node(P: Array, d: Array, to_P: Array, to_d: Array) -> None:
    """Copy a covariance and a mean, element by element: a kernel with assignments of arrays takes long to compile."""
    for i in range(d.size):
        to_d[i] = d[i]
        for j in range(d.size):
            to_P[i, j] = P[i, j]


@helper
def _predict(
    P: Array, F: Array, Q: Array, weight: float, coupled: int, elements: Elements, room: Room, out: Array
) -> None:
    """Compute ``out = F P F' + Q / weight``, for a sparse F. From component ``coupled`` on the weight is 1.

    A wrong motion is no reason for the errors of the aids to change: if they could, a fix that contradicts the motion
    would be explained by a bias of its receiver.
    """
    n = P.shape[0]
    value, column, count = elements
    full, work, turned = room
    list_elements(F, value, column, count)
    for i in range(n):
        for j in range(n):
            full[i, j] = P[i, j]
    sparse_product(value, column, count, full, work)
    for i in range(n):
        for j in range(n):
            turned[i, j] = work[j, i]
    sparse_product(value, column, count, turned, full)
    scale = 1.0 / weight
    for i in range(n):
        for j in range(i + 1):
            x = 0.5 * (full[i, j] + full[j, i]) + (scale if i < coupled else 1.0) * Q[i, j]
            out[i, j] = x
            out[j, i] = x


@helper
def _absorb(
    P: Array,
    d: Array,
    measured: Measured,
    L: Array,
    whitened: Whitened,
    columns: Integers,
) -> bool:
    """Update P and d with a measurement with the noise covariance ``R / weight``.

    With ``L L' = S = H P H' + R / weight`` the whitened quantities U = ``L^-1 H P``, G = ``L^-1 H`` and y =
    ``L^-1 (r - H d)`` are stored; the update is ``d + U' y`` and ``P - U' U``. The last row of L holds the pivots. If S
    is singular, nothing is changed and the result is False. ``columns`` (3, n + 1) is work space: the columns of H that
    are not zero, and their number.
    """
    H, r, R, weight, m = measured
    U, G, y = whitened
    n = P.shape[0]
    for a in range(m):
        y[a] = r[a]
        for c in range(n):
            U[a, c] = 0.0
        count = 0
        for c in range(n):  # most elements are zero
            x = H[a, c]
            G[a, c] = x
            if x != 0.0:
                columns[a, count] = c
                count += 1
                y[a] -= x * d[c]
                for j in range(n):
                    U[a, j] += x * P[c, j]
        columns[a, n] = count
    for a in range(m):
        for b in range(a + 1):
            x = 0.5 * (R[a, b] + R[b, a]) / weight
            for k in range(columns[b, n]):
                c = columns[b, k]
                x += H[b, c] * U[a, c]
            L[a, b] = x
    if not factorise(L, m, 1e-14, L[3]):
        return False
    for a in range(m):
        for b in range(a):
            x = L[a, b]
            y[a] -= x * y[b]
            for c in range(n):
                U[a, c] -= x * U[b, c]
                G[a, c] -= x * G[b, c]
        x = 1.0 / L[a, a]
        y[a] *= x
        for c in range(n):
            U[a, c] *= x
            G[a, c] *= x
    for a in range(m):
        for i in range(n):
            d[i] += U[a, i] * y[a]
    for i in range(n):
        if m == 3:  # in one pass
            u, v, w = U[0, i], U[1, i], U[2, i]
            for j in range(n):
                P[i, j] -= u * U[0, j] + v * U[1, j] + w * U[2, j]
        elif m == 2:  # likewise
            u, v = U[0, i], U[1, i]
            for j in range(n):
                P[i, j] = P[i, j] - u * U[0, j] - v * U[1, j]
        else:
            for a in range(m):
                u = U[a, i]
                for j in range(n):
                    P[i, j] -= u * U[a, j]
    return True


@helper
def _mean_of(i: int, end: int, aids: AidingFactors, mean_H: Array, mean_r: Array, mean_R: Array) -> int:
    """Compute the mean of the measurement in row i and of the later used ones of its instrument before ``end``.

    The weight of each measurement in the mean is ``w / trace(R)``. ``used`` becomes 0 for those that i replaces.

    Returns
    -------
    int
        Number of measurements in the mean. If it is 1, nothing is written.
    """
    instrument, components, used = aids.instrument, aids.components, aids.used
    H, r, R, weight = aids.jacobian, aids.residual, aids.noise, aids.weight
    count = 1
    for k in range(i + 1, end):
        if used[k] == 1 and instrument[k] == instrument[i] and components[k] == components[i]:
            count += 1
    if count == 1:
        return count
    m, n = components[i], mean_H.shape[1]
    total = 0.0
    for a in range(3):
        mean_r[a] = 0.0
        for b in range(3):
            mean_R[a, b] = 0.0
        for c in range(n):
            mean_H[a, c] = 0.0
    for k in range(i, end):
        if used[k] == 0 or instrument[k] != instrument[i] or components[k] != m:
            continue
        trace = 0.0
        for a in range(m):
            trace += R[k, a, a]
        share = weight[k] / trace
        total += share
        for a in range(m):
            mean_r[a] += share * r[k, a]
            for c in range(n):
                mean_H[a, c] += share * H[k, a, c]
            for b in range(m):
                mean_R[a, b] += share / trace * R[k, a, b]
        if k > i:
            used[k] = 0
    for a in range(m):
        mean_r[a] /= total
        for c in range(n):
            mean_H[a, c] /= total
        for b in range(m):
            mean_R[a, b] /= total * total
    return count


@helper
def whiten_one(error: Array, whitener: Array, whitened: Array) -> float:
    """Whiten an error with an inverse Cholesky factor; the result is the norm of the whitened error."""
    square = 0.0
    for i in range(error.size):
        x = 0.0
        for j in range(i + 1):
            x += whitener[i, j] * error[j]
        whitened[i] = x
        square += x * x
    return sqrt(square)


@helper
def _return(adjoint: Array, U: Array, G: Array, y: Array, m: int, z: Array) -> None:
    """Update the adjoint a through a measurement of m components, backward: ``a + G' (y - U a)``; z is work space."""
    n = adjoint.size
    for a in range(m):
        z[a] = y[a]
        for c in range(n):
            z[a] -= U[a, c] * adjoint[c]
    for a in range(m):
        for c in range(n):
            adjoint[c] += G[a, c] * z[a]


@kernel
def solve_chain(
    window: Window, rows: Rows, prior: Matrix, mean: Vector, damping: float, first: int
) -> tuple[float, float]:
    """Compute one step of K nodes of n states with K - 1 motion factors and M aiding factors (equations in the module).

    Parameters
    ----------
    window : Window
        The nodes and factors. Of the nodes all is overwritten from node ``first`` on, and the steps of all nodes. Of
        the aiding factors ``cross``, ``white``, ``innovation`` and ``used``.
    rows : Rows
        Where they are.
    prior, mean : (n, n), (n,) arrays
        Covariance of the first node before its measurements, and its mean as a step of the node.
    damping : float
        The damping lambda, 0 for a Gauss-Newton step.
    first : int
        Nodes before this one have been eliminated already, without damping.

    Returns
    -------
    float, float
        Largest ``size`` of all nodes, and of the nodes before ``first``.
    """
    nodes, motions, aids = window.nodes, window.motions, window.aids
    count, base, k0, m0 = rows.nodes, rows.base, rows.first_node, rows.first_motion
    k1, m1, i0, i1 = k0 + count, m0 + count - 1, rows.first_aid, rows.first_aid + rows.aids
    transition, noise = motions.jacobian[m0:m1], motions.noise[m0:m1]
    error, motion_weight = motions.residual[m0:m1], motions.weight[m0:m1]
    predicted, predicted_shift = nodes.predicted[k0:k1], nodes.predicted_shift[k0:k1]
    filtered, filtered_shift = nodes.filtered[k0:k1], nodes.filtered_shift[k0:k1]
    step, size = nodes.step[k0:k1], nodes.size[k0:k1]
    node, instrument, components, used = aids.node, aids.instrument, aids.components, aids.used
    jacobian, residual, aid_noise, aid_weight = aids.jacobian, aids.residual, aids.noise, aids.weight
    cross, white, innovation = aids.cross, aids.white, aids.innovation
    n = step.shape[1]
    L, elements = np.empty((4, 3)), Elements(np.empty((n, n)), np.empty((n, n), np.uint64), np.empty(n, np.uint64))
    room = Room(np.zeros((n, padded(n))), np.zeros((n, padded(n))), np.zeros((n, padded(n))))
    damps = count if damping > 0.0 else 0
    damp_crosses, damp_whites = np.empty((damps, n, 1, n)), np.empty((damps, n, 1, n))
    damp_innovations = np.empty((damps, n, 1))
    damp_used = np.zeros((damps, n), dtype=np.bool_)
    unit, zero, damped = np.zeros((1, n)), np.zeros(1), np.empty((n, 1, 1))
    mean_jacobian, mean_residual, mean_noise = np.empty((3, n)), np.empty(3), np.empty((3, 3))

    columns, most = np.empty((3, n + 1), dtype=np.int64), 0
    for i in range(i0, i1):
        most = max(most, instrument[i])
    latest = np.full(most + 1, -1)

    i = i0
    while i < i1 and node[i] - base < first:
        i += 1
    for k in range(first, count):
        P, d = predicted[k], predicted_shift[k]
        if k == 0:
            _copy_node(prior, mean, P, d)
        else:
            weight = motion_weight[k - 1]
            _predict(filtered[k - 1], transition[k - 1], noise[k - 1], weight, rows.coupled, elements, room, P)
            for r in range(n):
                x = -error[k - 1, r]
                for c in range(n):
                    x += transition[k - 1, r, c] * filtered_shift[k - 1, c]
                d[r] = x
        _copy_node(P, d, filtered[k], filtered_shift[k])
        P, d = filtered[k], filtered_shift[k]
        if damps:
            for r in range(n):
                damped[r, 0, 0] = P[r, r]
            for r in range(n):
                unit[0, r] = 1.0
                damp_used[k, r] = _absorb(
                    P, d, Measured(unit, zero, damped[r], damping, 1), L,
                    Whitened(damp_crosses[k, r], damp_whites[k, r], damp_innovations[k, r]), columns,
                )  # fmt: skip
                unit[0, r] = 0.0
        end = i
        several = False  # whether an instrument has several measurements here
        while end < i1 and node[end] - base == k:
            used[end] = 1 if components[end] > 0 and aid_weight[end] > LEAST_WEIGHT else 0
            several |= latest[instrument[end]] == k
            latest[instrument[end]] = k
            end += 1
        while i < end:
            if used[i] == 1:
                m, whitened = components[i], Whitened(cross[i], white[i], innovation[i])
                if not several or _mean_of(i, end, aids, mean_jacobian, mean_residual, mean_noise) == 1:
                    measured = Measured(jacobian[i], residual[i], aid_noise[i], aid_weight[i], m)
                else:
                    measured = Measured(mean_jacobian, mean_residual, mean_noise, 1.0, m)
                used[i] = _absorb(P, d, measured, L, whitened, columns)
            i += 1

    adjoint, after, z, variance, ratio = np.zeros(n), np.empty(n), np.empty(3), np.empty(n), np.empty(n)
    largest = older = 0.0
    i = i1 - 1
    for k in range(count - 1, -1, -1):
        if k < count - 1:
            for r in range(n):
                after[r] = 0.0
            add_product(transition[k], adjoint, after)
            for r in range(n):
                adjoint[r] = after[r]
        for r in range(n):
            step[k, r] = filtered_shift[k, r]
        add_product(filtered[k], adjoint, step[k])
        for r in range(n):
            variance[r] = filtered[k, r, r]
        for r in range(n):
            ratio[r] = abs(step[k, r]) / sqrt(variance[r])
        size[k] = 0.0
        for r in range(n):
            if not variance[r] <= 0.0 and (ratio[r] > size[k] or ratio[r] != ratio[r]):
                size[k] = ratio[r]
        if size[k] > largest or size[k] != size[k]:
            largest = size[k]
        if k < first and (size[k] > older or size[k] != size[k]):
            older = size[k]
        while i >= i0 and node[i] - base == k:
            if used[i] == 1:
                _return(adjoint, cross[i], white[i], innovation[i], components[i], z)
            i -= 1
        if damps:
            for r in range(n - 1, -1, -1):
                if damp_used[k, r]:
                    _return(adjoint, damp_crosses[k, r], damp_whites[k, r], damp_innovations[k, r], 1, z)
    return largest, older


@helper
def error_after_step(error: Array, F: Array, older: Array, newer: Array, after: Array) -> None:
    """The error of a motion that a step of the nodes at its ends leaves, ``after = e + dx_k+1 - F dx_k``."""
    n = error.size
    for r in range(n):
        x = error[r] + newer[r]
        for c in range(n):
            x -= F[r, c] * older[c]
        after[r] = x


@kernel
def after_step(window: Window, rows: Rows) -> float:
    """Update shifts and residuals after the nodes have moved by their steps, by the linearised factors.

    Parameters
    ----------
    window : Window
        The nodes and factors; shifts of the nodes and residuals are updated, and whitened.
    rows : Rows
        Where they are.

    Returns
    -------
    float
        The cost after the step (`half_squares`).
    """
    nodes, motions, aids = window.nodes, window.motions, window.aids
    step, predicted_shift, filtered_shift = nodes.step, nodes.predicted_shift, nodes.filtered_shift
    k0, m0, count, base = rows.first_node, rows.first_motion, rows.nodes, rows.base
    transition, error, whitener = motions.jacobian, motions.residual, motions.whitener
    whitened, norm = motions.whitened, motions.norm
    node, jacobian, residual = aids.node, aids.jacobian, aids.residual
    aid_whitener, aid_whitened, aid_norm = aids.whitener, aids.whitened, aids.norm
    n = step.shape[1]
    for k in range(k0, k0 + count):
        for r in range(n):
            predicted_shift[k, r] -= step[k, r]
            filtered_shift[k, r] -= step[k, r]
    for k in range(count - 1):
        m = m0 + k
        error_after_step(error[m], transition[m], step[k0 + k], step[k0 + k + 1], error[m])
        norm[m] = whiten_one(error[m], whitener[m], whitened[m])
    for i in range(rows.first_aid, rows.first_aid + rows.aids):
        k = k0 + node[i] - base
        x, y, z = residual[i, 0], residual[i, 1], residual[i, 2]
        for c in range(n):
            s = step[k, c]
            x -= jacobian[i, 0, c] * s
            y -= jacobian[i, 1, c] * s
            z -= jacobian[i, 2, c] * s
        residual[i, 0], residual[i, 1], residual[i, 2] = x, y, z
        aid_norm[i] = whiten_one(residual[i], aid_whitener[i], aid_whitened[i])
    return half_squares(window, rows)


@kernel
def whiten(first: int, error: Matrix, whitener: Stack, whitened: Matrix, norm: Vector) -> None:
    """Whiten N errors of n components.

    Parameters
    ----------
    first : int
        Index of the first row that is computed.
    error : (N, n) array
        Errors to be whitened.
    whitener : (N, n, n) array
        Inverse Cholesky factors of their covariances, lower triangular.
    whitened : (N, n) array
        Overwritten with the whitened errors.
    norm : (N,) array
        Overwritten with the norms of the whitened errors.
    """
    for k in range(first, error.shape[0]):
        norm[k] = whiten_one(error[k], whitener[k], whitened[k])


@kernel
def keep_weights(window: Window, rows: Rows, motion_before: Vector, before: Vector, tolerance: float) -> int:
    """Keep the old values of weights that have hardly changed.

    Parameters
    ----------
    window : Window
        The factors. A new weight is replaced by the old one if neither the weight nor the influence of the factor
        (weight times norm) changes by more than the tolerance.
    rows : Rows
        Where they are.
    motion_before, before : (K - 1,), (M,) arrays
        The weights with which the motion and aiding factors were eliminated.
    tolerance : float
        Largest change that is ignored.

    Returns
    -------
    int
        The first node with a changed weight; K if there is none.
    """
    motions, aids, m0, i0 = window.motions, window.aids, rows.first_motion, rows.first_aid
    norm, weight = motions.norm, motions.weight
    node, aid_norm, aid_weight = aids.node, aids.norm, aids.weight
    first = rows.nodes
    for k in range(rows.nodes - 2, -1, -1):
        if abs(weight[m0 + k] - motion_before[k]) * max(norm[m0 + k], 1.0) > tolerance:
            first = k + 1
        else:
            weight[m0 + k] = motion_before[k]
    for i in range(rows.aids - 1, -1, -1):
        if abs(aid_weight[i0 + i] - before[i]) * max(aid_norm[i0 + i], 1.0) > tolerance:
            first = min(first, node[i0 + i] - rows.base)
        else:
            aid_weight[i0 + i] = before[i]
    return first


@kernel
def half_squares(window: Window, rows: Rows) -> float:
    """The cost: half the weighted sum of squares of all factors."""
    whitener, shift = window.prior.whitener, window.prior.shift
    norm, weight, whitened = window.motions.norm, window.motions.weight, window.motions.whitened
    aid_norm, aid_weight = window.aids.norm, window.aids.weight
    total = 0.0
    for i in range(shift.size):
        x = 0.0
        for j in range(i + 1):
            x += whitener[i, j] * shift[j]
        total += x * x
    for k in range(rows.first_motion, rows.first_motion + rows.nodes - 1):
        total += weight[k] * norm[k] * norm[k]
        if weight[k] != 1.0:
            for i in range(rows.coupled, shift.size):
                total += (1.0 - weight[k]) * whitened[k, i] * whitened[k, i]
    for i in range(rows.first_aid, rows.first_aid + rows.aids):
        total += aid_weight[i] * aid_norm[i] * aid_norm[i]
    return 0.5 * total
