"""The form of a model for a graph: the nodes of a window and the factors between them, and a propagated newest state.

The model itself, the *front*, is propagated from measurement to measurement as in a filter. At each time of a
measurement its state becomes a node, and the motion between two nodes becomes a motion factor: the transition matrix F
and the process noise Q that the model accumulated along its predicted trajectory. A factor stores by how much its two
nodes have moved since the prediction (``begin_shift``, ``end_shift``). This is sufficient to linearise it again: with
the present nodes x, the error is ``e = x_k+1 - f(x_k)`` for the exact motion f. So the IMU is integrated only once
(preintegration: C. Forster et al., "On-manifold preintegration for real-time visual-inertial odometry", IEEE Trans.
Robotics 33(1), 2017; here about the predicted trajectory and on the rotating Earth).

A measurement need not have a node of its own. It can be predicted at an *intermediate state*, some time after the
newest node. Its prediction is then a function of that node through the motion between them, and the noise of this
motion is added to the noise of the measurement. Two such measurements of one node share a part of this noise; this
correlation is neglected.

A subclass has the loops over a window: `linearise_motion`, `linearise_aids`, `observe`, `retract`, `along_motion`. All
but `observe` are in `simnav.estimators.models.moving_chain` for models whose motion depends on state and time only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property, singledispatch
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import ready
from simnav.estimator.needs import Needs
from simnav.estimators.algebra.block_tridiagonal import after_step, whiten
from simnav.estimators.algebra.factors import AidingFactors, Motions, NewRows, Nodes, Prior, Rows, Window
from simnav.estimators.algebra.whitening import whitening
from simnav.types import (
    NO_SIDE,
    Array,
    Datasheet,
    Estimate,
    Flags,
    ImuSamples,
    InitialState,
    Instruments,
    Measurement,
)

from .appended_rows import MotionSinceNode, append_aids, append_between, append_motion
from .base import ErrorModel, Linearised
from .channel_readings import ChannelReadings
from .columns import Columns, Made
from .filtering import Dynamics
from .intermediate_states import IntermediateStates
from .marginalisation import Reference, keep_prior, marginalise, subtract_step
from .named_state import NamedState, at_row

__all__ = ["Chain", "chain_of"]


class Chain(ABC):
    """The nodes and factors of a window over a model.

    Parameters
    ----------
    front : ErrorModel
        The model of the newest state. It must have the method `carry`.

    Attributes
    ----------
    size : int
        Number n of components of the model's error.
    nodes, motions, aids : Columns
        The nodes, with ``time`` and the arrays of the model that `node_arrays` names; motion factors; aiding factors,
        with ``side`` if readings have side information. What else they hold is in
        `simnav.estimators.algebra.factors`.
    between : Columns
        The intermediate states (`simnav.estimators.models.intermediate_states`), with the predicted arrays of the
        model, and, with the prefix ``now_``, those from the shifted node.
    base, base_between : int
        Number of the first node, and of the first intermediate state, of the window since the start of the run.
    prior : Prior
        The prior of the first node.
    since_node : MotionSinceNode
        The motion from the newest node to the front.
    names : tuple of str
        Names of the instruments; for one with channels, the source of each
        (`simnav.estimators.models.channels.by_channel`).
    """

    def __init__(self, front: ErrorModel):
        self.front = front

    @property
    def node_arrays(self) -> tuple[str, ...]:
        """Further arrays of the model that a node stores, in addition to those of its ``state``."""
        return ()

    #: The compiled functions of a step of a window, `simnav.estimators.models.new_factors.FactorFunctions`; None: the
    #: step is made by methods.
    functions: Any = None
    #: What the functions work on, with what `growing` returns.
    dynamics: Dynamics
    #: What is normal in the prior of the first node: ``"differences"`` of the state, or the right-invariant error on
    #: the ``"group"`` (`simnav.estimators.models.group_prior`). Without rotations both are the same.
    prior_of: Literal["differences", "group"] = "differences"
    #: Components of the model's error from this index on are independent and only decay.
    coupled: ClassVar[int] = 10**9

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """One node, at the start; its (n, n) covariance. Raises UnsuitableScenario."""
        front = self.front
        covariance = front.begin(start, instruments)
        self.size = n = front.size
        self.names = tuple(instruments)
        self._index = {name: i for i, name in enumerate(self.names)}
        self._kept = (*front.state, *self.node_arrays)
        self._made = Made()
        self.nodes = Columns(self._made, time=(), **{name: getattr(front, name).shape for name in self._kept})
        self.nodes.add(predicted=(n, n), predicted_shift=(n,), filtered=(n, n), filtered_shift=(n,), step=(n,), size=())
        self.motions = Columns(
            self._made, transition=(n, n), noise=(n, n), whitener=(n, n), begin_shift=(n,), end_shift=(n,), time=(),
            residual=(n,), jacobian=(n, n), whitened=(n,), norm=(), weight=(),
        )  # fmt: skip
        self.aids = Columns(
            self._made, node=np.int64, between=np.int64, instrument=np.int64, components=np.int64, time=(), value=(3,),
            noise=(3, 3), bare=np.int64, whitener=(3, 3), residual=(3,), jacobian=(3, n), whitened=(3,), norm=(),
            weight=(), cross=(3, n), white=(3, n), innovation=(3,), used=np.int64,
        )  # fmt: skip
        self._sides = max((len(own.kind.side) for own in front.own.values()), default=0)
        if self._sides:
            self.aids.add(side=(self._sides,))
        self._many = [(many, many.channels(self.names)) for many in front.many]
        together = {name for many in front.many for name in many.sources}
        #: Of each instrument: whether it has an equation of its own, and one reading is predicted at a time.
        self._one_by_one = np.array([name in front.own and name not in together for name in self.names], dtype=bool)
        self.between = Columns(
            self._made, node=np.int64, time=(), transition=(n, n), noise=(n, n), shift=(n,), jacobian=(n, n)
        )
        self.between.add(**{name: getattr(front, name).shape for name in self._kept})
        self.between.add(**{f"now_{name}": getattr(front, name).shape for name in front.state})
        self.base = self.base_between = 0
        self._append_node()
        self.since_node = MotionSinceNode(transition=np.eye(n), noise=np.zeros((n, n)), elapsed=np.zeros(1))
        self.prior = Prior(covariance=ready(covariance.copy()), whitener=np.empty((n, n)), shift=np.zeros(n))
        whitening(self.prior.covariance, self.prior.whitener)
        return covariance

    @cached_property
    def reference(self) -> Reference:
        """How the prior is linearised at another state; a model with rotations overrides it."""
        return Reference(at_node=keep_prior, at_mean=keep_prior, relative_shift=subtract_step)

    def _append_node(self) -> None:
        front = self.front
        self.nodes.append(time=front.time, **{name: getattr(front, name) for name in self._kept})

    @property
    def ahead(self) -> float:
        """Time from the newest node to the front [s]."""
        return float(self.since_node.elapsed[0])

    @property
    def rows(self) -> Rows:
        """Where the window is in whole columns."""
        rows: Rows | None = self._made.rows
        if rows is None:
            nodes, aids, between = self.nodes, self.aids, self.between
            rows = self._made.rows = Rows(
                nodes.first, nodes.last - nodes.first, self.motions.first, aids.first, aids.last - aids.first,
                between.first, between.last - between.first, self.base, self.base_between, min(self.coupled, self.size),
            )  # fmt: skip
        return rows

    @property
    def window(self) -> Window:
        """The nodes and factors as kernels take them; it holds until a column is replaced."""
        return self._made.once(Window, self._make_window)

    def _make_window(self) -> Window:
        return Window(
            nodes=self.nodes.record(Nodes), motions=self.motions.record(Motions),
            aids=self.aids.record(AidingFactors), prior=self.prior,
        )  # fmt: skip

    @property
    def moves(self) -> Any:
        """How the window is moved, as `simnav.estimators.models.inertial_chain.Moves`; here by methods."""
        return SimpleNamespace(
            reference=self.reference.in_python, linearise=lambda graph, rows, node: self.linearise_from(node),
            retract=lambda graph, rows, step: self.retract(step), take_step=lambda graph, rows: self.take_step(),
        )  # fmt: skip

    @property
    def graph(self) -> Any:
        """What the functions of `moves` work on, with the ``window``."""
        return SimpleNamespace(window=self.window)

    @property
    def needs(self) -> Needs:
        """What its model needs."""
        return self.front.needs

    def choose(self, instruments: Instruments, name: str) -> Chain:
        """Itself; UnsuitableScenario where its model lacks an instrument."""
        self.front.choose(instruments, name)
        return self

    @property
    def unaided(self) -> bool:
        """Whether its model observes nothing by design."""
        return self.front.unaided

    def observes(self, instrument: Datasheet) -> bool:
        """Whether measurements of an instrument can be factors."""
        return self.front.observes(instrument)

    def holds(self, instrument: Datasheet) -> bool:
        """Whether the model has a state for each block that an instrument brings along."""
        return self.front.holds(instrument)

    def load(self, imu: ImuSamples | None) -> None:
        """Take the IMU samples of the step that follows."""
        self.front.load(imu)

    @property
    def time(self) -> float:
        """Of the front [s]."""
        return self.front.time

    def propagate(self, until: float) -> None:
        """Advance the front."""
        begin = self.front.time
        if until <= begin:
            return
        since = self.since_node
        self.front.propagate(since.noise, until)
        self.front.carry(since.transition, until - begin)
        since.elapsed[0] += until - begin

    def extend(self) -> None:
        """Make the front a node, with the motion since the newest one as its factor."""
        self.motions.append()
        append_motion.unchecked(self.window.motions, self.motions.last - 1, self.since_node, self.front.time)
        self._append_node()

    def predicted_covariance(self, newest: Array) -> Array:
        """Covariance of the front from that of the newest node."""
        if self.ahead == 0.0:
            return newest
        since = self.since_node
        covariance: Array = since.transition @ newest @ since.transition.T
        covariance += since.noise
        return covariance

    def linearise(self, measurement: Measurement) -> Linearised | None:
        """Linearise a measurement at the front, without attaching it."""
        return self.front.measure(measurement)

    def nominal_noise(self, measurement: Measurement) -> Array | None:
        """The (m, m) noise of a measurement at the front; None if it cannot be used."""
        return self.front.nominal_noise(measurement)

    def nominal_noises(self, measurements: Sequence[Measurement]) -> Array | None:
        """As `ErrorModel.nominal_noises`, at the front."""
        return self.front.nominal_noises(measurements)

    def attach(self, measurements: Sequence[Measurement], noise: Array) -> None:
        """Add k measurements of one time and m components, with their (k, m, m) noise, as factors on the newest node.

        They are predicted at the front.
        """
        aids, k, newest = self.aids, len(measurements), self.base + len(self.nodes) - 1
        between = self._intermediate(newest) if self.ahead > 0.0 else -1
        aids.append_rows(k)
        append_aids.unchecked(
            self.window.aids, aids.last - k, newest, between,
            np.array([self._index[m.instrument] for m in measurements], dtype=np.int64),
            np.array([m.time for m in measurements], dtype=np.float64),
            np.ascontiguousarray(noise, dtype=np.float64), np.array([m.value for m in measurements], dtype=np.float64),
        )  # fmt: skip
        if self._sides and len(measurements[0].side):
            aids["side"][-k:, : len(measurements[0].side)] = [m.side for m in measurements]

    def _intermediate(self, newest: int) -> int:
        """The number of the intermediate state of a node at the front's time; a new one, if there is none yet."""
        front, between = self.front, self.between
        if not len(between) or between["node"][-1] != newest or between["time"][-1] != front.time:
            between.append(time=front.time, **{name: getattr(front, name) for name in self._kept})
            append_between.unchecked(self._states_between, between.last - 1, self.since_node, newest)
        return self.base_between + len(between) - 1

    def settle(self, moved: Array) -> None:
        """Set the front to the newest node. If it is later than the node, correct it by ``moved``, the node's shift."""
        if self.ahead == 0.0:
            self.front.restore([self.nodes.newest(name) for name in self.front.state])
        else:
            self.front.correct(self.since_node.transition @ moved)

    def growing(self, count: int) -> Any:
        """What `functions` append the rows of so many measurements to; it holds until a column is replaced."""
        raise NotImplementedError(f"{type(self).__name__} has no functions that append rows")

    def grow(self, new: NewRows) -> None:
        """Count the rows that `functions` have appended."""
        rows = ((self.nodes, new.nodes), (self.motions, new.nodes), (self.aids, new.aids), (self.between, new.between))
        for columns, appended in rows:
            if appended:
                columns.grow(appended)

    def detach(self, count: int) -> None:
        """Remove the newest aiding factors."""
        self.aids.drop_newest(count)

    def marginalise(self, count: int) -> None:
        """Let the oldest nodes leave; what they say about the first that stays, at the last step, is its prior."""
        leaving = marginalise.unchecked(count, self.window, self._states_between, self.rows, self.reference)
        self.base += count
        self.base_between += leaving.between
        self.nodes.drop(count)
        self.motions.drop(count)
        self.aids.drop(leaving.aids)
        self.between.drop(leaving.between)

    @property
    def _states_between(self) -> IntermediateStates:
        """The intermediate states as kernels take them."""
        return self._made.once(IntermediateStates, lambda: self.between.record(IntermediateStates))

    def _changed(self) -> list[Array]:
        """Views of the arrays that `retract` changes."""
        motions, nodes = self.motions, [self.nodes[name] for name in self.front.state]
        return [*nodes, motions["begin_shift"], motions["end_shift"], self.between["shift"], self.prior.shift]

    def copy_states(self) -> list[Array]:
        """Copies of what `retract` changes, for `restore_states`."""
        return [array.copy() for array in self._changed()]

    def restore_states(self, states: list[Array]) -> None:
        """Take a `retract` back."""
        for array, value in zip(self._changed(), states, strict=True):
            array[...] = value

    def estimate(self, covariance: Array) -> Estimate:
        """The front as an estimate."""
        return self.front.estimate(covariance)

    def linearise_from(self, node: int = 0) -> None:
        """Linearise the factors that have to do with a node of the window or later ones, and whiten their residuals."""
        motions, aids = self.motions, self.aids
        self.linearise_motion(node)
        self.linearise_aids(node)
        whiten.unchecked(
            max(node - 1, 0), motions["residual"], motions["whitener"], motions["whitened"], motions["norm"]
        )
        whiten.unchecked(self.first_aid(node), aids["residual"], aids["whitener"], aids["whitened"], aids["norm"])

    def first_aid(self, node: int) -> int:
        """The index of the first aiding factor of a node of the window, or of a later one."""
        return int(self.aids["node"].searchsorted(self.base + node)) if node else 0

    @abstractmethod
    def linearise_motion(self, node: int = 0) -> None:
        """Compute ``residual`` and ``jacobian`` of the motion factors that lead to a node or to later ones.

        With the state x predicted by a motion, ``residual`` is the newer node minus x, and ``jacobian`` is the
        derivative of x with respect to the older node.
        """

    @abstractmethod
    def linearise_aids(self, node: int = 0) -> None:
        """Compute ``residual`` (measured minus predicted) and ``jacobian`` (of the prediction) from a node on."""

    def places(self, first: int) -> list[tuple[NDArray[np.int64], Columns, str]]:
        """Where the aids from an index on are predicted: at nodes, and at intermediate states if there are any.

        Returns
        -------
        list of (row, states, prefix)
            The arguments of `observe`.
        """
        aids, between = self.aids, self.between
        row = aids["node"] - self.base
        if not len(between) or first == len(aids):
            return [(row, self.nodes, "")]
        at_node = aids["between"] < 0
        later = np.where(at_node, -1, aids["between"] - self.base_between)
        return [(np.where(at_node, row, -1), self.nodes, ""), (later, between, "now_")]

    @abstractmethod
    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """Fill ``residual``, ``components`` and the (M, 3, n) ``jacobian`` of the aids from one on.

        Parameters
        ----------
        first : int
            Index of the first measurement to be predicted.
        row : (M,) int array
            Index of the state of each aiding factor in ``states``; -1: the factor is not computed.
        states : Columns
            The states at which the measurements are predicted: nodes or intermediate states.
        prefix : str
            Prefix of the names of the model's arrays in ``states``.
        jacobian : (M, 3, n) array
            Overwritten with the Jacobians of the predictions with respect to these states.
        """

    def _note(self, i: int, found: tuple[Array, Array] | None, jacobian: Array) -> None:
        """Write (d,) innovation and (d, n) Jacobian of an aid; None where the state has no reading."""
        aids = self.aids
        aids["residual"][i], jacobian[i], aids["components"][i] = 0.0, 0.0, 0
        if found is not None:
            d = len(found[0])
            aids["residual"][i, :d], jacobian[i, :d], aids["components"][i] = *found, d

    def observe_own(self, first: int, row: NDArray[np.int64], jacobian: Array, states: NamedState) -> None:
        """`observe` for the aids whose kind has a measurement equation of its own.

        Parameters
        ----------
        first, row, jacobian
            As of `observe`.
        states : NamedState
            K states, as `simnav.estimators.models.base.ErrorModel.observe_own` takes one of them.
        """
        aids, own = self.aids, self.front.own
        one_by_one = self._one_by_one
        here, among = row[first:] >= 0, aids["instrument"][first:]
        for many, channel in self._many:
            if (found := here & (channel[among] >= 0)).any():
                self._observe_many(many, channel, first, found, row, jacobian, states)
        if not one_by_one.any():
            return
        for i in (first + np.flatnonzero(one_by_one[among] & here)).tolist():
            name = self.names[aids["instrument"][i]]
            d = len(own[name].kind.components)
            at = at_row(states, row[i])
            found = self.front.observe_own(name, aids["time"][i], aids["value"][i, :d], at, self.side_of(i))
            self._note(i, found, jacobian)

    def _observe_many(
        self,
        many: ChannelReadings,
        channel: NDArray[np.intp],
        first: int,
        found: Flags,
        row: NDArray[np.int64],
        jacobian: Array,
        states: NamedState,
    ) -> None:
        """`observe_own` for the readings of an instrument with channels: those ``found`` among the aids from one on."""
        aids, d = self.aids, len(many.kind.components)
        rows: Any = slice(first, len(row)) if found.all() else first + np.flatnonzero(found)
        at = row[rows]
        low, high = int(at.min()), int(at.max()) + 1
        # Rows in a slice are written where they are, without a copy.
        out = jacobian[rows, :d] if isinstance(rows, slice) else None
        innovation, of_these = many.linearise(
            aids["time"][rows], aids["value"][rows, :d], channel[aids["instrument"][rows]],
            at_row(states, slice(low, high)), at - low, aids["side"][rows, : len(many.kind.side)], out,
        )  # fmt: skip
        aids["residual"][rows], aids["components"][rows] = 0.0, d
        aids["residual"][rows, :d] = innovation
        if out is None:
            jacobian[rows, :d] = of_these
        jacobian[rows, d:] = 0.0

    def side_of(self, i: int) -> Array:
        """The (s,) side information of an aiding factor, whose instrument has an equation of its own."""
        if not self._sides:
            return NO_SIDE
        name = self.names[self.aids["instrument"][i]]
        side: Array = self.aids["side"][i, : len(self.front.own[name].kind.side)]
        return side

    @abstractmethod
    def retract(self, step: Array) -> None:
        """Add a (K, n) step to the nodes and to the shifts of the motion factors; subtract it from the prior shift."""

    def take_step(self) -> float:
        """Retract the nodes by their ``step``, and do `keep`."""
        self.retract(self.nodes["step"])
        return self.keep()

    def keep(self) -> float:
        """Refer what the elimination left, and the residuals, to the nodes as they are after the step; the cost."""
        cost: float = after_step.unchecked(self.window, self.rows)
        return cost

    @abstractmethod
    def along_motion(self, step: Array) -> Array:
        """A (K, n) step along the exact motion, with the motion errors of the linear solution.

        The first node has its given step. Each later node is the exact prediction from the node before, plus the motion
        error of the linear solution. If rotations are large, a straight step violates the stiff motion factors at
        second order (the Maratos effect: J. Nocedal, S. J. Wright, *Numerical Optimization*, 2006, section 15.5).
        """

    def relative_shift(self, shift: Array, step: Array) -> Array:
        """An (n,) shift, relative to the state after a step."""
        rest = np.empty_like(shift)
        self.reference.in_python.relative_shift(shift, step, rest)
        return rest


@singledispatch
def chain_of(model: Any) -> Chain:
    """The chain of a model, for a graph. A third party registers its own chain for the class of its model.

    Raises
    ------
    TypeError
        If no chain is known for the model.
    """
    raise TypeError(f"{type(model).__name__} has no chain, so that no graph can be made of it")


@chain_of.register
def _(model: Chain) -> Chain:
    return model
