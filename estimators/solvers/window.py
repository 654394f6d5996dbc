"""A sliding window: the newest states are estimated together, anew at every step, by Gauss-Newton.

Every time of a measurement is a node of the graph (`simnav.estimators.models.chain`), and every measurement and every
motion between nodes is a factor. After the measurements of a step the nodes are moved to the minimum of the weighted
sum of squares: linearise, weight, solve (`simnav.estimators.algebra.block_tridiagonal`), retract, until the next step
would be small. A step that increases the cost is rejected, and repeated with damping (Levenberg-Marquardt). Then the
oldest epochs leave the window. Their information on the new first node, at the last linearisation, is its prior (a
Schur complement: G. Sibley, L. Matthies, G. Sukhatme, "Sliding window filter with application to planetary landing", J.
Field Robotics 27(5), 2010). So only the later linearisation and weighting of these factors is lost. In which errors the
prior is normal matters where later measurements turn the first node far from it
(`simnav.estimators.models.group_prior`).

The first step of an epoch uses the elimination of the older nodes from the last epoch, as in incremental smoothing
(M. Kaess et al., "iSAM2: Incremental smoothing and mapping using the Bayes tree", Int. J. Robotics Research 31(2),
2012): only new factors are linearised and eliminated, and all nodes are moved. Then the weighting is called with the
new residuals. A weight is not changed if the change of its factor's influence is within the tolerance. Elimination
is repeated from the first node that has a factor with another weight. All factors are linearised and eliminated again
if a step is large, or if this would move the nodes by more than the tolerance.

A large step is accepted only if it does not increase the cost. Motion factors are stiff: a straight step through a
large rotation violates the motion factors at second order, and the cost increases although the step is good (the
Maratos effect). So such a step is tried again along the motion (`Chain.along_motion`), and damped only if this also
increases the cost.

If the cost of a window is improbable (`simnav.estimators.solvers.cost_consistency`), the diagnostic ``inconsistent`` is
1, and the reported covariance is multiplied by the variance factor.

The weight of a measurement has two parts: an `Adaptation` chooses its noise when it arrives, from the innovation, as in
a filter; a `Weighting` receives all factors of the window at every iteration.

The readings of each channel of an instrument are factors with a residual, a weight and a flag of their own
(`simnav.estimators.models.channels`). The diagnostics of the instrument are the means over its channels.

Sources: Guo et al. (2026), section 3 (window, Gauss-Newton, convergence at 1e-6 or after 10 iterations); Mao, Wang and
Fu (2025), section 2;
for the test of convergence by contraction (ratio of the step after a new linearisation to the steps before it; an
epoch starts from twice the ratio of the epoch before it, at most 1),
E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, 1996, section IV.8.
Eq. 15 of Mao, Wang and Fu (2025) takes the inverse of the window's prior for the newest covariance; it is that of the
oldest state. The newest one is the last block of the elimination.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, inf
from types import SimpleNamespace
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from simnav.compiled import ready
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.choice import no_choice
from simnav.estimators.adaptations.noise import NoiseAdaptation
from simnav.estimators.algebra.block_tridiagonal import half_squares, keep_weights, solve_chain
from simnav.estimators.algebra.direct_update import normalised_square
from simnav.estimators.algebra.factors import NewRows, Rows
from simnav.estimators.composition import Solver
from simnav.estimators.models.base import ErrorModel
from simnav.estimators.models.chains import Chain, chain_of
from simnav.estimators.models.channels import owners, summary
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.filtering import Prediction, Readings, ReadingsOfSteps
from simnav.estimators.models.inertial_chain import Moves
from simnav.estimators.models.propagation import Samples
from simnav.estimators.models.stated_sigmas import with_stated_sigmas
from simnav.estimators.models.suitable import ModelChoice
from simnav.estimators.weightings.base import Factors, Isolation, Weighting
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement, Measurements

from .admission import Admission, together
from .cost_consistency import CostTest
from .filter_step import use_nominal
from .looking_back import LooksBack
from .window_iteration import DAMPING_FACTOR, FIRST_DAMPING, Limits, Progress, Weighed, move_nodes
from .window_step import WindowStep, attach_readings, choose_and_test

__all__ = ["WindowEstimator"]

#: A measurement with a weight up to this is reported as faulty.
FAULTY_WEIGHT = 0.5
_NO_TIMES: Array = np.empty(0)
_NO_COVARIANCE: Array = np.empty((0, 0))


class WindowEstimator(LooksBack, Solver):
    """The solver of the module.

    Parameters
    ----------
    model : ErrorModel, ModelChoice or Chain
        A model with a chain (`simnav.estimators.models.chain.chain_of`), or the chain itself.
    adaptation : Adaptation, optional
        Chooses the noise of each measurement; None: the nominal noise. An adaptation that ``inflates`` is refused.
    weighting : Weighting, optional
        Sets the weight of each factor; None: every factor has the weight 1.
    isolation : Isolation, optional
        Decides which factors are faulty, and changes their weights; it needs a weighting.
    window : int or None
        Number of epochs (steps with measurements) in the window; None: all of them.
    tolerance : float
        Largest component of a step, in its sigmas, at which the nodes have converged. The step is not computed if the
        contraction from step to step, also of earlier epochs, predicts that it would be smaller. It is also the largest
        change of a weight, and of the weight times the norm of a whitened residual, that is ignored.
    iterations : int
        Largest number of steps in an epoch.
    spacing : float
        Measurements at times closer to the newest node than this [s] have no node of their own (`Chain`), unless
        they are the last of their step. 0, and with ``every_sample``: every time of a measurement is a node.
    prior : "differences" or "group"
        What is normal in the prior that nodes leave behind: the differences of the state, or the right-invariant error
        on the group SE_2(3) (`simnav.estimators.models.group_prior`). Only an inertial model makes a difference.
    every_sample : bool
        True: a node for every IMU sample, instead of one preintegrated factor between measurements. This is the graph
        of the AUV smoothing paper (2022) without its equivalent IMU factor.

    Attributes
    ----------
    chain : Chain
        The nodes and factors of the window, from `reset` on.
    covariance : (n, n) array
        Covariance of the newest node.
    """

    pieces = ("model", "adaptation", "weighting", "isolation")
    refuses: ClassVar[Mapping[str, str]] = {
        "iteration": "it linearises anew until the nodes have converged",
        "smoother": "the full graph is the window that smooths",
    }
    #: Whether a step takes the older nodes as they were eliminated before.
    incremental: ClassVar[bool] = True

    @classmethod
    def misfit(cls, keyword: str, made: type) -> str:
        """Why it cannot work with a piece of a class: it weighs motion by factors, not by a covariance."""
        if keyword == "adaptation" and getattr(made, "inflates", False):
            return "it inflates the covariance of the prediction, and a window holds the motion by factors"
        return super().misfit(keyword, made)

    def __init__(
        self,
        model: ModelChoice | Chain,
        adaptation: Adaptation | None = None,
        weighting: Weighting | None = None,
        isolation: Isolation | None = None,
        *,
        window: int | None = 20,
        tolerance: float = 1e-3,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: Literal["differences", "group"] = "differences",
        every_sample: bool = False,
    ):
        if window is not None and window < 1:
            raise ValueError(f"window is {window}; it must hold at least 1 epoch")
        if not tolerance > 0.0:
            raise ValueError(f"tolerance is {tolerance}; it must be positive")
        if iterations < 1:
            raise ValueError(f"iterations is {iterations}; at least 1 is needed")
        if not 0.0 <= spacing < np.inf:
            raise ValueError(f"spacing is {spacing}; it is a time in seconds, 0 or more")
        if prior not in ("differences", "group"):
            raise ValueError(f'prior is {prior!r}; it must be "differences" or "group"')
        if isolation is not None and weighting is None:
            raise ValueError(f"{type(isolation).__name__} changes weights, and there is no weighting")
        if adaptation is not None and adaptation.inflates:
            raise ValueError(
                f"{type(adaptation).__name__}, as it is set, inflates the covariance of the prediction; a window holds "
                "the motion by factors, so that it adapts filters only"
            )
        self._model_choice = model
        if isinstance(model, (Chain, ErrorModel)):
            self.chain = chain_of(model)
        self.adaptation = adaptation
        self.weighting, self.isolation = weighting, isolation
        self.window, self.tolerance, self.iterations, self.spacing = window, tolerance, iterations, spacing
        self.prior, self.every_sample = prior, every_sample

    def longest_lag(self, instruments: Instruments) -> float:
        """The time that the window holds [s]: an epoch is a step, or the interval of the fastest instrument in use."""
        instruments = by_source(instruments, self._model_choice, self.label)
        model = self._model_choice.choose(instruments, self.label)
        rates = [sheet.rate for sheet in instruments.values() if model.observes(sheet) and sheet.rate > 0.0]
        if self.window is None or not rates:
            return inf
        return (self.window - 1) * max(instruments.step, 1.0 / max(rates))

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        instruments = by_source(instruments, self._model_choice, self.label)
        self.chain = chain_of(with_stated_sigmas(self._model_choice.choose(instruments, self.label), instruments))
        self.chain.prior_of = self.prior
        self.chain.front.reports_all |= self.reports_all
        self.covariance = self.chain.begin(start, instruments)
        observed = [name for name, sheet in instruments.items() if self.chain.observes(sheet)]
        self._admission = Admission(instruments, observed)
        self._owners, self._mean_labels = owners(instruments), dict[str, str]()
        for what in (self.adaptation, self.weighting, self.isolation):
            if what is not None:
                what.reset(instruments)
        self._epochs: deque[int] = deque()  # nodes of each epoch in the window
        self._counted = self._eliminated = 0
        self._contraction, self._limits = 1.0, Limits(self.tolerance, self.iterations, self.incremental)
        self._factors: Factors | None = None
        self._step = self._step_of_kernels()
        components = [0] * len(self.chain.names) if self._step is None else self.chain.dynamics.aids.components.tolist()
        self._arrays = ReadingsOfSteps(dict(zip(self.chain.names, components, strict=True)))
        self._by_methods = SimpleNamespace(
            dynamics=SimpleNamespace(covariance=_NO_COVARIANCE), choice=None, advance=self.advance,
            predict=self.predict, choose=self.choose, make_node=self.make_node, attach=self.attach,
        )  # fmt: skip
        self._cost_test = CostTest()
        always, chosen = ("residual", "weight"), ("innovation", "nis") if self.adaptation else ()
        names = [*observed, "motion"]
        self._blank = {f"{q}.{n}": np.nan for q in (*always, *chosen) for n in names if n != "motion" or q in always}
        self._labels = [(f"residual.{name}", f"weight.{name}") for name in self.chain.names]
        self._blank |= {"iterations": 0.0, "cost": np.nan, "variance_factor": np.nan, "inconsistent": 0.0}

    def _step_of_kernels(self) -> WindowStep | None:
        """The step of a window where all that it does is compiled; None: it is made by methods."""
        chain, own = self.chain, self.adaptation
        f = chain.functions
        if f is None or self.every_sample:
            return None
        if own is None:
            return None if self._owners else WindowStep(
                dynamics=chain.dynamics, choice=no_choice(), advance=f.advance, predict=f.predict_noise,
                choose=use_nominal, make_node=f.make_node, attach=f.attach,
            )  # fmt: skip
        if not (isinstance(own, NoiseAdaptation) and own.ruled):
            return None
        step = WindowStep(
            dynamics=chain.dynamics, choice=own.noise_choice(chain.names, chain.size), advance=f.advance_covariance,
            predict=f.predict, choose=choose_and_test, make_node=f.make_node, attach=f.attach,
        )  # fmt: skip
        return step if step.compiled else None

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        chain = self.chain
        chain.load(measurements.imu)
        diagnostics: dict[str, float | Array] = dict(self._blank)
        flagged: list[tuple[str, float]] = []
        self._sample_times = _NO_TIMES
        if self.every_sample and measurements.imu is not None:
            self._sample_times = measurements.imu.time
        admitted = self._admission.admit(measurements, chain.time)
        attached = self._attach_all(admitted, measurements.time, diagnostics, flagged) if admitted else 0
        if attached:
            self._optimise(attached, diagnostics, flagged)
            self._marginalise()
        self._advance(measurements.time)
        diagnostics["skipped"] = float(self._admission.skipped)
        for what in (self.adaptation, self.weighting):
            if what is not None:
                diagnostics.update(what.diagnostics())
        if self._owners:
            diagnostics.update(summary(diagnostics, self._owners, self._mean_labels))
        estimate = chain.estimate(chain.predicted_covariance(self.covariance))
        diagnostics["inconsistent"] = float(self._cost_test.lasting)
        if self._cost_test.inconsistent and estimate.covariance is not None:
            estimate.covariance *= self._cost_test.inflation
            wider = self._cost_test.inflation**0.5
            estimate.states = {name: (value, wider * sigma) for name, (value, sigma) in estimate.states.items()}
        estimate.diagnostics, estimate.flagged = diagnostics, flagged
        return estimate

    def _attach_all(
        self,
        admitted: Sequence[Measurement],
        until: float,
        diagnostics: dict[str, float | Array],
        flagged: list[tuple[str, float]],
    ) -> int:
        """Make the measurements of a step factors; their number."""
        chain, count, spacing = self.chain, len(admitted), 0.0 if self.every_sample else self.spacing
        new: NewRows
        if self._step is not None:
            if self.adaptation is not None:
                chain.dynamics.covariance[...] = chain.predicted_covariance(self.covariance)
            growing, readings = chain.growing(count), self._arrays.fill(admitted)
            new = attach_readings.unchecked(
                self._step, growing, chain.rows, readings, chain.front.samples, count, until, spacing
            )
            chain.grow(new)
            self._admission.skipped += count - new.aids
            if self.adaptation is not None:
                self._note(readings, count, diagnostics, flagged)
            return new.aids
        self._groups, self._diagnostics, self._flagged = self._grouped(admitted), diagnostics, flagged
        readings = self._arrays.fill([group.measurements[0] for group in self._groups])
        count, growing = len(self._groups), SimpleNamespace(since_node=chain.since_node)
        new = attach_readings.function(
            self._by_methods, growing, chain.rows, readings, chain.front.samples, count, until, spacing
        )
        return new.aids

    def _note(
        self, readings: Readings, count: int, diagnostics: dict[str, float | Array], flagged: list[tuple[str, float]]
    ) -> None:
        """Note what an adaptation has chosen in compiled code."""
        assert isinstance(self.adaptation, NoiseAdaptation)
        sigma, reported, size, nis, rejected = (
            readings.sigma.tolist(), readings.reported.tolist(), readings.size.tolist(), readings.nis.tolist(),
            readings.rejected.tolist(),
        )  # fmt: skip
        for k, row in enumerate(readings.instrument[:count].tolist()):
            if size[k] < 0.0:
                continue
            name = self.chain.names[row]
            diagnostics[f"innovation.{name}"] = size[k]
            if nis[k] >= 0.0:
                diagnostics[f"nis.{name}"] = nis[k]
            if rejected[k]:
                self._admission.skipped -= 1
                flagged.append((name, float(readings.time[k])))
            else:
                self.adaptation.report.note(row, sigma[k], reported[k])

    def _grouped(self, admitted: Sequence[Measurement]) -> list[_Group]:
        """The measurements in groups that are attached together, each with its noise, or one by one."""
        if self.adaptation is not None or not self._owners:
            return [_Group([m]) for m in admitted]
        groups: list[_Group] = []
        for group in together(admitted, self._owners):
            noise = self.chain.nominal_noises(group) if len(group) > 1 else None
            groups += [_Group([m]) for m in group] if noise is None else [_Group(group, noise)]
        return groups

    def advance(self, dynamics: Any, growing: Any, samples: Samples, until: float) -> None:
        """Advance the front, leaving a node at each sample on the way if there is to be one."""
        self._advance(until)

    def predict(self, dynamics: Any, readings: Readings, k: int, prediction: Prediction) -> bool:
        """Predict a measurement, at least its nominal noise; False if it cannot be used."""
        group = self._groups[k]
        if group.noise is not None:
            return True
        (m, *_), chain = group.measurements, self.chain
        if self.adaptation is None:
            noise = chain.nominal_noise(m)
            group.noise = None if noise is None else noise[None]
            usable = noise is not None
        else:
            self._linearised = chain.linearise(m)
            usable = self._linearised is not None
        self._admission.skipped += not usable
        return usable

    def choose(self, choice: None, covariance: Array, readings: Readings, k: int, prediction: Prediction) -> None:
        """Ask the adaptation for the noise of a measurement; without one it is that of the datasheet."""
        if self.adaptation is None:
            return
        assert self._linearised is not None
        group, (residual, jacobian, noise) = self._groups[k], self._linearised
        (m, *_) = group.measurements
        covariance = self.chain.predicted_covariance(self.covariance)
        cross = covariance @ jacobian.T
        predicted = jacobian @ cross
        chosen = self.adaptation.adapt(Innovation(m, residual, predicted, noise, covariance, cross))
        self._diagnostics[f"innovation.{m.instrument}"] = hypot(*residual.tolist())
        nis = normalised_square(residual, ready(predicted), ready(noise if chosen is None else chosen))
        if nis >= 0.0:
            self._diagnostics[f"nis.{m.instrument}"] = nis
        if chosen is None:
            readings.rejected[k] = True
            self._flagged.append((m.instrument, m.time))
        else:
            group.noise = chosen[None]

    def make_node(self, dynamics: Any, growing: Any, rows: Rows, new: NewRows) -> NewRows:
        """Make the front a node for a measurement."""
        if self.adaptation is None:
            self.chain.extend()  # the measurement is going to change the covariance, and nothing asks for it before
        else:
            self._extend()
        return new

    def attach(
        self,
        dynamics: Any,
        growing: Any,
        rows: Rows,
        new: NewRows,
        readings: Readings,
        k: int,
        prediction: Prediction,
    ) -> NewRows:
        """Make a measurement, or the readings of channels at one time, factors of the newest node."""
        measurements, noise = self._groups[k].measurements, self._groups[k].noise
        assert noise is not None
        self.chain.attach(measurements, noise)
        return new._replace(aids=new.aids + len(measurements))

    def _advance(self, until: float) -> None:
        chain, samples = self.chain, self._sample_times
        if len(samples):
            first, last = np.searchsorted(samples, (chain.time + 1e-6, until - 1e-6))
            for time in samples[first:last].tolist():
                chain.propagate(time)
                self._extend()
        chain.propagate(until)

    def _extend(self) -> None:
        """Make the front the newest node."""
        self.covariance = self.chain.predicted_covariance(self.covariance)
        self.chain.extend()

    def _optimise(self, attached: int, diagnostics: dict[str, float | Array], flagged: list[tuple[str, float]]) -> None:
        """Estimate all nodes, the newest of which hold new factors, and report."""
        chain = self.chain
        done = self._converge(attached)
        attached = done.attached
        chain.settle(done.moved)
        self._cost_test.add(done.cost, float(chain.aids["weight"].dot(chain.aids["components"])))
        diagnostics["iterations"], diagnostics["cost"] = float(done.solved), done.cost
        diagnostics["variance_factor"] = self._cost_test.variance_factor
        if attached:
            aids, new = chain.window.aids, slice(chain.aids.last - attached, chain.aids.last)
            reported = (aids.instrument, aids.time, aids.norm, aids.weight)
            for index, time, norm, weight in zip(*(column[new].tolist() for column in reported)):
                of_residual, of_weight = self._labels[index]
                diagnostics[of_residual], diagnostics[of_weight] = norm, weight
                if weight <= FAULTY_WEIGHT:
                    flagged.append((chain.names[index], time))
        if len(chain.motions):
            diagnostics["residual.motion"] = float(chain.motions.newest("norm"))
            diagnostics["weight.motion"] = float(chain.motions.newest("weight"))

    def _converge(self, attached: int) -> _Solution:
        """Move the nodes to the minimum of the cost.

        Parameters
        ----------
        attached : int
            Number of new aiding factors. They are removed if there is no finite solution with them.
        """
        chain, step = self.chain, self.chain.nodes["step"]
        contraction = min(1.0, 2.0 * self._contraction)
        now = Progress(self._first_new(attached), contraction, contraction)
        self._factors, moved, accepted = None, np.zeros(chain.size), True
        weighed = Weighed(self.weighting is not None, True, len(step))
        chain.linearise_from(now.first)
        while not now.done:
            if weighed.asked:
                weighed = self._weigh(now.solved) if accepted else weighed._replace(first=len(step))
            now = self._move(now, weighed, moved)
            if now.lost:
                now, attached = self._without_new(now, weighed, moved, attached), 0
            accepted = not now.large or self._checked_step()
            if now.large:
                damping = _damping(now, accepted, self.iterations)
                now = now._replace(first=0, before=now.since, since=0.0, damping=damping)
                if accepted:
                    moved += step[-1]
                if now.solved == self.iterations:
                    break
        self._contraction, cost = now.learned, now.cost
        if now.damping > 0.0:  # the covariances and the prior are those without it
            chain.linearise_from()
            self._solve()
            step[:] = 0.0
            cost = chain.keep()
        self.covariance = chain.nodes.newest("filtered").copy()
        self._eliminated = len(step)
        return _Solution(cost, now.solved, moved, attached)

    def _move(self, now: Progress, weighed: Weighed, moved: Array) -> Progress:
        """Iterate until it is done or somebody is to be asked."""
        chain, moves = self.chain, self.chain.moves
        move = move_nodes.unchecked if isinstance(moves, Moves) else move_nodes.function
        further: Progress = move(moves, chain.graph, chain.rows, self._limits, weighed, now, moved)
        return further

    def _without_new(self, now: Progress, weighed: Weighed, moved: Array, attached: int) -> Progress:
        """Iterate without the new factors, with which there is no finite step."""
        self.chain.detach(attached)
        self._factors = None
        self._admission.skipped += attached
        self.chain.linearise_from()
        now = self._move(now._replace(first=0, damping=0.0), weighed, moved)
        if now.lost:
            raise FloatingPointError(f"the window at {self.chain.time:g} s has no finite solution")
        return now

    def _checked_step(self) -> bool:
        """Take a large step, if it does not raise the cost: straight, or else along the motion; linearise anew."""
        chain, step = self.chain, self.chain.nodes["step"]
        limit = self._cost() * (1.0 + 1e-9)
        before = chain.copy_states()
        for along in (False, True):
            if along:
                step[:] = chain.along_motion(step)
            chain.retract(step)
            self.chain.linearise_from()
            if self._cost() <= limit:
                return True
            chain.restore_states(before)
            self.chain.linearise_from()
        return False

    def _first_new(self, attached: int) -> int:
        """The first node that new factors touch; those before it are eliminated, and 0 where they are not."""
        if not (self.incremental and attached):
            return 0
        return min(self._eliminated, int(self.chain.aids["node"][-attached]) - self.chain.base)

    def _weigh(self, iteration: int) -> Weighed:
        """Ask the weighting, and the isolation."""
        assert self.weighting is not None
        chain = self.chain
        factors = self._factors = self._factors or self._all_factors()
        motion_before, before = factors.motion_weight.copy(), factors.weight.copy()
        factors.iteration = iteration
        settled = self.weighting.weigh(factors)
        if self.isolation is not None:
            settled = self.isolation.judge(factors) and settled
        first = keep_weights.unchecked(chain.window, chain.rows, motion_before, before, self.tolerance)
        return Weighed(True, settled, first)

    def _cost(self) -> float:
        """Half the sum of squares of all factors, with the weights that they have."""
        cost: float = half_squares.unchecked(self.chain.window, self.chain.rows)
        return cost

    def _solve(self) -> None:
        """Eliminate all nodes, without damping."""
        chain = self.chain
        prior = chain.prior
        linear, mean = np.empty_like(prior.covariance), np.empty_like(prior.shift)
        chain.reference.in_python.at_node(prior.covariance, prior.shift, linear, mean)
        solve_chain.unchecked(chain.window, chain.rows, linear, mean, 0.0, 0)

    def _all_factors(self) -> Factors:
        """Views of the factors, which hold until their number changes."""
        motions, aids = self.chain.motions, self.chain.aids
        return Factors(
            self.chain.names, aids["instrument"], aids["components"], aids["time"], aids["residual"], aids["noise"],
            aids["whitened"], aids["norm"], motions["time"], motions["residual"], motions["norm"],
            aids["weight"], motions["weight"], 0,
        )  # fmt: skip

    def _marginalise(self) -> None:
        """Let the oldest epochs leave the window."""
        chain, leaving = self.chain, 0
        new = chain.base + len(chain.nodes) - self._counted
        if new:
            self._epochs.append(new)
            self._counted += new
        while self.window is not None and len(self._epochs) > self.window:
            leaving += self._epochs.popleft()
        if leaving:
            chain.marginalise(leaving)
            self._eliminated -= leaving


@dataclass(slots=True)
class _Group:
    """Measurements that become factors together, and their (k, m, m) noise."""

    measurements: Sequence[Measurement]
    noise: Array | None = None


class _Solution(NamedTuple):
    """What the iteration of an epoch has found.

    Attributes
    ----------
    cost : float
        Half the weighted sum of squares.
    solved : int
        Number of linear systems that were solved.
    moved : (n,) array
        Shift of the newest node.
    attached : int
        Number of new aiding factors that are left.
    """

    cost: float
    solved: int
    moved: Array
    attached: int


def _damping(now: Progress, accepted: bool, iterations: int) -> float:
    """The damping after a large step; with some at the last one, what was solved for is not kept."""
    if not accepted:
        return max(FIRST_DAMPING, DAMPING_FACTOR * now.damping)
    less = now.damping / DAMPING_FACTOR if now.damping > FIRST_DAMPING else 0.0
    return max(less, FIRST_DAMPING) if now.solved == iterations else less
