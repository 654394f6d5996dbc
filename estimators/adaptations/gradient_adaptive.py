"""Gradient-adaptive weights of paper 000: residuals over their own robust scale, for motion, GNSS and DVL.

For each type of factor (an instrument, or motion) over the window (eqs. 19-21),

    ``r~ = |r| / (s + epsilon)``,  ``s = kappa median(|r|)``,  ``w = clip(a / (1 + r~^2 / c^2), w_min, 1)``,

and the information is multiplied by w (eq. 24; the print's eqs. 22 and 23 do not agree with it). The window is every
epoch that holds a measurement (eqs. 18 and 25 differ). The paper names three types; instruments other than GNSS count
as its DVL.

What is settled otherwise than printed, unless the preset is ``"paper"``:

- |r| is the whitened norm. The print's unwhitened norm of a GNSS residual is mostly that of the Down axis.
- The print calls ``1.4826 median(|r|)`` MAD and consistent. That holds for one component; of three, it is 2.28 sigma.
  Here kappa makes s consistent whatever the number of components: 1.4826, 0.849 and 0.650 for 1, 2 and 3.
- epsilon is in units of sigma. The print's 0.1 has the unit of the residual, whichever it is.
- s is never less than 1, the datasheet's noise. The residuals of a window are smaller than its noise where they fitted
  it, and a median of few means nothing: with fewer than ``fewest`` s is 1.
- A motion residual of n components counts by the mean square of its blocks of three (position, velocity, ...), which
  eq. 25 adds up, so that the same constants fit. In the print, it is the plain norm of metres, m/s and radians.

``a / (1 + r~^2 / c^2)`` is Cauchy's weight, not Geman and McClure's as the text has it; with a > 1 and the clip it is
1 up to ``r~ = c sqrt(a - 1)``. With ``w_min > 0`` the influence w r is *not* bounded, so the breakdown point of eq. 30
does not hold: a GNSS outlier of any size keeps half its information. And since the scale is estimated again at each
iteration, the cost need not fall (eq. 28). A fault that fills the window becomes the scale, and is not suppressed.

Source: M. Guo et al. 2026 (paper 000), section 3.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimators.adaptations.weighting import Factors, Weighting
from simnav.types import Array, Instruments

__all__ = ["GradientAdaptive", "Shape", "medians"]

#: a, c and w_min of eq. 21.
Shape = tuple[float, float, float]

#: Medians of the chi distribution of 1 to 3 degrees of freedom: the inverses of the consistent kappa.
_CHI_MEDIAN = np.array([1.0, 0.674490, 1.177410, 1.538172])


def medians(values: Array, group: NDArray[np.intp], groups: int) -> Array:
    """Median of the values of each group; 0 where it has none.

    Parameters
    ----------
    values : (M,) array
    group : (M,) array of int
        Of each value, below ``groups``.
    groups : int

    Examples
    --------
    >>> medians(np.array([3.0, 1.0, 2.0, 5.0, 8.0]), np.array([0, 0, 0, 2, 2]), 3)
    array([2. , 0. , 6.5])
    """
    counts = np.bincount(group, minlength=groups)
    ends = counts.cumsum()
    begins = ends - counts
    ordered = np.append(values[np.lexsort((values, group))], 0.0)
    middle: Array = 0.5 * (ordered[begins + (counts - 1) // 2] + ordered[begins + counts // 2])
    middle[counts == 0] = 0.0
    return middle


class GradientAdaptive(Weighting):
    """The weighting of the module.

    Parameters
    ----------
    preset : "default" or "paper"
        Whether the norms and scales are as printed.
    gnss, motion, other : (a, c, w_min)
        Of eq. 21, for GNSS, the IMU, and the DVL with all other instruments.
    epsilon : float
        Of eq. 19; in sigma, or with the preset "paper" in the residual's unit.
    fewest : int
        With fewer residuals of a type its scale is the nominal one.
    """

    def __init__(
        self,
        preset: Literal["default", "paper"] = "default",
        gnss: Shape = (3.0, 1.5, 0.5),
        motion: Shape = (2.0, 1.0, 0.3),
        other: Shape = (2.0, 1.0, 0.3),
        epsilon: float = 0.1,
        fewest: int = 5,
    ):
        if preset not in ("default", "paper"):
            raise ValueError(f"preset = {preset!r}: it must be 'default' or 'paper'")
        for name, shape in (("gnss", gnss), ("motion", motion), ("other", other)):
            if len(shape) != 3 or not (shape[0] > 0.0 and shape[1] > 0.0 and 0.0 <= shape[2] <= 1.0):
                raise ValueError(f"{name} = {shape}: it must be a > 0, c > 0 and w_min in [0, 1]")
        if not epsilon > 0.0:
            raise ValueError(f"epsilon = {epsilon:g}: it must be above 0")
        self.preset, self.epsilon, self.fewest = preset, epsilon, fewest
        self._gnss, self._motion, self._other = gnss, motion, other

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self._kinds = {name: sheet.kind for name, sheet in instruments.items()}
        self._names: tuple[str, ...] = ()
        self._scales = np.ones(0)
        self._motion_scale = 1.0

    def weigh(self, factors: Factors) -> bool:
        """Set the weights of the measurements and of motion."""
        if factors.names != self._names:
            self._arrange(factors.names)
        group = factors.instrument
        paper = self.preset == "paper"
        norm = _rows(factors.residual) if paper else factors.norm
        if paper:
            self._scales = 1.4826 * medians(norm, group, len(self._names))
        else:
            consistent = norm / _CHI_MEDIAN[factors.components]
            self._scales = np.maximum(medians(consistent, group, len(self._names)), 1.0)
            if len(norm) < self.fewest * len(self._names):
                self._scales[np.bincount(group, minlength=len(self._names)) < self.fewest] = 1.0
        # r~^2 / c^2, then a / (1 + r~^2 / c^2)
        ratio = norm / (self._c * (self._scales + self.epsilon))[group]
        ratio *= ratio
        ratio += 1.0
        np.minimum(np.maximum(self._a[group] / ratio, self._least[group]), 1.0, out=factors.weight)
        self._weigh_motion(factors)
        return True

    def _weigh_motion(self, factors: Factors) -> None:
        count, size = factors.motion_residual.shape
        if count == 0:
            return
        a, c, least = self._motion
        if self.preset == "paper":
            norm = _rows(factors.motion_residual[:, :9])
            self._motion_scale = 1.4826 * _median(norm)
        else:
            norm = factors.motion_norm * (3.0 / size) ** 0.5
            # The mean square of n/3 blocks is near 3 for residuals as large as the noise.
            self._motion_scale = max(_median(norm) / 3.0**0.5, 1.0) if count >= self.fewest else 1.0
        ratio = norm / (c * (self._motion_scale + self.epsilon))
        np.minimum(np.maximum(a / (1.0 + ratio * ratio), least), 1.0, out=factors.motion_weight)

    def _arrange(self, names: tuple[str, ...]) -> None:
        """Spread the constants over the instruments."""
        self._names = names
        gnss = ("gnss_position", "gnss_velocity")
        shapes = [self._gnss if self._kinds[n] in gnss else self._other for n in names]
        self._a, self._c, self._least = np.array(shapes, dtype=np.float64).reshape(-1, 3).T.copy()

    def diagnostics(self) -> dict[str, float | Array]:
        """``scale.<instrument>`` and ``scale.motion``: s, in sigma or as the preset has it."""
        scales: dict[str, float | Array] = {f"scale.{n}": s for n, s in zip(self._names, self._scales.tolist())}
        scales["scale.motion"] = self._motion_scale
        return scales


def _rows(matrix: Array) -> Array:
    """Euclidean norm of each row."""
    norm: Array = np.sqrt(np.einsum("ij,ij->i", matrix, matrix))
    return norm


def _median(values: Array) -> float:
    ordered = np.sort(values)
    n = len(ordered)
    return 0.5 * float(ordered[(n - 1) // 2] + ordered[n // 2])
