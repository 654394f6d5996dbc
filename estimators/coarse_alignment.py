"""Coarse alignment: attitude and heading of a run that begins without them, from gravity, Earth rate, fixes and speeds.

A start may say that it does not know the heading, or the attitude (`simnav.types.InitialState.unknown`). An inertial
filter cannot begin there: its error equations hold for errors of about twenty degrees. So a row waits, and its packets
are kept until the attitude at time 0 is known. Then the row begins at time 0 with that attitude and takes all packets
that were kept, as if it had known the attitude from the start. Nothing is lost of what the measurements say, and a
smoother has the whole run.

1. *Levelling.* The specific force is resolved in the axes that the body had at time 0, by the gyroscopes, and averaged
   over `LEVELLING` seconds. Waves and manoeuvres average out there, whatever the body's motion, and the mean points up.
   A steady acceleration a would tilt it by a/g. It also makes it larger than gravity, and the standard deviation of
   the tilt is derived from that.
2. *Heading.* A Kalman filter from each of several headings around the circle, weighed by the likelihood of its
   innovations (the row ``heading-bank``). One method serves a moored vessel and one under way, and all instruments that
   the filters have an equation for: a wrong heading turns the Earth rate to where the gyroscopes do not feel it
   (gyrocompassing), the acceleration to where the fixes do not go, and the speed of a log to another course. A compass
   tells it at once. While nothing tells it, all headings stay.
3. *Hand-over.* When the standard deviation of the attitude has fallen to `ENOUGH`, the attitude is carried back to
   time 0 by the gyroscopes, without the bias that the filter has found, and by the Earth rate. The row is told
   `WIDER` times the standard deviation, for it uses the same readings again: so what counts twice is a quarter of the
   information at most.

Before that the estimates are those of the filters, whose covariance includes the spread of the headings, and in the
first seconds the position of the start carried on by its velocity.

Moored, the heading follows from the Earth rate to ``b / (Omega cos(latitude))`` with a gyroscope bias b to the east. So
an IMU with more than about 0.3 deg/h needs motion or a compass. Memory grows by some 20 MB an hour until then.

Source: gravity in the axes of time 0 is the idea of optimisation-based alignment (F. O. Silson, *Coarse alignment of a
ship's strapdown inertial attitude reference system using velocity loci*, IEEE Trans. Instrumentation and Measurement
60(6), 2011; Y. Wu and X. Pan, *Velocity/position integration formula part I: application to in-flight coarse
alignment*, IEEE Trans. Aerospace and Electronic Systems 49(2), 2013). The bank of filters in place of their solution of
Wahba's problem also weighs the noise of the fixes and the errors of the IMU: D. T. Magill, *Optimal adaptive estimation
of sampled stochastic processes*, IEEE TAC 10(4), 1965.
"""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2, isfinite, radians
from typing import Any

import numpy as np

from simnav.compiled import kernel
from simnav.estimator.lookup import make
from simnav.geometry.earth import displace, earth_rate, gravity
from simnav.geometry.rotation import (
    dcm_from_rotation_vector,
    dcm_from_rpy,
    rotate_right,
    rotation_coefficients,
    rpy_from_dcm,
)
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

__all__ = ["ENOUGH", "LEVELLING", "SPACING_DEG", "WIDER", "CoarseAlignment", "turn"]

#: How long the specific force is averaged for roll and pitch [s].
LEVELLING = 20.0
#: Distance between the headings at which filters begin [deg]. A filter that begins 10 deg off, as with the 20 deg of
#: the row ``heading-bank``, sometimes believes in a heading that is wrong by six of its standard deviations.
SPACING_DEG = 8.0
#: A row begins when no component of the attitude has a larger standard deviation [rad].
ENOUGH = radians(2.0)
#: Standard deviation that the row is told, over that of the alignment. With more its filter is linearised too far off.
WIDER = 2.0
#: What waves leave of roll and pitch after levelling, one sigma [rad].
_TILT = radians(1.0)


@kernel
def turn(rate: Matrix, force: Matrix, interval: Vector, bias: Vector, dcm: Matrix, pushed: Vector) -> None:
    """Turn axes by the gyroscopes, and integrate the specific force in the axes of the beginning, in place.

    Parameters
    ----------
    rate, force : (n, 3) array
        Mean angular rate [rad/s] and specific force [m/s^2] of each sample.
    interval : (n,) array
        Length of each sample [s].
    bias : (3,) array
        Of the gyroscopes; taken off [rad/s].
    dcm : (3, 3) array
        Rotation from the axes of the body now to those of the beginning; updated.
    pushed : (3,) array
        Integral of the specific force in the axes of the beginning [m/s]; updated.
    """
    for k in range(interval.size):
        if not isfinite(rate[k].sum() + force[k].sum()):
            continue
        dt = interval[k]
        r0, r1, r2 = (rate[k, 0] - bias[0]) * dt, (rate[k, 1] - bias[1]) * dt, (rate[k, 2] - bias[2]) * dt
        for i in range(3):
            pushed[i] += (dcm[i, 0] * force[k, 0] + dcm[i, 1] * force[k, 1] + dcm[i, 2] * force[k, 2]) * dt
        a, b = rotation_coefficients(r0 * r0 + r1 * r1 + r2 * r2)
        rotate_right(dcm, r0, r1, r2, a, b)


class CoarseAlignment:
    """The alignment of one run.

    Parameters
    ----------
    start : InitialState
        With an unknown heading or attitude.
    instruments : Instruments
        With an IMU, and an instrument beside it.

    Attributes
    ----------
    start : InitialState
        As it was given; once ``aligned`` with the attitude that was found, at the same time.
    aligned : bool
        Whether the attitude is known.
    packets : list of Measurements
        All packets since the start.

    Raises
    ------
    UnsuitableScenario
        If there is no IMU, or nothing beside it.
    """

    def __init__(self, start: InitialState, instruments: Instruments):
        self.start, self.aligned = start, False
        self.packets: list[Measurements] = []
        self._filters: Any = make("heading-bank", spacing_deg=SPACING_DEG)
        self._instruments = instruments
        self._levelled = start.unknown == "heading"
        self._filters.reset(start if self._levelled else self._level(np.array([0.0, 0.0, -1.0])), instruments)

    def update(self, measurements: Measurements) -> Estimate:
        """Keep one step's measurements, and use them; afterwards the row may be ``aligned``.

        Parameters
        ----------
        measurements : Measurements
            The packet of the step.

        Returns
        -------
        Estimate
            Of the end of the step. Its diagnostic ``aligning`` is 1.
        """
        packet = measurements.kept()
        self.packets.append(packet)
        if self._levelled:
            estimate: Estimate = self._filters.update(packet)
        elif packet.time - self.start.time < LEVELLING:
            estimate = self._carried_on(packet.time)
        else:
            _, pushed = self._turned(np.zeros(3))
            self._filters.reset(self._level(pushed), self._instruments)
            self._levelled = True
            for each in self.packets:
                estimate = self._filters.update(each)
        if self._levelled:
            self._judge(estimate)
        estimate.diagnostics = {**estimate.diagnostics, "aligning": 1.0}
        return estimate

    def _carried_on(self, time: float) -> Estimate:
        """Position and velocity of the start at a later time."""
        elapsed, covariance = time - self.start.time, self.start.covariance.copy()
        covariance[:3, :3] += elapsed**2 * covariance[3:6, 3:6]
        position = displace(self.start.position, elapsed * self.start.velocity)
        return Estimate(time, position, self.start.velocity.copy(), covariance=covariance)

    def _turned(self, bias: Array) -> tuple[Array, Array]:
        """Rotation from the body now to the body at time 0, and the integral of the specific force there."""
        dcm, pushed = np.eye(3), np.zeros(3)
        for packet in self.packets:
            imu = packet.imu
            if imu is not None:
                turn(imu.angular_rate, imu.specific_force, imu.interval, bias, dcm, pushed)
        return dcm, pushed

    def _level(self, pushed: Array) -> InitialState:
        """The start with the roll and pitch at which a mean specific force points up."""
        x, y, z = (-pushed / max(float(np.linalg.norm(pushed)), 1e-9)).tolist()
        g = float(gravity(self.start.position[0], self.start.position[2]))
        length = sum(float(p.imu.interval.sum()) for p in self.packets if p.imu is not None)
        excess = float(pushed @ pushed) / length**2 - g * g if length else 0.0
        imu = self._instruments.imu
        bias = 0.0 if imu is None else imu.accelerometer.bias / g
        variance = _TILT**2 + bias**2 + max(excess, 0.0) / g**2
        attitude = np.array([atan2(y, z), -asin(max(-1.0, min(1.0, x))), self.start.attitude[2]])
        return replace(
            self.start, attitude=attitude, covariance=_with(self.start.covariance, (variance, variance, None))
        )

    def _judge(self, estimate: Estimate) -> None:
        """Set the attitude at the start, if it is known well enough."""
        found, attitude = estimate.covariance, estimate.attitude
        if found is None or attitude is None or not found.diagonal()[6:].max() <= ENOUGH**2:
            return
        gyroscope_bias = self._filters.best.model.bias[:3]
        dcm, _ = self._turned(gyroscope_bias)
        position = self.start.position if estimate.position is None else estimate.position
        back = dcm_from_rotation_vector(earth_rate(float(position[0])) * (estimate.time - self.start.time))
        first = rpy_from_dcm(back @ dcm_from_rpy(attitude) @ dcm.T)
        variances: list[float | None] = [WIDER**2 * float(v) for v in found.diagonal()[6:]]
        if self.start.unknown == "heading":
            first[:2], variances[:2] = self.start.attitude[:2], (None, None)
        covariance = _with(self.start.covariance, variances)
        self.start, self.aligned = replace(self.start, attitude=first, covariance=covariance), True


def _with(covariance: Array, variances: tuple[float | None, ...] | list[float | None]) -> Array:
    """A covariance with other variances of the attitude, which are independent; None: as it is."""
    made = covariance.copy()
    for k, variance in enumerate(variances, start=6):
        if variance is not None:
            made[k], made[:, k] = 0.0, 0.0
            made[k, k] = variance
    return made
