"""A buoy that drifts: a model of four states, as functions over a flat state."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from simnav.estimators.algebra.joseph import project
from simnav.estimators.models.filtering import Aid, Dynamics, ModelFunctions, Prediction, Readings, aid_table
from simnav.estimators.models.function_model import FunctionModel
from simnav.estimators.models.propagation import Samples
from simnav.geometry.earth import radii_scalar
from simnav.kernel_types import Vector
from simnav.structures import filled, structure
from simnav.types import Estimate

#: Time [s]; latitude, longitude [rad] and height [m]; velocity north and east [m/s]; metres for a radian.
STATE = structure(time=float, position=3, velocity=2, metres=2)
#: Variance density of the velocity [(m/s)^2/s].
MOTION = structure(density=float)


def propagate(dynamics: Dynamics, samples: Samples, until: float) -> None:
    state, P, F = dynamics.numbers.view(STATE)[0], dynamics.covariance, dynamics.transition
    dt = until - state.time
    if dt <= 0.0:
        return
    for i in range(2):
        state.position[i] += dt * state.velocity[i] / state.metres[i]
        F[i, 2 + i] = dt
    P[:, :] = F @ P @ F.T
    for i in range(2):
        P[2 + i, 2 + i] += dynamics.constants.view(MOTION)[0].density * dt
    state.time = until


def predict(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    state, noise = dynamics.numbers.view(STATE)[0], dynamics.aids.noise[readings.instrument[k]]
    H = np.zeros((2, 4))
    for i in range(2):
        prediction.innovation[i] = (readings.value[k, i] - state.position[i]) * state.metres[i]
        H[i, i] = 1.0
        for j in range(2):
            prediction.nominal[i, j] = noise[i] if i == j else 0.0
    project(dynamics.covariance, H, prediction.cross, prediction.predicted)
    return True


def retract(dynamics: Dynamics) -> None:
    state = dynamics.numbers.view(STATE)[0]
    for i in range(2):
        state.position[i] += dynamics.correction[i] / state.metres[i]
        state.velocity[i] += dynamics.correction[2 + i]


def difference(numbers: Vector, other: Vector, error: Vector) -> None:
    state, there = numbers.view(STATE)[0], other.view(STATE)[0]
    for i in range(2):
        error[i] = (state.position[i] - there.position[i]) * state.metres[i]
        error[2 + i] = state.velocity[i] - there.velocity[i]


class DriftingBuoy(FunctionModel):
    """Position and velocity, north and east, from GNSS alone."""

    size = 4
    equations = ModelFunctions(propagate, predict, retract, difference)

    def observes(self, instrument):
        return instrument.kind == "gnss_position"

    def components(self, instrument):
        return 2

    def begin(self, start, instruments):
        self.sheets = {name: sheet for name, sheet in instruments.items() if self.observes(sheet)}
        self.names = list(self.sheets)
        latitude, _, height = start.position
        meridian, prime = radii_scalar(sin(latitude))
        metres = meridian + height, (prime + height) * cos(latitude)
        self.numbers = filled(
            STATE, time=start.time, position=start.position, velocity=start.velocity[:2], metres=metres
        )
        self.constants = filled(MOTION, density=0.04)
        return np.diag(start.covariance.diagonal()[[0, 1, 3, 4]])

    def table(self, names):
        sheets = [self.sheets[name] for name in names]
        aids = [Aid() for _ in sheets]  # no lever arm, bias or scale
        return aid_table(aids, [2] * len(aids), [sheet.sigma[:2] ** 2 for sheet in sheets])

    def estimate(self, covariance):
        state, at = self.numbers.view(STATE)[0], [0, 1, 3, 4]
        P = np.eye(9)
        P[np.ix_(at, at)] = covariance
        velocity = np.array([*state.velocity, 0.0])
        estimated = np.array([1, 1, 0, 1, 1, 0, 0, 0, 0], bool)
        return Estimate(self.time, state.position.copy(), velocity, None, P, estimated)
