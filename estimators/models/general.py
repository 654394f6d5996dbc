"""A model of others, by its motion and the chart of its state: everything that solvers need follows by differences.

A subclass says in plain NumPy

- `initial`: the state at the start of a run, an (m,) array, and the covariance of its (n,) error
- `move`: where the motion leads in a time
- `noise`: what it adds to the covariance of the error
- `navigation`: position, velocity, attitude and angular rate of a state, from which every instrument's reading follows
- `retract` and `difference`: a state with an error added, and the error between two states; plain sum and difference,
  unless a component is an angle or a latitude
- `describe`: the state as an estimate

From these come the transition matrix, the Jacobian of each measurement, sigma points, and the chain for windows and
full graphs (`GeneralChain`). Derivatives are central differences. A subclass may override `transition` or `read` with
faster forms. After its own states come the errors of its instruments
(`simnav.estimators.models.error_states.merged_states`) and the blocks that instruments bring along
(`simnav.blocks`).

`simnav.estimators.models.inertial` and `simnav.estimators.models.ship` are compiled forms of such models. In the tests
both stand in the general form, too, with the same blocks, and give the same numbers (``tests/cases/general_forms.py``).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from simnav.estimators.algebra.inflation import NO_STATES
from simnav.kinds import NavigationPoint
from simnav.types import KINDS, NO_SIDE, Array, Datasheet, Estimate, InitialState, Instruments, Measurement

from .ambiguity import innovation_of
from .base import Linearised
from .chain import Chain, chain_of
from .columns import Columns
from .declared_errors import bias_of
from .equations import EQUATIONS, equation_of
from .error_states import merged_states
from .lever_arms import has_measurement_function, with_lever_arms
from .measurement_functions import MeasurementFunction
from .moving_chain import MovingChain, MovingModel
from .points import PointModel
from .state_blocks import StateBlocks

__all__ = ["GeneralChain", "GeneralModel"]

#: Steps of the differences, as a part of the sigma at the start; and where that is zero.
PART, SMALLEST = 1e-3, 1e-6


class GeneralModel(PointModel, MovingModel):
    """The model of the module; a subclass defines its abstract methods.

    Attributes
    ----------
    x : (m,) array
        The state of the motion.
    extra : (k,) array
        Errors of the instruments, then the blocks that they bring along.
    blocks : StateBlocks
        The blocks, and their places in the error.
    equations : tuple of str
        Measurement equations (`simnav.kinds.EQUATIONS`) that the model uses; also every kind with an observation of its
        own. Subclasses may override it.
    errors : tuple of str
        Errors of instruments that have states (`simnav.estimators.models.declared_errors`). A subclass leaves out what
        is among its own states, and returns it from `own_errors`.
    """

    state = ("x", "extra")
    moving = NO_STATES
    equations: ClassVar[tuple[str, ...]] = tuple(EQUATIONS)
    errors: ClassVar[tuple[str, ...]] = ("bias", "current", "scale", "misalignment")

    @abstractmethod
    def initial(self, start: InitialState, instruments: Instruments) -> tuple[Array, Array]:
        """The (m,) state at the start of a run, and the (n, n) covariance of its error."""

    @abstractmethod
    def move(self, x: Array, elapsed: float) -> Array:
        """The (m,) state after a time [s]."""

    @abstractmethod
    def noise(self, x: Array, elapsed: float) -> Array:
        """(n, n) covariance that a time [s] adds to the error."""

    @abstractmethod
    def navigation(self, x: Array, time: float) -> NavigationPoint:
        """Position, velocity, attitude and angular rate of a state, without ``blocks``."""

    @abstractmethod
    def describe(self, x: Array, time: float, covariance: Array) -> Estimate:
        """A state with the (n, n) covariance of its error as an estimate."""

    def own_errors(self, x: Array) -> Mapping[str, Array]:
        """Values of errors that are among the model's own states, by name, like a ``current``; by default none."""
        return {}

    def retract(self, x: Array, error: Array) -> Array:
        """The state that differs from another by an (n,) error; by default their sum."""
        return np.asarray(x + error)

    def difference(self, x: Array, reference: Array) -> Array:
        """The (n,) error that leads from ``reference`` to ``x``: the inverse of `retract`."""
        return np.asarray(x - reference)

    def read(self, x: Array, time: float, sheet: Datasheet, extra: Array, side: Array = NO_SIDE) -> Array | None:
        """What an instrument should read at a state: (d,) array, or None; with its errors and the blocks in ``extra``.

        ``side`` is the (s,) side information of the reading of a channel.
        """
        own = self.own.get(sheet.name)
        point = self.navigation(x, time)
        errors = {**self.own_errors(x), **{name: extra[at] for name, at in self._errors_at[sheet.name].items()}}
        if own is None:
            reading = equation_of(sheet).read(point, sheet, errors)
        else:
            reading = own.read(self._point(own, x, time, extra, side))
        if reading is None or "bias" not in errors:
            return reading
        return KINDS[sheet.kind].add_error(reading, errors["bias"])

    def _point(self, own: MeasurementFunction, x: Array, time: float, extra: Array, side: Array) -> NavigationPoint:
        """The state at which a function predicts a reading."""
        point = self.navigation(x, time)
        return point._replace(blocks=own.blocks(extra), channel=own.channel, side=side)

    def observes(self, instrument: Datasheet) -> bool:
        """Whether the model uses an instrument."""
        return instrument.equation in self.equations or KINDS[instrument.kind].observation is not None

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; the covariance of its error, biases and blocks included."""
        self.time = start.time
        instruments = with_lever_arms(instruments)
        x, own = self.initial(start, instruments)
        self.x, self.n_own = np.array(x, dtype=np.float64), len(own)
        self.sheets = {name: s for name, s in instruments.items() if self.observes(s)}
        self.blocks = StateBlocks(self.n_own)
        self._errors_at: dict[str, dict[str, slice]] = {}
        self._white: dict[str, Array] = {}
        for name, sheet in self.sheets.items():
            self._white[name] = np.diag(sheet.sigma**2 + bias_of(sheet).white_variance())
            at = self._errors_at[name] = {}
            for error, rates in merged_states(sheet).items():
                if error in self.errors:
                    first = self.blocks.add(name, error, rates) - self.n_own
                    at[error] = slice(first, first + len(rates))
        brought = [s for s in self.sheets.values() if has_measurement_function(s)]
        self.blocks.bring(brought)
        self.own = {s.name: MeasurementFunction(s, self.blocks.places(s.name, self.n_own), start.time) for s in brought}
        self.size = self.blocks.size
        self.extra = np.zeros(self.size - self.n_own)
        variance, _, _ = self.blocks.columns(self.n_own)
        covariance = np.zeros((self.size, self.size))
        covariance[: self.n_own, : self.n_own] = own
        covariance[range(self.n_own, self.size), range(self.n_own, self.size)] = variance
        self._steps = PART * np.sqrt(covariance.diagonal())
        self._steps[self._steps == 0.0] = SMALLEST
        self._last = np.eye(self.size)
        return covariance

    # --- what follows

    def moved_extra(self, extra: Array, elapsed: float) -> Array:
        """(k,) or (j, k) errors and blocks after a time [s]."""
        moved = np.asarray(extra * self.blocks.step(elapsed)[0])
        self.blocks.carry_values(moved.T, self.n_own, elapsed)
        return moved

    def transition(self, x: Array, moved: Array, elapsed: float) -> Array:
        """(n, n) derivative of the motion's error by that of a state ``x``, which it leads to ``moved``."""
        m = self.n_own
        F = np.eye(self.size)
        for j in range(m):
            step = np.zeros(m)
            step[j] = self._steps[j]
            ends = [self.difference(self.move(self.retract(x, s * step), elapsed), moved) for s in (1.0, -1.0)]
            F[:m, j] = (ends[0] - ends[1]) / (2.0 * step[j])
        F[range(m, self.size), range(m, self.size)] = self.blocks.step(elapsed)[0]
        for at in self.blocks.clocks:
            F[at, at + 1] = elapsed
        return F

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        elapsed, m = until - self.time, self.n_own
        if elapsed <= 0.0:
            return
        moved = self.move(self.x, elapsed)
        F = self._last = self.transition(self.x, moved, elapsed)
        covariance[:] = F @ covariance @ F.T
        covariance[:m, :m] += self.noise(self.x, elapsed)
        covariance[range(m, self.size), range(m, self.size)] += self.blocks.step(elapsed)[1]
        self.blocks.add_noise(covariance, elapsed)
        covariance[:] = 0.5 * (covariance + covariance.T)
        self.x[:], self.extra[:], self.time = moved, self.moved_extra(self.extra, elapsed), until

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        error[...] = self._last @ error

    def linearise(
        self, name: str, time: float, value: Array, x: Array, extra: Array, side: Array = NO_SIDE
    ) -> tuple[Array, Array] | None:
        """Innovation (d,) and Jacobian (d, n) of a measurement at any state; None where it has no reading."""
        sheet, kind, m = self.sheets[name], KINDS[self.sheets[name].kind], self.n_own
        reading = self.read(x, time, sheet, extra, side)
        if reading is None:
            return None
        jacobian = np.zeros((len(reading), self.size))
        for j in [*range(m), *(m + k for k in self._extra_of(name))]:
            error = np.zeros(self.size)
            error[j] = self._steps[j]
            ends, length = [reading, reading], 0.0
            for end, sign in enumerate((1.0, -1.0)):
                there = self.read(self.retract(x, sign * error[:m]), time, sheet, extra + sign * error[m:], side)
                if there is not None:
                    ends[end] = there
                    length += error[j]
            if length:
                jacobian[:, j] = kind.difference(ends[0], ends[1]) / length
        return innovation_of(kind, sheet, value, reading), jacobian

    def _extra_of(self, name: str) -> list[int]:
        """Which of ``extra`` an instrument depends on."""
        return [k - self.n_own for place in self.blocks.of(name) for k in range(place.start, place.stop)]

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement at the present state."""
        name = measurement.instrument
        found = self.linearise(name, measurement.time, measurement.value, self.x, self.extra, measurement.side)
        if found is None:
            return None
        noise, own = self._white[name], self.own.get(name)
        if own is not None and (more := own.reading_noise(measurement.side)) is not None:
            noise = noise + more
        if own is not None and own.kind.message_noise is not None:
            noise = noise + own.message_noise(self._point(own, self.x, self.time, self.extra, measurement.side))
        return Linearised(*found, noise)

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        self.x[:] = self.retract(self.x, dx[: self.n_own])
        self.extra += dx[self.n_own :]

    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state and the points; return the process noise."""
        elapsed, m = until - self.time, self.n_own
        ends = [self.move(self.retract(self.x, e[:m]), elapsed) for e in errors]
        noise = np.zeros((self.size, self.size))
        self.propagate(noise, until)
        errors[:, :m] = [self.difference(end, self.x) for end in ends]
        errors[:, m:] = self.moved_extra(errors[:, m:], elapsed)
        return noise

    def observe_points(self, measurement: Measurement, errors: Array) -> Array:
        """What the instrument should read at the points, minus what it should read at the state."""
        name, m = measurement.instrument, self.n_own
        sheet, kind = self.sheets[name], KINDS[measurement.kind]
        time, side = measurement.time, measurement.side
        found = self.linearise(name, time, measurement.value, self.x, self.extra, side)
        reading = self.read(self.x, time, sheet, self.extra, side)
        assert found is not None and reading is not None  # noqa: PT018 (`measure` says something of it)
        differences = errors @ found[1].T
        for k, error in enumerate(errors):
            there = self.read(self.retract(self.x, error[:m]), time, sheet, self.extra + error[m:], side)
            if there is not None:
                differences[k] = kind.difference(there, reading)
        return np.asarray(differences)

    def move_all(self, states: tuple[Array, ...], elapsed: Array, jacobian: Array | None = None) -> None:
        """As `MovingModel.move_all`."""
        for k, (x, extra, time) in enumerate(zip(*states, elapsed.tolist(), strict=True)):
            moved = self.move(x, time)
            if jacobian is not None:
                jacobian[k] = self.transition(x, moved, time)
            x[:], extra[:] = moved, self.moved_extra(extra, time)

    def difference_all(self, states: tuple[Array, ...], others: tuple[Array, ...]) -> Array:
        """As `MovingModel.difference_all`."""
        own = [self.difference(x, other) for x, other in zip(states[0], others[0], strict=True)]
        return np.hstack([np.reshape(own, (len(own), self.n_own)), states[1] - others[1]])

    def retract_all(self, states: tuple[Array, ...], steps: Array) -> None:
        """As `MovingModel.retract_all`."""
        for x, step in zip(states[0], steps, strict=True):
            x[:] = self.retract(x, step[: self.n_own])
        states[1][...] += steps[:, self.n_own :]

    def estimate(self, covariance: Array) -> Estimate:
        """The state as an estimate."""
        m = self.n_own
        estimate = self.describe(self.x.copy(), self.time, covariance[:m, :m])
        states = self.blocks.report(self.extra, m, covariance, self.reports_all)
        return replace(estimate, states={**estimate.states, **states})


class GeneralChain(MovingChain):
    """The chain of a general model.

    Parameters
    ----------
    front : GeneralModel
        The model that runs ahead and leaves the nodes behind.
    """

    front: GeneralModel

    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """As `Chain.observe`."""
        aids, x, extra = self.aids, states[f"{prefix}x"], states[f"{prefix}extra"]
        for i in (first + np.flatnonzero(row[first:] >= 0)).tolist():
            name = self.names[aids["instrument"][i]]
            d = len(self.front._white[name])
            side = self.side_of(i) if name in self.front.own else NO_SIDE
            found = self.front.linearise(name, aids["time"][i], aids["value"][i, :d], x[row[i]], extra[row[i]], side)
            self._note(i, found, jacobian)


@chain_of.register
def _(model: GeneralModel) -> Chain:
    return GeneralChain(model)
