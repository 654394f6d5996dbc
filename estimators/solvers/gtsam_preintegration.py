"""IMU samples in the form in which GTSAM integrates them, and its preintegration on the rotating Earth.

Preintegration is that of 4.3 on the Galilean group (`PreintegratedCombinedMeasurementsG`, `GalileanCombinedImuFactor`):
it integrates a sample of constant rate and force in closed form, the turn of the axes included. The older
`PreintegratedCombinedMeasurements` sums rotation vectors in a tangent space by Euler's method (0.1 urad a second in a
seaway), and forces in the axes at the start of each sample (millimetres per second). Our samples are means, and the
rate is not constant in an interval: `imu_pieces` adds coning and sculling (as `simnav.strapdown`, Savage 1998).

GTSAM 4.3 moves a factor exactly in the rotating frame: Coriolis, and the centrifugal acceleration about the *origin* of
the frame. Gravity at p contains the centrifugal acceleration of p, so ``g(p) + w x (w x p)`` is handed over, one vector
for a factor, at its middle. That gravity changes with the position is in no Jacobian (the Schuler loop, of 84 minutes).

Biases walk at random with the densities that `InertialModel` uses. GTSAM has no Gauss-Markov decay: the variance of a
bias with a correlation time grows where nothing observes it.

GTSAM keeps a pointer to the parameters in every factor, so each preintegration has its own.

Sources: F. Dellaert and others, GTSAM 4.3; C. Forster et al., "On-manifold preintegration for real-time visual-inertial
odometry", IEEE Trans. Robotics 33(1), 2017.
"""

from __future__ import annotations

from math import ceil
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.models.flat_lines import FlatLineTest
from simnav.estimators.models.inertial_errors import TRIAD
from simnav.estimators.models.propagation import (
    CLOCK,
    HELD_ATTITUDE,
    HELD_VELOCITY,
    IMU_NOISE,
    TURN_TIME,
    Samples,
    next_interval,
)
from simnav.geometry.rotation import cross
from simnav.kernel_types import Matrix, Vector
from simnav.structures import filled, length, structure
from simnav.types import Array, ImuSamples

from .tangent_frame import TANGENT_PART, TangentFrame

__all__ = ["Preintegration", "imu_pieces"]

#: Least density of the biases' random walk, as a fraction of their initial variance [1/s], and least densities at all:
#: a factor needs a covariance that can be inverted, in double precision.
LEAST_WALK, LEAST_GYROSCOPE, LEAST_ACCELEROMETER = 1e-9, 1e-20, 1e-16
#: GTSAM's integration covariance [m^2/s]; it keeps a factor of a single sample invertible: 1 um in a second.
INTEGRATION = 1e-12
#: A stretch without data is integrated in at least so many parts of at most this length [s]: of a single one the noise
#: of velocity and position would be the same.
HELD_PARTS, HELD_PART = 4, 0.1
_EYE = np.eye(3)
#: Noise densities of an IMU that measures, and of one without data.
_MEASURED, _HELD = np.zeros(6), np.repeat(np.square([HELD_ATTITUDE, HELD_VELOCITY]), 3)
#: A piece of constant rate and force; held is 1 where there is no data, and the state is to be held. Unmeasured is the
#: noise density of each axis of the IMU that did not measure.
PIECE = structure(duration=float, rate=3, force=3, held=float, unmeasured=6)


@kernel
def imu_pieces(
    clock: Vector,
    memory: Vector,
    bias: Vector,
    samples: Samples,
    first: int,
    until: float,
    nominal: float,
    pieces: Matrix,
) -> tuple[int, int]:
    """Cut the stretch up to a time into pieces of constant rate and force, as GTSAM integrates them.

    A sample that spans ``until`` is used in part, the rest by the next call; where samples are missing there is a piece
    to be held.

    Parameters
    ----------
    clock : array
        A `simnav.estimators.models.propagation.CLOCK`; updated, but for the seconds held.
    memory : (6,) array
        Angle and velocity increment of the last whole sample; updated.
    bias : (6,) array
        Gyroscopes, accelerometers: taken off for coning and sculling, and put on again.
    samples : Samples
        The IMU samples.
    first : int
        Index of the first sample that is not completely used.
    until, nominal : float
        End of the stretch, and the nominal interval [s].
    pieces : (m, ...) array
        Filled, a `PIECE` in each row. m of twice the samples and four more suffices.

    Returns
    -------
    int, int
        Index of the first sample that is not used up, and the number of pieces.
    """
    eps = 1e-7
    sampled = clock.view(CLOCK)[0]
    rate, force = sampled.mean_rate, sampled.mean_force
    gyroscope, accelerometer = bias[TRIAD.gyroscopes], bias[TRIAD.accelerometers]
    angle, change = memory[TRIAD.gyroscopes], memory[TRIAD.accelerometers]
    t, i, count = sampled.time, first, 0
    while t < until - eps:
        covered = next_interval(sampled, samples, i, t, until, nominal)
        i, stop, whole = covered.sample, covered.stop, covered.whole
        dt = stop - t
        piece = pieces[count].view(PIECE)[0]
        count += 1
        piece.duration, piece.held = dt, 0.0
        for axis in range(6):
            piece.unmeasured[axis] = samples.unmeasured[i, axis] if i < samples.time.size else 0.0
        if covered.hold:
            piece.held = 1.0
            memory[:] = 0.0
        else:
            a0, a1, a2 = (rate[0] - gyroscope[0]) * dt, (rate[1] - gyroscope[1]) * dt, (rate[2] - gyroscope[2]) * dt
            n0 = (force[0] - accelerometer[0]) * dt
            n1 = (force[1] - accelerometer[1]) * dt
            n2 = (force[2] - accelerometer[2]) * dt
            m0, m1, m2 = angle[0], angle[1], angle[2]
            q0, q1, q2 = cross(m0, m1, m2, a0, a1, a2)
            r0, r1, r2 = a0 + q0 / 12.0, a1 + q1 / 12.0, a2 + q2 / 12.0
            x0, x1, x2 = cross(m0, m1, m2, n0, n1, n2)
            y0, y1, y2 = cross(change[0], change[1], change[2], a0, a1, a2)
            s0, s1, s2 = (x0 + y0) / 12.0, (x1 + y1) / 12.0, (x2 + y2) / 12.0
            # GTSAM will turn all of it by half the sample; the sculling is in the axes at the start.
            x0, x1, x2 = cross(r0, r1, r2, s0, s1, s2)
            piece.rate[0], piece.rate[1] = r0 / dt + gyroscope[0], r1 / dt + gyroscope[1]
            piece.rate[2] = r2 / dt + gyroscope[2]
            piece.force[0] = (n0 + s0 - 0.5 * x0) / dt + accelerometer[0]
            piece.force[1] = (n1 + s1 - 0.5 * x1) / dt + accelerometer[1]
            piece.force[2] = (n2 + s2 - 0.5 * x2) / dt + accelerometer[2]
            if whole > 0.0:
                scale = whole / dt
                angle[0], angle[1], angle[2] = a0 * scale, a1 * scale, a2 * scale
                change[0], change[1], change[2] = n0 * scale, n1 * scale, n2 * scale
        t = stop
    sampled.time = max(sampled.time, until)
    return i, count


class ImuNoise(NamedTuple):
    """(3, 3) covariance densities of the gyroscopes and of the accelerometers."""

    gyroscope: Array
    accelerometer: Array


class Preintegration:
    """The motion since the newest node: GTSAM's preintegrated measurements, and the state that they predict.

    Parameters
    ----------
    densities : (9,) array
        Noise parameters of the IMU, see `simnav.estimators.models.propagation.accumulate_error`.
    variance : (6,) array
        Initial variances of the biases, gyroscopes first.
    frame : TangentFrame
        The local frame of the graph.
    time : float
        At which it begins [s].
    flat_lines : FlatLineTest
        Of the samples of the IMU.

    Attributes
    ----------
    state : gtsam.NavState
        State at the start of the integration.
    bias : gtsam.imuBias.ConstantBias
        Of the node at which it begins.
    elapsed : float
        Since the node [s].
    held : float
        Seconds without usable samples so far.
    """

    def __init__(self, densities: Array, variance: Array, frame: TangentFrame, time: float, flat_lines: FlatLineTest):
        self._noise: Any = densities.view(IMU_NOISE)[0]
        self._flat_lines = flat_lines
        self._frame = frame
        gyroscope, accelerometer = float(self._noise.gyroscope_walk), float(self._noise.accelerometer_walk)
        of_gyroscopes, of_accelerometers = (LEAST_WALK * float(variance[triad][0]) for triad in TRIAD)
        self._walk = ImuNoise(
            max(gyroscope, of_gyroscopes, LEAST_WALK * LEAST_GYROSCOPE) * _EYE,
            max(accelerometer, of_accelerometers, LEAST_WALK * LEAST_ACCELEROMETER) * _EYE,
        )
        self._clock, self._memory, self._turn = filled(CLOCK, time=time, used=-1e9), np.zeros(6), np.zeros(3)
        self.held = 0.0
        self.load(None)

    @property
    def time(self) -> float:
        """Of the end [s]."""
        return float(self._clock.view(CLOCK)[0].time)

    @property
    def rate(self) -> Array:
        """Body rate at the end, extrapolated, as measured [rad/s]."""
        return np.array(self._clock.view(CLOCK)[0].rate)

    def load(self, imu: ImuSamples | None) -> None:
        """Take the IMU samples of the step that follows."""
        self._first = 0
        self._samples = self._flat_lines.samples(imu)

    def begin(self, state: Any, bias: Any) -> None:
        """Start anew at a node."""
        import gtsam

        noise, turn = self._noise, self._turn**2
        self.state, self.bias, self.elapsed = state, bias, 0.0
        self._hat = np.array([*bias.gyroscope(), *bias.accelerometer()])
        turning = noise.scale * turn + noise.misalignment * (turn.sum() - turn)
        self._white = ImuNoise(
            np.diag(np.maximum(noise.gyroscope + turning, LEAST_GYROSCOPE)),
            max(float(noise.accelerometer), LEAST_ACCELEROMETER) * _EYE,
        )
        self._params = p = gtsam.PreintegrationCombinedParams(self._frame.gravity(state.position()))
        p.setOmegaCoriolis(self._frame.rotation)
        p.setGyroscopeCovariance(self._white.gyroscope)
        p.setAccelerometerCovariance(self._white.accelerometer)
        p.setIntegrationCovariance(INTEGRATION * _EYE)
        p.setBiasOmegaCovariance(self._walk.gyroscope)
        p.setBiasAccCovariance(self._walk.accelerometer)
        self._measurements = gtsam.PreintegratedCombinedMeasurementsG(p, bias)
        self._end: Any = state

    def revise(self, state: Any, bias: Any) -> None:
        """The node has moved; what was integrated stays, about the former bias."""
        self.state, self.bias = state, bias
        self._end = state if self._measurements.deltaTij() == 0.0 else None

    def advance(self, until: float) -> None:
        """Integrate up to a time."""
        elapsed = until - self.time
        if elapsed <= 0.0:
            return
        pieces = np.empty((2 * len(self._samples.time) + 4, length(PIECE)))
        self._first, count = imu_pieces(
            self._clock, self._memory, self._hat, self._samples, self._first, until, float(self._noise.interval), pieces
        )
        own = pieces[:count].view(PIECE)[:, 0]
        duration, held, force, rate = own["duration"], own["held"], own["force"], own["rate"]
        unmeasured: Array = own["unmeasured"]
        replaced, integrate = np.any(unmeasured, axis=1).tolist(), self._measurements.integrateMeasurement
        for k, dt in enumerate(duration.tolist()):
            if held[k]:
                self._hold(dt)
            elif replaced[k]:
                self._set_noise(unmeasured[k])
                integrate(force[k], rate[k], dt)
                self._set_noise(_MEASURED)
            else:
                integrate(force[k], rate[k], dt)
            self._end = None
        self.elapsed += elapsed
        used = held == 0.0
        mean = (rate[used] - self._hat[TRIAD.gyroscopes]).T @ duration[used] / elapsed
        self._turn += min(1.0, elapsed / TURN_TIME) * (mean - self._turn)

    def _hold(self, dt: float) -> None:
        """No data: attitude and velocity stay as they are, with noise to match."""
        w, state = self._frame.rotation, self.predict()
        back = state.pose().rotation().matrix().T
        place, speed = state.position(), state.velocity()
        force = 2.0 * np.cross(w, speed) + np.cross(w, np.cross(w, place)) - self._frame.gravity(place)
        self._set_noise(_HELD)
        force, rate = back @ force + self._hat[TRIAD.accelerometers], back @ w + self._hat[TRIAD.gyroscopes]
        parts = max(HELD_PARTS, ceil(dt / HELD_PART))
        for _ in range(parts):
            self._measurements.integrateMeasurement(force, rate, dt / parts)
        self._set_noise(_MEASURED)
        self.held += dt

    def _set_noise(self, unmeasured: Array) -> None:
        """Set the noise densities of the IMU: white, and those of the axes that did not measure, gyroscopes first."""
        gyroscope, accelerometer = (np.diag(unmeasured[triad]) for triad in TRIAD)
        self._params.setGyroscopeCovariance(self._white.gyroscope + gyroscope)
        self._params.setAccelerometerCovariance(self._white.accelerometer + accelerometer)

    def predict(self) -> Any:
        """The gtsam.NavState at the end."""
        if self._end is None:
            end = self._measurements.predict(self.state, self.bias)
            self._params.n_gravity = self._frame.gravity(0.5 * (self.state.position() + end.position()))
            self._end = self._measurements.predict(self.state, self.bias)
        return self._end

    def factor(self, begin: tuple[int, int, int], end: tuple[int, int, int]) -> Any:
        """The factor between two nodes, each given by the keys of pose, velocity and bias."""
        import gtsam

        self.predict()  # so that gravity is that of the middle
        return gtsam.GalileanCombinedImuFactor(begin[0], begin[1], end[0], end[1], begin[2], end[2], self._measurements)

    def carry(self, covariance: Array) -> Array:
        """(15, 15) covariance at the end from that at the node: pose, velocity and bias, as GTSAM's variables.

        GTSAM's `NavState` has the velocity in body axes.
        """
        if self._measurements.deltaTij() == 0.0:
            return covariance
        by_state, by_bias = np.zeros((9, 9), order="F"), np.zeros((9, 6), order="F")
        end = self._measurements.predict(self.state, self.bias, by_state, by_bias)
        into, out = np.eye(9), np.eye(15)
        part = TANGENT_PART
        into[part.speed, part.speed] = self.state.pose().rotation().matrix().T
        out[part.speed, part.speed] = end.pose().rotation().matrix()
        transition = np.eye(15)
        transition[part.state, part.state] = by_state @ into
        transition[part.state, part.bias] = by_bias
        moved = transition @ covariance @ transition.T + self._measurements.preintMeasCov()
        carried: Array = out @ moved @ out.T
        return carried
