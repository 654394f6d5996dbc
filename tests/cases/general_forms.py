"""The inertial model and the ship model in the general form: what their compiled forms are compared with.

They say motion, noise, navigation state and chart, and nothing of derivatives, biases and blocks. The motion of the
inertial one goes through the same mechanization; that of the ship is written out in NumPy.
"""

from __future__ import annotations

from math import ceil, cos, exp, sin

import numpy as np

from simnav.estimators.models.general import GeneralModel
from simnav.estimators.models.inertial import InertialModel, roll_pitch_yaw
from simnav.estimators.models.propagation import (
    BLOCK,
    BLOCK_NUMBERS,
    CLOCK,
    Motion,
    accumulate_error,
    advance_inertial,
    correct_inertial,
)
from simnav.estimators.models.ship import ShipModel
from simnav.geometry.earth import displace, earth_rate, relative_position
from simnav.geometry.rotation import rotation_vector_from_dcm, wrap_angle
from simnav.kinds import NavigationPoint
from simnav.types import Estimate, Instruments
from tests.cases.samples_as_given import as_given

__all__ = ["GeneralInertial", "GeneralShip"]


class GeneralInertial(GeneralModel):
    """Position (3), velocity (3), rotation (9) and biases of the IMU (6); the error is that of the inertial model."""

    def initial(self, start, instruments):
        imu = InertialModel()
        covariance = imu.begin(start, Instruments([], instruments.imu, instruments.step))
        self._noise, self._samples, self._first = imu._noise, imu.samples, 0
        self._kept = imu.motion.increments, imu.motion.turn, imu.motion.clock
        return np.concatenate([imu.position, imu.velocity, imu.dcm.ravel(), imu.bias]), covariance

    def load(self, imu):
        self._samples, self._first = as_given(imu), 0

    def _moved(self, x, elapsed):
        state = x[:3].copy(), x[3:6].copy(), x[6:15].reshape(3, 3).copy(), x[15:].copy()
        position, velocity, dcm, bias = state
        memory, turn, clock = (kept.copy() for kept in self._kept)
        until, blocks = self.time + elapsed, np.empty((int(elapsed / BLOCK) + 2, BLOCK_NUMBERS))
        moving = Motion(position, velocity, dcm, bias, memory, turn, clock)
        first, count = advance_inertial(moving, self._samples, self._first, until, self._noise, blocks)
        moved = np.concatenate([position, velocity, dcm.ravel(), bias])
        return moved, (memory, turn, clock), first, (blocks, count)

    def move(self, x, elapsed):
        return self._moved(x, elapsed)[0]

    def noise(self, x, elapsed):
        transition, noise = np.empty((15, 15)), np.empty((15, 15))
        accumulate_error(*self._moved(x, elapsed)[3], self._noise, transition, noise)
        return noise

    def propagate(self, covariance, until):
        _, kept, first, _ = self._moved(self.x, until - self.time)
        super().propagate(covariance, until)
        self._kept, self._first = kept, first

    def navigation(self, x, time):
        dcm = x[6:15].reshape(3, 3)
        rate = self._kept[2].view(CLOCK)[0].rate - x[15:18] - dcm.T @ earth_rate(x[0])
        return NavigationPoint(time, x[:3], x[3:6], dcm, rate)

    def retract(self, x, error):
        y = x.copy()
        correct_inertial(y[:3], y[3:6], y[6:15].reshape(3, 3), y[15:], np.empty(0), np.ascontiguousarray(error))
        return y

    def difference(self, x, reference):
        turn = x[6:15].reshape(3, 3) @ reference[6:15].reshape(3, 3).T
        return np.concatenate([
            relative_position(x[:3], reference[:3]), x[3:6] - reference[3:6], rotation_vector_from_dcm(turn),
            x[15:] - reference[15:],
        ])  # fmt: skip

    def describe(self, x, time, covariance):
        attitude = roll_pitch_yaw(x[6:15].reshape(3, 3))
        return Estimate(time, x[:3].copy(), x[3:6].copy(), attitude, covariance[:9, :9].copy())


class GeneralShip(GeneralModel):
    """Latitude, longitude, height, speed, heading, turn rate, current; the error has no height."""

    equations = ("horizontal_position", "heading", "water_speed")
    errors = ("bias", "scale")  # the current is a state of the ship

    def initial(self, start, instruments):
        self._ship = ship = ShipModel()
        covariance = ship.begin(start, instruments)[:7, :7]
        return np.concatenate([ship.position, ship.x[2:7]]), covariance

    def own_errors(self, x):
        return {"current": x[6:]}

    def move(self, x, elapsed):
        ship, (*place, u, psi, r, north, east) = self._ship, x.tolist()
        steps = max(1, ceil(elapsed - 1e-9))
        dt = elapsed / steps
        for _ in range(steps):
            turn = ship.turn_time * (1.0 - exp(-dt / ship.turn_time)) * r
            middle = psi + 0.5 * turn
            moved = np.array([dt * (u * cos(middle) + north), dt * (u * sin(middle) + east), 0.0])
            place, psi, r = displace(np.array(place), moved), psi + turn, r * exp(-dt / ship.turn_time)
            north, east = north * exp(-dt / ship.current_time), east * exp(-dt / ship.current_time)
        return np.array([*place, u, psi, r, north, east])

    def noise(self, x, elapsed):
        """For a step of at most a second: half of it before the motion and half after it."""
        half = 0.5 * elapsed * np.diag(self._ship.density[:7])
        F = self.transition(x, self.move(x, elapsed), elapsed)[:7, :7]
        return F @ half @ F.T + half

    def retract(self, x, error):
        place = displace(x[:3], np.array([error[0], error[1], 0.0]))
        return np.concatenate([place, x[3:] + error[2:]])

    def difference(self, x, reference):
        error = np.concatenate([relative_position(x[:3], reference[:3])[:2], x[3:] - reference[3:]])
        error[3] = wrap_angle(error[3])
        return error

    def navigation(self, x, time):
        c, s = np.cos(x[4]), np.sin(x[4])
        velocity = np.array([x[3] * c + x[6], x[3] * s + x[7], 0.0])
        dcm = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return NavigationPoint(time, x[:3], velocity, dcm, np.array([0.0, 0.0, x[5]]))

    def describe(self, x, time, covariance):
        return Estimate(time, x[:3].copy(), self.navigation(x, time).velocity, np.array([0.0, 0.0, x[4]]))
