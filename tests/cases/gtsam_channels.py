"""A peer of tightly coupled windows: GTSAM's fixed-lag smoother over instruments with channels and blocks of states.

The rows of GTSAM (`simnav.estimators.rows.gtsam`) use compiled measurement equations only, so they leave satellites
out. This estimator adds what they lack, by factors of our own:

- a variable of each node for the blocks that the instruments bring along (`simnav.blocks`): the clock of a receiver,
  the troposphere, the lasting error of each range
- between two nodes a linear factor of the motion of the blocks
- one factor for all readings of an instrument at a time: pseudoranges and their rates are predicted by the function of
  the kind (`simnav.kinds.Kind.observations`), and their Jacobian is converted to GTSAM's variables by the error map of
  `simnav.estimators.solvers.tangent_frame.TangentFrame`

It shares datasheets and measurement equations with the windows of simnav. Integration of the IMU, linearisation,
elimination and marginalisation are GTSAM's. It is for tests and benchmarks: where GTSAM finds no solution, it raises.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from simnav.estimators.models.channels import by_channel, owners
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.measurements import State
from simnav.estimators.models.named_state import at_row
from simnav.estimators.solvers.admission import Admission, together
from simnav.estimators.solvers.gtsam_graph import InertialGraph
from simnav.estimators.solvers.gtsam_solvers import LONGEST, THRESHOLDS, FixedLagEstimator
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement, Measurements

__all__ = ["ChannelFixedLag", "ChannelGraph"]

#: Number of states of a node without blocks.
NODE = 15
#: Linear update at which a variable of blocks is linearised again: everything is linear in them.
LINEAR = 1e3
#: A block that does not move has this part of its initial variance as noise, so that its factor has a whitener.
LEAST_NOISE = 1e-12


class ChannelGraph(InertialGraph):
    """The inertial graph with a variable for blocks, and a factor for all readings of an instrument with channels.

    Attributes
    ----------
    full : InertialModel
        Has the places of the blocks, and how they move.
    """

    def begin(self, start: InitialState, instruments: Instruments) -> tuple[Any, Any]:
        """Node 0; its prior factors and its values."""
        import gtsam

        priors, values = super().begin(start, instruments)
        own = [sheet for sheet in instruments.values() if sheet.name in self.model.own]
        self.full = InertialModel()
        variance = self.full.begin(start, Instruments(own, instruments.imu, instruments.step)).diagonal()[NODE:].copy()
        assert not self.full.bias_at, "channels with biases of their own are beyond this peer"
        assert {name for many in self.full.many for name in many.sources} == set(self.full.own)
        self._least, k = LEAST_NOISE * variance, len(variance)
        self._still = gtsam.Values()
        self.moved = np.zeros(k)
        key, unit = _C + 0, gtsam.noiseModel.Unit.Create(k)
        prior = gtsam.JacobianFactor(key, np.diag(variance**-0.5), np.zeros(k), unit)
        at = gtsam.Values()
        at.insert(key, np.zeros(k))
        priors.push_back(gtsam.LinearContainerFactor(prior, at))
        values.insert(key, np.zeros(k))
        return priors, values

    def all_keys(self, node: int) -> tuple[int, ...]:
        """Keys of a node's pose, velocity, bias and blocks."""
        return *self.keys(node), _C + node

    def extend(self) -> tuple[Any, Any]:
        """Make a node of where the motion has led; its factors and values."""
        import gtsam

        elapsed = self.motion.elapsed
        imu, values = super().extend()
        transition, noise = self._motion_of_blocks(elapsed)
        root = np.linalg.inv(np.linalg.cholesky(noise))
        k, before, after = len(root), _C + self.node - 1, _C + self.node
        unit = gtsam.noiseModel.Unit.Create(k)
        linear = gtsam.JacobianFactor(before, -root @ transition, after, root, np.zeros(k), unit)
        at = gtsam.Values()
        for key in (before, after):
            at.insert(key, np.zeros(k))
        factors = gtsam.NonlinearFactorGraph()
        factors.push_back(imu)
        factors.push_back(gtsam.LinearContainerFactor(linear, at))
        self.moved = transition @ self.moved
        values.insert(after, self.moved)
        return factors, values

    def _motion_of_blocks(self, elapsed: float) -> tuple[Array, Array]:
        """Transition matrix and process noise of all blocks over a time [s]."""
        blocks, n = self.full.blocks, self.full.size
        decay, variance = blocks.step(elapsed)
        first = NODE - blocks.first
        transition, noise = np.eye(n), np.zeros((n, n))
        blocks.carry(transition, elapsed)
        blocks.add_noise(noise, elapsed)
        decayed = transition[NODE:, NODE:] @ np.diag(decay[first:])
        return decayed, noise[NODE:, NODE:] + np.diag(np.maximum(variance[first:], self._least))

    def aids(self, readings: Sequence[Measurement]) -> Any:
        """The factor of all readings of one instrument at one time, on the newest node."""
        import gtsam

        names = [m.instrument for m in readings]
        many = next(many for many in self.full.many if names[0] in many.sources)
        time, value = np.array([m.time for m in readings]), np.array([m.value for m in readings])
        channel, side = many.channels(names), np.array([m.side for m in readings])
        x, v, b, c = self.all_keys(self.node)
        n, d = value.shape
        row, rate, k = np.zeros(n, dtype=np.intp), self._rate, self.full.size - NODE

        def error(_: Any, values: Any, jacobians: Any) -> Array:
            pose, bias = values.atPose3(x), values.atConstantBias(b)
            at = self.frame.state(pose.rotation().matrix(), pose.translation(), values.atPoint3(v))
            state = State(at.position, at.velocity, at.dcm, rate, bias.gyroscope(), values.atVector(c))
            innovation, jacobian = many.linearise(time, value, channel, at_row(state, None), row, side)
            if jacobians is not None:
                ours = jacobian.reshape(n * d, NODE + k)
                turned = ours[:, :9] @ at.error_map
                jacobians[0], jacobians[1] = turned[:, :6], turned[:, 6:]
                jacobians[2], jacobians[3] = np.zeros((n * d, 6)), ours[:, NODE:]
            return -innovation.ravel()

        noise = gtsam.noiseModel.Diagonal.Sigmas(np.sqrt(many.noise(side)).ravel())
        return gtsam.CustomFactor(noise, [x, v, b, c], error)


class ChannelFixedLag(FixedLagEstimator):
    """GTSAM's `IncrementalFixedLagSmoother` with the graph of the module; parameters as of `FixedLagEstimator`."""

    def __init__(self, window: int = 20, threshold: float = 1.0, iterations: int = 5):
        super().__init__(window, threshold, iterations)
        self.tight = self.graph = ChannelGraph()

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run with an IMU and instruments with channels; others as the rows of GTSAM use them."""
        instruments = by_channel(instruments)
        prior, values = self.tight.begin(start, instruments)
        self._admission = Admission(instruments, instruments)
        self._owners, self._restarts, self._epoch = owners(instruments), 0, 0
        self._covariance = self.tight.start_covariance
        self._begin(prior, values)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        import gtsam

        graph = self.tight
        factors, values = gtsam.NonlinearFactorGraph(), gtsam.Values()

        def extend(least: float) -> None:
            if graph.motion.elapsed > least:
                motion, node = graph.extend()
                factors.push_back(motion)
                values.insert(node)

        graph.motion.load(measurements.imu)
        admitted = self._admission.admit(measurements, graph.motion.time)
        for readings in together(admitted, self._owners):
            graph.motion.advance(min(readings[0].time, measurements.time))
            own = readings[0].instrument in self._owners
            noise = None if own else graph.linearise(readings[0])
            extend(0.0)
            if own:
                factors.push_back(graph.aids(readings))
            elif noise is not None:
                factors.push_back(graph.aid(graph.observe(readings[0], noise.noise)))
        graph.motion.advance(measurements.time)
        extend(LONGEST)
        if factors.size():
            self._epoch += 1
            self._solve(factors, values)
            keys = list(graph.all_keys(graph.node))
            found = self._values(keys)
            graph.motion.revise(*graph.read(found, graph.node))
            graph.moved = found.atVector(keys[-1])
            self._all = np.ascontiguousarray(self._isam().jointMarginalCovariance(keys).fullMatrix())
            self._covariance = np.ascontiguousarray(self._all[:NODE, :NODE])
        estimate = graph.estimate(self._covariance)
        estimate.states = graph.full.blocks.report(graph.moved, NODE, self._all, everything=False)
        return estimate

    def _isam2_parameters(self) -> Any:
        import gtsam

        parameters = super()._isam2_parameters()
        limits = gtsam.ISAM2ThresholdMap()
        blocks = {"c": [LINEAR] * len(self.tight.moved)}
        for letter, limit in (THRESHOLDS | blocks).items():
            limits.insert((letter, self.threshold * np.array(limit)))
        parameters.setRelinearizeThreshold(limits)
        return parameters


_C = ord("c") << 56
