"""Dead reckoning: heading and speed are integrated from the initial position; no position is measured.

Heading
    With an IMU, the gyroscopes are integrated from the initial heading, with a slow correction (`COMPASS_TIME`) to the
    compass if there is one. Roll and pitch are integrated likewise, with a slow correction (`LEVEL_TIME`) to the
    vertical of the accelerometers. Without an IMU, the heading is that of the compass.
Speed
    The newest reading of the DVL, or of the speed log if there is no DVL or no DVL reading for `SILENCE` seconds.
    Without new readings the last velocity in body axes is held.
Height
    From the depth sensor if there is one, otherwise the integral of the DVL's vertical velocity.

The covariance follows from the datasheets: heading error (with the gyroscopes' bias, or the compass's errors), biases
of the speed forward and starboard (bias, scale factor, misalignment, current), and white noise.

Source: N. Bowditch, *The American Practical Navigator*, chapter on dead reckoning; the complementary filter after
Groves 2013, section 6.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot
from typing import ClassVar, NamedTuple

import numpy as np

from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import IMU, Needs
from simnav.estimators.composition import Solver
from simnav.estimators.models.declared_errors import bias_of, bias_of_triad
from simnav.estimators.models.equations import equation_of
from simnav.estimators.models.error_states import merged, with_variance
from simnav.estimators.models.inertial_errors import ERROR
from simnav.estimators.models.measurements import radii, wrap
from simnav.geometry.earth import gravity
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, rpy_from_dcm
from simnav.kinds import BODY_VELOCITY, DEPTH, HEADING, WATER_SPEED, kinds_with
from simnav.strapdown import mechanize
from simnav.types import KINDS, Array, Datasheet, Estimate, ImuSamples, InitialState, Instruments, Measurements

__all__ = ["DeadReckoningEstimator"]

#: Time constants of the heading towards the compass and of roll and pitch towards the vertical [s].
COMPASS_TIME, LEVEL_TIME = 60.0, 300.0
#: A DVL or log without a reading for this long is silent [s]; then the speed wanders by `DRIFT` [m/s/sqrt(s)].
SILENCE, DRIFT = 5.0, 0.05
#: Velocity in a seaway between readings, one sigma [m/s].
SEAWAY = 0.2
#: Samples beyond these are no measurements of a marine vehicle [rad/s], [m/s^2].
LARGEST = (50.0, 500.0)


class _Errors(NamedTuple):
    """Where the error states are: position, heading, gyroscope bias, and bias of the speed forward and to starboard."""

    north: int = 0
    east: int = 1
    heading: int = 2
    gyroscope: int = 3
    ahead: int = 4
    abeam: int = 5


_ERROR = _Errors()


class DeadReckoningEstimator(Solver):
    """Dead reckoning: heading from gyroscopes or compass, speed from DVL or log, from the initial position on.

    Parameters
    ----------
    current : float
        Standard deviation of each component of the current, which a speed log does not measure [m/s]; it is used for
        the covariance only.
    """

    refuses: ClassVar[Mapping[str, str]] = {
        "model": "it is a model of its own",
        **dict.fromkeys(
            ("adaptation", "weighting", "isolation", "iteration", "smoother"), "it weighs no instrument against another"
        ),
    }

    def __init__(self, current: float = 0.3):
        self.current = current

    @property
    def needs(self) -> Needs:
        """A speed, and a heading or the gyroscopes of an IMU."""
        return (tuple(kinds_with(BODY_VELOCITY, WATER_SPEED)), (IMU, *kinds_with(HEADING)))

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs a DVL or a speed log, and an IMU or a compass."""
        compasses = instruments.of_equation(HEADING)
        speeds = [*instruments.of_equation(BODY_VELOCITY), *instruments.of_equation(WATER_SPEED)]
        if not speeds:
            raise UnsuitableScenario("dead reckoning needs a DVL or a speed log; there is neither")
        if not compasses and instruments.imu is None:
            raise UnsuitableScenario("dead reckoning needs a compass or the gyroscopes of an IMU; there is neither")
        self._imu = instruments.imu
        self._compass = compasses[0] if compasses else None
        self._speeds = {s.name: s for s in speeds}
        self._depth = next(iter(instruments.of_equation(DEPTH)), None)
        self._position = np.array(start.position, dtype=np.float64)
        self._dcm = np.ascontiguousarray(dcm_from_rpy(start.attitude))
        self._body = self._dcm.T @ start.velocity  # velocity of the reference point, body axes
        self._memory = np.zeros(6)
        self._heard = {s.name: start.time for s in speeds}
        self._time = self._started = start.time
        self._start = start.covariance
        self._skipped = 0
        self._silent = False

        P = np.zeros((6, 6))
        P[:2, :2] = start.covariance[:2, :2]
        P[_ERROR.heading, _ERROR.heading] = start.covariance[ERROR.heading, ERROR.heading]
        self._gyro_walk = 0.0
        if self._imu is not None:
            drift = bias_of_triad(self._imu.gyroscope, "deg_s")
            P[_ERROR.gyroscope, _ERROR.gyroscope] = merged(drift)[0].variance
            self._gyro_walk = self._imu.gyroscope.random_walk**2 + float(drift.white_density()[0])
        self._covariance = P
        self._use(speeds[0])

    def _use(self, sheet: Datasheet) -> None:
        """Take the errors of an instrument as those of the speed."""
        self._source = sheet
        speed = hypot(*self._body[:2].tolist())
        slow = with_variance(np.zeros(len(sheet.bias)), bias_of(sheet).processes)
        ahead = float(slow[0]) + (sheet.scale * speed) ** 2
        equation = equation_of(sheet)
        abeam = float(slow[1]) + (sheet.misalignment[2] * speed) ** 2 if equation.in_body else 0.0
        extra = self.current**2 if equation.through_water else 0.0
        P = self._covariance
        P[_ERROR.ahead :, :], P[:, _ERROR.ahead :] = 0.0, 0.0
        P[_ERROR.ahead, _ERROR.ahead], P[_ERROR.abeam, _ERROR.abeam] = ahead + extra, abeam + extra

    def update(self, measurements: Measurements) -> Estimate:
        """Carry the position on through one step."""
        begin, dt = self._dcm.copy(), measurements.time - self._time
        turned = self._turn(measurements.imu) if self._imu is not None else None
        self._headings(measurements, begin, dt)
        was = begin @ self._body
        self._advance(measurements, begin, dt)
        if turned is not None:
            self._level(turned, self._dcm @ self._body - was)
        self._spread(dt)
        self._time = measurements.time
        return self._estimate()

    def _turn(self, imu: ImuSamples | None) -> tuple[Array, float] | None:
        """Turn the attitude by the gyroscopes; return the velocity that the accelerometers gained, and its time."""
        self._rate = np.zeros(3)
        if imu is None or len(imu) == 0:
            return None
        good = np.abs(imu.angular_rate).max(axis=1) < LARGEST[0]
        good &= np.abs(imu.specific_force).max(axis=1) < LARGEST[1]
        good &= np.diff(imu.time, prepend=-np.inf) > 0.0
        rate = np.ascontiguousarray(imu.angular_rate[good])
        if not len(rate):
            return None
        interval = np.ascontiguousarray(imu.interval[good])
        velocity = self._dcm @ self._body
        gained = velocity.copy()
        force = np.ascontiguousarray(imu.specific_force[good])
        mechanize(self._position.copy(), gained, self._dcm, self._memory, rate, force, interval)
        self._rate = rate[-1]
        return gained - velocity, float(interval.sum())

    def _headings(self, measurements: Measurements, begin: Array, dt: float) -> None:
        """Draw the heading to the compass, by the newest reading."""
        if self._compass is None or dt <= 0.0:
            return
        reading = measurements.latest(self._compass.name)
        if reading is None or not KINDS[reading.kind].plausible(reading.value):
            self._skipped += reading is not None
            return
        first, last = (float(np.arctan2(c[1, 0], c[0, 0])) for c in (begin, self._dcm))
        share = (reading.time - measurements.start) / dt
        error = wrap(float(reading.value[0]) - (first + share * wrap(last - first)))
        gain = 1.0 if self._imu is None else min(1.0, dt / COMPASS_TIME)
        self._dcm = np.ascontiguousarray(dcm_from_rotation_vector(np.array([0.0, 0.0, gain * error])) @ self._dcm)

    def _advance(self, measurements: Measurements, begin: Array, dt: float) -> None:
        """Integrate the velocity from reading to reading."""
        time = self._time
        for m in measurements.aids:
            sheet = self._speeds.get(m.instrument)
            if sheet is not None:
                if not KINDS[m.kind].plausible(m.value) or not time - 1e-4 <= m.time <= measurements.time + 1e-4:
                    self._skipped += 1
                    continue
                self._heard[sheet.name] = m.time
                if not self._preferred(sheet, m.time):
                    continue
                if sheet is not self._source or self._silent:
                    self._use(sheet)
                self._silent = False
                time = self._carry(time, m.time, begin, dt)
                turning = np.cross(self._rate, sheet.lever_arm) if self._imu is not None else np.zeros(3)
                equation = equation_of(sheet)
                self._body = equation.in_body_axes(m.value) - equation.in_body_axes(turning)
        self._carry(time, measurements.time, begin, dt)
        if self._depth is not None:
            reading = measurements.latest(self._depth.name)
            if reading is not None and KINDS[reading.kind].plausible(reading.value):
                self._position[2] = float((self._dcm @ self._depth.lever_arm)[2]) - float(reading.value[0])

    def _preferred(self, sheet: Datasheet, time: float) -> bool:
        """Whether no better instrument has been heard lately; they are in order of preference."""
        for name in self._speeds:
            if name == sheet.name:
                return True
            if time - self._heard[name] < SILENCE:
                return False
        return True

    def _carry(self, time: float, until: float, begin: Array, dt: float) -> float:
        """Move the position by the present velocity; the attitude is interpolated over the step."""
        if until <= time:
            return time
        share = 1.0 if dt <= 0.0 else (0.5 * (time + until) - self._time) / dt
        vn, ve, vd = ((begin + share * (self._dcm - begin)) @ self._body).tolist()
        latitude, _, height = self._position.tolist()
        meridian, prime = radii(latitude)
        h = until - time
        self._position += (h * vn / (meridian + height), h * ve / ((prime + height) * np.cos(latitude)), -h * vd)
        return until

    def _level(self, turned: tuple[Array, float], change: Array) -> None:
        """Draw roll and pitch to the vertical: what the accelerometers gained beyond the true change is tilt."""
        gained, dt = turned
        g = float(gravity(self._position[0], self._position[2]))
        tilt = np.array([gained[1] - change[1], -(gained[0] - change[0]), 0.0]) / (g * dt)
        step = min(1.0, dt / LEVEL_TIME) * np.clip(tilt, -0.1, 0.1)
        self._dcm = np.ascontiguousarray(dcm_from_rotation_vector(-step) @ self._dcm)

    def _spread(self, dt: float) -> None:
        """Propagate the covariance through the step."""
        P, c = self._covariance, self._dcm
        v = c @ self._body
        F = np.eye(6)
        F[_ERROR.north, _ERROR.heading], F[_ERROR.east, _ERROR.heading] = -v[1] * dt, v[0] * dt
        F[_ERROR.north, _ERROR.ahead], F[_ERROR.north, _ERROR.abeam] = c[0, 0] * dt, c[0, 1] * dt
        F[_ERROR.east, _ERROR.ahead], F[_ERROR.east, _ERROR.abeam] = c[1, 0] * dt, c[1, 1] * dt
        F[_ERROR.heading, _ERROR.gyroscope] = -dt
        P = F @ P @ F.T
        sheet = self._source
        each = float(sheet.sigma[0]) ** 2 * max(dt, 1.0 / sheet.rate) * dt / max(1.0, dt * sheet.rate)
        P[_ERROR.north, _ERROR.north] += each
        P[_ERROR.east, _ERROR.east] += each
        P[_ERROR.heading, _ERROR.heading] += self._gyro_walk * dt
        if self._compass is not None:
            # The heading's error is the compass's: it grows no further.
            white = float(self._compass.sigma[0]) ** 2
            if self._imu is not None:
                white = white / (2.0 * COMPASS_TIME * self._compass.rate) + self._gyro_walk * COMPASS_TIME
            slow = float(with_variance(np.zeros(1), bias_of(self._compass).processes)[0])
            slow += float(P[_ERROR.gyroscope, _ERROR.gyroscope]) * COMPASS_TIME**2
            limit = slow + white
            settled = 1.0 if self._imu is None else min(1.0, 2.0 * dt / COMPASS_TIME)
            shrink = np.ones(6)
            shrink[_ERROR.heading] = (
                1.0 + settled * (limit / max(float(P[_ERROR.heading, _ERROR.heading]), 1e-12) - 1.0)
            ) ** 0.5
            P = P * np.outer(shrink, shrink)
        if self._time - self._heard[sheet.name] > SILENCE:
            self._silent = True
            P[_ERROR.ahead, _ERROR.ahead] += DRIFT**2 * dt
            P[_ERROR.abeam, _ERROR.abeam] += DRIFT**2 * dt
        self._covariance = P

    def _estimate(self) -> Estimate:
        c, P, start = self._dcm, self._covariance, self._start
        v = c @ self._body
        G = np.zeros((9, 6))
        place, speed = ERROR.position, ERROR.velocity
        G[place, _ERROR.north] = G[place + 1, _ERROR.east] = G[ERROR.heading, _ERROR.heading] = 1.0
        G[speed, [_ERROR.heading, _ERROR.ahead, _ERROR.abeam]] = -v[1], c[0, 0], c[0, 1]
        G[speed + 1, [_ERROR.heading, _ERROR.ahead, _ERROR.abeam]] = v[0], c[1, 0], c[1, 1]
        full = G @ P @ G.T
        sigma = float(self._source.sigma[0])
        full[range(3, 6), range(3, 6)] += sigma**2 + SEAWAY**2
        tilt = np.full(2, 0.03**2)
        if self._imu is not None:
            turning, acceleration = (
                merged(bias_of_triad(triad, unit))[0].variance
                for triad, unit in ((self._imu.gyroscope, "deg_s"), (self._imu.accelerometer, "m_s2"))
            )
            tilt = np.diag(start)[ERROR.attitude : ERROR.heading] + acceleration / 9.81**2 + turning * LEVEL_TIME**2
        full[range(ERROR.attitude, ERROR.heading), range(ERROR.attitude, ERROR.heading)] = tilt
        age = self._time - self._started
        drift_down = float(tilt.mean()) * float(v[:2] @ v[:2]) * age**2 + sigma**2 * age
        height = start[ERROR.height, ERROR.height] + drift_down
        if self._depth is not None:
            height = float(self._depth.sigma[0] ** 2 + self._depth.bias[0] ** 2) + SEAWAY**2
        full[ERROR.height, ERROR.height] = height
        full[ERROR.sinking, ERROR.sinking] += float(tilt.mean()) * float(v[:2] @ v[:2])
        estimated = None
        attitude = rpy_from_dcm(c)
        if self._imu is None:
            dvl = equation_of(self._source).in_body
            estimated = np.array([True, True, self._depth is not None, True, True, dvl, False, False, True])
            attitude[:2] = 0.0
        diagnostics = {"skipped": float(self._skipped), "silent": float(self._silent)}
        return Estimate(self._time, self._position.copy(), v, attitude, full, estimated, diagnostics)
