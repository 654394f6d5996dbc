"""Carlson's federated Kalman filter: a local filter for each aiding sensor, fused by a master.

All local filters share one inertial reference, the state of the model. Each local filter has its own correction x_i of
the reference, the covariance P_i of the remaining error, and one sensor. The information is divided, so that it is not
counted twice: with shares beta_i that sum to 1, local filter i starts with P_0 / beta_i and has the process noise
Q / beta_i. P_0 is the initial covariance and Q the process noise. At a fusion epoch the master sums up

    P_f^-1 = sum P_i^-1,    P_f^-1 x_f = sum P_i^-1 x_i

over the common states, and feeds x_f back to the shared reference. Then

- *with reset*, every local filter continues with P_f / beta_i and x_f (Carlson's fusion-reset mode). If all fuse after
  every measurement and no sensor has states of its own, this is exactly the centralised filter.
- *without reset*, every local filter continues with its own estimate (no-reset mode). It receives no information from
  the other sensors, so a fault of one sensor stays in one filter (except for the shared reference, about which all are
  linearised), but the estimate is worse. P_f is then an upper bound of the covariance: it is conservative by design.

P_f is a bound for this reason: the joint error of all local filters starts with the covariance ``11' (x) P_0`` and has
the noise ``11' (x) Q``. Both are at most ``diag(P_0 / beta_i)`` and ``diag(Q / beta_i)``, and motion and updates, block
by block and linear, keep it so: the actual joint covariance is at most ``diag(P_i)``, and the fused one, with the
weights ``W_i = P_f P_i^-1``, at most ``sum W_i P_i W_i' = P_f``. It is exact where all local filters have the same
gain, thus for sensors of one kind, or with a reset after every measurement. In the tests the variances of position are
up to a quarter above, that of a bias up to twice.

Calibration states belong to the local filter of their sensor. They are not fused; given the common states they are
independent of the other filters' (which holds exactly at one time only, and is the price of the architecture: with them
P_f is a bound with reset, too, because their local filter sees only its share of what is known of the common states). A
reset keeps what a local filter knows of them given the common states: with ``G = P_bc P_cc^-1`` it changes P_cc, takes
b along by G, and leaves the conditional covariance of b as it is.

Between two fusions the estimate is the propagated reference: measurements have an effect at the next fusion only. This
delay is the reason for the loss of the federated filter in the AUV smoothing paper (2022), which fuses at the rate of
the slowest sensor; the default here is the same. In an outage of a sensor its local filter only predicts, so nothing
has to be reconfigured. All measurements are linearised about the shared reference. The channels of
an instrument are in one local filter.

Source: N. A. Carlson, *Federated square root filter for decentralized parallel processes*, IEEE Trans. Aerospace and
Electronic Systems 26(3), 1990; *Post-processing algorithm based on factor graph optimization for AUV integrated
navigation*, 2022, doi:10.1177/01423312221109880, which compares with such a filter and prints no equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.estimator import UnsuitableScenario
from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.algebra.inflation import inflate_motion
from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.models.channels import instrument_of
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.covariance_propagation import propagate_covariance
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.propagation import Samples
from simnav.estimators.models.state_blocks import without_shared_blocks
from simnav.estimators.models.unaided import UnaidedModel
from simnav.types import Array, Estimate, InitialState, Instruments

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["FederatedEstimator"]

#: Two times are the same within this [s].
SAME = 1e-6


class _Local(NamedTuple):
    """A local filter, or the master's own share: share of the information, own states, correction, covariance."""

    share: float
    own: NDArray[np.intp]
    error: Array
    covariance: Array


class FederatedEstimator(KalmanEstimator):
    """Local filters over one `InertialModel`, fused; a subclass registers.

    Parameters
    ----------
    model : InertialModel
        The model of the shared reference.
    adaptation : Adaptation, optional
        Chooses the noise of each measurement; default: the datasheet's.
    fusion_period : float, optional
        Time between fusions [s]; 0 fuses after every measurement; None: the period of the slowest sensor.
    reset_locals : bool
        Whether the local filters are reset to the fused state after a fusion.
    master_share : float
        Share of the information of the master itself, in [0, 1). The master propagates it and fuses it with the others.
    shares : tuple of float, optional
        Shares of the aiding sensors in the scenario's order, above 0; with ``master_share`` they sum to 1. Empty: equal
        shares.
    """

    pieces = ("model", "adaptation")
    sets_aside: ClassVar[bool] = True
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "iteration": "a local filter corrects its own error, not the reference that is linearised about",
        "smoother": "every local filter has a covariance of its own",
    }
    model: InertialModel

    @classmethod
    def misfit(cls, keyword: str, made: type) -> str:
        """Why it cannot work with a piece of a class: its filters share the motion of an inertial model."""
        if keyword == "model" and not issubclass(made, InertialModel):
            return "its local filters share the motion of an InertialModel"
        if keyword == "model" and issubclass(made, NineStateModel):
            return "its local filters have the biases of the IMU among their states"
        if keyword == "model" and issubclass(made, UnaidedModel):
            return "it has a local filter for each instrument, and this model observes none"
        return super().misfit(keyword, made)

    def __init__(
        self,
        model: InertialModel,
        adaptation: Adaptation | None = None,
        fusion_period: float | None = None,
        reset_locals: bool = True,
        master_share: float = 0.0,
        shares: tuple[float, ...] = (),
    ):
        if fusion_period is not None and not 0.0 <= fusion_period < np.inf:
            raise ValueError(f"fusion_period is a time in seconds, 0 or more, not {fusion_period}")
        if not 0.0 <= master_share < 1.0:
            raise ValueError(f"master_share is a part of the information, in [0, 1), not {master_share}")
        if shares and not (min(shares) > 0.0 and abs(sum(shares) + master_share - 1.0) < 1e-9):
            raise ValueError(f"shares are above 0 and sum to 1 with the master's {master_share:g}, unlike {shares}")
        super().__init__(model, adaptation)
        self.fusion_period, self.reset_locals = fusion_period, reset_locals
        self.master_share, self.shares = master_share, tuple(shares)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run."""
        instruments = by_source(without_shared_blocks(instruments), self._model_choice, self.label)
        super().reset(start, instruments)
        self._of = {name: instrument_of(instruments[name]) for name in self._names}
        names = list(dict.fromkeys(self._of.values()))
        shares = self.shares or tuple((1.0 - self.master_share) / len(names) for _ in names)
        if len(shares) != len(names):
            raise UnsuitableScenario(f"{len(shares)} shares do not fit {len(names)} aiding sensors: {', '.join(names)}")
        model = self.model
        self._common = c = len(model.transition)
        own: dict[str, dict[int, None]] = {name: {} for name in names}  # each place once, in order
        for source, name in self._of.items():
            own[name] |= {k: None for at in model.blocks.of(source) for k in range(at.start, at.stop)}
        self._locals: dict[str, _Local] = {}
        for name, share in zip(names, shares):
            self._locals[name] = self._local(share, np.array(list(own[name]), dtype=np.intp))
        if self.master_share:
            self._locals[""] = self._local(self.master_share, np.array([], dtype=np.intp))
        period = self.fusion_period
        self._period = max(1.0 / instruments[n].rate for n in self._names) if period is None else period
        self._next = start.time + self._period
        self._still = np.zeros(model.size - c)

    def _local(self, share: float, own: NDArray[np.intp]) -> _Local:
        c, covariance = self._common, self.covariance.copy()
        covariance[:c, :c] /= share
        return _Local(share, own, np.zeros(self.model.size), covariance)

    def functions(self) -> FilterFunctions:
        """Motion, prediction and correction are those of the local filters."""
        functions = super().functions()
        return FilterFunctions(
            self.propagate, self.predict, functions.choose if self.adaptation is None else self.choose, self.inflate,
            self.correct, self.retract,
        )  # fmt: skip

    def propagate(self, dynamics: Dynamics, samples: Samples, until: float) -> None:
        """Advance the reference and all filters, and fuse on the way."""
        while self._period > 0.0 and self._next < until - SAME:
            self._step(self._next)
            self._fuse()
        self._step(until)

    def _step(self, until: float) -> None:
        model, c = self.model, self._common
        elapsed = until - model.time
        if elapsed <= 0.0:
            return
        model.propagate(self.covariance, until)
        transition, decay, density = model.transition, model._decay, model._density
        kept = np.exp(-decay * elapsed)
        for local in self._locals.values():
            noise = model.process_noise / local.share
            propagate_covariance(local.covariance, transition, noise, self._still, decay, density, elapsed)
            local.error[:c] = transition @ local.error[:c]
            local.error[c:] *= kept
            if model.blocks.clocks:
                model.blocks.carry_covariance(local.covariance, elapsed)
                model.blocks.carry(local.error, elapsed)

    def _estimate(self) -> Estimate:
        """The master's estimate; fused, if the step ends with a fusion epoch."""
        if self._period > 0.0 and self._next <= self.model.time + SAME:
            self._fuse()
        return super()._estimate()

    def predict(self, dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
        """Compare a measurement with the state of its local filter."""
        m = self._measurements[k]
        linearised = self.model.measure(m)
        if linearised is None:
            return False
        local = self._correcting = self._locals[self._of[m.instrument]]
        residual, jacobian, noise = linearised
        prediction.cross[:] = np.dot(local.covariance, jacobian.T)
        prediction.predicted[:] = np.dot(jacobian, prediction.cross)
        prediction.innovation[:], prediction.nominal[:] = residual - jacobian @ local.error, noise
        return True

    def choose(self, choice: Choice, covariance: Array, readings: Readings, k: int, prediction: Prediction) -> None:
        """Ask the adaptation about a reading of a local filter."""
        super().choose(choice, self._correcting.covariance, readings, k, prediction)

    def inflate(self, dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
        """Inflate the covariance of the local filter."""
        own, factor = self._correcting.covariance, float(readings.inflation[k])
        if self.adaptation is not None and self.adaptation.inflates:
            for matrix in (own, prediction.cross, prediction.predicted):
                matrix *= factor
            return False
        inflate_motion(own, factor, dynamics.first_variances, self.model.moving)
        return True

    def correct(self, dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
        """Correct the covariance of the local filter."""
        innovation, cross, predicted, noise = (
            prediction.innovation, prediction.cross, prediction.predicted, prediction.noise,
        )  # fmt: skip
        return joseph_update(self._correcting.covariance, cross, predicted + noise, innovation, dynamics.correction)

    def retract(self, dynamics: Dynamics) -> None:
        """Add the correction to the error of the local filter."""
        self._correcting.error[:] += dynamics.correction
        if self._period == 0.0:
            self._fuse()

    def _fuse(self) -> None:
        """Add up the information of all local filters; correct the reference; share the sum out again."""
        n, c = self.model.size, self._common
        self._next += self._period
        information, weighted = np.zeros((c, c)), np.zeros(c)
        known = np.diag(self.covariance)[:c] > 0.0  # a state without any variance is the same in all filters
        gain, conditional = np.zeros((n - c, c)), np.zeros((n - c, n - c))
        for local in self._locals.values():
            P = local.covariance
            inverse = _inverse(P[:c, :c], known)
            information += inverse
            weighted += inverse @ local.error[:c]
            own = local.own
            if len(own):
                gain[own - c] = P[own, :c] @ inverse
                conditional[np.ix_(own - c, own - c)] = P[np.ix_(own, own)] - gain[own - c] @ P[:c, own]
        fused = _inverse(information, known)
        dx = np.zeros(n)
        dx[:c] = fused @ weighted
        for local in self._locals.values():
            own = local.own
            dx[own] = local.error[own] + gain[own - c] @ (dx[:c] - local.error[:c])
        self.covariance[:] = _joint(fused, gain, conditional)
        self.model.correct(dx)
        for local in self._locals.values():
            own = local.own
            if self.reset_locals:
                local.error[:] = 0.0
                mine = np.zeros_like(gain)
                mine[own - c] = gain[own - c]
                local.covariance[:] = _joint(fused / local.share, mine, conditional)
            else:
                local.error[:c] -= dx[:c]
                local.error[own] -= dx[own]


def _inverse(matrix: Array, use: NDArray[np.bool_]) -> Array:
    """Inverse of the rows and columns in use of a covariance or information matrix, scaled by its diagonal; else 0."""
    at = slice(None) if use.all() else np.ix_(use, use)
    part = matrix[at]
    scale = 1.0 / np.sqrt(np.diag(part))
    scales = scale[:, None] * scale
    correlation = part * scales
    try:
        root = np.linalg.inv(np.linalg.cholesky(correlation))
    except np.linalg.LinAlgError:  # singular to rounding: what is known beyond it counts as known to rounding
        values, vectors = np.linalg.eigh(correlation)
        root = (vectors / np.sqrt(np.maximum(values, 1e-14 * len(values)))).T
    inverse = np.zeros_like(matrix)
    inverse[at] = (root.T @ root) * scales
    return inverse


def _joint(common: Array, gain: Array, conditional: Array) -> Array:
    """Covariance of common states and those that follow them by a gain, with what is left of them."""
    c, n = len(common), len(common) + len(gain)
    joint = np.empty((n, n))
    joint[:c, :c] = common
    joint[c:, :c] = gain @ common
    joint[:c, c:] = joint[c:, :c].T
    own = conditional + joint[c:, :c] @ gain.T
    joint[c:, c:] = 0.5 * (own + own.T)
    return joint
