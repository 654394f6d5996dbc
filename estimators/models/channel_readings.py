"""The readings of the channels of one instrument, predicted all at one time.

A window predicts each reading of each of its nodes again in every iteration: 20 satellites in 20 nodes are 400 calls of
a Python function. A kind that has `simnav.kinds.Kind.observations` is called once instead. The result is that of
`simnav.estimators.models.measurement_functions`, reading by reading.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from simnav.blocks import NAVIGATION
from simnav.geometry.earth import earth_rate
from simnav.kinds import NavigationPoints
from simnav.types import Array

from .ambiguity import innovation_of
from .channels import ChannelDatasheet, whole
from .inertial_errors import ERROR, PART, TRIAD
from .measurement_functions import Kinematics, MeasurementFunction
from .measurements import State
from .named_state import NamedState

__all__ = ["ChannelReadings", "channel_readings_of"]


def channel_readings_of(
    own: Mapping[str, MeasurementFunction], bias_at: Mapping[str, int], form: type[ChannelReadings] | None = None
) -> list[ChannelReadings]:
    """One `ChannelReadings` for each instrument with channels whose kind can predict many readings at one time.

    Parameters
    ----------
    own : mapping of str to MeasurementFunction
        The equation of each source of readings, by its name.
    bias_at : mapping of str to int
        Index in the error state of the first bias of a source; sources without one are not in it.
    form : type, optional
        The class for the states of the model. Default: `ChannelReadings`, for those of an inertial model.
    """
    groups: dict[str, list[str]] = {}
    for name, observation in own.items():
        sheet = observation.sheet
        if isinstance(sheet, ChannelDatasheet) and observation.observations is not None:
            groups.setdefault(sheet.instrument, []).append(name)
    return [(form or ChannelReadings)({name: own[name] for name in names}, bias_at) for names in groups.values()]


class ChannelReadings:
    """The measurement equation of all channels of an instrument.

    Parameters
    ----------
    own : mapping of str to MeasurementFunction
        The equation of each channel, by its source.
    bias_at : mapping of str to int
        As of `channel_readings_of`.

    Attributes
    ----------
    biased : bool
        Whether a channel has biases. Filters take such channels one by one; a change needs new versions of their rows.
    has_noise : bool
        Whether the noise of a reading depends on the state (`MeasurementFunction.has_noise`).
    """

    #: Index in the error state of the first of `_own_states`.
    first_own: ClassVar[int] = ERROR.calibration

    def __init__(self, own: Mapping[str, MeasurementFunction], bias_at: Mapping[str, int]):
        first = next(iter(own.values()))
        assert isinstance(first.sheet, ChannelDatasheet)
        assert first.observations is not None
        self.sources, self.kind, self._observations = tuple(own), first.kind, first.observations
        self._sheet = whole(first.sheet)
        self._channel = {name: first.sheet.siblings.index(o.channel) for name, o in own.items()}
        #: Of each channel: the index in the error state of its first bias; -1 without biases.
        self._bias_at = np.full(len(first.sheet.siblings), -1)
        self._bias_at[list(self._channel.values())] = [bias_at.get(name, -1) for name in own]
        self.biased, self.has_noise = bool(np.any(self._bias_at >= 0)), first.has_noise
        places = first.places
        stated = [block for block in first.sheet.blocks if block.name in places]
        self._at = [(b.name, slice(places[b.name], places[b.name] + b.size)) for b in stated]
        self._without_state = {b.name: b.size for b in first.sheet.blocks if b.name not in places}

    def __deepcopy__(self, memo: object) -> ChannelReadings:
        """Itself: it never changes, and an estimator that takes late readings is copied in each step."""
        return self

    def channels(self, names: Sequence[str]) -> NDArray[np.intp]:
        """(k,) places of the channels of sources in the datasheet; -1 for the sources of other instruments."""
        return np.array([self._channel.get(name, -1) for name in names], dtype=np.intp)

    def linearise(
        self,
        time: Array,
        value: Array,
        channel: NDArray[np.intp],
        states: NamedState,
        row: NDArray[np.intp],
        side: Array,
        out: Array | None = None,
    ) -> tuple[Array, Array]:
        """Innovations and Jacobians of n readings.

        Parameters
        ----------
        time : (n,) array
            Times of validity [s].
        value : (n, d) array
            Measured values.
        channel : (n,) int array
            Their channels, as of `channels`.
        states : NamedState
            K states of the model.
        row : (n,) int array
            Which of the states each reading is predicted at.
        side : (n, s) array
            Their side information.
        out : (n, d, e) array, optional
            Overwritten with the Jacobians, and returned; None: they are in a new array.

        Returns
        -------
        innovation : (n, d) array
            Measured minus predicted.
        jacobian : (n, d, e) array
            Derivative of the prediction by the error state.
        """
        offset, own = self.first_own, self._own_states(states).take(row, axis=0)
        blocks = {name: np.zeros((len(time), size)) for name, size in self._without_state.items()}
        for name, at in self._at:
            blocks[name] = own[:, at]
        motion = self._navigation(states, row, own)
        points = NavigationPoints(time=time, **motion._asdict(), blocks=blocks, channel=channel, side=side)
        reading, by_block = self._observations(points, self._sheet)
        jacobian = np.empty((len(time), value.shape[1], offset + own.shape[1])) if out is None else out
        jacobian[...] = 0.0
        self._by_navigation(by_block[NAVIGATION], own, jacobian)
        for name, at in self._at:
            jacobian[:, :, at.start + offset : at.stop + offset] = by_block[name]
        if self.biased and len(biased := np.flatnonzero(self._bias_at[channel] >= 0)):
            component = np.arange(value.shape[1])
            columns = self._bias_at[channel[biased], None] + component
            jacobian[biased[:, None], component, columns] = 1.0
            reading = np.array(reading)
            reading[biased] = self.kind.add_error(reading[biased], own[biased[:, None], columns - offset])
        return innovation_of(self.kind, self._sheet, value, reading), jacobian

    def _own_states(self, states: NamedState) -> Array:
        """(K, m) array: where the states of the instrument are, from `first_own` of the error state on."""
        assert isinstance(states, State)
        return states.calibration

    def _navigation(self, states: NamedState, row: NDArray[np.intp], own: Array) -> Kinematics:
        """The motion at each of n readings; ``own`` is what `_own_states` has there."""
        assert isinstance(states, State)
        turning = states.rate[:, TRIAD.gyroscopes] - states.bias[:, TRIAD.gyroscopes]
        turning -= np.einsum("nji,nj->ni", states.dcm, earth_rate(states.position[:, 0]))
        motion = Kinematics(states.position, states.velocity, states.dcm, turning)
        return Kinematics(*(column.take(row, axis=0) for column in motion))

    def _by_navigation(self, derivative: Array, own: Array, jacobian: Array) -> None:
        """Write the (n, d, 9) derivative by the navigation state into that by the error state."""
        jacobian[:, :, PART.navigation] = derivative

    def more_noise(self, sides: Sequence[Array]) -> Array | None:
        """`MeasurementFunction.noise_without_state` of n readings.

        Parameters
        ----------
        sides : sequence of (s,) array
            Their side information.

        Returns
        -------
        (n, d, d) array or None
            Covariances. None where each reading has to be asked for by itself, also for the sake of a message.
        """
        if self.kind.reading_sigma is None or self.has_noise:
            return None
        try:
            variance = self.noise(np.array(sides))
        except Exception:  # the reading that it is about says which
            return None
        n, d = variance.shape
        more = np.zeros((n, d, d))
        more[:, range(d), range(d)] = variance - self._sheet.sigma**2
        return more

    def noise(self, side: Array) -> Array:
        """The (n, d) variances of the white noise of n readings, from their (n, s) side information.

        Raises
        ------
        ValueError
            If the kind's function returns something else.
        """
        function, shape = self.kind.reading_sigma, (len(side), len(self.kind.components))
        if function is None:
            return np.broadcast_to(self._sheet.sigma**2, shape)
        sigma = np.asarray(function(side, self._sheet), dtype=np.float64)
        if sigma.shape != shape or not (isfinite(sigma.sum()) and sigma.min() >= 0.0):
            raise ValueError(
                f"reading_sigma of kind {self._sheet.kind!r}, for the instrument {self._sheet.name!r}, should return "
                f"an array of shape {shape} for so many readings, finite and not negative, not {sigma.tolist()!r:.200}"
            )
        return np.asarray(sigma**2)
