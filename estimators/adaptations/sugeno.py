"""A first-order Sugeno network of five layers (ANFIS): Gaussian memberships on a grid, linear consequents.

The layers of J.-S. R. Jang, "ANFIS: adaptive-network-based fuzzy inference system", IEEE Trans. Systems, Man and
Cybernetics 23(3), 1993, section III:

1. grades of membership ``exp(-((x - c) / s)^2 / 2)`` of each input (Jang's bell is another function of the same use);
2. strength of a rule: the product of the grades of its antecedents, one membership of each input;
3. strengths divided by their sum;
4. each rule's consequent ``p' x + r``, weighted by that;
5. the sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import exp
from operator import mul

import numpy as np

from simnav.types import Array

__all__ = ["Sugeno"]


@dataclass(frozen=True, eq=False)
class Sugeno:
    """The network; n inputs with m memberships each make ``m**n`` rules.

    Rule ``r`` has the memberships ``unravel_index(r, (m,) * n)`` as antecedents: the last input changes fastest.

    Attributes
    ----------
    centres, widths : (n, m) array
        Centres c and widths s of the Gaussian memberships, in the inputs' units: the premise parameters.
    consequents : (m**n, n + 1) array
        Slopes p and constant r of each rule.
    """

    centres: Array
    widths: Array
    consequents: Array

    @classmethod
    def grid(cls, inputs: int, memberships: int = 3) -> Sugeno:
        """A network with memberships evenly over [0, 1], which cross at one half (Jang 1993, section IV); output 0."""
        centres = np.tile(np.linspace(0.0, 1.0, memberships), (inputs, 1))
        half = 0.5 / (memberships - 1)
        widths = np.full_like(centres, half / np.sqrt(2.0 * np.log(2.0)))
        return cls(centres, widths, np.zeros((memberships**inputs, inputs + 1)))

    @property
    def antecedents(self) -> Array:
        """(m**n, n, m) array: one where a rule uses a membership of an input, zero elsewhere."""
        n, m = self.centres.shape
        used: Array = np.eye(m)[np.indices((m,) * n).reshape(n, -1).T]
        return used

    def grades(self, x: Array) -> Array:
        """Layer 1: (k, n, m) grades of membership of (k, n) inputs."""
        graded: Array = np.exp(-0.5 * ((x[:, :, None] - self.centres) / self.widths) ** 2)
        return graded

    def weights(self, x: Array) -> Array:
        """Layers 2 and 3: (k, m**n) normalised strengths of (k, n) inputs.

        The sum over all rules of products is the product of the sums, so the grades of each input can be normalised
        separately. They are divided by the largest first, so that an input far from all memberships belongs to the
        nearest.
        """
        logs = -0.5 * ((x[:, :, None] - self.centres) / self.widths) ** 2
        shares = np.exp(logs - logs.max(axis=2, keepdims=True))
        shares /= shares.sum(axis=2, keepdims=True)
        strength: Array = shares[:, 0]
        for i in range(1, shares.shape[1]):
            strength = (strength[:, :, None] * shares[:, i, None, :]).reshape(len(x), -1)
        return strength

    def rules(self, x: Array) -> Array:
        """(k, m**n) consequents of (k, n) inputs."""
        values: Array = x @ self.consequents[:, :-1].T + self.consequents[:, -1]
        return values

    def __call__(self, x: Array) -> Array:
        """Layers 4 and 5: (k,) outputs of (k, n) inputs."""
        output: Array = np.einsum("kr,kr->k", self.weights(x), self.rules(x))
        return output

    def single(self, x: list[float]) -> float:
        """The output for one input, computed mostly with Python floats, which are faster for few numbers."""
        values: list[float] = (self.consequents @ [*x, 1.0]).tolist()
        for value, memberships in zip(reversed(x), reversed(self._premises)):
            logs = [((value - centre) / width) ** 2 for centre, width in memberships]
            nearest = min(logs)
            shares = [exp(0.5 * (nearest - log)) for log in logs]
            total, m = sum(shares), len(shares)
            values = [sum(map(mul, values[k : k + m], shares)) / total for k in range(0, len(values), m)]
        return values[0]

    @cached_property
    def _premises(self) -> list[list[list[float]]]:
        """Centre and width of each membership of each input."""
        listed: list[list[list[float]]] = np.stack([self.centres, self.widths], axis=2).tolist()
        return listed
