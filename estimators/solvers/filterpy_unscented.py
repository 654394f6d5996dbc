"""filterpy's unscented filter over our ship model, through the adapter.

The motion, the measurements and the noise are `simnav.estimators.models.ship_points`; the filter is filterpy's, version
2. It is there to be compared with ``ship-ukf``, which does the same on the manifold.

Of filterpy 2.0 as it is, and worked around here or in the adapter:

- Its `CubatureKalmanFilter` takes the points from before the process noise was added into the update, so that its
  innovation covariance lacks H Q H' (a test shows it against the closed form). It is not used. The unscented filter
  draws its points again at the end of `predict`, and is right; between two measurements of one time it is made to by a
  `predict` of no time.
- Its update leaves P unsymmetric by rounding, and its Cholesky factor fails on a state without variance: P is
  symmetrised, and the root is ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import cos
from typing import Any, ClassVar

import numpy as np

from simnav.estimators.composition import Solver
from simnav.estimators.models.equations import equation_of_kind
from simnav.estimators.models.measurements import radii, wrap
from simnav.estimators.models.points import draw_points
from simnav.estimators.models.ship import OBSERVED
from simnav.estimators.models.ship_kernels import SHIP
from simnav.estimators.models.ship_points import ShipPoints
from simnav.geometry.earth import displace
from simnav.types import Array, Datasheet, Estimate, InitialState, Instruments, Measurement

from .filterpy_adapter import FilterpyEstimator

__all__ = ["FilterpyUnscentedEstimator"]

_HORIZONTAL = [SHIP.north, SHIP.east]


class FilterpyUnscentedEstimator(Solver, FilterpyEstimator):
    """filterpy's unscented Kalman filter over a ship's points.

    Parameters
    ----------
    model : ShipPoints
        The model whose states are estimated.
    alpha, beta, kappa : float
        Of the sigma points, as for `simnav.estimators.solvers.sigma_point.SigmaPointEstimator`.
    """

    pieces = ("model",)
    linearises = False
    refuses: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("adaptation", "weighting", "isolation", "iteration", "smoother"),
        "filterpy's filter works alone, to be compared with SigmaPointEstimator",
    )
    uses = OBSERVED
    observes = FilterpyEstimator.observes

    @classmethod
    def misfit(cls, keyword: str, made: type) -> str:
        """Why it cannot work with a piece of a class: its functions are those of one model."""
        if keyword == "model" and not issubclass(made, ShipPoints):
            return "filterpy's filter is given the functions of ShipPoints"
        return super().misfit(keyword, made)

    def __init__(self, model: ShipPoints, *, alpha: float = 0.5, beta: float = 2.0, kappa: float = 0.0):
        if not 0.0 < alpha < np.inf:
            raise ValueError(f"alpha is the scale of the sigma points: a number above 0, not {alpha}")
        self.alpha, self.beta, self.kappa = alpha, beta, kappa
        self.model = model

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        self.model.choose(instruments, self.label)
        # It reads compiled equations only: what is not known of lever arms and stamps has no states here.
        super().reset(start, instruments.changed(lambda s: replace(s, blocks=(), timing=None) if s.equation else s))

    def build(self, start: InitialState, instruments: Instruments) -> Any:
        """The filter at the model's initial state."""
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

        P = self.model.begin(start, instruments)
        n = self.model.size
        if not self.kappa > -n:
            raise ValueError(f"kappa is above minus the number of states, {n}, not {self.kappa}")
        points = MerweScaledSigmaPoints(n, self.alpha, self.beta, self.kappa, sqrt_method=_root)
        kf = UnscentedKalmanFilter(n, 2, 1.0, self._read, self._move, points, residual_z=self._difference)
        kf.x, kf.P = self.model.x.copy(), P
        return kf

    def predict(self, kf: Any, dt: float) -> None:
        """Advance by the model's motion and noise; with dt = 0, draw the points again."""
        self._settle(kf)
        kf.Q = np.zeros_like(kf.P)
        self.model.propagate(kf.Q, self.model.time + dt)
        kf.predict(dt=dt)

    def correct(self, kf: Any, z: Array, sheet: Datasheet) -> None:
        """Update with one measurement."""
        self._measurement = Measurement(self.model.time, sheet.name, sheet.kind, z)
        self._settle(kf)
        linearised = self.model.measure(self._measurement)
        if linearised is None:
            self._admission.skipped += 1
            return
        kf.update(z[: len(linearised.noise)], R=linearised.noise)
        kf.P = 0.5 * (kf.P + kf.P.T)

    def _settle(self, kf: Any) -> None:
        """Put the model where the filter is: its noise depends on the state."""
        self.model.x[:] = kf.x
        self.model.x[_HORIZONTAL] = 0.0
        self.model.position[:] = displace(self.origin, np.array([kf.x[SHIP.north], kf.x[SHIP.east], 0.0]))

    def _move(self, x: Array, dt: float) -> Array:
        states = x[None, :].copy()
        self.model.move(states, dt)
        # Metres at the origin's radii, as the adapter gives positions.
        latitude, _, height = self.origin.tolist()
        meridian, prime = radii(latitude)
        here = latitude + float(x[SHIP.north]) / (meridian + height)
        own_meridian, own_prime = radii(here)
        step = states[0, _HORIZONTAL] - x[_HORIZONTAL]
        step[0] *= (meridian + height) / (own_meridian + height)
        step[1] *= (prime + height) * cos(latitude) / ((own_prime + height) * cos(here))
        states[0, _HORIZONTAL] = x[_HORIZONTAL] + step
        return np.asarray(states[0])

    def _read(self, x: Array) -> Array:
        return np.asarray(self.model.read(self._measurement, x[None, :])[0])

    def _difference(self, a: Array, b: Array) -> Array:
        if equation_of_kind(self._measurement.kind).is_heading:
            return np.array([wrap(float(a[0] - b[0]))])
        return a - b

    def _estimate(self) -> Estimate:
        self._settle(self.kf)
        estimate = self.model.estimate(self.kf.P)
        estimate.time = self._time
        estimate.diagnostics = {"skipped": float(self._admission.skipped)}
        return estimate


def _root(matrix: Array) -> Array:
    """Upper Cholesky factor; of a semi-definite matrix, too."""
    n = len(matrix)
    points = np.empty((2 * n, n))
    draw_points(np.ascontiguousarray(0.5 * (matrix + matrix.T)), 1.0, points)
    return points[:n]
