"""Measurement equations of kinds of instruments that are Python functions.

A kind may name one of the compiled equations (`simnav.kinds.EQUATIONS`), or be declared with a function that predicts a
reading and gives its Jacobian (`simnav.kinds.Observation`; see ``docs/how-to/add-an-instrument.md``). Such functions
are used here, for every model over the inertial state, in filters and graphs; for a ship without an IMU see
`simnav.estimators.models.ship_observation`.

A reading may depend on states that the instrument brings along (`simnav.blocks`). A Jacobian, or a block of it, that
the function does not give is computed here by central differences.

The reading of a channel also depends on which channel it is and on its side information, and its noise may do so, too
(`simnav.kinds.Kind.reading_sigma`).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from simnav.blocks import NAVIGATION
from simnav.geometry.earth import earth_rate, principal_radii
from simnav.geometry.rotation import dcm_from_rotation_vector
from simnav.kinds import NavigationPoint, NavigationPoints
from simnav.plugins import place_of
from simnav.types import KINDS, NO_SIDE, Array, Datasheet

from .ambiguity import innovation_of
from .channels import ChannelDatasheet, whole
from .delayed import acceleration, is_delayed
from .inertial_errors import PART, TRIAD
from .lever_arms import observation_of
from .measurements import State

__all__ = ["Kinematics", "MeasurementFunction", "PredictedReading"]

#: Number of columns of an observation's Jacobian: position, velocity, attitude.
_COMPONENTS = PART.navigation.stop
#: Steps of the differences: position [m], velocity [m/s], attitude [rad]; of a block, as a part of its sigma, and where
#: that is zero.
_STEPS = np.repeat([0.1, 1e-3, 1e-5], 3)
_PART_OF_SIGMA, _SMALLEST_STEP = 1e-3, 1e-6
#: Step of an angular rate, of which a swing is linear [rad/s].
_RATE_STEP = 1e-2
_NONE: Mapping[str, Array] = MappingProxyType({})


class Kinematics(NamedTuple):
    """The motion of k states of a vessel.

    Attributes
    ----------
    position : (k, 3) array
        Geodetic latitude and longitude [rad], height [m].
    velocity : (k, 3) array
        North, east, down [m/s].
    dcm : (k, 3, 3) array
        Direction cosine matrix from body axes to north-east-down.
    angular_rate : (k, 3) array
        Rate of the body relative to the Earth, in body axes [rad/s].
    """

    position: Array
    velocity: Array
    dcm: Array
    angular_rate: Array

    def at(self, k: int) -> Kinematics:
        """One of the states."""
        return Kinematics(self.position[k], self.velocity[k], self.dcm[k], self.angular_rate[k])


class PredictedReading(NamedTuple):
    """A reading of d components, compared with what a state predicts.

    Attributes
    ----------
    innovation : (d,) array
        Measured minus predicted, in the units of the kind's errors.
    jacobian : (d, n) array
        Derivative of the prediction by the error of the state.
    own : (d, 9 + b) array
        That by the navigation state and the b components of blocks, as `MeasurementFunction.predict` gives it.
    point : NavigationPoint
        Where the reading is predicted.
    """

    innovation: Array
    jacobian: Array
    own: Array
    point: NavigationPoint


class MeasurementFunction:
    """The measurement equation of one instrument, or of one of its channels.

    Parameters
    ----------
    sheet : Datasheet
        Datasheet of an instrument that is observed by a function
        (`simnav.estimators.models.lever_arms.has_measurement_function`). For one with channels it is that of a channel
        (`simnav.estimators.models.channels.by_channel`); the function receives that of the instrument.
    places : mapping of str to int, optional
        Index of the first state of each of its blocks in the array of values that `point` receives. A block without a
        place has no state: it is zero, and its uncertainty counts as noise.
    since : float
        Time of the start of the run [s].

    Raises
    ------
    ValueError
        During a run, if the function of the kind raises, or does not return finite arrays of the right shapes.
    """

    def __init__(self, sheet: Datasheet, places: Mapping[str, int] = MappingProxyType({}), since: float = 0.0):
        assert not sheet.channels, "each channel has an equation of its own, see `by_channel`"
        self.sheet, self.kind, self._of_instrument = sheet, KINDS[sheet.kind], whole(sheet)
        self.channel = sheet.channel if isinstance(sheet, ChannelDatasheet) else ""
        observation = observation_of(sheet)
        assert observation is not None
        self._observation = observation
        #: The function for many readings. It knows no delays.
        self.observations = None if is_delayed(sheet) else self.kind.observations
        self._since, self._variance = since, sheet.sigma**2
        #: Index of the first state of each block that has states.
        self.places: Mapping[str, int] = {b.name: places[b.name] for b in sheet.blocks if b.name in places}
        self._slices = [
            (b.name, slice(places[b.name], places[b.name] + b.size)) for b in sheet.blocks if b.name in places
        ]
        self._zeros = {b.name: np.zeros(b.size) for b in sheet.blocks if b.name not in places}
        sizes = [block.size for block in sheet.blocks]
        ends = _COMPONENTS + np.cumsum([0, *sizes])
        #: Columns of the function's own Jacobian, by block.
        self._columns = {NAVIGATION: slice(0, _COMPONENTS)}
        self._columns |= {b.name: slice(int(i), int(i) + b.size) for b, i in zip(sheet.blocks, ends)}
        self._width = int(ends[-1])
        #: Of the columns after navigation: those with a state, and the places of these states.
        stated = [b.name in places for b in sheet.blocks for _ in range(b.size)]
        self._stated = _COMPONENTS + np.flatnonzero(stated)
        self._free = _COMPONENTS + np.flatnonzero(np.logical_not(stated))
        self._places = np.array(
            [places[b.name] + k for b in sheet.blocks if b.name in places for k in range(b.size)], dtype=np.intp
        )
        self._steps = [
            s * _PART_OF_SIGMA or _SMALLEST_STEP for b in sheet.blocks for s in np.atleast_1d(b.sigma).tolist()
        ]

    def __deepcopy__(self, memo: object) -> MeasurementFunction:
        """Itself: it never changes, and an estimator that takes late readings is copied in each step."""
        return self

    def point(self, time: float, state: State, side: Array = NO_SIDE) -> NavigationPoint:
        """The state for the function.

        Parameters
        ----------
        time : float
            Time of validity [s].
        state : State
            Where a delay needs it, the specific force as measured [m/s^2] is behind the angular rate.
        side : (s,) array
            Side information of the reading.
        """
        position, velocity, dcm, rate, bias = state.position, state.velocity, state.dcm, state.rate, state.bias
        turning = rate[TRIAD.gyroscopes] - bias[TRIAD.gyroscopes] - dcm.T @ earth_rate(position[0])
        moved = None
        if len(rate) == 6:
            moved = acceleration(position, velocity, dcm, rate[TRIAD.accelerometers] - bias[TRIAD.accelerometers])
        blocks = self.blocks(state.calibration)
        return NavigationPoint(time, position, velocity, dcm, turning, blocks, self.channel, side, moved)

    def blocks(self, values: Array) -> Mapping[str, Array]:
        """The values of the blocks, by name."""
        if not self.sheet.blocks:
            return _NONE
        return {**self._zeros, **{name: values[at] for name, at in self._slices}}

    def predict(self, point: NavigationPoint) -> tuple[Array, Array] | None:
        """The (d,) reading at a state and its Jacobian; None if there is no reading at the state.

        The Jacobian has nine columns for navigation, then those of the blocks in the order of the datasheet.
        """
        return self._checked(point, self._call(point))

    def _checked(self, point: NavigationPoint, result: Any) -> tuple[Array, Array] | None:
        """What the function returned at a point, with a whole Jacobian."""
        if result is None:
            return None
        d = len(self.kind.components)
        bare = isinstance(result, np.ndarray)
        try:
            reading, derivatives = (result, {}) if bare else result
            reading = np.asarray(reading, dtype=np.float64)
            if not isinstance(derivatives, Mapping):
                derivatives = {NAVIGATION: derivatives}
            blocks = {name: np.asarray(part, dtype=np.float64) for name, part in derivatives.items()}
        except (TypeError, ValueError):
            raise self._wrong(repr(result)) from None
        sizes = {name: (d, at.stop - at.start) for name, at in self._columns.items()}
        if reading.shape != (d,) or any(part.shape != sizes.get(name) for name, part in blocks.items()):
            shapes = " and ".join(str(part.shape) for part in blocks.values())
            if set(blocks) != {NAVIGATION}:
                shapes = ", ".join(f"{name!r}: {part.shape}" for name, part in blocks.items())
            raise self._wrong(f"shapes {reading.shape} and {shapes or 'nothing'}")
        if len(blocks) == 1 and self._width == _COMPONENTS:
            jacobian = blocks[NAVIGATION]
        else:
            jacobian = self._completed(point, reading, blocks)
        # A sum is finite where each of its terms is. That of an estimator whose state is not finite is its own fault.
        state = (point.position, point.velocity, point.dcm, *point.blocks.values())
        if not isfinite(reading.sum() + jacobian.sum()) and all(np.isfinite(part).all() for part in state):
            raise ValueError(
                f"{self._label()} should return finite numbers, or None where the state has no reading, not "
                f"{reading.tolist()} with the Jacobian {jacobian.tolist()}"
            )
        return reading, jacobian

    def _call(self, point: NavigationPoint) -> Any:
        try:
            return self._observation(point, self._of_instrument)
        except Exception as error:
            raise ValueError(f"{self._label()} raised {type(error).__name__}: {error}") from error

    def _wrong(self, returned: str) -> ValueError:
        """The error for a result of another form."""
        d = len(self.kind.components)
        message = (
            f"{self._label()} should return a reading of shape {(d,)} and its Jacobian "
            f"of shape {(d, _COMPONENTS)}, or None, not {returned}"
        )
        if self.sheet.blocks:
            sizes = ", ".join(f"{name!r}: {(d, at.stop - at.start)}" for name, at in self._columns.items())
            message += f"; by block the Jacobian is a dict of arrays of the shapes {{{sizes}}}"
        return ValueError(message)

    def _completed(self, point: NavigationPoint, reading: Array, blocks: Mapping[str, Array]) -> Array:
        """The whole Jacobian, with differences for the blocks that are not given."""
        jacobian = np.zeros((len(reading), self._width))
        for name, at in self._columns.items():
            if name in blocks:
                jacobian[:, at] = blocks[name]
                continue
            for k in range(at.start, at.stop):
                step = float(_STEPS[k]) if k < _COMPONENTS else self._steps[k - _COMPONENTS]
                jacobian[:, k] = self._slope(point, reading, k, step)
        return jacobian

    def _slope(self, point: NavigationPoint, reading: Array, column: int, step: float) -> Array:
        """The derivative of the reading by one component of the state; zero where its neighbours have no reading."""
        ends, length = [reading, reading], 0.0
        for side, sign in enumerate((1.0, -1.0)):
            error = np.zeros(self._width)
            error[column] = sign * step
            found = self._call(self._moved(point, error))
            if found is not None:
                ends[side] = np.asarray(found if isinstance(found, np.ndarray) else found[0], dtype=np.float64)
                length += step
        return np.asarray(self.kind.difference(ends[0], ends[1]) / length) if length else np.zeros(len(reading))

    def _moved(self, point: NavigationPoint, error: Array) -> NavigationPoint:
        """A state with an error: navigation, then the blocks of the datasheet."""
        position = point.position + error[PART.position] / _metres(point.position)
        velocity = point.velocity + error[PART.velocity]
        dcm = dcm_from_rotation_vector(error[PART.attitude]) @ point.dcm
        blocks = point.blocks
        if self.sheet.blocks:
            blocks = {b.name: point.blocks[b.name] + error[self._columns[b.name]] for b in self.sheet.blocks}
        return point._replace(position=position, velocity=velocity, dcm=dcm, blocks=blocks)

    def _label(self) -> str:
        """The function, for messages: of which kind it is, for which instrument, and where it stands."""
        file, line = place_of(self._observation)
        function = getattr(self._observation, "__name__", repr(self._observation))
        place = f"{function}() in {Path(file).name}, line {line}"
        return f"the observation of kind {self.sheet.kind!r} ({place}), for the instrument {self.sheet.name!r},"

    def spread(self, own: Array, point: NavigationPoint) -> Array | None:
        """The (d, d) covariance that a reading has beyond the noise of the datasheet; None if there is nothing.

        It is the noise of the blocks that have no state, the difference of this reading's own noise
        (`simnav.kinds.Kind.reading_sigma`) from that of the datasheet, and the noise of a message (`message_noise`).

        Parameters
        ----------
        own : (d, 9 + b) array
            Jacobian of `predict`.
        point : NavigationPoint
            The state of the reading. The uncertainty of a clock or a random walk grows from the start of the run to its
            time.
        """
        more = self.reading_noise(point.side)
        if self.kind.message_noise is not None:
            said = self.message_noise(point)
            more = said if more is None else more + said
        if not len(self._free):
            return more
        noise = np.zeros((len(own), len(own))) if more is None else more
        for block in self.sheet.blocks:
            if block.name in self._zeros:
                part = own[:, self._columns[block.name]]
                noise += part @ block.covariance(max(0.0, point.time - self._since)) @ part.T
        return noise

    @property
    def has_noise(self) -> bool:
        """Whether the noise of a reading depends on the state: by blocks without states, or by a message."""
        return bool(len(self._free)) or self.kind.message_noise is not None

    def noise_without_state(self, side: Array) -> Array | None:
        """The (d, d) covariance of `spread` where it depends on the side information only; None if it does not.

        It tells nothing about whether the state has a reading, so a kind that may have none has no such form.
        """
        if self.observations is None or self.has_noise:
            return None
        return self.reading_noise(side)

    def reading_noise(self, side: Array) -> Array | None:
        """The (d, d) covariance of a reading with this side information minus that of the datasheet; None if equal."""
        function, d = self.kind.reading_sigma, len(self.kind.components)
        if function is None:
            return None
        try:
            sigma = np.asarray(function(side, self._of_instrument), dtype=np.float64)
        except Exception as error:
            message = f"reading_sigma of kind {self.sheet.kind!r} raised {type(error).__name__}: {error}"
            raise ValueError(message) from error
        if sigma.shape != (d,) or not (isfinite(sigma.sum()) and sigma.min() >= 0.0):
            raise ValueError(
                f"reading_sigma of kind {self.sheet.kind!r}, for the instrument {self.sheet.name!r} with the side "
                f"information {side.tolist()}, should return an array of shape {(d,)}, finite and not negative, not "
                f"{sigma.tolist()}"
            )
        more = np.zeros((d, d))
        more.flat[:: d + 1] = sigma**2 - self._variance
        return more

    def message_noise(self, point: NavigationPoint) -> Array:
        """The (d, d) covariance that the error of another navigator adds to a reading (`simnav.kinds.MessageNoise`)."""
        function, d = self.kind.message_noise, len(self.kind.components)
        assert function is not None
        try:
            noise = np.asarray(function(point, self._of_instrument), dtype=np.float64)
        except Exception as error:
            message = f"message_noise of kind {self.sheet.kind!r} raised {type(error).__name__}: {error}"
            raise ValueError(message) from error
        if noise.shape != (d, d) or not (isfinite(noise.sum()) and noise.diagonal().min() >= 0.0):
            raise ValueError(
                f"message_noise of kind {self.sheet.kind!r}, for the instrument {self.sheet.name!r}, should return a "
                f"covariance of shape {(d, d)}, not {noise.tolist()}"
            )
        return noise

    def compare(
        self, point: NavigationPoint, value: Array, states: Array, offset: int, bias_at: int
    ) -> PredictedReading | None:
        """Compare a reading with what is predicted for it; None where the state has no reading.

        Parameters
        ----------
        point : NavigationPoint
            The state at which the reading is predicted.
        value : (d,) array
            Measured value.
        states : (m,) array
            Values of the states from the index ``offset`` of the error state on, as `point` received them.
        offset : int
            The index.
        bias_at : int
            Index in the error state of the instrument's first bias; -1 for none.
        """
        predicted = self.predict(point)
        if predicted is None:
            return None
        reading, own = predicted
        jacobian, d = self._jacobian(own, states, offset), len(reading)
        if bias_at >= 0:
            jacobian[range(d), range(bias_at, bias_at + d)] = 1.0
            reading = self.kind.add_error(reading, states[bias_at - offset : bias_at - offset + d])
        return PredictedReading(innovation_of(self.kind, self.sheet, value, reading), jacobian, own, point)

    def _jacobian(self, own: Array, states: Array, offset: int) -> Array:
        """The (d, n) derivative by the error state, but for biases, from that by navigation and blocks."""
        jacobian = np.zeros((len(own), offset + len(states)))
        self._by_motion(own, states, jacobian)
        if len(self._places):
            jacobian[:, self._places + offset] = own[:, self._stated]
        return jacobian

    def _by_motion(self, own: Array, states: Array, jacobian: Array) -> None:
        """Write the derivative by the navigation state into that by the error state; a hook."""
        jacobian[:, :_COMPONENTS] = own[:, :_COMPONENTS]

    def _near(self, point: NavigationPoint, states: Array, errors: Array) -> Kinematics:
        """The motion of k states that differ from a point by (k, n) errors; a hook."""
        return Kinematics(
            position=point.position + errors[:, PART.position] / _metres(point.position),
            velocity=point.velocity + errors[:, PART.velocity],
            dcm=dcm_from_rotation_vector(errors[:, PART.attitude]) @ point.dcm,
            angular_rate=point.angular_rate - errors[:, PART.gyroscope_bias],
        )

    def differences(self, point: NavigationPoint, states: Array, errors: Array, offset: int, bias_at: int) -> Array:
        """The (k, d) predicted readings of the instrument at k states, minus that at one state.

        Parameters
        ----------
        point : NavigationPoint
            The state with which the k states are compared; it has a reading.
        states, offset, bias_at
            As of `compare`.
        errors : (k, n) array
            Differences of the states from the point, as in `simnav.estimators.models.base.ErrorModel.correct`. For a
            state without a reading the Jacobian at the point is used.
        """
        predicted = self.predict(point)
        assert predicted is not None, "`measure` says something of it"
        reading, own = predicted
        near = self._near(point, states, errors)
        if self.observations is not None:
            differences = np.asarray(self.kind.difference(self.read_many(point, near, errors, offset), reading))
        else:
            differences = errors @ self._jacobian(own, states, offset).T
            for k, error in enumerate(errors):
                blocks = self._blocks_at(point, error, offset)
                there = self.read(point._replace(**near.at(k)._asdict(), blocks=blocks))
                if there is not None:
                    differences[k] = self.kind.difference(there, reading)
        if bias_at >= 0:
            differences += errors[:, bias_at : bias_at + len(reading)]
        return differences

    def read_many(self, point: NavigationPoint, states: Kinematics, errors: Array, offset: int) -> Array:
        """The (k, d) readings at k states by one call, for a kind that predicts many (`simnav.kinds.Observations`).

        Parameters
        ----------
        point : NavigationPoint
            The state with which the k states are compared: time, channel and side information are its own.
        states : Kinematics
            Of the k states.
        errors, offset
            As of `differences`: the values of blocks follow from them.
        """
        assert self.observations is not None
        k = len(errors)
        blocks = {name: np.zeros((k, len(zero))) for name, zero in self._zeros.items()}
        for name, at in self._slices:
            blocks[name] = point.blocks[name] + errors[:, offset + at.start : offset + at.stop]
        channel = self._of_instrument.channels.index(self.channel) if self.channel else 0
        side = point.side[None].repeat(k, axis=0)
        points = NavigationPoints(
            time=np.full(k, point.time), **states._asdict(), blocks=blocks, channel=np.full(k, channel), side=side
        )
        reading, _ = self.observations(points, self._of_instrument)
        return np.asarray(reading)

    def by_angular_rate(self, point: NavigationPoint) -> Array:
        """The (d, 3) derivative of the reading by the angular rate of the body, by differences; zero without a reading.

        A reading has it by the swing of a lever arm. `linearise` leaves it out: a filter that subtracts its estimate of
        the gyroscopes' bias from the rate is left with the error of that estimate, which is small. A model whose rate
        is not corrected needs it (`simnav.estimators.models.truth_linearised`).
        """
        jacobian = np.zeros((len(self.kind.components), 3))
        reading = self.read(point)
        if reading is None:
            return jacobian
        for k in range(3):
            rate = point.angular_rate.copy()
            rate[k] += _RATE_STEP
            there = self.read(point._replace(angular_rate=rate))
            if there is not None:
                jacobian[:, k] = self.kind.difference(there, reading) / _RATE_STEP
        return jacobian

    def _blocks_at(self, point: NavigationPoint, error: Array, offset: int) -> Mapping[str, Array]:
        """The blocks at a state that differs from a point by an (n,) error."""
        if not self._slices:
            return point.blocks
        moved = {name: point.blocks[name] + error[offset + at.start : offset + at.stop] for name, at in self._slices}
        return {**self._zeros, **moved}

    def read(self, point: NavigationPoint) -> Array | None:
        """The reading alone, without a Jacobian by differences; a Jacobian that needs none is checked, too."""
        result = self._call(point)
        if not self.sheet.blocks and not isinstance(result, np.ndarray):
            found = self._checked(point, result)
            return None if found is None else found[0]
        if result is None:
            return None
        reading = np.asarray(result if isinstance(result, np.ndarray) else result[0], dtype=np.float64)
        if reading.shape != (len(self.kind.components),):
            raise self._wrong(f"shape {reading.shape}")
        return reading


def _metres(position: Array) -> Array:
    """(3,) metres north and east a radian of latitude and longitude, and a metre of height down."""
    meridian, prime = principal_radii(position[0])
    return np.array([meridian + position[2], (prime + position[2]) * np.cos(position[0]), -1.0])
