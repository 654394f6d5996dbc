"""The inertial model for sigma-point solvers: points through the mechanization and the true measurement functions.

A point is retracted from the model's state as a correction is: metres north-east-down over the radii, velocity and
biases added, the attitude turned by ``exp(phi x)`` from the left. Calibration states are linear, and only decay.

The points are not propagated through every IMU sample. Only the model's own state is (`InertialModel.propagate`). For
pieces of at most `PIECE` seconds, the exact inverse of the mechanization converts its motion into one equivalent
sample: the mean rate and specific force that lead from its velocity and attitude at the start to those at the end
(preintegration, including coning, sculling and the present bias). Every point is propagated with this sample, minus the
difference of its biases. Compared with the propagation of each point through all samples, an error of 1 mrad or 10 cm/s
differs by less than 1e-4 of itself after a second at sea (a test); the cost is a fiftieth.

The readings of instruments are computed by their nonlinear functions, with one exception, as in the EKF: the products
of a scale factor or a misalignment with the errors of velocity and attitude are neglected. Normally they are of the
order of a thousandth. If a disturbance has led to a wrong scale factor (a constant 0.5 m/s^2 on the accelerometers in
the scenario of Zhan et al. 2026: -0.45), these products keep it at this value, with an error of 13 m instead of 0.5 m.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, ceil, cos, sin, sqrt
from typing import Any, ClassVar

import numpy as np

from simnav.compiled import helper, kernel
from simnav.geometry.earth import radii_scalar
from simnav.geometry.rotation import rotate_left, rotation_coefficients
from simnav.inverse_strapdown import sample_from_motion, small_matrix
from simnav.kernel_types import Matrix, Vector
from simnav.strapdown import mechanize_step
from simnav.types import Array, Measurement

from .filtering import Aid, Dynamics, ModelFunctions, Prediction, Readings, aid_of
from .inertial import InertialModel
from .inertial_errors import ERROR, TRIAD
from .inertial_functions import predict as linearise
from .inertial_functions import propagate as propagate_linearised
from .inertial_functions import retract, state_of
from .measurements import (
    HEADING,
    NAVIGATION_STATES,
    SPEED_LOG,
    State,
    observe_inertial,
)
from .points import PointModel, predict_through, propagate_through
from .propagation import IMU_NOISE, Samples, motion_of, time_of

__all__ = ["PIECE", "InertialPoints", "observe_points", "propagate_points"]

#: Longest piece of the motion that one equivalent sample stands for [s].
PIECE = 0.5


@helper
def _turn(dcm: Array, r0: float, r1: float, r2: float, turned: Array) -> None:
    """Compute ``turned = exp(r x) dcm``."""
    a, b = rotation_coefficients(r0 * r0 + r1 * r1 + r2 * r2)
    rotate_left(dcm, r0, r1, r2, a, b, turned)


@kernel
def propagate_points(before: Vector, after: Vector, constants: Vector, decay: Vector, errors: Matrix) -> None:
    """Propagate points through one piece of a state's motion, in place.

    Parameters
    ----------
    before, after : (MOTION_NUMBERS + c,) arrays
        The flat state (`simnav.estimators.models.propagation.motion_of`) with c calibration states, at the start and at
        the end of the piece.
    constants : (9,) array
        An `IMU_NOISE`.
    decay : (c,) array
        Inverse correlation times of the calibration states [1/s].
    errors : (k, ERROR.calibration + c) array
        Differences of the points from the state at the start; overwritten with those at the end.
    """
    start, end = motion_of(before), motion_of(after)
    position, velocity, dcm, next_velocity = start.position, start.velocity, start.dcm, end.velocity
    c, d, interval, imu = dcm, end.dcm, time_of(end) - time_of(start), constants.view(IMU_NOISE)[0]
    memory = np.zeros(6)
    sample = sample_from_motion(
        position[0],
        position[2],
        (velocity[0], velocity[1], velocity[2]),
        (next_velocity[0], next_velocity[1], next_velocity[2]),
        small_matrix(c),
        small_matrix(d),
        memory,
        interval,
    )
    rate, force = sample.angular_rate, sample.specific_force
    end_latitude = position[0] + sample.displacement[0]
    end_longitude = position[1] + sample.displacement[1]
    end_height = position[2] + sample.displacement[2]
    meridian, prime = radii_scalar(sin(position[0]))
    north, east = meridian + position[2], (prime + position[2]) * cos(position[0])
    meridian, prime = radii_scalar(sin(end_latitude))
    next_north, next_east = meridian + end_height, (prime + end_height) * cos(end_latitude)
    keep_g, keep_a = np.exp(-imu.gyroscope_decay * interval), np.exp(-imu.accelerometer_decay * interval)
    for j in range(decay.size):
        keep = np.exp(-decay[j] * interval)
        for k in range(errors.shape[0]):
            errors[k, ERROR.calibration + j] *= keep
    p, v, m = np.empty(3), np.empty(3), np.empty((3, 3))
    for k in range(errors.shape[0]):
        still = True
        for j in range(ERROR.calibration):
            still = still and errors[k, j] == 0.0
        if still:
            continue
        p[0] = position[0] + errors[k, ERROR.position] / north
        p[1] = position[1] + errors[k, ERROR.position + 1] / east
        p[2] = position[2] - errors[k, ERROR.position + 2]
        for j in range(3):
            v[j] = velocity[j] + errors[k, ERROR.velocity + j]
        _turn(dcm, errors[k, ERROR.attitude], errors[k, ERROR.attitude + 1], errors[k, ERROR.attitude + 2], m)
        memory[:] = 0.0
        g, a = ERROR.gyroscope_bias, ERROR.accelerometer_bias
        mechanize_step(
            p, v, m, memory,
            (rate[0] - errors[k, g], rate[1] - errors[k, g + 1], rate[2] - errors[k, g + 2]),
            (force[0] - errors[k, a], force[1] - errors[k, a + 1], force[2] - errors[k, a + 2]),
            interval,
        )  # fmt: skip
        errors[k, ERROR.position] = (p[0] - end_latitude) * next_north
        errors[k, ERROR.position + 1] = (p[1] - end_longitude) * next_east
        errors[k, ERROR.position + 2] = end_height - p[2]
        # Rotation vector of C_k C': its skew part holds the sine, its trace the cosine (good below half a turn).
        x0, x1, x2, trace = 0.0, 0.0, 0.0, 0.0
        for j in range(3):
            errors[k, ERROR.velocity + j] = v[j] - next_velocity[j]
            trace += m[0, j] * d[0, j] + m[1, j] * d[1, j] + m[2, j] * d[2, j]
            x0 += 0.5 * (m[2, j] * d[1, j] - m[1, j] * d[2, j])
            x1 += 0.5 * (m[0, j] * d[2, j] - m[2, j] * d[0, j])
            x2 += 0.5 * (m[1, j] * d[0, j] - m[0, j] * d[1, j])
        sine = sqrt(x0 * x0 + x1 * x1 + x2 * x2)
        ratio = 1.0 if sine < 1e-12 else atan2(sine, 0.5 * (trace - 1.0)) / sine
        errors[k, ERROR.attitude], errors[k, ERROR.attitude + 1], errors[k, ERROR.attitude + 2] = (
            ratio * x0,
            ratio * x1,
            ratio * x2,
        )
        for j in range(3):
            errors[k, ERROR.gyroscope_bias + j] *= keep_g
            errors[k, ERROR.accelerometer_bias + j] *= keep_a


@kernel
def observe_points(
    aid: Aid,
    state: State,
    errors: Matrix,
    differences: Matrix,
) -> None:
    """The predicted readings of an instrument at points, minus that at the state.

    The readings are linear in position and calibration (see the module). For the other states the nonlinear function of
    the instrument is evaluated at the point.

    Parameters
    ----------
    aid, state
        Parameters of the instrument and the state, as in `simnav.estimators.models.measurements.observe_inertial`.
    errors : (k, n) array
        Differences of the points from the state.
    differences : (k, d) array
        Overwritten with the differences of the readings.
    """
    code, arm, bias_at, scale_at = aid
    position, velocity, dcm, rate, bias, calibration = state
    n, d = errors.shape[1], differences.shape[1]
    linear, scratch = np.zeros((3, n)), np.zeros((3, 12))
    at_state, reading = np.zeros(3), np.zeros(3)
    value = position  # any will do; for a fix, one nearby is the more accurate
    v, b, m = velocity.copy(), bias[TRIAD.gyroscopes].copy(), dcm.copy()
    through = velocity.copy()  # the water, for a log
    if code == SPEED_LOG and bias_at >= 0:
        for j in range(2):
            through[j] -= calibration[bias_at + 1 + j - NAVIGATION_STATES]
    # First the state, for the Jacobian; then the state as if calibrated, and the points likewise.
    for k in range(-2, errors.shape[0]):
        if k == -1:
            v[:] = through
        if k >= 0:
            for j in range(3):
                v[j], b[j] = through[j] + errors[k, ERROR.velocity + j], bias[j] + errors[k, ERROR.gyroscope_bias + j]
            _turn(dcm, errors[k, ERROR.attitude], errors[k, ERROR.attitude + 1], errors[k, ERROR.attitude + 2], m)
        full = k == -2
        known = observe_inertial(
            Aid(code, arm, bias_at if full else -1, scale_at if full else -1), value,
            State(position, v, m, rate, b, calibration), reading, linear if full else scratch,
        )  # fmt: skip
        if k == -1:
            at_state[:] = reading
        if k < 0:
            continue
        for i in range(d):
            x = at_state[i] - reading[i]
            if code == HEADING:
                x = atan2(sin(x), cos(x))
            if known == 0:  # a point near the vertical
                x = 0.0
                for j in range(ERROR.velocity, ERROR.calibration):
                    x += linear[i, j] * errors[k, j]
            for j in range(ERROR.position, ERROR.velocity):
                x += linear[i, j] * errors[k, j]
            for j in range(ERROR.calibration, n):
                x += linear[i, j] * errors[k, j]
            differences[k, i] = x


@helper
def move_in_pieces(
    advance: Callable[[Any, Samples, float], None],
    advanced: Any,
    samples: Samples,
    until: float,
    numbers: Array,
    constants: Array,
    decay: Array,
    errors: Array,
) -> None:
    """Advance a state to a time, and points through its motion, piece by piece.

    Parameters
    ----------
    advance : callable
        Advances the state to a time: ``advance(advanced, samples, time)``.
    advanced
        What it works on.
    samples : Samples
        The IMU samples of the step.
    until : float
        The time, later than that of the state [s].
    numbers : (MOTION_NUMBERS + c,) array
        The flat state.
    constants, decay, errors
        As of `propagate_points`.
    """
    begin = time_of(motion_of(numbers))
    elapsed = until - begin
    pieces = ceil(elapsed / PIECE - 1e-9)
    for k in range(1, pieces + 1):
        before = numbers.copy()
        advance(advanced, samples, until if k == pieces else begin + elapsed * k / pieces)
        propagate_points(before, numbers, constants, decay, errors)


@kernel
def move(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance state and points; the covariance becomes that of the process noise."""
    dynamics.covariance[:] = 0.0
    move_in_pieces(
        propagate_linearised, dynamics, samples, until, dynamics.numbers, dynamics.constants, dynamics.decay,
        dynamics.points.errors,
    )  # fmt: skip


@kernel(passed=True)
def propagate(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance the state and its covariance to a time, through points."""
    if until > time_of(motion_of(dynamics.numbers)):
        propagate_through(move, retract, dynamics, samples, until)


@kernel
def read(dynamics: Dynamics, readings: Readings, k: int, differences: Matrix) -> None:
    """What an instrument should read at the points, minus what it should read at the state."""
    aid = aid_of(dynamics.aids, readings.instrument[k])
    observe_points(aid, state_of(dynamics.numbers), dynamics.points.errors, differences)


@kernel(passed=True)
def predict(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Compute what a reading should be, and the covariance of that, from points."""
    return predict_through(linearise, read, dynamics, readings, k, prediction)


POINT_FUNCTIONS = ModelFunctions(propagate, predict, retract)


class InertialPoints(InertialModel, PointModel):
    """`InertialModel` with sigma points.

    Parameters
    ----------
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    """

    fused: ClassVar[bool] = True

    def point_functions(self) -> ModelFunctions | None:
        """As `PointModel.point_functions`; None where `functions` is."""
        return None if self.functions() is None else POINT_FUNCTIONS

    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state and the points; return the process noise."""
        noise, elapsed = np.zeros((self.size, self.size)), until - self.time
        move_in_pieces(self._advance, noise, self.samples, until, self.numbers, self._noise, self._decay, errors)
        if self.blocks.clocks:
            self.blocks.carry(errors.T, elapsed)
        return noise

    def _advance(self, noise: Array, samples: Samples, until: float) -> None:
        self.propagate(noise, until)

    def observe_points(self, measurement: Measurement, errors: Array) -> Array:
        """What the instrument should read at the points, minus what it should read at the state."""
        name = measurement.instrument
        if name in self.own:
            own, bias_at = self.own[name], self.bias_at.get(name, -1)
            point = own.point(measurement.time, self.state_of_own(), measurement.side)
            return own.differences(point, self.calibration, errors, NAVIGATION_STATES, bias_at)
        differences = np.empty((len(errors), len(self.noise[name])))
        observe_points.unchecked(self.aid_parameters[name], self._state(), errors, differences)
        return differences
