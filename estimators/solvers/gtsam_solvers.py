"""Estimators whose solver is GTSAM's: incremental fixed-lag smoother, ISAM2, and batch with and without outliers.

One update a step: each distinct time of a measurement makes a node, the factors of the step are handed over together,
and the estimate is the newest node, carried to the end of the step. The covariance is the newest node's joint marginal
of pose, velocity and bias, carried likewise.

GTSAM's incremental solvers make one Gauss-Newton step an update, and linearise a variable again when its linear update
has grown beyond a threshold. They are asked again, up to ``iterations`` times, as long as there is such a variable.

Elimination is by QR: by Cholesky's method GTSAM calls these graphs indeterminate, which tie biases that walk by 1e-8 to
positions.

Where a solver fails (GTSAM's indeterminate system, anything not finite), it begins again with a prior at the newest
node that was good, with the marginal that it had; the step's aiding factors are tried once more, then left out
(diagnostics ``restarts``, ``skipped``).

`BatchFixedLagSmoother` is of no use here: it exposes no marginals to Python and has no cheaper path.

Source: M. Kaess et al., "iSAM2: incremental smoothing and mapping using the Bayes tree", Int. J. Robotics Research
31(2), 2012; H. Yang et al., "Graduated non-convexity for robust spatial perception", IEEE Robotics and Automation
Letters 5(2), 2020; F. Dellaert and others, GTSAM 4.3.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from simnav.estimator.needs import AID, IMU, Needs
from simnav.estimators.composition import Solver
from simnav.estimators.models.channels import by_channel
from simnav.estimators.models.inertial import InertialModel
from simnav.types import (
    Array,
    Estimate,
    InitialState,
    Instruments,
    Measurement,
    Measurements,
    NavigationStates,
)

from .admission import LATE, Admission
from .gtsam_graph import InertialGraph, Observation
from .tangent_frame import TANGENT_PART

__all__ = ["BatchEstimator", "FixedLagEstimator", "GncEstimator", "GtsamEstimator", "Isam2Estimator"]

#: A node without a measurement is made after this long [s]: a factor has one gravity vector.
LONGEST = 2.0
#: Linear update at which a variable is linearised again: pose (rotation [rad], position [m]), velocity [m/s],
#: bias (accelerometers [m/s^2], gyroscopes [rad/s]). Everything is linear in position, nearly so in the biases.
THRESHOLDS = {"x": [5e-3] * 3 + [10.0] * 3, "v": [0.05] * 3, "b": [0.02] * 3 + [1e-3] * 3}


#: Least linear update that is handed on in back-substitution, of rotations [rad] as of positions [m]; GTSAM's 1e-3
#: would leave milliradians undone.
WILDFIRE = 1e-7
#: Sigma of the tie between a linearised factor and its error, in units of that error's sigma.
TIGHT = 1e-3
#: A factor with less is left out.
LEAST_WEIGHT = 1e-4
_Y = ord("y") << 56


class GtsamEstimator(Solver):
    """What the rows share; a subclass makes the solver and says which nodes it needs.

    Parameters
    ----------
    threshold : float
        Scale of the updates at which a variable is linearised again; 1 is `THRESHOLDS`, 0 always.
    iterations : int
        Most updates of the solver in a step.
    """

    slow = True
    refuses: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("model", "adaptation", "weighting", "isolation", "iteration", "smoother"),
        "GTSAM's graph is made from our inertial model and solved by GTSAM alone, to be compared with ours",
    )
    #: Whether every end of a step is a node.
    every_step = False

    @property
    def needs(self) -> Needs:
        """An IMU, and anything to aid it."""
        return (IMU, AID)

    def observes(self, instruments: Instruments) -> Collection[str]:
        """Those with a compiled measurement equation."""
        return [name for name, sheet in instruments.items() if sheet.equation]

    def __init__(self, threshold: float = 1.0, iterations: int = 5):
        if not threshold >= 0.0:
            raise ValueError(f"threshold scales the updates that are linearised again: 0 or more, not {threshold}")
        if iterations < 1:
            raise ValueError(f"iterations is the number of updates in a step: at least 1, not {iterations}")
        self.threshold, self.iterations = threshold, iterations
        self.graph = InertialGraph()

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU and at least one aiding instrument."""
        instruments = by_channel(instruments)
        InertialModel().choose(instruments, self.label)
        prior, values = self.graph.begin(start, instruments)
        observed = self.observes(instruments)
        self._admission = Admission(instruments, observed)
        self._restarts = self._epoch = 0
        self._ends: list[tuple[float, int]] = []
        self._covariance = self.graph.start_covariance
        self._blank = {f"residual.{name}": np.nan for name in observed}
        self._begin(prior, values)

    def __getstate__(self) -> dict[str, Any]:
        if hasattr(self, "_ends"):  # a run has begun
            raise TypeError(f"{self.label}: a graph of GTSAM can be neither copied nor pickled; do so before the run")
        return vars(self)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        graph, step = self.graph, _Step(self.graph)
        motion = graph.motion
        motion.load(measurements.imu)
        for m in self._admission.admit(measurements, motion.time):
            motion.advance(min(m.time, measurements.time))
            linearised = graph.linearise(m)
            if linearised is None:
                self._admission.skipped += 1
                continue
            step.extend()
            step.observe(m, linearised.noise)
        motion.advance(measurements.time)
        if self.every_step or motion.elapsed > LONGEST:
            step.extend()
        diagnostics: dict[str, float | Array] = dict(self._blank)
        if step.motions.size() or step.aids.size():
            self._epoch += 1
            diagnostics.update(self._take(step))
        diagnostics |= {"skipped": float(self._admission.skipped), "restarts": float(self._restarts)}
        if self.every_step:
            self._ends.append((measurements.time, graph.node))
        estimate = graph.estimate(self._covariance)
        estimate.diagnostics = diagnostics
        return estimate

    def _take(self, step: _Step) -> dict[str, float]:
        """Solve with a step's factors: the newest node, its covariance, and diagnostics."""
        import gtsam

        graph = self.graph
        keys = [key for node in range(step.anchor[0], graph.node + 1) for key in graph.keys(node)]
        for attempt in range(3):
            factors, values = gtsam.NonlinearFactorGraph(step.motions), gtsam.Values(step.values)
            try:
                if attempt > 0:
                    self._restarts += attempt == 1
                    factors.push_back(graph.prior(*step.anchor, self._covariance))
                    values.insert(graph.values(*step.anchor))
                    self._renew()
                if attempt < 2:
                    factors.push_back(step.aids)
                else:
                    self._admission.skipped += step.aids.size()
                    step.drop_aids()
                diagnostics = self._solve(factors, values)
                found = self._values(keys)
                state, bias = graph.read(found, graph.node)
                covariance = np.ascontiguousarray(self._isam().jointMarginalCovariance(keys[-3:]).fullMatrix())
                if not np.isfinite(covariance).all() or not np.isfinite(state.position()).all():
                    raise RuntimeError("it is not finite")
                break
            except RuntimeError as error:
                if attempt == 2:
                    what = str(error).strip().splitlines()[0]
                    raise RuntimeError(
                        f"GTSAM has no solution at {graph.motion.time:g} s, not even without aids: {what}"
                    ) from error
        graph.motion.revise(state, bias)
        self._covariance = covariance
        self._keep(step, found)
        for k, observation in enumerate(step.observed):
            diagnostics[f"residual.{observation.measurement.instrument}"] = float(
                np.sqrt(max(0.0, 2.0 * step.aids.at(k).error(found)))
            )
        return diagnostics

    def _isam2_parameters(self) -> Any:
        import gtsam

        parameters = gtsam.ISAM2Params()
        parameters.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(WILDFIRE))
        limits = gtsam.ISAM2ThresholdMap()
        for letter, values in THRESHOLDS.items():
            limits.insert((letter, self.threshold * np.array(values)))
        parameters.setRelinearizeThreshold(limits)
        parameters.relinearizeSkip = 1
        parameters.setFactorization("QR")
        return parameters

    @abstractmethod
    def _begin(self, prior: Any, values: Any) -> None:
        """Make the solver, with node 0."""

    @abstractmethod
    def _renew(self) -> None:
        """Make the solver anew, empty."""

    @abstractmethod
    def _solve(self, factors: Any, values: Any) -> dict[str, float]:
        """Take new factors and the nodes that they need; diagnostics."""

    @abstractmethod
    def _isam(self) -> Any:
        """The gtsam.ISAM2 inside."""

    @abstractmethod
    def _values(self, keys: list[int]) -> Any:
        """Values of some keys."""

    def _keep(self, step: _Step, found: Any) -> None:
        """Keep a step's factors, and its nodes as they are now; a hook."""

    def _trajectory(self, values: Any) -> NavigationStates:
        """The ends of all steps, which are nodes."""
        states = [self.graph.navigation(self.graph.read(values, node)[0]) for _, node in self._ends]
        times = np.array([time for time, _ in self._ends])
        return NavigationStates(times, *(np.array(series) for series in zip(*states, strict=True)))


class FixedLagEstimator(GtsamEstimator):
    """`IncrementalFixedLagSmoother` over the last epochs.

    Parameters
    ----------
    window : int
        Number of steps with nodes that are kept; older nodes are marginalised.
    threshold, iterations
        Limits of the updates of the solver, as for `GtsamEstimator`.
    """

    def __init__(self, window: int = 20, threshold: float = 1.0, iterations: int = 5):
        super().__init__(threshold, iterations)
        if window < 2:
            raise ValueError(f"window is a number of epochs: at least 2, not {window}")
        self.window = window

    def _begin(self, prior: Any, values: Any) -> None:
        self._renew()
        self._solve(prior, values)

    def _renew(self) -> None:
        import gtsam

        self._smoother = gtsam.IncrementalFixedLagSmoother(self.window - 1.0, self._isam2_parameters())

    def _solve(self, factors: Any, values: Any) -> dict[str, float]:
        smoother = self._smoother
        smoother.update(factors, values, dict.fromkeys(values.keys(), float(self._epoch)))
        relinearised = 0
        for iteration in range(1, self.iterations + 1):
            changed = smoother.getISAM2Result().getVariablesRelinearized()
            relinearised += changed
            if (iteration > 1 and not changed) or iteration == self.iterations:
                break
            smoother.update()
        return {"iterations": float(iteration), "relinearised": float(relinearised)}

    def _isam(self) -> Any:
        return self._smoother.getISAM2()

    def _values(self, keys: list[int]) -> Any:
        return self._smoother.calculateEstimate(keys)


class Isam2Estimator(GtsamEstimator):
    """`ISAM2` over the whole run; `smooth` is its best estimate of all nodes."""

    every_step = True

    def _begin(self, prior: Any, values: Any) -> None:
        import gtsam

        self._settled = gtsam.Values()
        self._solver: Any = None
        self._renew()
        self._solve(prior, values)

    def _renew(self) -> None:
        import gtsam

        if self._solver is not None:
            self._settled.insert_or_assign(self._solver.calculateEstimate())
        self._solver = gtsam.ISAM2(self._isam2_parameters())

    def _solve(self, factors: Any, values: Any) -> dict[str, float]:
        result = self._solver.update(factors, values)
        relinearised = result.getVariablesRelinearized()
        iteration = 1
        while iteration < self.iterations:
            iteration += 1
            changed = self._solver.update().getVariablesRelinearized()
            relinearised += changed
            if not changed:
                break
        return {"iterations": float(iteration), "relinearised": float(relinearised)}

    def _isam(self) -> Any:
        return self._solver

    def _values(self, keys: list[int]) -> Any:
        return self._solver.calculateEstimate(keys)

    def smooth(self) -> NavigationStates | None:
        """The trajectory of ISAM2's best estimate, at the ends of all steps."""
        import gtsam

        if not self._ends:
            return None
        values = gtsam.Values(self._settled)
        values.insert_or_assign(self._solver.calculateBestEstimate())
        return self._trajectory(values)


class BatchEstimator(FixedLagEstimator):
    """In real time the fixed-lag smoother; `smooth` solves for the whole run by Levenberg and Marquardt.

    Parameters
    ----------
    window, threshold, iterations
        As for `FixedLagEstimator`, in real time.
    most : int
        Most iterations of the batch.

    Attributes
    ----------
    cost : float
        Of the batch solution: half the sum of squares of the whitened errors.
    """

    every_step = True

    def __init__(self, window: int = 20, threshold: float = 1.0, iterations: int = 5, most: int = 50):
        super().__init__(window, threshold, iterations)
        if most < 1:
            raise ValueError(f"most is the number of iterations of the batch: at least 1, not {most}")
        self.most = most

    def _begin(self, prior: Any, values: Any) -> None:
        import gtsam

        self._factors, self._start = gtsam.NonlinearFactorGraph(), gtsam.Values(values)
        self._factors.push_back(prior)
        self._aiding: list[int] = []
        self._observed: list[Observation] = []
        super()._begin(prior, values)

    def _keep(self, step: _Step, found: Any) -> None:
        self._factors.push_back(step.motions)
        first = self._factors.size()
        self._factors.push_back(step.aids)
        self._aiding += range(first, self._factors.size())
        self._observed += step.observed
        self._start.insert_or_assign(found)

    def _parameters(self, tolerance: float = 1e-10) -> Any:
        import gtsam

        parameters = gtsam.LevenbergMarquardtParams()
        parameters.setMaxIterations(self.most)
        parameters.setLinearSolverType("MULTIFRONTAL_QR")
        parameters.setRelativeErrorTol(tolerance)
        parameters.setAbsoluteErrorTol(1e-8)
        return parameters

    def smooth(self) -> NavigationStates | None:
        """The batch solution at the ends of all steps."""
        if not self._ends:
            return None
        values = self._optimise()
        self.cost = float(self._factors.error(values))
        return self._trajectory(values)

    def _optimise(self) -> Any:
        """GTSAM's values of all nodes; a hook."""
        import gtsam

        return gtsam.LevenbergMarquardtOptimizer(self._factors, self._start, self._parameters()).optimize()


class GncEstimator(BatchEstimator):
    """As `BatchEstimator`, with graduated non-convexity over the aiding factors.

    `GncLMOptimizer` makes copies of the factors with new weights, and a `CustomFactor` cannot be copied. So its
    whitened error becomes a variable y with a unit prior, which can: the factor itself, linearised at the batch
    solution, ties y to the state (``A dx - b = y``, with a sigma of `TIGHT`; the gyroscopes' bias over a lever arm is
    left out). The weights that come of it then go to the exact factors, for a last run of Levenberg and Marquardt.

    Parameters
    ----------
    window, threshold, iterations, most
        Settings of the real-time estimates and of the batch, as for `BatchEstimator`.
    loss : {"tls", "gm"}
        Truncated least squares, or Geman and McClure.
    probability : float
        Of a good measurement to be taken for good, by the chi-square distribution.

    Attributes
    ----------
    weights : list of (str, float, float)
        After `smooth`: instrument, time and weight of every aiding factor.
    """

    def __init__(
        self,
        window: int = 20,
        threshold: float = 1.0,
        iterations: int = 5,
        most: int = 50,
        loss: Literal["tls", "gm"] = "tls",
        probability: float = 0.99,
    ):
        super().__init__(window, threshold, iterations, most)
        if loss not in ("tls", "gm"):
            raise ValueError(f"loss is tls or gm, not {loss!r}")
        if not 0.0 < probability < 1.0:
            raise ValueError(f"probability is between 0 and 1, not {probability}")
        self.loss, self.probability = loss, probability

    def _optimise(self) -> Any:
        import gtsam

        values = super()._optimise()
        factors, aiding = self._exposed(values)
        parameters = gtsam.GncLMParams(self._parameters(1e-5))
        parameters.setLossType(gtsam.GncLossType.TLS if self.loss == "tls" else gtsam.GncLossType.GM)
        parameters.setAllowNonNoiseModelFactors(True)
        parameters.setKnownInliers(sorted(set(range(factors.size())) - set(aiding)))
        optimizer = gtsam.GncLMOptimizer(factors, values, parameters)
        optimizer.setInlierCostThresholdsAtProbability(self.probability)
        values = optimizer.optimize().extract(self._start.keys())
        found = np.asarray(optimizer.getWeights())[aiding]
        # The exact factors, with the weights found.
        weighted = gtsam.NonlinearFactorGraph()
        for k in sorted(set(range(self._factors.size())) - set(self._aiding)):
            weighted.push_back(self._factors.at(k))
        self.weights = []
        for observation, weight in zip(self._observed, found.tolist(), strict=True):
            self.weights.append((observation.measurement.instrument, observation.measurement.time, weight))
            if weight > LEAST_WEIGHT:
                weighted.push_back(self.graph.aid(observation._replace(noise=observation.noise / weight)))
        return gtsam.LevenbergMarquardtOptimizer(weighted, values, self._parameters()).optimize()

    def _exposed(self, values: Any) -> tuple[Any, list[int]]:
        """The graph as `GncLMOptimizer` can take it, and which factors to weigh; adds new variables to ``values``."""
        import gtsam

        factors, aiding, custom = gtsam.NonlinearFactorGraph(), [], set(self._aiding)
        point = gtsam.Values(values)
        for k in range(self._factors.size()):
            factor = self._factors.at(k)
            if k in custom and isinstance(factor, gtsam.CustomFactor):
                y, m = _Y + k, factor.dim()
                jacobian, right = factor.linearize(point).jacobian()
                keys, tight = factor.keys(), gtsam.noiseModel.Isotropic.Sigma(m, TIGHT)
                values.insert_or_assign(y, -right)
                point.insert_or_assign(y, np.zeros(m))
                tie: Any
                if len(keys) == 1:
                    tie = gtsam.JacobianFactor(keys[0], jacobian, y, -np.eye(m), right, tight)
                else:
                    a, b = jacobian[:, TANGENT_PART.pose], jacobian[:, TANGENT_PART.speed]
                    tie = gtsam.JacobianFactor(keys[0], a, keys[1], b, y, -np.eye(m), right, tight)
                factors.push_back(gtsam.LinearContainerFactor(tie, point))
                factor = gtsam.PriorFactorVector(y, np.zeros(m), gtsam.noiseModel.Unit.Create(m))
            if k in custom:
                aiding.append(factors.size())
            factors.push_back(factor)
        return factors, aiding


class _Step:
    """The factors and nodes that one step adds to a graph."""

    def __init__(self, graph: InertialGraph):
        import gtsam

        self._graph = graph
        self.anchor = graph.node, graph.motion.state, graph.motion.bias
        self.motions, self.aids, self.values = (
            gtsam.NonlinearFactorGraph(),
            gtsam.NonlinearFactorGraph(),
            gtsam.Values(),
        )
        self.observed: list[Observation] = []

    def extend(self) -> None:
        """Make a node of where the motion has led, unless it is next to one: a factor has its length in its noise."""
        if self._graph.motion.elapsed > LATE:
            factor, values = self._graph.extend()
            self.motions.push_back(factor)
            self.values.insert(values)

    def observe(self, measurement: Measurement, noise: Array) -> None:
        """Attach a measurement to the newest node."""
        observation = self._graph.observe(measurement, noise)
        self.aids.push_back(self._graph.aid(observation))
        self.observed.append(observation)

    def drop_aids(self) -> None:
        """Leave the measurements out."""
        import gtsam

        self.aids, self.observed = gtsam.NonlinearFactorGraph(), []
