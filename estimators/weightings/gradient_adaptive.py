"""Gradient-adaptive weights of Guo et al. (2026): residuals divided by a robust scale, for motion, GNSS and DVL.

For each type of factor (an instrument, or motion) over the window (eqs. 19-21),

    ``r~ = |r| / (s + epsilon)``,  ``s = kappa median(|r|)``,  ``w = clip(a / (1 + r~^2 / c^2), w_min, 1)``,

with the residual r, its scale s and the constants epsilon, a, c and w_min. The information is multiplied by w (eq. 24;
eqs. 22 and 23 contradict it). The window consists of all epochs with a measurement (eqs. 18 and 25 differ). The paper
names three types; here, instruments other than GNSS have the constants of its DVL. The channels of an instrument are of
one type.

Deviations from the print, unless the preset is ``"paper"``:

- |r| is the whitened norm. The printed, unwhitened norm of a GNSS residual is mostly that of the Down axis.
- The paper calls ``1.4826 median(|r|)`` the MAD, and consistent. This holds for one component; for three it is 2.28
  sigma. Here kappa makes s consistent: 1.4826, 0.849 and 0.650 for 1, 2 and 3 components.
- c of the DVL is 2. In units of the consistent scale the printed value of 1 costs 15 % of the efficiency on Gaussian
  noise; in the printed units of 2.28 sigma it does not.
- epsilon is in units of sigma. The printed 0.1 has the unit of the residual.
- s is at least 1, the datasheet's noise. The residuals of a window are smaller than the noise of the measurements that
  it was fitted to, and a median of few values is not reliable: with fewer than ``fewest`` residuals s is 1.
- For a motion residual the mean square of its blocks of three components (position, velocity, ...) is used, so that the
  same constants fit. The print uses the plain norm of metres, m/s and radians.

``a / (1 + r~^2 / c^2)`` is Cauchy's weight, not Geman and McClure's as the text has it; with a > 1 and the clip it is
1 up to ``r~ = c sqrt(a - 1)``. With ``w_min > 0`` the influence w r is *not* bounded, so the breakdown point of eq. 30
does not hold: a GNSS outlier of any size keeps half of its information. The scale is estimated again at each iteration,
so the cost does not always fall (eq. 28). A fault that fills the window determines the scale and is not suppressed.

Source: M. Guo et al. 2026, doi:10.20944/preprints202601.1976.v1, section 3.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.models.channels import instrument_of, owners
from simnav.estimators.models.inertial_errors import PART
from simnav.kernel_types import IntegerVector, Matrix, Vector
from simnav.kinds import POSITION, VELOCITY
from simnav.types import Array, Instruments

from .base import Factors, Weighting

__all__ = ["GradientAdaptive", "Shape", "medians"]

#: a, c and w_min of eq. 21.
Shape = tuple[float, float, float]

#: Medians of the chi distribution of 1 to 3 degrees of freedom: the inverses of the consistent kappa.
_CHI_MEDIAN = np.array([1.0, 0.674490, 1.177410, 1.538172])


@helper
def medians(values: Vector, group: IntegerVector, fewest: int, out: Vector) -> None:
    """Medians of groups.

    Parameters
    ----------
    values : (M,) array
        Values of all groups.
    group : (M,) array of int
        Number of the group of each value, below G.
    fewest : int
        Smallest number of values, at least 1; a group with fewer values has the median 1.
    out : (G,) array
        Overwritten with the medians.
    """
    members = np.empty(values.size)
    for g in range(out.size):
        count = 0
        for i in range(values.size):
            if group[i] == g:
                members[count] = values[i]
                count += 1
        if count < fewest:
            out[g] = 1.0
        else:
            ordered = np.sort(members[:count])
            out[g] = 0.5 * (ordered[(count - 1) // 2] + ordered[count // 2])


@kernel
def _adapt(
    norm: Vector,
    kappa: Vector,
    kind: IntegerVector,
    group: IntegerVector,
    shapes: Matrix,
    settings: tuple[float, float, int],
    scales: Vector,
    weight: Vector,
) -> None:
    """Compute the scales of the groups and the weights of their members (eqs. 19-21).

    ``kappa`` holds the constant of each norm's type. ``settings`` are epsilon, the smallest scale, and the smallest
    number of members for which a group has a scale of its own.
    """
    epsilon, floor, fewest = settings
    scaled = np.empty(norm.size)
    for i in range(norm.size):
        scaled[i] = kappa[kind[i]] * norm[i]
    medians(scaled, group, fewest, scales)
    for g in range(scales.size):
        scales[g] = max(scales[g], floor)
    for i in range(norm.size):
        a, c, least = shapes[group[i], 0], shapes[group[i], 1], shapes[group[i], 2]
        ratio = norm[i] / (c * (scales[group[i]] + epsilon))
        weight[i] = min(max(a / (1.0 + ratio * ratio), least), 1.0)


class GradientAdaptive(Weighting):
    """Gradient-adaptive weights (see the module).

    Parameters
    ----------
    preset : "default" or "paper"
        "paper": norms and scales as printed.
    gnss, motion, other : (a, c, w_min)
        Constants of eq. 21 for GNSS, for the IMU, and for the DVL and all other instruments. ``other=None`` means
        ``(2, 2, 0.3)``, or ``(2, 1, 0.3)`` with the preset "paper".
    epsilon : float
        Constant of eq. 19 [sigma]; with the preset "paper" in the unit of the residual.
    fewest : int
        Smallest number of residuals of a type; with fewer its scale is the nominal one.
    """

    def __init__(
        self,
        preset: Literal["default", "paper"] = "default",
        gnss: Shape = (3.0, 1.5, 0.5),
        motion: Shape = (2.0, 1.0, 0.3),
        other: Shape | None = None,
        epsilon: float = 0.1,
        fewest: int = 5,
    ):
        if preset not in ("default", "paper"):
            raise ValueError(f"preset = {preset!r}: it must be 'default' or 'paper'")
        other = other or (2.0, 1.0 if preset == "paper" else 2.0, 0.3)
        for name, shape in (("gnss", gnss), ("motion", motion), ("other", other)):
            if len(shape) != 3 or not (shape[0] > 0.0 and shape[1] > 0.0 and 0.0 <= shape[2] <= 1.0):
                raise ValueError(f"{name} = {shape}: it must be a > 0, c > 0 and w_min in [0, 1]")
        if not epsilon > 0.0:
            raise ValueError(f"epsilon = {epsilon:g}: it must be above 0")
        self.preset, self.epsilon, self.fewest = preset, epsilon, fewest
        self._gnss, self._motion, self._other = gnss, motion, other

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self._owners = owners(instruments)
        self._receivers = {instrument_of(sheet) for sheet in instruments.of_equation(POSITION, VELOCITY)}
        self._names: tuple[str, ...] = ()
        self._types: list[str] = []
        self._scales = np.ones(1)
        paper = self.preset == "paper"
        self._kappa = np.full(4, 1.4826) if paper else 1.0 / _CHI_MEDIAN
        self._kappa_motion = np.array([1.4826 if paper else 3.0**-0.5])
        self._floor, self._least = (0.0, 1) if paper else (1.0, self.fewest)

    def weigh(self, factors: Factors) -> bool:
        """Set the weights of the measurements and of motion."""
        if factors.names != self._names:
            self._names = factors.names
            types = [self._owners.get(name, name) for name in factors.names]
            self._types = list(dict.fromkeys(types))
            self._type = np.array([self._types.index(name) for name in types], dtype=np.int64)
            shapes = [self._gnss if n in self._receivers else self._other for n in self._types]
            self._shapes = np.array([*shapes, self._motion], dtype=np.float64)
            self._scales = np.ones(len(self._shapes))
        if self.preset == "paper":
            norm, motion = _rows(factors.residual), _rows(factors.motion_residual[:, PART.navigation])
        else:
            norm, motion = factors.norm, factors.motion_norm * (3.0 / factors.motion_residual.shape[1]) ** 0.5
        constants, scales, zero = self._shapes, self._scales, np.zeros(len(motion), np.int64)
        settings = self.epsilon, self._floor, self._least
        of_type = self._type[factors.instrument] if self._owners else factors.instrument
        _adapt.unchecked(
            norm, self._kappa, factors.components, of_type, constants[:-1], settings, scales[:-1], factors.weight,
        )  # fmt: skip
        _adapt.unchecked(
            motion, self._kappa_motion, zero, zero, constants[-1:], settings, scales[-1:], factors.motion_weight
        )
        return True

    def diagnostics(self) -> dict[str, float | Array]:
        """``scale.<instrument>`` and ``scale.motion``: s, in sigma or as the preset has it."""
        return {f"scale.{name}": s for name, s in zip((*self._types, "motion"), self._scales.tolist())}


def _rows(matrix: Array) -> Array:
    """Euclidean norm of each row."""
    norm: Array = np.sqrt(np.einsum("ij,ij->i", matrix, matrix))
    return norm
