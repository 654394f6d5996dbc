"""A density in the plane as masses on a lattice that moves with it: products, affine maps, diffusion, refinement.

The lattice is affine: its steps are the columns of a matrix, which an affine map of the plane multiplies. So a map
needs no interpolation. Gaussian noise is added by the discrete analogue of the Gaussian kernel, which is positive and
has exactly the variance asked for, however small it is compared with the steps. With the noise s in units of the steps
its transform at the angles k is ::

    exp(-a (1 - cos k1) - b (1 - cos k2) - c (1 - cos(k1 +- k2))),   c = |s12|, a = s11 - c, b = s22 - c

with the sign of s12. Where a or b is negative the covariance is still exact, and negative masses are left out. Masses
far below the largest one are dropped. The lattice is refined by a factor of two, with the mean kept, and a noise that
is wide beside the steps makes a new one.

Source: N. Bergman, *Recursive Bayesian Estimation: Navigation and Tracking Applications*, Linkoping Studies in Science
and Technology, Dissertations 579, 1999, chapter 5 (the point-mass filter and its adaptive mesh); T. Lindeberg,
*Scale-space for discrete signals*, IEEE Transactions on Pattern Analysis and Machine Intelligence 12(3), 1990 (the
kernel).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt
from typing import Self

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array

__all__ = ["PointMass"]

#: Masses below this part of the largest one are dropped.
_LEAST = 1e-9
#: Standard deviations that the lattice of a Gaussian covers on either side, and its steps for each of them.
_COVERED, _STEPS = 5.0, 3.0
#: Noise of more than so many steps is added on a new lattice; noise of a square below the second figure is left out.
_WIDE, _NONE = 3.0, 1e-12
#: On a new lattice the noise in each direction is at least this part of a step.
_NARROW = 0.6
#: Least variance of a density that the lattice resolves, in squares of its steps: a Gaussian has its moments to 1e-4.
_RESOLVED = 0.5


@dataclass
class PointMass:
    """Masses on a lattice.

    Attributes
    ----------
    origin : (2,) array
        Place of the first node.
    basis : (2, 2) array
        Columns: the steps from a node to the next one along the rows and along the columns.
    weight : (r, c) array
        Masses of the nodes; their sum is 1.

    Examples
    --------
    >>> density = PointMass.gaussian(np.diag([4.0, 1.0]))
    >>> density.moments()[1].round(2).tolist()
    [[4.0, 0.0], [0.0, 1.0]]
    """

    origin: Array
    basis: Array
    weight: Array

    @classmethod
    def gaussian(cls, covariance: Array) -> Self:
        """The Gaussian density with the mean zero and a (2, 2) covariance."""
        square, axes = np.linalg.eigh(covariance)
        basis = axes * np.sqrt(np.maximum(square, 1e-12)) / _STEPS
        reach = ceil(_COVERED * _STEPS)
        one = np.exp(-0.5 * (np.arange(-reach, reach + 1) / _STEPS) ** 2)
        weight = np.outer(one, one)
        return cls(-basis @ np.full(2, float(reach)), basis, weight / weight.sum())

    @property
    def active(self) -> NDArray[np.bool_]:
        """(r, c) mask of the nodes with a mass that counts."""
        return np.asarray(self.weight > 0.0)

    def places(self, index: tuple[NDArray[np.intp], ...]) -> Array:
        """(k, 2) places of k nodes, by their rows and columns."""
        return np.asarray(self.origin + np.stack(index, axis=1) @ self.basis.T)

    def moments(self) -> tuple[Array, Array]:
        """Mean (2,) and covariance (2, 2)."""
        rows, columns = self.weight.sum(axis=1), self.weight.sum(axis=0)
        i, j = np.arange(len(rows), dtype=np.float64), np.arange(len(columns), dtype=np.float64)
        mean = np.array([rows @ i, columns @ j])
        i, j = i - mean[0], j - mean[1]
        mixed = i @ self.weight @ j
        spread = np.array([[rows @ i**2, mixed], [mixed, columns @ j**2]])
        return self.origin + self.basis @ mean, self.basis @ spread @ self.basis.T

    def take(self, index: tuple[NDArray[np.intp], ...], log_factor: Array) -> float:
        """Multiply the masses of k nodes by a likelihood, and drop all others.

        Parameters
        ----------
        index : tuple of (k,) arrays
            Rows and columns of the nodes.
        log_factor : (k,) array
            Logarithm of the likelihood at each of them.

        Returns
        -------
        float
            Logarithm of the mean likelihood; where it is minus infinity nothing is changed.
        """
        most = float(log_factor.max())
        if most == -np.inf:
            return most
        weight = np.zeros_like(self.weight)
        weight[index] = self.weight[index] * np.exp(log_factor - most)
        total = float(weight.sum())
        if not total > 0.0:  # the likelihood is zero wherever there is much mass: it says nothing
            return -np.inf
        self.weight = weight / total
        self.crop()
        return most + float(np.log(total))

    def move(self, matrix: Array, offset: Array) -> None:
        """Map every place x to ``matrix x + offset``."""
        self.origin, self.basis = matrix @ self.origin + offset, matrix @ self.basis

    def shift(self, offset: Array) -> None:
        """Move every place by an offset."""
        self.origin = self.origin + offset

    def diffuse(self, covariance: Array) -> None:
        """Add Gaussian noise with a (2, 2) covariance."""
        from scipy import fft  # a quarter of a second, which each process of estimators would pay

        inverse = np.linalg.inv(self.basis)
        s = inverse @ covariance @ inverse.T
        if max(s[0, 0], s[1, 1]) > _WIDE**2:
            self._spread(covariance)
            return
        if max(s[0, 0], s[1, 1]) < _NONE:
            return
        pad = 1 + ceil(6.0 * sqrt(max(s[0, 0], s[1, 1])))
        weight = np.pad(self.weight, pad)
        self.origin = self.origin - self.basis @ np.full(2, float(pad))
        shape = tuple(fft.next_fast_len(n, real=True) for n in weight.shape)
        k1 = 2.0 * np.pi * fft.fftfreq(shape[0])[:, None]
        k2 = 2.0 * np.pi * fft.rfftfreq(shape[1])[None]
        mixed = abs(s[0, 1])
        exponent = (s[0, 0] - mixed) * (1.0 - np.cos(k1)) + (s[1, 1] - mixed) * (1.0 - np.cos(k2))
        exponent = exponent + mixed * (1.0 - np.cos(k1 + np.sign(s[0, 1]) * k2))
        spread = fft.irfft2(fft.rfft2(weight, shape) * np.exp(-exponent), shape)
        self.weight = np.asarray(spread[: weight.shape[0], : weight.shape[1]])
        self.crop()

    def _spread(self, covariance: Array) -> None:
        """Add noise that is wide beside the steps: on a new lattice along its axes, with steps of half its width.

        Across a noise that is narrow the steps stay what they were, and the noise is at least `_NARROW` of them.
        """
        square, axes = np.linalg.eigh(covariance)
        sigma = np.sqrt(np.maximum(square, 0.0))
        step = np.maximum(0.5 * sigma, np.linalg.norm(axes.T @ self.basis, axis=1))
        width = np.maximum(sigma, _NARROW * step)
        index = np.nonzero(self.active)
        place, weight = self.places(index) @ axes, self.weight[index]
        first = place.min(axis=0) - _COVERED * width
        count = np.ceil((place.max(axis=0) + _COVERED * width - first) / step).astype(int) + 1
        along, across = (
            np.exp(-0.5 * ((first[k] + step[k] * np.arange(count[k]) - place[:, k : k + 1]) / width[k]) ** 2)
            for k in range(2)
        )
        self.weight, self.origin, self.basis = along.T @ (weight[:, None] * across), axes @ first, axes * step
        self.crop()

    def crop(self) -> None:
        """Drop small masses, and the rows and columns at the edges that have none."""
        weight = np.where(self.weight > _LEAST * self.weight.max(), self.weight, 0.0)
        rows, columns = np.flatnonzero(weight.any(axis=1)), np.flatnonzero(weight.any(axis=0))
        first = np.array([rows[0], columns[0]], dtype=np.float64)
        self.origin = self.origin + self.basis @ first
        weight = weight[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        self.weight = weight / weight.sum()

    @property
    def resolved(self) -> bool:
        """Whether the steps are not much longer than the standard deviation in the direction where it is least."""
        inverse = np.linalg.inv(self.basis)
        return bool(np.linalg.eigvalsh(inverse @ self.moments()[1] @ inverse.T)[0] >= _RESOLVED)

    def refine(self) -> None:
        """Halve the steps; between the nodes the masses are interpolated linearly."""
        weight = np.pad(self.weight, 1)
        self.origin = self.origin - self.basis @ np.ones(2)
        for _ in range(2):  # rows, then columns
            fine = np.zeros((2 * weight.shape[0] - 1, weight.shape[1]))
            fine[::2] = weight
            fine[1::2] = 0.5 * (weight[:-1] + weight[1:])
            weight = fine.T
        self.weight, self.basis = weight, 0.5 * self.basis
        self.crop()
