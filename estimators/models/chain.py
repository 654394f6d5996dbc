"""What a model is to a graph: the nodes of a window and the factors that link them, around a state that runs ahead.

The model itself, the *front*, runs from measurement to measurement as it does in a filter. At each time of a
measurement its state becomes a node, and what lies between two nodes a motion factor: the transition matrix F and the
noise Q that the model accumulated, on the trajectory that it predicted. A factor knows how far its two ends have moved
since (``begin_shift``, ``end_shift``), which is all it takes to linearise it anew: with x the nodes now, the error is
``e = x_k+1 - f(x_k)``, f being the exact motion. So the IMU is integrated once, whatever happens to the nodes
(preintegration: C. Forster et al., "On-manifold preintegration for real-time visual-inertial odometry", IEEE Trans.
Robotics 33(1), 2017; here about the predicted trajectory and on the rotating Earth).

A measurement need not have a node of its own. It can be *folded* onto the newest node, some time before it: what it
should read is then a function of that node through the motion between them, whose noise is added to the measurement's.
Two measurements that are folded onto one node share a part of that noise; this correlation is neglected.

A subclass compiles four loops over a window: `linearise_motion`, `linearise_aids`, `retract`, `along_motion`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import singledispatch
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import kernel
from simnav.estimator.needs import Needs
from simnav.estimators.algebra.whitening import whitening
from simnav.estimators.models.base import ErrorModel, Linearised
from simnav.types import Array, Datasheet, Estimate, ImuSamples, InitialState, Instruments, Integers, Measurement

__all__ = ["Chain", "Columns", "chain_of"]


@kernel("void(f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[::1])")
def _attach(noise: Array, value: Array, full: Array, whitener: Array, values: Array) -> None:
    """The (m, m) noise and the value of a measurement, widened to three components; and the whitener."""
    for i in range(3):
        values[i] = value[i] if i < value.size else 0.0
        for j in range(3):
            full[i, j] = noise[i, j] if max(i, j) < noise.shape[0] else 1.0 if i == j else 0.0
    whitening(full, whitener)


@kernel("void(i8, i8[::1], i8, f8[:, :, ::1], f8[:, :, ::1])")
def through_motion(first: int, row: Integers, coupled: int, transition: Array, jacobian: Array) -> None:
    """Take Jacobians at folds back to their nodes, in place.

    Parameters
    ----------
    first : int
        Aid to begin with.
    row : (M,) int array
        Of each aid among the folds; -1 for those that are not folded.
    coupled : int
        States from this one on only decay, each on its own.
    transition : (K, n, n) array
        Of the folds.
    jacobian : (M, 3, n) array
        Overwritten.
    """
    n = transition.shape[1]
    at_node = np.empty(n)
    for i in range(first, row.size):
        if row[i] < 0:
            continue
        for r in range(3):
            at_node[:] = 0.0
            for j in range(n):
                x = jacobian[i, r, j]
                if x != 0.0:
                    if j < coupled:
                        for c in range(coupled):
                            at_node[c] += x * transition[row[i], j, c]
                    else:
                        at_node[j] += x * transition[row[i], j, j]
            for c in range(n):
                jacobian[i, r, c] = at_node[c]


@kernel("void(i8, i8[::1], i8[::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, :, ::1], i8[::1])")
def add_motion_noise(
    first: int, row: Integers, components: Integers, jacobian: Array, motion_noise: Array, noise: Array,
    whitener: Array, bare: Integers,
) -> None:  # fmt: skip
    """Add the noise of the motion up to a fold to that of the measurements there, ``R + H Q H'``, once.

    Parameters
    ----------
    first : int
        Aid to begin with.
    row : (M,) int array
        Of each aid among the folds; -1 for those that are not folded.
    components : (M,) int array
        Number of components of each measurement.
    jacobian : (M, 3, n) array
        H, with respect to the state at the fold.
    motion_noise : (K, n, n) array
        Q of the folds, from their nodes.
    noise, whitener : (M, 3, 3) arrays
        Overwritten.
    bare : (M,) int array
        1 where it has not been added yet; overwritten with 0.
    """
    n = jacobian.shape[2]
    cross = np.empty(n)
    for i in range(first, row.size):
        if row[i] < 0 or bare[i] == 0:
            continue
        bare[i] = 0
        H, Q = jacobian[i], motion_noise[row[i]]
        for a in range(components[i]):
            cross[:] = 0.0
            for j in range(n):
                x = H[a, j]
                if x != 0.0:
                    for c in range(n):
                        cross[c] += x * Q[j, c]
            for b in range(components[i]):
                x = 0.0
                for c in range(n):
                    x += cross[c] * H[b, c]
                noise[i, a, b] += x
        whitening(noise[i], whitener[i])


class Columns:
    """Named columns of equal length; rows are appended at the end and dropped at the front.

    Parameters
    ----------
    **columns : tuple of int, or dtype
        Shape of a row's float64 entry, or the type of a scalar.

    Examples
    --------
    >>> c = Columns(time=(), value=(2,))
    >>> for t in range(3):
    ...     c.append(time=t, value=(t, -t))
    >>> c.drop(1)
    >>> c["time"].tolist(), c["value"][0].tolist()
    ([1.0, 2.0], [1.0, -1.0])
    """

    def __init__(self, **columns: Any):
        self._capacity = 64
        self._columns: dict[str, Any] = {}
        self._views: dict[str, Any] = {}
        self._first = self._last = 0
        self.add(**columns)

    def add(self, **columns: Any) -> None:
        """More columns; the rows that there are have zeros in them."""
        for name, what in columns.items():
            shape, dtype = ((self._capacity, *what), float) if isinstance(what, tuple) else ((self._capacity,), what)
            self._columns[name] = np.zeros(shape, dtype)

    def __len__(self) -> int:
        return self._last - self._first

    def __getitem__(self, name: str) -> Any:
        """A view of a column, (rows, ...)."""
        view = self._views.get(name)
        if view is None:
            view = self._views[name] = self._columns[name][self._first : self._last]
        return view

    def newest(self, name: str) -> Any:
        """A view of the last row's entry in a column."""
        return self._columns[name][self._last - 1]

    def append(self, **values: Any) -> None:
        """Add a row; what is not given keeps any value."""
        if self._last == self._capacity:
            self._make_room()
        for name, value in values.items():
            self._columns[name][self._last] = value
        self._last += 1
        self._views.clear()

    def drop(self, count: int) -> None:
        """Take ``count`` rows off the front."""
        self._first += count
        self._views.clear()

    def pop(self, count: int) -> None:
        """Take ``count`` rows off the end."""
        self._last -= count
        self._views.clear()

    def _make_room(self) -> None:
        """Move the rows to the front; twice the space where they fill more than half of it."""
        rows = len(self)
        grown = 2 * self._capacity if 2 * rows > self._capacity else self._capacity
        for name, column in self._columns.items():
            if grown > self._capacity:
                new = np.zeros((grown, *column.shape[1:]), column.dtype)
                new[:rows] = column[self._first : self._last]
                self._columns[name] = new
            else:
                column[:rows] = column[self._first : self._last].copy()
        self._capacity, self._first, self._last = grown, 0, rows


class Chain(ABC):
    """The nodes and factors of a window over a model.

    Parameters
    ----------
    front : ErrorModel
        With `carry`.

    Attributes
    ----------
    size : int
        n, of the model's error.
    nodes : Columns
        ``time`` and the arrays of the model that `node_arrays` names.
    motions : Columns
        Of the factor that leads to a node from the one before: ``transition``, ``noise``, ``whitener`` (n, n);
        ``begin_shift``, ``end_shift`` (n,); as linearised last, ``jacobian`` (n, n) and ``residual`` (n,); ``weight``.
    aids : Columns
        ``node`` (number since the start of the run), ``fold`` (likewise, or -1), ``instrument`` (index into ``names``),
        ``components``, ``time``, ``value`` (3,), ``noise`` and ``whitener`` (3, 3), ``bare`` (1 where the noise lacks
        that of the motion yet); as linearised last ``residual`` (3,), ``jacobian`` (3, n); ``weight``. In ascending
        order of their nodes.
    folds : Columns
        Times between nodes at which there are measurements: ``node`` (number of the node before), ``time``,
        ``transition`` and ``noise`` (n, n) from the node, ``shift`` (n,) by which the node has moved since, the
        model's arrays as predicted then, and with ``now_`` before their names as the shifted node leads to;
        ``jacobian`` (n, n).
    fold_base : int
        Number of the first of them since the start of the run.
    names : tuple of str
        Of the instruments.
    base : int
        Number of the first node of the window since the start of the run.
    ahead : float
        Time from the newest node to the front [s].
    prior : (n, n) array
        Covariance of the first node without its own measurements.
    prior_shift : (n,) array
        Mean of the first node without its own measurements, minus the node.
    """

    def __init__(self, front: ErrorModel):
        self.front = front

    #: Arrays of the model that a node keeps beside those of its ``state``.
    node_arrays: tuple[str, ...] = ()
    #: Components of the model's error from this one on have no part in the motion of others, and only decay.
    coupled: ClassVar[int] = 10**9

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """One node, at the start; its (n, n) covariance. Raises UnsuitableScenario."""
        front = self.front
        covariance = front.begin(start, instruments)
        self.size = n = front.size
        self.names = tuple(instruments)
        self._index = {name: i for i, name in enumerate(self.names)}
        self._kept = (*front.state, *self.node_arrays)
        self.nodes = Columns(time=(), **{name: getattr(front, name).shape for name in self._kept})
        self.motions = Columns(
            transition=(n, n), noise=(n, n), whitener=(n, n), begin_shift=(n,), end_shift=(n,), time=(),
            residual=(n,), jacobian=(n, n), whitened=(n,), norm=(), weight=(),
        )  # fmt: skip
        self.aids = Columns(
            node=np.int64, fold=np.int64, instrument=np.int64, components=np.int64, time=(), value=(3,), noise=(3, 3),
            bare=np.int64, whitener=(3, 3), residual=(3,), jacobian=(3, n), whitened=(3,), norm=(), weight=(),
        )  # fmt: skip
        self.folds = Columns(node=np.int64, time=(), transition=(n, n), noise=(n, n), shift=(n,), jacobian=(n, n))
        self.folds.add(**{name: getattr(front, name).shape for name in self._kept})
        self.folds.add(**{f"now_{name}": getattr(front, name).shape for name in front.state})
        self.base = self.fold_base = 0
        self._identity = np.eye(n)
        self._append_node()
        self._pending()
        self.set_prior(covariance, np.zeros(n))
        return covariance

    def _append_node(self) -> None:
        front = self.front
        self.nodes.append(time=front.time, **{name: getattr(front, name) for name in self._kept})

    def _pending(self) -> None:
        """Motion since the newest node: none."""
        self._transition, self._noise = self._identity.copy(), np.zeros_like(self._identity)
        self.ahead = 0.0

    def set_prior(self, covariance: Array, shift: Array) -> None:
        """What is believed of the first node: its covariance, and the mean less the node."""
        self.prior, self.prior_shift = covariance.copy(), shift.copy()
        self.prior_whitener = np.empty_like(self.prior)
        whitening(self.prior, self.prior_whitener)

    @property
    def needs(self) -> Needs:
        """What its model needs."""
        return self.front.needs

    def choose(self, instruments: Instruments, name: str) -> Chain:
        """Itself; UnsuitableScenario where its model lacks an instrument."""
        self.front.choose(instruments, name)
        return self

    def observes(self, instrument: Datasheet) -> bool:
        """Whether measurements of an instrument can be factors."""
        return self.front.observes(instrument)

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
        self.front.propagate(self._noise, until)
        self.front.carry(self._transition, until - begin)
        self.ahead += until - begin

    def extend(self) -> None:
        """Make the front a node, with the motion since the newest one as its factor."""
        self.motions.append(
            transition=self._transition, jacobian=self._transition, noise=self._noise, begin_shift=0.0, end_shift=0.0,
            time=self.front.time, weight=1.0,
        )  # fmt: skip
        whitening(self._noise, self.motions.newest("whitener"))
        self._append_node()
        self._pending()

    def predicted_covariance(self, newest: Array) -> Array:
        """Covariance of the front from that of the newest node."""
        if self.ahead == 0.0:
            return newest
        covariance: Array = self._transition @ newest @ self._transition.T
        covariance += self._noise
        return covariance

    def linearise(self, measurement: Measurement) -> Linearised | None:
        """A measurement at the front, not attached yet."""
        return self.front.measure(measurement)

    def nominal_noise(self, measurement: Measurement) -> Array | None:
        """The (m, m) noise of a measurement at the front; None where it says nothing usable."""
        return self.front.nominal_noise(measurement)

    def attach(self, measurement: Measurement, noise: Array) -> None:
        """Make a measurement at the front, with the (m, m) noise, a factor on the newest node.

        The noise of the motion between is added where it is linearised first.
        """
        aids, ahead = self.aids, self.ahead > 0.0
        aids.append(
            node=self.base + len(self.nodes) - 1, fold=self._fold() if ahead else -1, bare=ahead, weight=1.0,
            instrument=self._index[measurement.instrument], components=len(noise), time=measurement.time,
        )  # fmt: skip
        _attach(
            np.ascontiguousarray(noise, dtype=np.float64), np.ascontiguousarray(measurement.value, dtype=np.float64),
            aids.newest("noise"), aids.newest("whitener"), aids.newest("value"),
        )  # fmt: skip

    def _fold(self) -> int:
        """The number of the fold at the front's time; a new one, if there is none yet."""
        front, folds = self.front, self.folds
        newest = self.base + len(self.nodes) - 1
        if not len(folds) or folds["node"][-1] != newest or folds["time"][-1] != front.time:
            folds.append(
                node=newest, time=front.time, transition=self._transition, noise=self._noise, shift=0.0,
                jacobian=self._transition, **{name: getattr(front, name) for name in self._kept},
            )  # fmt: skip
        return self.fold_base + len(folds) - 1

    def settle(self, moved: Array) -> None:
        """Set the front to the newest node, or, where it has run ahead of it, by how much that was ``moved``."""
        if self.ahead == 0.0:
            self.front.restore([self.nodes.newest(name) for name in self.front.state])
        else:
            self.front.correct(self._transition @ moved)

    def detach(self, count: int) -> None:
        """Take the newest aiding factors off again."""
        self.aids.pop(count)

    def drop(self, count: int) -> None:
        """Take the oldest nodes off the window, with their factors."""
        self.base += count
        self.nodes.drop(count)
        self.motions.drop(count)
        self.aids.drop(int(np.searchsorted(self.aids["node"], self.base)))
        folds = int(np.searchsorted(self.folds["node"], self.base))
        self.fold_base += folds
        self.folds.drop(folds)

    def copy_states(self) -> list[Array]:
        """What `retract` changes, for `restore_states`."""
        changed = [self.nodes[name].copy() for name in self.front.state]
        shifts = self.motions["begin_shift"], self.motions["end_shift"], self.folds["shift"], self.prior_shift
        return [*changed, *(shift.copy() for shift in shifts)]

    def restore_states(self, states: list[Array]) -> None:
        """Take a `retract` back."""
        for name, value in zip(self.front.state, states[:-4], strict=True):
            self.nodes[name][...] = value
        self.motions["begin_shift"][...], self.motions["end_shift"][...] = states[-4:-2]
        self.folds["shift"][...], self.prior_shift = states[-2:]

    def estimate(self, covariance: Array) -> Estimate:
        """The front as an estimate."""
        return self.front.estimate(covariance)

    def factors_from(self, node: int) -> tuple[int, int]:
        """The first rows of motions and aids that have to do with a node of the window or a later one."""
        return max(node - 1, 0), int(np.searchsorted(self.aids["node"], self.base + node)) if node else 0

    @abstractmethod
    def linearise_motion(self, first: int = 0) -> None:
        """Fill ``residual`` and ``jacobian`` of the motion factors from a row on, for the nodes as they are.

        With x the state after a motion, ``residual`` is the newer node less x, ``jacobian`` the derivative of x with
        respect to the older node.
        """

    def linearise_aids(self, first: int = 0) -> None:
        """Fill ``residual`` (measured less predicted) and ``jacobian`` (of the prediction) from a row on."""
        aids, folds = self.aids, self.folds
        jacobian, row = aids["jacobian"], aids["node"] - self.base
        if not len(folds) or first == len(aids):
            self.observe(first, row, self.nodes, "", jacobian)
            return
        at_node = aids["fold"] < 0
        self.observe(first, np.where(at_node, row, -1), self.nodes, "", jacobian)
        self.move_folds(int(np.searchsorted(folds["node"], aids["node"][first])))
        row = np.where(at_node, -1, aids["fold"] - self.fold_base)
        self.observe(first, row, folds, "now_", jacobian)
        add_motion_noise(
            first, row, aids["components"], jacobian, folds["noise"], aids["noise"], aids["whitener"], aids["bare"]
        )
        through_motion(first, row, min(self.coupled, self.size), folds["jacobian"], jacobian)

    @abstractmethod
    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """Fill ``residual``, ``components`` and the (M, 3, n) ``jacobian`` of the aids from one on.

        Parameters
        ----------
        first : int
            Index of the first measurement to be predicted.
        row : (M,) int array
            Of each aid in ``states``; -1 for those to be left alone.
        states : Columns
            Nodes or folds.
        prefix : str
            Of the names of the model's state in them.
        jacobian : (M, 3, n) array
            Of the prediction with respect to the state there.
        """

    def observe_own(self, first: int, row: NDArray[np.int64], jacobian: Array, *state: Array) -> None:
        """`observe` for the aids whose kind has a measurement equation of its own.

        Parameters
        ----------
        first, row, jacobian
            As of `observe`.
        *state : (K, ...) array
            The states, as `simnav.estimators.models.base.ErrorModel.observe_own` takes one of them.
        """
        aids, own = self.aids, self.front.own
        of_its_own = np.array([name in own for name in self.names])
        for i in first + np.flatnonzero(of_its_own[aids["instrument"][first:]] & (row[first:] >= 0)):
            name = self.names[aids["instrument"][i]]
            d = len(own[name].kind.components)
            aids["residual"][i], jacobian[i], aids["components"][i] = 0.0, 0.0, 0
            at = tuple(column[row[i]] for column in state)
            found = self.front.observe_own(name, aids["time"][i], aids["value"][i, :d], at)
            if found is not None:
                aids["residual"][i, :d], jacobian[i, :d], aids["components"][i] = *found, d

    @abstractmethod
    def move_folds(self, first: int) -> None:
        """Fill ``now_...`` and ``jacobian`` of the folds, from a row on, for the nodes as they are."""

    @abstractmethod
    def retract(self, step: Array) -> None:
        """Add a (K, n) step to the nodes and to the shifts of the motion factors; take it off the prior's."""

    @abstractmethod
    def along_motion(self, step: Array) -> Array:
        """A (K, n) step that leaves the same motion errors as a given one does in the linear solution.

        The first node takes its step; each later node goes where the motion leads from there, plus the motion error
        that the linearised factors say. Where rotations are large, a straight step leaves the motion, which is stiff,
        at second order (the Maratos effect: J. Nocedal, S. J. Wright, *Numerical Optimization*, 2006, section 15.5).
        """

    def turned(self, covariance: Array, shift: Array) -> Array:
        """A covariance about a state, about another that is away by a (n,) shift; a hook, as `relative_shift`."""
        return covariance

    def relative_shift(self, shift: Array, step: Array) -> Array:
        """A (n,) shift as seen from where a step leads; a hook for those whose errors do not simply subtract."""
        return shift - step


@singledispatch
def chain_of(model: Any) -> Chain:
    """The chain of a model, for a graph; a file with a chain of its own registers it for its model's class.

    Raises
    ------
    TypeError
        If no chain is known for the model.
    """
    raise TypeError(f"{type(model).__name__} has no chain, so that no graph can be made of it")


@chain_of.register
def _(model: Chain) -> Chain:
    return model
