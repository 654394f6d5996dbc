"""A point-mass filter over the horizontal position beside an error-state Kalman filter: navigation by the bottom.

The density of the horizontal position is kept as masses on a lattice (`simnav.estimators.algebra.point_mass`), because
a sounding may fit several places. All other states, and the motion, are linear given the position: their density is
Gaussian, with a mean that is linear in the position, and one covariance. So the filter is Rao-Blackwellised, with the
conditional mean kept by regression. Instruments other than soundings are used by the Kalman filter as it is.

Let x be the horizontal error at the last sounding, whose density is the lattice, and x' that of now. The Kalman filter
carries x along as a clone: with its mean m, covariance M and cross covariance C with the present error, of covariance
P', the instruments since then have multiplied the density of x by ``N(x; m, M) / N(x; 0, M0)``, and ::

    x' = F (x - m) + w,    F = C' M^-1,    w ~ N(0, P' - F M F')

With the regression B of all errors on x', the covariance G given x', and a sounding y of the bottom that is predicted
as h(x') at a node, its likelihood is that of ::

    rho = y - h(x') - H B x',    S = R + H G H' + (steps of the lattice times the slope)^2 / 4

H is the Jacobian by the states other than the horizontal position. The last term is what the depth varies by within a
cell, so a coarse lattice uses a sounding with less weight, and the lattice is refined while this term is large and the
number of nodes allows. The moments of the masses and of rho then give the mean and the covariance of all states. If the
density is Gaussian and the bottom a plane, this is the Kalman filter.

A reading that fits nowhere has a likelihood of its own (``outliers``): then it changes nothing.

Source: N. Bergman, L. Ljung and F. Gustafsson, *Terrain navigation using Bayesian statistics*, IEEE Control Systems
Magazine 19(3), 1999, of the point-mass filter; J. Dunik, M. Sotak, M. Vesely, O. Straka and W. Hawkinson, *Design of
Rao-Blackwellized point-mass filter with application in terrain aided navigation*, IEEE Transactions on Aerospace and
Electronic Systems 55(1), 2019, of the linear states.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from simnav.estimator import UnsuitableScenario, lacking
from simnav.estimator.needs import Needs
from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.algebra.point_mass import PointMass
from simnav.estimators.models.base import Linearised
from simnav.estimators.models.channels import whole
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.measurement_functions import MeasurementFunction
from simnav.estimators.models.propagation import Samples
from simnav.geometry.earth import displace
from simnav.kinds import KINDS, NavigationPoints
from simnav.types import Array, InitialState, Instruments, Measurement

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["TerrainPointMass"]

#: The kinds of instruments of which it needs one.
_SOUNDERS = ("altimeter", "multibeam_profile")
#: The horizontal position among the states.
_AT = slice(0, 2)
#: The lattice is refined while its steps add more than this part of the variance of a sounding.
_COARSE = 0.1
#: A sounding that is an outlier with more than this probability does not change the other states.
_DOUBTFUL = 0.5


class TerrainPointMass(KalmanEstimator):
    """The filter of the module.

    Parameters
    ----------
    model : InertialModel
        States, dynamics and measurement equations.
    nodes : int
        Largest number of nodes of the lattice.
    outliers : float
        Probability that a sounding is not of the bottom.
    """

    pieces: ClassVar[tuple[str, ...]] = ("model",)
    slow = True

    def __init__(self, model: InertialModel, nodes: int = 20000, outliers: float = 1e-3):
        super().__init__(model)
        if nodes < 100:
            raise ValueError(f"nodes = {nodes}: should be 100 or more")
        if not 0.0 <= outliers < 1.0:
            raise ValueError(f"outliers = {outliers:g}: should be 0 or more, and below 1")
        self.nodes, self.outliers = nodes, outliers

    @property
    def needs(self) -> Needs:
        """An IMU, and an instrument that measures the distance to the bottom."""
        return (*super().needs, _SOUNDERS)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        if lack := lacking((_SOUNDERS,), instruments):
            raise UnsuitableScenario(f"{self.label}: {lack}")
        super().reset(start, instruments)
        self._density: PointMass | None = None
        self._sheets = {name: whole(own.sheet) for name, own in self.model.own.items()}
        self._sheets = {name: sheet for name, sheet in self._sheets.items() if "bottom" in sheet.details}

    def functions(self) -> FilterFunctions:
        """Soundings are used by the lattice, and the clone of the position goes with every correction."""
        functions = super().functions()
        return functions.replaced(
            propagate=self.propagate, predict=self.predict, correct=self.correct, retract=self.retract
        )

    # --- the clone of the horizontal position, from one sounding to the next

    def _begin_clone(self) -> None:
        """The clone is the present position."""
        P = self.covariance
        self._cross = P[:, _AT].copy()
        self._first = P[_AT, _AT].copy()
        self._clone, self._mean = self._first.copy(), np.zeros(2)

    def propagate(self, dynamics: Dynamics, samples: Samples, until: float) -> None:
        """Advance the state, and the covariance with the clone."""
        begin = self.model.time
        super().propagate(dynamics, samples, until)
        if self._density is not None and until > begin:
            self.model.carry(self._cross, until - begin)

    def correct(self, dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
        """Correct by a measurement and take the clone along; a sounding moves the lattice."""
        m, linearised = self._measurements[k], self._linearised
        assert linearised is not None
        if m.instrument in self._sheets:
            self._sounded = True
            self._catch_up()
            nis, readings.size[k] = self._sound(m, linearised)
            self._begin_clone()
            return nis
        self._sounded = False
        residual, cross, predicted, noise = (
            prediction.innovation, prediction.cross, prediction.predicted, prediction.noise,
        )  # fmt: skip
        projected, innovation = cross.copy(), predicted + noise
        nis = super().correct(dynamics, choice, readings, k, prediction)
        if nis >= 0.0 and self._density is not None:
            gain = np.linalg.solve(innovation, linearised.jacobian @ self._cross).T
            self._mean += gain @ residual
            self._clone -= gain @ innovation @ gain.T
            self._cross -= projected @ gain.T
        return nis

    def retract(self, dynamics: Dynamics) -> None:
        """Add the correction to the state; that of a sounding is added already."""
        if not self._sounded:
            self.model.correct(dynamics.correction)

    def _catch_up(self) -> None:
        """Bring the density of the position to the present time."""
        present = self.covariance[_AT, _AT]
        if self._density is None:
            self._density = PointMass.gaussian(present)
            return
        density, before, after = self._density, np.linalg.inv(self._first), np.linalg.inv(self._clone)
        index = np.nonzero(density.active)
        place = density.places(index)
        off = place - self._mean
        told = 0.5 * (np.einsum("ni,ij,nj->n", place, before, place) - np.einsum("ni,ij,nj->n", off, after, off))
        density.take(index, told)
        matrix = self._cross[_AT].copy() @ after
        density.move(matrix, -matrix @ self._mean)
        noise = present - matrix @ self._clone @ matrix.T
        square, axes = np.linalg.eigh(0.5 * (noise + noise.T))
        density.diffuse(axes * np.maximum(square, 0.0) @ axes.T)

    # --- soundings

    def _predictions(self, m: Measurement, place: Array) -> tuple[Array, Array]:
        """(k,) readings with the position moved by (k, 2) offsets [m], and their (k, 2) derivatives by it."""
        model, sheet, own = self.model, self._sheets[m.instrument], self.model.own[m.instrument]
        assert isinstance(model, InertialModel)
        assert isinstance(own, MeasurementFunction)
        observations = KINDS[sheet.kind].observations
        assert observations is not None
        point = own.point(m.time, model.state_of_own(), m.side)
        k = len(place)

        def many(array: Array) -> Array:
            return np.broadcast_to(array, (k, *array.shape))

        points = NavigationPoints(
            np.full(k, m.time),
            displace(point.position, np.column_stack([place, np.zeros(k)])),
            many(point.velocity), many(point.dcm), many(point.angular_rate),
            {name: many(value) for name, value in point.blocks.items()},
            np.full(k, sheet.channels.index(own.channel)), many(point.side),
        )  # fmt: skip
        reading, jacobian = observations(points, sheet)
        return reading[:, 0], jacobian["navigation"][:, 0, _AT]

    def _sound(self, m: Measurement, linearised: Linearised) -> tuple[float, float]:
        """Correct the density, the state and its covariance; normalised square and size of the innovation."""
        density, P = self._density, self.covariance
        assert density is not None
        regression = np.linalg.solve(P[_AT, _AT], P[_AT]).T  # B
        remaining = P - regression @ P[_AT]  # G
        remaining[_AT], remaining[:, _AT] = 0.0, 0.0
        other = linearised.jacobian[0].copy()
        other[_AT] = 0.0
        projected = remaining @ other
        variance = float(linearised.noise[0, 0] + other @ projected)
        here = self._predictions(m, np.zeros((1, 2)))[0][0] + linearised.innovation[0]
        while True:
            index = np.nonzero(density.active)
            place = density.places(index)
            reading, slope = self._predictions(m, place)
            within = 0.25 * np.sum((slope @ density.basis) ** 2, axis=1)
            weight = density.weight[index]
            fine = density.resolved and weight @ within <= _COARSE * variance
            if fine or 4 * len(place) > self.nodes:
                break
            density.refine()
        rho, spread = here - reading - place @ (other @ regression), variance + within
        mean = float(weight @ rho)
        total = float(weight @ (spread + (rho - mean) ** 2))
        fits = np.exp(-0.5 * rho**2 / spread) / np.sqrt(2.0 * np.pi * spread)
        least = self.outliers / max(abs(float(m.value[0])), 1.0)
        likelihood = (1.0 - self.outliers) * fits + least
        chance = (1.0 - self.outliers) * float(weight @ fits) / max(float(weight @ likelihood), 1e-300)
        if likelihood.min() > 0.0 or likelihood.max() > 0.0:
            density.take(index, np.log(np.maximum(likelihood, 1e-300)))
        kept = density.moments()
        moved = weight * likelihood
        moved /= moved.sum()
        innovation = variance + float(moved @ within)
        gain = projected / innovation
        middle = float(moved @ rho)
        away = place - moved @ place
        mixed, own = (moved * (rho - middle)) @ away, float(moved @ (rho - middle) ** 2)
        if chance < _DOUBTFUL:
            gain, innovation = np.zeros_like(gain), 0.0
        correction = regression @ kept[0] + gain * middle
        cross = np.outer(regression @ mixed, gain)
        P[:] = remaining + regression @ kept[1] @ regression.T + cross + cross.T
        P += (own - innovation) * np.outer(gain, gain)
        P[:] = 0.5 * (P + P.T)
        self.model.correct(correction)
        density.shift(-kept[0])
        return mean**2 / total, abs(mean)
