"""The constant-velocity model: position and velocity driven by white acceleration, for GNSS alone.

Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, Wiley 2001,
section 6.2.2 (continuous white noise acceleration).
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin

import numpy as np

from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import Needs
from simnav.kinds import POSITION, VELOCITY, kinds_with
from simnav.types import Array, Datasheet, Estimate, InitialState, Instruments, Measurement

from .base import ErrorModel, Linearised
from .declared_errors import bias_of
from .equations import equation_of
from .error_states import with_variance
from .measurements import radii, wrap

__all__ = ["KinematicModel"]

#: Below this speed the course is no heading for a lever arm [m/s].
SLOWEST = 1.0
#: Roll, pitch and drift angle that a lever arm is not corrected for, and their rate, one sigma [rad], [rad/s].
TILT, TILT_RATE = 0.04, 0.03
#: Velocity in a seaway that fixes once a second cannot follow, one sigma [m/s].
SEAWAY = 0.2


class KinematicModel(ErrorModel):
    """The model of the module; six states.

    The bias and the slow errors of a receiver are not observable. They are added to the covariance of the estimate.

    Parameters
    ----------
    acceleration : float
        Noise density of the velocity, each axis [m/s/sqrt(s)].
    """

    size = 6
    state = ("position", "velocity")
    memory = ("_yaw",)

    def __init__(self, acceleration: float = 0.2):
        self.acceleration = acceleration

    def observes(self, instrument: Datasheet) -> bool:
        """Whether it is GNSS."""
        return instrument.equation in (POSITION, VELOCITY)

    @property
    def needs(self) -> Needs:
        """GNSS positions."""
        return (tuple(kinds_with(POSITION)),)

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without GNSS positions."""
        receivers = instruments.of_equation(POSITION)
        if not receivers:
            raise UnsuitableScenario(
                f"it needs an instrument of kind {' or '.join(kinds_with(POSITION))}; there is none"
            )
        self.instruments = instruments
        self.time = start.time
        self.position = np.array(start.position, dtype=np.float64)
        self.velocity = np.array(start.velocity, dtype=np.float64)
        self._yaw = np.array(start.attitude[2], dtype=np.float64)
        slow = [with_variance(np.zeros(3), bias_of(r).processes) for r in receivers]
        self._slow = np.diag(np.max(slow, axis=0))
        return np.array(start.covariance[:6, :6])

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        dt = until - self.time
        if dt <= 0.0:
            return
        latitude, _, height = self.position.tolist()
        vn, ve, vd = self.velocity.tolist()
        meridian, prime = radii(latitude)
        self.position += dt * np.array([vn / (meridian + height), ve / ((prime + height) * cos(latitude)), -vd])
        F = np.eye(6)
        F[range(3), range(3, 6)] = dt
        q = self.acceleration**2
        covariance[:] = F @ covariance @ F.T
        covariance[range(3), range(3)] += q * dt**3 / 3.0
        covariance[range(3), range(3, 6)] += q * dt**2 / 2.0
        covariance[range(3, 6), range(3)] += q * dt**2 / 2.0
        covariance[range(3, 6), range(3, 6)] += q * dt
        self.time = until

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error through the last propagation, in place."""
        error[:3] += elapsed * error[3:]

    def measure(self, measurement: Measurement) -> Linearised:
        """Linearise a fix or a velocity; a lever arm is turned by the course, or the last one, or the initial yaw."""
        sheet = self.instruments[measurement.instrument]
        H = np.zeros((3, 6))
        if equation_of(sheet).is_fix:
            H[:, 3:] = np.eye(3)
            arm = sheet.lever_arm
            noise = sheet.sigma**2 + sheet.bias**2 + SEAWAY**2 + TILT_RATE**2 * float(arm @ arm)
            return Linearised(measurement.value - self.velocity, H, np.diag(noise))
        vn, ve = float(self.velocity[0]), float(self.velocity[1])
        if hypot(vn, ve) > SLOWEST:
            self._yaw[...] = atan2(ve, vn)
        x, y, z = sheet.lever_arm.tolist()
        c, s = cos(self._yaw), sin(self._yaw)
        arm = np.array([c * x - s * y, s * x + c * y, z])
        latitude, longitude, height = self.position.tolist()
        meridian, prime = radii(latitude)
        offset = np.array([
            (float(measurement.value[0]) - latitude) * (meridian + height),
            wrap(float(measurement.value[1]) - longitude) * (prime + height) * cos(latitude),
            height - float(measurement.value[2]),
        ])  # fmt: skip
        H[:, :3] = np.eye(3)
        noise = sheet.sigma**2 + TILT**2 * float(arm @ arm)
        return Linearised(offset - arm, H, np.diag(noise))

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        latitude, _, height = self.position.tolist()
        meridian, prime = radii(latitude)
        self.position += np.array([dx[0] / (meridian + height), dx[1] / ((prime + height) * cos(latitude)), -dx[2]])
        self.velocity += dx[3:]

    def estimate(self, covariance: Array) -> Estimate:
        """Position and velocity."""
        full = np.zeros((9, 9))
        full[:6, :6] = covariance
        full[:3, :3] += self._slow
        full[range(3, 6), range(3, 6)] += SEAWAY**2
        return Estimate(self.time, self.position.copy(), self.velocity.copy(), None, full)
