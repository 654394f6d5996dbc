"""The 15-state inertial error model: position, velocity, attitude, gyroscope and accelerometer bias.

The state is propagated by `simnav.strapdown` at IMU rate. Between measurements one kernel accumulates the transition
matrix and the process noise of the error from blocks of at most `BLOCK` seconds, so that the covariance is touched once
a measurement.

Error: estimate minus truth; position ``(R_M + h) dlat, (R_N + h) cos(lat) dlon, -dh`` [m], velocity [m/s] and the
rotation vector phi of C_est C_true' [rad], all in north-east-down, and the biases [rad/s], [m/s^2]. Its dynamics
(phi-angle form, Groves 2013, section 14.2.4, with his signs turned to estimate minus truth):

- dr' = dv + (curvature terms of order v/R) dr
- dv' = -[f_n x] phi - C db_a - (2 w_ie + w_en) x dv - (2 dw_ie + dw_en) x v + 2 g/R dr_D
- phi' = -w_in x phi - dw_in - C db_g
- db' = -db/T + noise

Beyond the 15 there are calibration states, as the datasheets ask for them: a bias for every component of an aiding
instrument that has a bias or an in-run instability, a DVL's scale factor and misalignment, a speed log's scale factor
and the current along the keel. With instruments of white noise only, n is 15; with ``calibrate=False`` it always is,
and those errors count as white noise.

An IMU's scale factor and misalignment are not states. On a level vehicle gravity turns the accelerometers' into a bias,
which is added to the turn-on bias; the gyroscopes' act in turns, as noise in proportion to the turn rate, averaged over
`TURN_TIME` so that a seaway does not count. Quantization carries its residual over, so that its sum stays within a
step: it counts for nothing.
"""

from __future__ import annotations

from math import atan2, cos, exp, hypot, sin

import numpy as np

from estimators.models import measurements
from estimators.models.base import ErrorModel, GaussMarkov, Linearised, gauss_markov, triad_bias
from simnav.compiled import kernel
from simnav.earth import EQUATORIAL_GRAVITY, ROTATION_RATE, SEMI_MAJOR_AXIS, gravity_scalar, radii_scalar
from simnav.estimator import UnsuitableScenario
from simnav.rotation import cross, dcm_from_rpy, rotation_coefficients
from simnav.strapdown import mechanize_step
from simnav.types import (
    Array,
    Datasheet,
    Estimate,
    ImuDatasheet,
    ImuSamples,
    InitialState,
    Instruments,
    Measurement,
)

__all__ = ["BLOCK", "InertialModel", "propagate_covariance", "propagate_inertial"]

#: Longest block over which attitude and specific force count as constant in the transition matrix [s].
BLOCK = 0.2
#: Time over which the turn rate is averaged, and for which a scale-factor error is taken to last in a turn [s].
TURN_TIME = 60.0
#: What a step without IMU data adds: velocity [m/s/sqrt(s)] and attitude [rad/sqrt(s)] random walk.
HELD_VELOCITY, HELD_ATTITUDE = 0.3, 0.03
#: Samples beyond these are no measurements of a marine vehicle [rad/s], [m/s^2].
LARGEST_RATE, LARGEST_FORCE = 50.0, 500.0
#: Sigma and correlation time of the current along the keel, for a speed log [m/s], [s].
CURRENT, CURRENT_TIME = 0.5, 1800.0
#: Relative growth of gravity from the equator to the poles [-].
GRAVITY_FLATTENING = 0.0053024

_NAV = 15


@kernel()
def _usable(w0, w1, w2, f0, f1, f2):  # type: ignore[no-untyped-def]
    rate = abs(w0) + abs(w1) + abs(w2)
    force = abs(f0) + abs(f1) + abs(f2)
    return rate < LARGEST_RATE and force < LARGEST_FORCE  # false for NaN


@kernel()
def _dynamics(F, position, velocity, c, f0, f1, f2, gyro_decay, accelerometer_decay):  # type: ignore[no-untyped-def]
    """The matrix F of the module, at a state with mean DCM ``c`` and mean specific force f (north-east-down)."""
    s, cl = sin(position[0]), cos(position[0])
    meridian, prime = radii_scalar(s)
    a, b = 1.0 / (meridian + position[2]), 1.0 / (prime + position[2])
    t = s / cl
    v0, v1, v2 = velocity[0], velocity[1], velocity[2]
    e0, e2 = ROTATION_RATE * cl, -ROTATION_RATE * s
    k0, k1, k2 = v1 * b, -v0 * a, -v1 * b * t
    F[0, 0], F[0, 2], F[0, 3] = -v2 * a, v0 * a, 1.0
    F[1, 0], F[1, 1], F[1, 2], F[1, 4] = v1 * t * a, -v2 * b - v0 * t * a, v1 * b, 1.0
    F[2, 5] = 1.0
    # -(2 w_ie + w_en) x dv
    x0, x1, x2 = 2.0 * e0 + k0, k1, 2.0 * e2 + k2
    F[3, 3], F[3, 4], F[3, 5] = 0.0, x2, -x1
    F[4, 3], F[4, 4], F[4, 5] = -x2, 0.0, x0
    F[5, 3], F[5, 4], F[5, 5] = x1, -x0, 0.0
    # -dw_en x v, with dw_en = (dv_E b, -dv_N a, -dv_E b t): w x v = (w1 v2 - w2 v1, w2 v0 - w0 v2, w0 v1 - w1 v0)
    F[3, 3] += a * v2
    F[3, 4] += -b * t * v1
    F[4, 4] += b * t * v0 + b * v2
    F[5, 3] += -a * v0
    F[5, 4] += -b * v1
    # -2 dw_ie x v, with dw_ie = (e2, 0, -e0) a dr_N
    F[3, 0] = -2.0 * e0 * a * v1
    F[4, 0] = 2.0 * (e0 * v0 + e2 * v2) * a
    F[5, 0] = -2.0 * e2 * a * v1 + 2.0 * GRAVITY_FLATTENING * EQUATORIAL_GRAVITY * s * cl * a
    F[5, 2] = 2.0 * gravity_scalar(s, position[2]) / SEMI_MAJOR_AXIS
    # -[f x] phi
    F[3, 7], F[3, 8] = f2, -f1
    F[4, 6], F[4, 8] = -f2, f0
    F[5, 6], F[5, 7] = f1, -f0
    # -w_in x phi - dw_ie - dw_en
    w0, w1, w2 = e0 + k0, k1, e2 + k2
    F[6, 7], F[6, 8] = w2, -w1
    F[7, 6], F[7, 8] = -w2, w0
    F[8, 6], F[8, 7] = w1, -w0
    F[6, 0], F[8, 0] = -e2 * a, e0 * a
    F[6, 4], F[7, 3], F[8, 4] = -b, a, b * t
    for i in range(3):
        for j in range(3):
            F[3 + i, 12 + j] = -c[i, j]
            F[6 + i, 9 + j] = -c[i, j]
        F[9 + i, 9 + i] = -gyro_decay
        F[12 + i, 12 + i] = -accelerometer_decay


@kernel()
def _advance_rows(F, dt, M, A, B):  # type: ignore[no-untyped-def]
    """``M = (I + F dt + F F dt^2 / 2) M`` with work space A, B; F is sparse, M has n columns."""
    n = M.shape[1]
    for i in range(15):
        for j in range(n):
            A[i, j] = 0.0
        for k in range(15):
            x = F[i, k] * dt
            if x != 0.0:
                for j in range(n):
                    A[i, j] += x * M[k, j]
    for i in range(15):
        for j in range(n):
            B[i, j] = 0.0
        for k in range(15):
            x = 0.5 * F[i, k] * dt
            if x != 0.0:
                for j in range(n):
                    B[i, j] += x * A[k, j]
    for i in range(15):
        for j in range(n):
            M[i, j] += A[i, j] + B[i, j]


@kernel()
def _add_noise(Q, c, dt, turn, noise, held):  # type: ignore[no-untyped-def]
    """Add the noise of dt seconds: white, of the bias states, of turning with scale errors, of a time without data."""
    scale, misalignment = noise[6], noise[7]
    t0, t1, t2 = turn[0] * turn[0], turn[1] * turn[1], turn[2] * turn[2]
    g0 = (noise[0] + scale * t0 + misalignment * (t1 + t2)) * dt
    g1 = (noise[0] + scale * t1 + misalignment * (t0 + t2)) * dt
    g2 = (noise[0] + scale * t2 + misalignment * (t0 + t1)) * dt
    for i in range(3):
        for j in range(3):
            Q[6 + i, 6 + j] += c[i, 0] * c[j, 0] * g0 + c[i, 1] * c[j, 1] * g1 + c[i, 2] * c[j, 2] * g2
        Q[3 + i, 3 + i] += noise[1] * dt + HELD_VELOCITY * HELD_VELOCITY * held
        Q[6 + i, 6 + i] += HELD_ATTITUDE * HELD_ATTITUDE * held
        Q[9 + i, 9 + i] += noise[3] * dt
        Q[12 + i, 12 + i] += noise[5] * dt


@kernel(
    "i8(f8[::1], f8[::1], f8[:, ::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], "
    "i8, f8, f8[::1], f8[:, ::1], f8[:, ::1])"
)
def propagate_inertial(  # type: ignore[no-untyped-def]
    position, velocity, dcm, memory, bias, turn, clock,
    time, interval, rate, force, first, until, noise, transition, process_noise,
):  # fmt: skip
    """Advance an inertial state to a time that need not be a sample's, in place.

    A sample that spans ``until`` is used in part, the rest by the next call. Where samples are missing or absurd the
    state is held at its velocity and attitude, and the noise of that time is added.

    Parameters
    ----------
    position, velocity : (3,) arrays
    dcm : (3, 3) array
    memory : (6,) array
        Increments of the last whole sample.
    bias : (6,) array
        Gyroscope and accelerometer bias.
    turn : (3,) array
        Averaged body rate [rad/s].
    clock : (9,) array
        Time of the state; end of the last sample used; seconds held so far; that sample's mean rate and force.
    time, interval : (k,) arrays
    rate, force : (k, 3) arrays
        The samples at hand.
    first : int
        Index of the first that is not used up.
    until : float
    noise : (9,) array
        Gyroscope and accelerometer white noise density; decay and noise density of the gyroscopes' bias, of the
        accelerometers'; ``scale^2 TURN_TIME`` and ``misalignment^2 TURN_TIME`` of the gyroscopes; nominal interval.
        (Order: 0, 1 white; 2, 3 gyroscope bias; 4, 5 accelerometer bias; 6, 7; 8.)
    transition, process_noise : (15, 15) arrays
        Overwritten: the error at ``until`` is ``transition`` times the error before, plus noise.

    Returns
    -------
    int
        Index of the first sample that is not used up.
    """
    eps = 1e-7
    F, A, B = np.zeros((15, 15)), np.empty((15, 15)), np.empty((15, 15))
    mean, before = np.empty((3, 3)), np.empty((3, 3))
    keep = np.empty(6)
    W = np.empty((15, 15))
    transition[:] = 0.0
    process_noise[:] = 0.0
    for i in range(15):
        transition[i, i] = 1.0
    t, i, n = clock[0], first, time.size
    nominal = noise[8]
    while t < until - eps:
        begin = t
        end = min(until, t + BLOCK)
        v0, v1, v2 = velocity[0], velocity[1], velocity[2]
        for r in range(3):
            for s in range(3):
                before[r, s] = dcm[r, s]
                mean[r, s] = 0.0
        held, s0, s1, s2 = 0.0, 0.0, 0.0, 0.0
        while t < end - eps:
            while i < n and (
                time[i] <= t + eps
                or not _usable(rate[i, 0], rate[i, 1], rate[i, 2], force[i, 0], force[i, 1], force[i, 2])
            ):
                i += 1
            hold = False
            whole = 0.0
            if i < n and time[i] - interval[i] <= t + 0.5 * nominal:
                stop = min(time[i], end)
                for r in range(3):
                    clock[3 + r], clock[6 + r] = rate[i, r], force[i, r]
                clock[1] = stop
                if stop >= time[i] - eps:
                    whole = interval[i]
            elif i < n:
                stop = min(time[i] - interval[i], end)
                hold = True
            elif clock[1] >= 0.0 and t < clock[1] + 1.5 * nominal:
                stop = min(clock[1] + 2.0 * nominal, end)  # the step ends between samples: carry the last one on
            else:
                stop = end
                hold = True
            dt = stop - t
            if hold:
                meridian, prime = radii_scalar(sin(position[0]))
                position[0] += dt * velocity[0] / (meridian + position[2])
                position[1] += dt * velocity[1] / ((prime + position[2]) * cos(position[0]))
                position[2] -= dt * velocity[2]
                memory[:] = 0.0
                held += dt
            else:
                w0, w1, w2 = clock[3] - bias[0], clock[4] - bias[1], clock[5] - bias[2]
                f0, f1, f2 = clock[6] - bias[3], clock[7] - bias[4], clock[8] - bias[5]
                keep[:] = memory
                mechanize_step(position, velocity, dcm, memory, w0, w1, w2, f0, f1, f2, dt)
                if whole > 0.0:
                    memory[0], memory[1], memory[2] = w0 * whole, w1 * whole, w2 * whole
                    memory[3], memory[4], memory[5] = f0 * whole, f1 * whole, f2 * whole
                else:
                    memory[:] = keep
                s0, s1, s2 = s0 + w0 * dt, s1 + w1 * dt, s2 + w2 * dt
            for r in range(3):
                for s in range(3):
                    mean[r, s] += dcm[r, s] * dt
            t = stop
        block = end - begin
        shift = 0.5 * min(nominal, block)
        for r in range(3):
            for s in range(3):
                mean[r, s] = (mean[r, s] - shift * (dcm[r, s] - before[r, s])) / block
        # Mean specific force from the change of velocity: f = v' + (2 w_ie + w_en) x v - g
        sl, cl = sin(position[0]), cos(position[0])
        meridian, prime = radii_scalar(sl)
        m0, m1, m2 = 0.5 * (v0 + velocity[0]), 0.5 * (v1 + velocity[1]), 0.5 * (v2 + velocity[2])
        x0 = 2.0 * ROTATION_RATE * cl + m1 / (prime + position[2])
        x1 = -m0 / (meridian + position[2])
        x2 = -2.0 * ROTATION_RATE * sl - m1 / (prime + position[2]) * sl / cl
        f0 = (velocity[0] - v0) / block + x1 * m2 - x2 * m1
        f1 = (velocity[1] - v1) / block + x2 * m0 - x0 * m2
        f2 = (velocity[2] - v2) / block + x0 * m1 - x1 * m0 - gravity_scalar(sl, position[2])
        _dynamics(F, position, velocity, mean, f0, f1, f2, noise[2], noise[4])
        weight = min(1.0, block / TURN_TIME)
        turn[0] += weight * (s0 / block - turn[0])
        turn[1] += weight * (s1 / block - turn[1])
        turn[2] += weight * (s2 / block - turn[2])
        _advance_rows(F, block, transition, A, B)
        # Half the noise enters before the block and half after: second order in its length.
        _add_noise(process_noise, mean, 0.5 * block, turn, noise, 0.5 * held)
        _advance_rows(F, block, process_noise, A, B)
        for r in range(15):
            for s in range(15):
                W[r, s] = process_noise[s, r]
        _advance_rows(F, block, W, A, B)
        for r in range(15):
            for s in range(r + 1):
                process_noise[r, s] = W[r, s]
                process_noise[s, r] = W[r, s]
        _add_noise(process_noise, mean, 0.5 * block, turn, noise, 0.5 * held)
        clock[2] += held
        decay_g, decay_a = exp(-noise[2] * block), exp(-noise[4] * block)
        for r in range(3):
            bias[r] *= decay_g
            bias[3 + r] *= decay_a
    clock[0] = until
    return i


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[::1], f8[::1], f8)")
def propagate_covariance(covariance, transition, process_noise, calibration, rate, density, elapsed):  # type:
    """``P = Phi P Phi' + Q`` in place, where the states from the m-th on are Gauss-Markov biases of their own.

    Parameters
    ----------
    covariance : (n, n) array
    transition, process_noise : (m, m) arrays
        Of the first m states.
    calibration : (n - m,) array
        Values of the others; they decay.
    rate, density : (n - m,) arrays
        Inverse of their correlation times [1/s], and their noise densities.
    elapsed : float
        [s]. The discretisation is exact, so that a stationary state stays stationary in a step of any length.
    """
    n, m = covariance.shape[0], transition.shape[0]
    X = np.zeros((m, n))
    decay, noise = np.empty(n - m), np.empty(n - m)
    for i in range(n - m):
        decay[i] = exp(-rate[i] * elapsed)
        calibration[i] *= decay[i]
        noise[i] = density[i] * elapsed
        if rate[i] > 0.0:
            noise[i] = density[i] * (1.0 - decay[i] * decay[i]) / (2.0 * rate[i])
    for i in range(m):
        for k in range(m):
            x = transition[i, k]
            if x != 0.0:
                for j in range(n):
                    X[i, j] += x * covariance[k, j]
    T = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            T[i, j] = transition[j, i]
    Y = np.zeros((m, m))
    for i in range(m):
        for k in range(m):
            x = X[i, k]
            for j in range(m):
                Y[i, j] += x * T[k, j]
    for i in range(m):
        for j in range(i + 1):
            x = 0.5 * (Y[i, j] + Y[j, i]) + process_noise[i, j]
            covariance[i, j] = x
            covariance[j, i] = x
        for j in range(m, n):
            x = X[i, j] * decay[j - m]
            covariance[i, j] = x
            covariance[j, i] = x
    for i in range(m, n):
        for j in range(m, n):
            covariance[i, j] *= decay[i - m] * decay[j - m]
        covariance[i, i] += noise[i - m]


@kernel("void(f8[::1], f8[::1], f8[:, ::1], f8[::1], f8[::1], f8[::1])")
def correct_inertial(position, velocity, dcm, bias, calibration, dx):  # type: ignore[no-untyped-def]
    """Add the correction ``dx`` to a state, in place; the attitude is turned by ``exp(dx[6:9] x)`` from the left."""
    meridian, prime = radii_scalar(sin(position[0]))
    position[1] += dx[1] / ((prime + position[2]) * cos(position[0]))
    position[0] += dx[0] / (meridian + position[2])
    position[2] -= dx[2]
    r0, r1, r2 = dx[6], dx[7], dx[8]
    a, b = rotation_coefficients(r0 * r0 + r1 * r1 + r2 * r2)
    for j in range(3):
        c0, c1, c2 = dcm[0, j], dcm[1, j], dcm[2, j]
        x0, x1, x2 = cross(r0, r1, r2, c0, c1, c2)
        y0, y1, y2 = cross(r0, r1, r2, x0, x1, x2)
        dcm[0, j] = c0 + a * x0 + b * y0
        dcm[1, j] = c1 + a * x1 + b * y1
        dcm[2, j] = c2 + a * x2 + b * y2
    for j in range(3):
        velocity[j] += dx[3 + j]
    for j in range(6):
        bias[j] += dx[9 + j]
    for j in range(calibration.size):
        calibration[j] += dx[15 + j]


_NO_TIMES, _NO_VECTORS = np.empty(0), np.empty((0, 3))
_GRAVITY = 9.81


class InertialModel(ErrorModel):
    """The model of the module.

    Parameters
    ----------
    calibrate : bool
        False: 15 states, no calibration of the aiding instruments.

    Attributes
    ----------
    position, velocity : (3,) array
    dcm : (3, 3) array
    bias : (6,) array
    calibration : (n - 15,) array
        Of the aiding instruments.
    bias_at, scale_at : dict of str to int
        Index in the error state of an instrument's first bias, and of its scale factor.
    noise : dict of str to (d, d) array
        White noise of an instrument.
    raw_rate : (3,) array
        Angular rate of the last IMU sample used, as measured.
    transition, process_noise : (15, 15) array
        Of the last propagation.
    """

    state = ("position", "velocity", "dcm", "bias", "calibration")

    def __init__(self, calibrate: bool = True):
        self.calibrate = calibrate

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without an IMU."""
        imu = instruments.imu
        if imu is None:
            raise UnsuitableScenario("it needs an IMU")
        self.instruments = instruments
        self.time = start.time
        self.position = np.array(start.position, dtype=np.float64)
        self.velocity = np.array(start.velocity, dtype=np.float64)
        self.dcm = np.ascontiguousarray(dcm_from_rpy(start.attitude))
        self.bias, self._memory, self._turn = np.zeros(6), np.zeros(6), np.zeros(3)
        self._clock = np.zeros(9)
        self._clock[0], self._clock[1] = start.time, -1e9
        self.raw_rate = self._clock[3:6]
        self.transition, self.process_noise = np.empty((_NAV, _NAV)), np.empty((_NAV, _NAV))
        self.load(None)
        gyro, level, vertical = self._sensors(imu)
        self._aids()
        n = self.size
        covariance = np.zeros((n, n))
        covariance[:9, :9] = start.covariance
        variance = [*[gyro] * 3, level, level, vertical, *(v for v, _, _ in self._states)]
        covariance[range(9, n), range(9, n)] = variance
        return covariance

    def _sensors(self, imu: ImuDatasheet) -> tuple[float, float, float]:
        """Noise of the IMU; return the bias variances: gyroscopes, level accelerometers, vertical accelerometer."""
        g, a = imu.gyroscope, imu.accelerometer
        gyro = triad_bias(g)
        # A level vehicle: gravity on the vertical axis, and on the others through their misalignment.
        level, vertical = triad_bias(a, a.misalignment * _GRAVITY), triad_bias(a, a.scale * _GRAVITY)
        dt = 1.0 / imu.rate
        gyro_white = g.random_walk**2 + gyro.white
        self._noise = np.array([
            gyro_white,
            a.random_walk**2 + level.white,
            gyro.decay, gyro.noise,
            min(level.decay, vertical.decay), max(level.noise, vertical.noise),
            g.scale**2 * TURN_TIME, g.misalignment**2 * TURN_TIME,
            dt,
        ])  # fmt: skip
        self._rate_variance = gyro_white / dt
        return gyro.variance, level.variance, vertical.variance

    def _aids(self) -> None:
        """Calibration states and white noise of the aiding instruments."""
        self.bias_at: dict[str, int] = {}
        self.scale_at: dict[str, int] = {}
        self.noise: dict[str, Array] = {}
        self._jacobians: dict[str, Array] = {}
        self._states: list[tuple[float, float, float]] = []  # initial variance, decay, noise density
        for sheet in self.instruments.values():
            if not self.observes(sheet):
                continue
            states = [
                gauss_markov(b, s, sheet.correlation_time, shortest=0.5 / sheet.rate)
                for b, s in zip(sheet.bias, sheet.bias_instability)
            ]
            if sheet.kind == "speed_log":
                current = GaussMarkov(CURRENT**2, 1.0 / CURRENT_TIME, 2.0 * CURRENT**2 / CURRENT_TIME, 0.0)
                states = [GaussMarkov(states[0].variance + current.variance, current.decay, current.noise, 0.0)]
            fast = sheet.correlation_time < 0.5 / sheet.rate
            white = sheet.bias_instability**2 if fast else np.zeros(len(states))
            if not self.calibrate:
                white = white + [s.variance for s in states]
            elif any(s.variance or s.noise for s in states):
                self.bias_at[sheet.name] = _NAV + len(self._states)
                self._states += [(s.variance, s.decay, s.noise) for s in states]
            if self.calibrate and sheet.kind in ("dvl", "speed_log") and (sheet.scale or np.any(sheet.misalignment)):
                self.scale_at[sheet.name] = _NAV + len(self._states)
                extra = sheet.misalignment if sheet.kind == "dvl" else ()
                self._states += [(x * x, 0.0, 0.0) for x in (sheet.scale, *extra)]
            self.noise[sheet.name] = measurements.white_noise(sheet, white, self._rate_variance)
        self._states += self._more_states()
        self.size = _NAV + len(self._states)
        self.calibration = np.zeros(len(self._states))
        self._decay = np.array([d for _, d, _ in self._states])
        self._density = np.array([q for _, _, q in self._states])

    def _more_states(self) -> list[tuple[float, float, float]]:
        """A hook: initial variance, decay and noise density of further calibration states."""
        return []

    def observes(self, instrument: Datasheet) -> bool:
        """Every kind of instrument."""
        return instrument.kind in measurements.MODELS

    def load(self, imu: ImuSamples | None) -> None:
        """Take the IMU samples of the step that follows."""
        self._first = 0
        self._samples: tuple[Array, Array, Array, Array]
        if imu is None or len(imu) == 0:
            self._samples = (_NO_TIMES, _NO_TIMES, _NO_VECTORS, _NO_VECTORS)
        else:
            self._samples = (imu.time, imu.interval, imu.angular_rate, imu.specific_force)
            if not all(a.flags.c_contiguous and a.flags.writeable and a.dtype == np.float64 for a in self._samples):
                time, interval, rate, force = (np.array(a, dtype=np.float64) for a in self._samples)
                self._samples = (time, interval, rate, force)

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance through the samples loaded."""
        elapsed = until - self.time
        if elapsed <= 0.0:
            return
        self._first = propagate_inertial(
            self.position, self.velocity, self.dcm, self._memory, self.bias, self._turn, self._clock,
            *self._samples, self._first, until, self._noise, self.transition, self.process_noise,
        )  # fmt: skip
        self.time = until
        propagate_covariance(
            covariance, self.transition, self.process_noise, self.calibration, self._decay, self._density, elapsed
        )

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error through the last propagation, in place."""
        m = len(self.transition)
        error[:m] = self.transition @ error[:m]
        error[m:] *= np.exp(-self._decay * elapsed)

    @property
    def held(self) -> float:
        """Seconds without usable IMU data so far."""
        return float(self._clock[2])

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement (`estimators.models.measurements`)."""
        sheet = self.instruments[measurement.instrument]
        jacobian = self._jacobians.get(sheet.name)
        if jacobian is None:
            jacobian = self._jacobians[sheet.name] = np.zeros((len(sheet.sigma), self.size))
        return measurements.MODELS[sheet.kind](self, sheet, measurement.value, jacobian)

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        correct_inertial(self.position, self.velocity, self.dcm, self.bias, self.calibration, dx)

    def estimate(self, covariance: Array) -> Estimate:
        """The state as an estimate, all nine components."""
        c = self.dcm
        c20, c21, c22 = float(c[2, 0]), float(c[2, 1]), float(c[2, 2])
        attitude = np.array([atan2(c21, c22), atan2(-c20, hypot(c21, c22)), atan2(float(c[1, 0]), float(c[0, 0]))])
        return Estimate(self.time, self.position.copy(), self.velocity.copy(), attitude, covariance[:9, :9].copy())
