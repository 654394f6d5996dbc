"""One filter or a bank of them, with noise of their own, as kernels over the linear problems of the plain filter.

The equations are those of `simnav.estimators.learning.reference`. The environment of one voyage, the vector form and an
estimator that holds a policy call the same three kernels, so that they agree bit for bit.
"""

from __future__ import annotations

from math import exp, log, log1p, log10, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import Array, helper, kernel
from simnav.estimators.algebra.cholesky import factorise, solve_factor
from simnav.estimators.algebra.joseph import joseph_update, project
from simnav.kernel_types import FlagVector, IntegerVector, Matrix, Stack, Vector
from simnav.structures import structure

from .features import LIMIT, MEMORY, PER_INSTRUMENT, PER_MEASUREMENT, WHITE
from .reference import Linear

__all__ = ["KEPT", "Steps", "observe", "set_scales", "take"]

#: What a filter remembers of an instrument: fading means of the surprise and of the innovations over their sigmas, time
#: of the last measurement [s], logarithm of the scale over the largest.
KEPT = structure(surprise=float, innovation=3, heard=float, setting=float)


class Steps(NamedTuple):
    """The step of each of the b filters of a bank.

    Attributes
    ----------
    active : (b,) bool array
        Whether the filter takes a step.
    first, last : (b,) int array
        Its events in the step: number of the first one, and number after the last one.
    """

    active: FlagVector
    first: IntegerVector
    last: IntegerVector


@kernel
def set_scales(actions: Matrix, largest: float, setting: Matrix, scale: Stack, process_scale: Vector) -> None:
    """Convert actions in [-1, 1], logarithms of factors over the logarithm of the largest factor, to factors on sigmas.

    Parameters
    ----------
    actions : (b, p + 1) array
        Actions for p instruments and the process noise; they are clipped to [-1, 1].
    largest : float
        Largest factor on a sigma.
    setting : (b, p) array
        Overwritten with the logarithms of the instruments.
    scale : (b, p, k) array
        Overwritten with the factors on the sigmas of the k components of each instrument.
    process_scale : (b,) array
        Overwritten with the factors on the sigma of the process noise.
    """
    places = setting.shape[1]
    for b in range(actions.shape[0]):
        for i in range(places):
            a = min(max(actions[b, i], -1.0), 1.0)
            setting[b, i] = a
            factor = exp(a * log(largest))
            for j in range(scale.shape[2]):
                scale[b, i, j] = factor
        process_scale[b] = exp(min(max(actions[b, places], -1.0), 1.0) * log(largest))


@helper
def _clipped(value: float) -> float:
    return min(max(value, -LIMIT), LIMIT)


@kernel
def observe(
    steps: Steps,
    linear: Linear,
    end: Vector,
    context: Matrix,
    layout: tuple[IntegerVector, Matrix, int],
    filters: tuple[Stack, Matrix, Stack],
    observation: Annotated[NDArray[np.float32], "float32[:, ::1]"],
) -> None:
    """Compute the observations before the decision on the next step (`simnav.estimators.learning.features`).

    The innovations are those before any measurement of the step is used.

    Parameters
    ----------
    steps : Steps
        The steps.
    linear : Linear
        The events of all voyages.
    end : (b,) array
        End of each filter's step [s].
    context : (b, 11) array
        Numbers on the voyage, see `simnav.estimators.learning.features.Context`.
    layout : (k,) int array, (b, p) array, int
        Place of each instrument in the observation, -1 for none; nominal time between two measurements of each place
        [s]; largest number of measurements of a step in the observation.
    filters : (b, n, n), (b, n) and (b, p, 6) arrays
        Covariances, distances to the plain filter, and the `KEPT` of the instruments, which is updated.
    observation : (b, o) float32 array
        Overwritten for the filters that are active.
    """
    active, first, last = steps
    transition, moves, correction = linear.transition, linear.moves, linear.correction
    instrument, time, size = linear.instrument, linear.time, linear.size
    innovation, jacobian, noise = linear.innovation, linear.jacobian, linear.noise
    place, period, most = layout
    covariance, delta, memory = filters
    n = delta.shape[1]
    places = period.shape[1]
    width = PER_INSTRUMENT + PER_MEASUREMENT * most
    ahead, moved = np.empty(n), np.empty(n)
    counts = np.empty(places, np.int64)
    spread = np.empty((3, 3))
    white, pivot = np.empty(3), np.empty(3)
    for b in range(first.size):
        if not active[b]:
            continue
        row, P = observation[b], covariance[b]
        for j in range(places * width):
            row[j] = 0.0
        for i in range(n):
            ahead[i] = delta[b, i]
        counts[:] = 0
        for e in range(first[b], last[b]):
            if moves[e]:
                for i in range(n):
                    x = 0.0
                    for j in range(n):
                        x += transition[e, i, j] * ahead[j]
                    moved[i] = x
                for i in range(n):
                    ahead[i] = moved[i]
            m = size[e]
            at = place[instrument[e]] if m > 0 else -1
            if at >= 0:
                # S with the covariance at the start of the step, which is accurate enough for an observation
                for i in range(m):
                    for k in range(i + 1):
                        x = noise[e, i, k]
                        for r in range(n):
                            h = jacobian[e, i, r]
                            if h != 0.0:
                                for c in range(n):
                                    x += h * P[r, c] * jacobian[e, k, c]
                        spread[i, k] = x
                for i in range(m):
                    x = innovation[e, i]
                    for r in range(n):
                        x -= jacobian[e, i, r] * ahead[r]
                    white[i] = x
                base = at * width + PER_INSTRUMENT + PER_MEASUREMENT * counts[at]
                seen = counts[at] < most
                counts[at] += 1
                kept = memory[b, at].view(KEPT)[0]
                elapsed = max(time[e] - kept.heard, 0.0)
                gain = 1.0 - exp(-elapsed / MEMORY)
                kept.heard = time[e]
                for i in range(m):
                    x = white[i] / sqrt(spread[i, i])
                    kept.innovation[i] += gain * (_clipped(x) - kept.innovation[i])
                    if seen:
                        row[base + 1 + i] = _clipped(x / WHITE)
                factorise(spread, m, 0.0, pivot)
                solve_factor(spread, m, white)
                nis = 0.0
                for i in range(m):
                    nis += white[i] * white[i]
                surprise = log1p(sqrt(nis / m))
                kept.surprise += gain * (surprise - kept.surprise)
                if seen:
                    row[base] = _clipped(surprise)
            for i in range(n):
                ahead[i] -= correction[e, i]
        for at in range(places):
            base = at * width
            kept = memory[b, at].view(KEPT)[0]
            mean = kept.innovation
            row[base] = _clipped(kept.surprise)
            for i in range(3):
                row[base + 1 + i] = _clipped(mean[i])
            x = mean[0] ** 2 + mean[1] ** 2 + mean[2] ** 2
            row[base + 4] = log1p(sqrt(x))
            row[base + 5] = _clipped(log1p(max(end[b] - kept.heard, 0.0) / period[b, at]))
            row[base + 6] = _clipped(counts[at] / most)
            row[base + 7] = kept.setting
        base = places * width
        row[base] = _clipped(0.5 * log10(max(P[0, 0] + P[1, 1], 1e-18)))
        for i in range(context.shape[1]):
            row[base + 1 + i] = _clipped(context[b, i])


@helper
def _moving(transition: Array) -> int:
    """Number of states without the last ones that are constant, as those of instruments are: rows and columns of I."""
    for i in range(transition.shape[0] - 1, -1, -1):
        if transition[i, i] != 1.0:
            return i + 1
        for j in range(transition.shape[0]):
            if j != i and (transition[i, j] != 0.0 or transition[j, i] != 0.0):
                return i + 1
    return 0


@helper
def _propagate(
    P: Array,
    delta: Array,
    transition: Array,
    process_noise: Array,
    factor: float,
    A: Array,
    B: Array,
    T: Array,
    moved: Array,
) -> None:
    """Compute ``delta = Phi delta`` and ``P = Phi P Phi' + factor Q`` in place; P is symmetric.

    Products with zeros are left out, and so are those of the constant states. The sums stay the same to the last bit.

    A, B, T are (n, n) and ``moved`` is (n,) work space.
    """
    n, m = delta.size, _moving(transition)
    for k in range(m):
        moved[k] = 0.0
        for i in range(m):
            T[k, i] = transition[i, k]
            B[k, i] = 0.0
    for k in range(m):
        x = delta[k]
        for i in range(m):
            moved[i] += T[k, i] * x
    for i in range(m):
        delta[i] = moved[i]
        for j in range(n):
            A[i, j] = 0.0
        for k in range(m):
            x = transition[i, k]
            if x != 0.0:
                for j in range(n):
                    A[i, j] += x * P[k, j]
    for k in range(m):
        end = m
        while end > 1 and T[k, end - 1] == 0.0:
            end -= 1
        end = min((end + 3) // 4 * 4, m)  # whole vectors of the processor
        for i in range(m):
            x = A[i, k]
            for j in range(end):
                B[i, j] += x * T[k, j]
    for i in range(n):
        for j in range(i + 1):
            if i < m:
                x = 0.5 * (B[i, j] + B[j, i])
            elif j < m:
                x = A[j, i]
            else:
                x = 0.5 * (P[i, j] + P[j, i])
            x += factor * process_noise[i, j]
            P[i, j] = x
            P[j, i] = x


@kernel
def take(
    steps: Steps,
    linear: Linear,
    place: IntegerVector,
    scale: Stack,
    process_scale: Vector,
    covariance: Stack,
    delta: Matrix,
) -> None:
    """Advance each filter of a bank by one step, with the noise that its agent has set.

    Parameters
    ----------
    steps : Steps
        The steps.
    linear : Linear
        The events of all voyages.
    place : (k,) int array
        Place of each instrument in the observation; -1 for none.
    scale : (b, p, k) array
        Factor on the sigma of each measurement of the step, for the instrument of each place. The last factor also
        applies to further measurements. A measurement with a factor of zero or less is not used.
    process_scale : (b,) array
        Factor on the sigma of the process noise.
    covariance, delta : (b, n, n), (b, n) arrays
        Covariances P of the filters, and differences delta from the plain filter; updated.
    """
    active, first, last = steps
    transition, process_noise, moves = linear.transition, linear.process_noise, linear.moves
    instrument, size, correction = linear.instrument, linear.size, linear.correction
    innovation, jacobian, noise = linear.innovation, linear.jacobian, linear.noise
    n = delta.shape[1]
    most = scale.shape[2]
    A, B, T, moved = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty(n)
    correct = np.empty(n)
    counts = np.empty(scale.shape[1], np.int64)
    H1, H2, H3 = np.empty((1, n)), np.empty((2, n)), np.empty((3, n))
    C1, C2, C3 = np.empty((n, 1)), np.empty((n, 2)), np.empty((n, 3))
    S1, S2, S3 = np.empty((1, 1)), np.empty((2, 2)), np.empty((3, 3))
    v1, v2, v3 = np.empty(1), np.empty(2), np.empty(3)
    for b in range(first.size):
        if not active[b]:
            continue
        P, d = covariance[b], delta[b]
        factor = process_scale[b] * process_scale[b]
        counts[:] = 0
        for e in range(first[b], last[b]):
            if moves[e]:
                _propagate(P, d, transition[e], process_noise[e], factor, A, B, T, moved)
            m = size[e]
            if m > 0:
                at = place[instrument[e]]
                sigma = 1.0
                if at >= 0:
                    sigma = scale[b, at, min(counts[at], most - 1)]
                    counts[at] += 1
                if sigma > 0.0:
                    if m == 1:
                        H, C, S, v = H1, C1, S1, v1
                    elif m == 2:
                        H, C, S, v = H2, C2, S2, v2
                    else:
                        H, C, S, v = H3, C3, S3, v3
                    for i in range(m):
                        x = innovation[e, i]
                        for r in range(n):
                            H[i, r] = jacobian[e, i, r]
                            x -= jacobian[e, i, r] * d[r]
                        v[i] = x
                    project(P, H, C, S)
                    for i in range(m):
                        for k in range(m):
                            S[i, k] += sigma * sigma * noise[e, i, k]
                    if joseph_update(P, C, S, v, correct) >= 0.0:
                        for r in range(n):
                            d[r] += correct[r]
                for r in range(n):
                    d[r] -= correction[e, r]
