"""The inertial navigation graph for GTSAM: nodes, factors, and the conversion of what comes out.

A node is a pose (body to `TangentFrame`), a velocity and a bias, GTSAM's variables x, v, b; between nodes there is one
`CombinedImuFactor` (`simnav.estimators.solvers.gtsam_preintegration`).

Aids: `GPSFactorArm` for GNSS positions. For all others GTSAM has nothing that fits; they are `CustomFactor` with the
measurement models of `simnav.estimators.models.measurements`, of 15 states: biases, scale factor and misalignment of
the aids count as white noise. Their Jacobian is converted by the frame's error map.

A custom factor calls Python each time that it is linearised, for 17 us. The alternative is a container of the factor as
it was linearised at first (`LinearContainerFactor`). Measured in the open sea it saves nothing, for few factors are
linearised again (an epoch of the fixed-lag smoother takes 4.0 ms with one and 4.3 ms with the other), and it costs
0.3 mm, 0.14 mm/s and 44 urad of accuracy. So all are custom, and exact.

Source: F. Dellaert and others, GTSAM 4.3.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.models.base import Linearised
from simnav.estimators.models.filtering import NOWHERE, Aid
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_errors import ERROR, PART, TRIAD
from simnav.estimators.models.measurements import (
    DVL,
    GNSS_POSITION,
    GNSS_VELOCITY,
    SPEED_LOG,
    State,
    observe_inertial,
)
from simnav.estimators.models.stated_sigmas import with_stated_sigmas
from simnav.geometry.rotation import rpy_from_dcm
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement

from .gtsam_preintegration import Preintegration
from .tangent_frame import TANGENT, TANGENT_PART, GeodeticState, LocalState, TangentFrame, tangent_state

__all__ = ["InertialGraph", "Observation", "TangentState", "observe_tangent"]

#: Correlations of less than this between the groups of a prior are left out.
LEAST_CORRELATION = 1e-2
#: Least initial sigmas of gyroscope [rad/s] and accelerometer [m/s^2] biases: a prior must be invertible.
LEAST_BIAS = 1e-10, 1e-8


class TangentState(NamedTuple):
    """A state in a `TangentFrame`.

    Attributes
    ----------
    rotation : (3, 3) array
        From body to frame.
    place, speed : (3,) array
        Position [m] and velocity [m/s] in the frame.
    rate : (3,) array
        Body rate as measured [rad/s].
    bias : (6,) array
        Biases of the accelerometers [m/s^2], and of the gyroscopes [rad/s].
    """

    rotation: Matrix
    place: Vector
    speed: Vector
    rate: Vector
    bias: Vector


@kernel
def observe_tangent(
    aid: tuple[int, Vector],
    value: Vector,
    origin: Vector,
    axes: Matrix,
    state: TangentState,
    error: Vector,
    jacobian: Matrix,
) -> int:
    """Compute prediction minus measurement, and its Jacobian, for a state in a `TangentFrame`.

    Parameters
    ----------
    aid, value
        Code and lever arm, and measured value, as in `simnav.estimators.models.measurements.observe_inertial`.
    origin, axes : arrays
        Origin and axes of the frame, see `TangentFrame`.
    state : TangentState
        The state.
    error : (3,) array
        Overwritten with prediction minus measurement.
    jacobian : (3, 15) array
        Overwritten with the Jacobian with respect to rotation and displacement in body axes, velocity in the frame, and
        bias.

    Returns
    -------
    int
        Number of components; 0 if there is no such measurement at this state.
    """
    code, arm = aid
    there = GeodeticState(np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((9, 9)))
    tangent_state(origin, axes, LocalState(state.rotation, state.place, state.speed), there, np.empty(3))
    nothing, ours = np.empty(0), np.empty((3, ERROR.calibration))
    gyroscopes = state.bias[3:]  # GTSAM has them behind the accelerometers
    at = State(there.position, there.velocity, there.dcm, state.rate, gyroscopes, nothing)
    d = observe_inertial(Aid(code, arm, NOWHERE, NOWHERE), value, at, error, ours)
    for i in range(d):
        error[i] = -error[i]
        for j in range(TANGENT.accelerometer_bias):
            x = 0.0
            for k in range(ERROR.gyroscope_bias):
                x += ours[i, k] * there.error_map[k, j]
            jacobian[i, j] = x
        for j in range(3):
            jacobian[i, TANGENT.accelerometer_bias + j] = ours[i, ERROR.accelerometer_bias + j]
            jacobian[i, TANGENT.gyroscope_bias + j] = ours[i, ERROR.gyroscope_bias + j]
    return d


class Observation(NamedTuple):
    """The data of the factor of a measurement on a node.

    Attributes
    ----------
    measurement : Measurement
        The measurement of the factor.
    noise : (m, m) array
        Covariance of its noise.
    node : int
        Index of the node that it belongs to.
    rate : (3,) array
        Body rate there, as measured [rad/s].
    """

    measurement: Measurement
    noise: Array
    node: int
    rate: Array


class InertialGraph:
    """Makes the nodes and factors of a run; the newest node, and what happened since, is at hand.

    Attributes
    ----------
    frame : TangentFrame
        The local frame of the graph.
    motion : Preintegration
        From the newest node on.
    node : int
        Number of the newest node.
    start_covariance : (15, 15) array
        Of node 0's variables.
    """

    def begin(self, start: InitialState, instruments: Instruments) -> tuple[Any, Any]:
        """Node 0; returns its prior factors and its values. Raises UnsuitableScenario without an IMU."""
        import gtsam

        self.model = with_stated_sigmas(InertialModel(calibrate=False), instruments)
        covariance = self.model.begin(start, instruments)
        covariance = covariance[: ERROR.calibration, : ERROR.calibration].copy()
        index = np.arange(ERROR.gyroscope_bias, ERROR.calibration)
        covariance[index, index] = np.maximum(covariance[index, index], np.repeat(np.square(LEAST_BIAS), 3))
        self.frame = frame = TangentFrame(start.position)
        turn = frame.turn(start.position)
        state = gtsam.NavState(gtsam.Rot3(turn @ self.model.dcm), frame.local(start.position), turn @ start.velocity)
        bias = gtsam.imuBias.ConstantBias()
        variance = np.diag(covariance)[ERROR.gyroscope_bias :]
        self.motion = Preintegration(self.model._noise, variance, frame, start.time, self.model.flat_lines)
        self.motion.begin(state, bias)
        self.node, self._rate = 0, np.zeros(3)
        self._aid = {name: (aid.code, np.array(aid.lever_arm)) for name, aid in self.model.aid_parameters.items()}
        inverse = np.linalg.inv(self._error_map(state))
        self.start_covariance = inverse @ covariance @ inverse.T
        return self.prior(0, state, bias, self.start_covariance), self.values(0, state, bias)

    def keys(self, node: int) -> tuple[int, int, int]:
        """Keys of a node's pose, velocity and bias."""
        return _X + node, _V + node, _B + node

    def prior(self, node: int, state: Any, bias: Any, covariance: Array) -> Any:
        """Factors that hold a node at a state, with a (15, 15) covariance of its variables.

        Where its groups (rotation, position, velocity, bias) are uncorrelated they are GTSAM's own priors; else a
        container of one linear factor, which GTSAM does not turn with the node: once the heading is corrected by w, it
        pulls a position in a direction that is off by w/2.
        """
        import gtsam

        graph = gtsam.NonlinearFactorGraph()
        (x, v, b), part = self.keys(node), TANGENT_PART
        sigma = np.sqrt(np.diag(covariance))
        correlation = covariance / sigma / sigma[:, None]
        for group in (part.rotation, part.place, part.speed, part.bias):
            correlation[group, group] = 0.0
        if np.abs(correlation).max() > LEAST_CORRELATION:
            root = np.linalg.inv(np.linalg.cholesky(0.5 * (covariance + covariance.T)))
            unit = gtsam.noiseModel.Unit.Create(15)
            linear = gtsam.JacobianFactor(
                x, root[:, part.pose], v, root[:, part.speed], b, root[:, part.bias], np.zeros(15), unit
            )
            graph.push_back(gtsam.LinearContainerFactor(linear, self.values(node, state, bias)))
            return graph
        gaussian = gtsam.noiseModel.Gaussian.Covariance
        turn = state.pose().rotation().matrix()
        place, rotation = turn @ covariance[part.place, part.place] @ turn.T, state.pose().rotation()
        graph.push_back(gtsam.PoseRotationPrior3D(x, rotation, gaussian(covariance[part.rotation, part.rotation])))
        graph.push_back(gtsam.GPSFactor(x, state.position(), gaussian(place)))
        graph.push_back(gtsam.PriorFactorPoint3(v, state.velocity(), gaussian(covariance[part.speed, part.speed])))
        graph.push_back(gtsam.PriorFactorConstantBias(b, bias, gaussian(covariance[part.bias, part.bias])))
        return graph

    def values(self, node: int, state: Any, bias: Any) -> Any:
        """The variables of a node."""
        import gtsam

        x, v, b = self.keys(node)
        values = gtsam.Values()
        values.insert(x, state.pose())
        values.insert(v, state.velocity())
        values.insert(b, bias)
        return values

    def extend(self) -> tuple[Any, Any]:
        """Make a node of where the motion has led; returns its IMU factor and values."""
        motion = self.motion
        state = motion.predict()
        factor = motion.factor(self.keys(self.node), self.keys(self.node + 1))
        self.node += 1
        self._rate = motion.rate
        motion.begin(state, motion.bias)
        return factor, self.values(self.node, state, motion.bias)

    def linearise(self, measurement: Measurement) -> Linearised | None:
        """A measurement at the state that the motion has led to; None where it says nothing usable."""
        model, state = self.model, self.motion.predict()
        there = self._geodetic(state)
        model.position[:], model.velocity[:], model.dcm[:] = there.position, there.velocity, there.dcm
        model.bias[TRIAD.gyroscopes] = self.motion.bias.gyroscope()
        model.bias[TRIAD.accelerometers] = self.motion.bias.accelerometer()
        model.raw_rate[:] = self.motion.rate
        return model.measure(measurement)

    def observe(self, measurement: Measurement, noise: Array) -> Observation:
        """A measurement on the newest node, with its (m, m) noise."""
        return Observation(measurement, noise, self.node, self._rate)

    def aid(self, observation: Observation) -> Any:
        """The factor of a measurement."""
        import gtsam

        measurement, noise, node, rate = observation
        name, value = measurement.instrument, np.array(measurement.value, dtype=np.float64)
        code, arm = self._aid[name]
        if code == GNSS_POSITION:
            turn = self.frame.turn(value)
            gaussian = gtsam.noiseModel.Gaussian.Covariance(turn @ noise @ turn.T)
            return gtsam.GPSFactorArm(self.keys(node)[0], self.frame.local(value), arm, gaussian)
        x, v, b = self.keys(node)
        origin, axes, m = self.frame.origin, self.frame.axes, len(noise)
        moving = code in (GNSS_VELOCITY, DVL, SPEED_LOG)
        with_rate = moving and bool(np.any(arm))
        still, unbiased = np.zeros(3), np.zeros(6)

        def error(_: Any, values: Any, jacobians: Any) -> Array:
            pose = values.atPose3(x)
            rotation = np.ascontiguousarray(pose.rotation().matrix())
            speed = values.atPoint3(v) if moving else still
            bias = values.atConstantBias(b).vector() if with_rate else unbiased
            e, h = np.zeros(3), np.zeros((3, 15))
            state = TangentState(rotation, np.array(pose.translation()), speed, rate, bias)
            observe_tangent((code, arm), value, origin, axes, state, e, h)
            if jacobians is not None:
                jacobians[0] = h[:m, TANGENT_PART.pose]
                if moving:
                    jacobians[1] = h[:m, TANGENT_PART.speed]
                if with_rate:
                    jacobians[2] = h[:m, TANGENT_PART.bias]
            return e[:m]

        keys = [x, v, b] if with_rate else [x, v] if moving else [x]
        return gtsam.CustomFactor(gtsam.noiseModel.Gaussian.Covariance(noise), keys, error)

    def read(self, values: Any, node: int) -> tuple[Any, Any]:
        """State and bias of a node among GTSAM's values."""
        import gtsam

        x, v, b = self.keys(node)
        return gtsam.NavState(values.atPose3(x), values.atPoint3(v)), values.atConstantBias(b)

    def navigation(self, state: Any) -> tuple[Array, Array, Array]:
        """Geodetic position, velocity and roll-pitch-yaw of a gtsam.NavState."""
        there = self._geodetic(state)
        return there.position, there.velocity, rpy_from_dcm(there.dcm)

    def estimate(self, covariance: Array) -> Estimate:
        """Where the motion has led, from the (15, 15) covariance of the newest node."""
        state = self.motion.predict()
        to_ours = self._error_map(state)[PART.navigation]
        ours = to_ours @ self.motion.carry(covariance) @ to_ours.T
        return Estimate(self.motion.time, *self.navigation(state), 0.5 * (ours + ours.T))

    def _error_map(self, state: Any) -> Array:
        """(15, 15) matrix from a change of a node's variables to the error of `InertialModel`."""
        full, axis = np.zeros((15, 15)), np.arange(3)
        full[: ERROR.gyroscope_bias, : TANGENT.accelerometer_bias] = self._geodetic(state).error_map
        full[ERROR.gyroscope_bias + axis, TANGENT.gyroscope_bias + axis] = 1.0
        full[ERROR.accelerometer_bias + axis, TANGENT.accelerometer_bias + axis] = 1.0
        return full

    def _geodetic(self, state: Any) -> GeodeticState:
        """A gtsam.NavState as `InertialModel` has it."""
        return self.frame.state(state.pose().rotation().matrix(), state.position(), state.velocity())


_X, _V, _B = (ord(letter) << 56 for letter in "xvb")
