"""Hybrid learning of a Sugeno network: least squares for the consequents, gradient descent for the premises.

J.-S. R. Jang 1993, section III (hybrid learning rule, off-line) and section III-C (step size). Each pass over the data
goes forward, where with the premises held the output is linear in the consequents and these are found by least squares,
and backward, where with the consequents held the premises go one step down the gradient of the squared error. Ours are
the ridge for rules that the data do not reach, and early stopping on data that were not trained on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from simnav.estimators.adaptations.sugeno import Sugeno
from simnav.types import Array

__all__ = ["Learned", "StepSize", "fit_consequents", "learn", "premise_gradient", "rmse"]

#: Where the smallest eigenvalue of the normal equations is below this part of the largest, they are ridged by it.
RIDGE = 1e-6
#: Memberships stay at least this wide, in units of the inputs, which are scaled to [0, 1].
NARROWEST = 0.02
#: A pass counts as better where it lowers the validation error by this part.
GAIN = 1e-5
#: Rows of the least-squares problem at a time: they stay in the cache.
_BLOCK = 512


def rmse(network: Sugeno, x: Array, y: Array) -> float:
    """Root mean squared error of a network over (k, n) inputs and (k,) outputs."""
    return float(np.sqrt(np.mean((network(x) - y) ** 2)))


def fit_consequents(network: Sugeno, x: Array, y: Array, ridge: float = RIDGE) -> Sugeno:
    """Forward pass: the consequents of least squared error, the premises held.

    Rules that the data hardly reach leave the normal equations rank deficient; then ``ridge`` times the largest
    eigenvalue is added to all of them, which draws what is not determined to zero.

    Parameters
    ----------
    network : Sugeno
        The network whose rules are fitted.
    x : (k, n) array
        Inputs of k samples, scaled to [0, 1].
    y : (k,) array
        Target outputs of the k samples.
    ridge : float
        Regularisation, as a fraction of the largest eigenvalue.
    """
    shape = network.consequents.shape
    size = shape[0] * shape[1]
    normal, right = np.zeros((size, size)), np.zeros(size)
    for k in range(0, len(x), _BLOCK):
        some = x[k : k + _BLOCK]
        extended = np.column_stack([some, np.ones(len(some))])
        rows = (network.weights(some)[:, :, None] * extended[:, None, :]).reshape(len(some), size)
        normal += rows.T @ rows
        right += rows.T @ y[k : k + _BLOCK]
    values, axes = np.linalg.eigh(normal)
    if values[0] < ridge * values[-1]:
        values = np.maximum(values, 0.0) + ridge * values[-1]
    return replace(network, consequents=(axes @ ((axes.T @ right) / values)).reshape(shape))


def premise_gradient(network: Sugeno, x: Array, y: Array) -> tuple[Array, Array]:
    """Backward pass: gradient of the mean squared error in centres and widths, the consequents held.

    With normalised strengths w, consequents f_r and output f, ``df/d(log strength of r) = w_r (f_r - f)``.

    Returns
    -------
    (n, m) array, (n, m) array
        Derivatives with respect to the centres and to the widths of the memberships.
    """
    weights, rules = network.weights(x), network.rules(x)
    output = np.einsum("kr,kr->k", weights, rules)
    share = weights * (rules - output[:, None]) * (2.0 / len(x) * (output - y))[:, None]
    n, m = network.centres.shape
    by_membership = (share @ network.antecedents.reshape(-1, n * m)).reshape(-1, n, m)
    off = (x[:, :, None] - network.centres) / network.widths
    centres = np.sum(by_membership * off, axis=0) / network.widths
    widths = np.sum(by_membership * off**2, axis=0) / network.widths
    return centres, widths


class StepSize:
    """Length of a step along the gradient, after Jang 1993, section III-C.

    Up by a tenth after four falls of the error running; down by a tenth after two rises, each followed by a fall.

    Parameters
    ----------
    length : float
        Of the first step, in the space of the premises.
    """

    def __init__(self, length: float = 0.01):
        self.length = length
        self._errors: list[float] = []

    def see(self, error: float) -> float:
        """Take the error of a pass; return the length of the step that follows."""
        self._errors = [*self._errors[-4:], error]
        if len(self._errors) == 5:
            falls = [after < before for before, after in zip(self._errors, self._errors[1:])]
            if all(falls) or falls == [False, True, False, True]:
                self.length *= 1.1 if all(falls) else 0.9
                self._errors = self._errors[-1:]
        return self.length


@dataclass(frozen=True, eq=False)
class Learned:
    """What `learn` returns.

    Attributes
    ----------
    network : Sugeno
        That of the best pass by the validation error.
    initial : Sugeno
        Before the first backward pass: the grid, with consequents fitted.
    training, validation : list of float
        Root mean squared error of each pass.
    best : int
        Index of the best pass.
    """

    network: Sugeno
    initial: Sugeno
    training: list[float] = field(default_factory=list)
    validation: list[float] = field(default_factory=list)
    best: int = 0


def learn(
    network: Sugeno,
    data: tuple[Array, Array],
    validation: tuple[Array, Array],
    passes: int = 200,
    step: float = 0.01,
    patience: int = 20,
    progress: Callable[[int, float, float], None] | None = None,
) -> Learned:
    """Learn by the hybrid rule; there is nothing random in it.

    Parameters
    ----------
    network : Sugeno
        Its premises are where learning begins.
    data, validation : ((k, n) array, (k,) array)
        Inputs, scaled to [0, 1], and outputs.
    passes : int
        At most so many.
    step : float
        Length of the first step of the premises.
    patience : int
        It ends after so many passes without a better validation error.
    progress : callable, optional
        Called after each pass with its number, training and validation error.

    Raises
    ------
    ValueError
        If there are no data, or they are not finite.
    """
    for name, (x, y) in (("training", data), ("validation", validation)):
        if len(x) == 0 or len(x) != len(y) or not (np.isfinite(x).all() and np.isfinite(y).all()):
            raise ValueError(f"the {name} data should be finite inputs and outputs, as many of one as of the other")
    network = fit_consequents(network, *data)
    best = initial = network
    size = StepSize(step)
    errors: list[float] = []
    checks: list[float] = []
    at, lowest = 0, np.inf
    for k in range(passes):
        errors.append(rmse(network, *data))
        checks.append(rmse(network, *validation))
        if progress is not None:
            progress(k, errors[-1], checks[-1])
        if checks[-1] < lowest * (1.0 - GAIN):
            best, at, lowest = network, k, checks[-1]
        if k - at >= patience:
            break
        length = size.see(errors[-1])
        centres, widths = premise_gradient(network, *data)
        norm = float(np.sqrt(np.sum(centres**2) + np.sum(widths**2)))
        if norm == 0.0:
            break
        network = replace(
            network,
            centres=network.centres - length / norm * centres,
            widths=np.maximum(network.widths - length / norm * widths, NARROWEST),
        )
        network = fit_consequents(network, *data)
    return Learned(best, initial, errors, checks, at)
