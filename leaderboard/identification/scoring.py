"""Maximum likelihood of the innovations by Fisher's scoring.

With the innovations v, their covariances S and derivatives by the parameters i and j, slope and information of the
logarithm of the likelihood are ::

    g_i = sum( -v' W v_i + 1/2 v' W S_i W v - 1/2 tr(W S_i) ),   W = S^-1
    I_ij = sum( v_i' W v_j + 1/2 tr(W S_i W S_j) )

(N. K. Gupta and R. K. Mehra, "Computational aspects of maximum likelihood estimation and reduction in sensitivity
function calculations", IEEE TAC 19(6), 1974). The derivatives are differences between runs of the filter, one run a
parameter. A parameter has a wide normal prior, so that one about which the log says nothing stays where it is. The
step is damped as by Levenberg and Marquardt. The inverse of the information is the covariance of the estimates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simnav.types import Array

from .assumption import Assumption, Parameter, with_all
from .innovations import Innovations, Likelihood, common

__all__ = ["Maximum", "log_likelihood", "maximise"]

#: The largest step of a parameter at once: of the logarithm of a size, and in spreads.
_STEP = 1.5
#: Runs of scoring at most; it ends when a step promises less than this.
_LIMIT, _SETTLED = 12, 0.01
#: Damping at most.
_HARDEST = 1e6


@dataclass(frozen=True, eq=False)
class Maximum:
    """A maximum of the likelihood.

    Attributes
    ----------
    parameters : tuple of Parameter
        What was fitted.
    x : (p,) array
        Their numbers (`Parameter.value`).
    covariance : (p, p) array
        Of these.
    log_likelihood : float
        At the maximum, without the prior.
    assumed : Assumption
        At the maximum.
    """

    parameters: tuple[Parameter, ...]
    x: Array
    covariance: Array
    log_likelihood: float
    assumed: Assumption


def log_likelihood(found: Innovations) -> float:
    """The logarithm of the likelihood; minus infinity if it is no number."""
    total = sum(stream.log_likelihood for stream in found.values())
    return total if np.isfinite(total) else -np.inf


def maximise(
    likelihood: Likelihood, assumed: Assumption, parameters: Sequence[Parameter], limit: int = _LIMIT
) -> Maximum:
    """Fit parameters; they begin at their first values.

    Parameters
    ----------
    likelihood : Likelihood
        That of the recording.
    assumed : Assumption
        All that is not fitted.
    parameters : sequence of Parameter
        What is fitted.
    limit : int
        Steps at most.
    """
    x, weight = np.zeros(len(parameters)), np.array([p.spread**-2.0 for p in parameters])
    largest = np.array([_STEP if p.size else _STEP * p.spread for p in parameters])
    found = likelihood.innovations(with_all(assumed, parameters, x))
    value, damping = log_likelihood(found), 1e-3
    slope, information = _slope(likelihood, assumed, parameters, x, found)
    for _ in range(limit):
        gradient, curvature = slope - weight * x, information + np.diag(weight)
        if not np.isfinite(gradient).all() or float(gradient @ np.linalg.solve(curvature, gradient)) < 2.0 * _SETTLED:
            break
        moved = False
        while damping < _HARDEST:
            step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), gradient)
            step /= max(1.0, float(np.max(np.abs(step) / largest)))
            other = likelihood.innovations(with_all(assumed, parameters, x + step))
            gain = log_likelihood(other) - value - 0.5 * float(weight @ ((x + step) ** 2 - x**2))
            if gain > 0.0:
                x, found, value, damping, moved = x + step, other, log_likelihood(other), max(0.1 * damping, 1e-6), True
                break
            damping = max(10.0 * damping, 1e-2)
        if not moved:
            break
        slope, information = _slope(likelihood, assumed, parameters, x, found)
    covariance: Array = np.asarray(np.linalg.inv(information + np.diag(weight)), dtype=np.float64)
    return Maximum(tuple(parameters), x, covariance, value, with_all(assumed, parameters, x))


def _slope(
    likelihood: Likelihood, assumed: Assumption, parameters: Sequence[Parameter], x: Array, found: Innovations
) -> tuple[Array, Array]:
    """(p,) slope and (p, p) information of the logarithm of the likelihood."""
    count = len(parameters)
    slope, information = np.zeros(count), np.zeros((count, count))
    sides = [
        [found if not h else likelihood.innovations(with_all(assumed, parameters, x + h * unit)) for h in p.steps]
        for p, unit in zip(parameters, np.eye(count), strict=True)
    ]
    for name, stream in found.items():
        v, s, w = stream.value, stream.covariance, stream.inverse
        by_value, by_spread = np.zeros((count, *v.shape)), np.zeros((count, *s.shape))
        for i, parameter in enumerate(parameters):
            for side, h in zip(sides[i], parameter.steps, strict=True):
                if name in side and side[name] is not stream:
                    here, there = common(stream, side[name])
                    share = np.sign(h) / (parameter.steps[1] - parameter.steps[0])
                    by_value[i, here] += share * (side[name].value[there] - v[here])
                    by_spread[i, here] += share * (side[name].covariance[there] - s[here])
        weighted = np.einsum("nij,nj->ni", w, v)
        relative = np.einsum("nij,pnjk->pnik", w, by_spread)
        slope += -np.einsum("ni,pni->p", weighted, by_value)
        slope += 0.5 * np.einsum("ni,pnij,nj->p", weighted, by_spread, weighted)
        slope -= 0.5 * np.einsum("pnii->p", relative)
        information += np.einsum("pni,nij->pnj", by_value, w).reshape(count, -1) @ by_value.reshape(count, -1).T
        turned = np.swapaxes(relative, 2, 3).reshape(count, -1)
        information += 0.5 * relative.reshape(count, -1) @ turned.T
    return slope, information
