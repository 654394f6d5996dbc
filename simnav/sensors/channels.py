"""Instruments with channels: at one time they give a reading of each satellite, beam or beacon that they hear.

Every channel has its own turn-on bias, in-run bias and white noise, each from a random stream that is named after the
instrument and the channel. It draws at every sample, heard or not, so that a further channel changes no other one.
"""

from __future__ import annotations

from abc import abstractmethod
from functools import partial

import numpy as np
from numpy.typing import NDArray

from simnav.recording import AidStream, FaultLabel
from simnav.sensors.error_processes import TotalError
from simnav.sensors.instrument import AidSpec, Instrument, InstrumentError, label_of, raised
from simnav.sensors.processes import GaussMarkov
from simnav.streams import stream
from simnav.types import NO_SIDE, Array, TapStates

__all__ = ["ChannelInstrument"]


class ChannelInstrument(Instrument):
    """An aiding instrument with channels in one run.

    A subclass has `observe`, and as far as they apply `side_information`, `available` and `noise_sigma`. Their arrays
    have an axis for the c channels, in the order of `AidSpec.channels`.

    Parameters
    ----------
    spec : AidSpec
        Rate, mounting and error parameters, from the scenario.
    name : str
        Name of the instrument in the scenario; its random streams are named after it.
    seed : int
        Seed of the run.

    Attributes
    ----------
    channels : tuple of str
        Identifiers of the channels.
    bias : (c, d) array
        Turn-on bias of each channel in this run.
    totals : list of TotalError
        The further processes of each channel; empty without any.
    bit : int
        Number of the label of its own (`own_label`) among those of the run.
    """

    bit: int = 0

    def __init__(self, spec: AidSpec, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.sheet = sheet = spec.datasheet(name)
        self.channels = sheet.channels
        self._noises = [self._stream(c, "noise") for c in self.channels] if sheet.sigma.any() else []
        self._instabilities = (
            [
                GaussMarkov(sheet.bias_instability, sheet.correlation_time, self._stream(c, "bias_instability"))
                for c in self.channels
            ]
            if sheet.bias_instability.any()
            else []
        )
        self.totals = (
            [TotalError(spec.processes, spec.definition, seed, name, c) for c in self.channels]
            if spec.processes
            else []
        )
        self.bias = np.zeros((len(self.channels), len(sheet.sigma))) + spec.figure("fixed_bias")
        if sheet.bias.any():
            self.bias += [sheet.bias * self._stream(c, "bias").standard_normal(len(sheet.bias)) for c in self.channels]

    def _stream(self, channel: str, process: str) -> np.random.Generator:
        return stream(self._seed, "instrument", self.name, channel, process)

    @abstractmethod
    def observe(self, tap: TapStates) -> Array:
        """The (n, c, d) values without bias and noise."""

    def side_information(self, tap: TapStates) -> Array:
        """The (n, c, s) side information of the readings; components as in ``Kind.side``."""
        if self.definition.side:
            raise NotImplementedError(
                f"{type(self).__qualname__} has no side_information(), but its kind has the side information "
                f"{', '.join(self.definition.side_names)}"
            )
        return np.empty((len(tap.time), len(self.channels), 0))

    def noise_sigma(self, observed: Array, side: Array = NO_SIDE) -> Array:
        """The (n, c, d) standard deviation of the white noise of each reading.

        By default it is ``Kind.reading_sigma`` of the side information, or the sigma of the datasheet.

        Parameters
        ----------
        observed : (n, c, d) array
            Values without bias and noise. They are NaN where nothing is delivered.
        side : (n, c, s) array
            Side information; likewise.
        """
        sigma = np.broadcast_to(self.sigma, observed.shape).copy()
        rule = self.definition.reading_sigma
        if rule is not None:
            for i in zip(*np.nonzero(np.isfinite(observed).all(axis=2)), strict=True):
                sigma[i] = rule(side[i], self.sheet)
        return sigma

    def available(self, tap: TapStates) -> NDArray[np.bool_] | None:
        """An (n, c) mask of the readings that are delivered; None: all."""
        return None

    def own_label(self, duration: float) -> FaultLabel | None:
        """The label of errors that the surroundings make and no fault of the scenario; None: there are none.

        Parameters
        ----------
        duration : float
            Length of the run [s].
        """
        return None

    def own_labels(self, duration: float) -> tuple[FaultLabel, ...]:
        """All labels of its own, `own_label` first; their bits follow each other, from `bit` on."""
        own = self.own_label(duration)
        return () if own is None else (own,)

    def ahead(self, time: Array) -> tuple[Array, Array]:
        """See `Instrument.ahead`; both arrays are (n, c, d)."""
        error = self.bias[None].repeat(len(time), axis=0)
        variates = np.zeros(error.shape)
        for j, process in enumerate(self._instabilities):
            error[:, j] += process.sample(time)
        for j, rng in enumerate(self._noises):
            variates[:, j] = rng.standard_normal((len(time), error.shape[2]))
        return error, variates

    def sense(self, tap: TapStates) -> AidStream:
        """Measure the states of the next block.

        Parameters
        ----------
        tap : TapStates
            True states at the instrument's sample times.

        Returns
        -------
        AidStream
            The readings without faults. ``dropped`` and ``dropped_channel`` say which are missing.

        Raises
        ------
        InstrumentError
            If a method of the instrument raises, or returns an array of another shape than it should, or a number that
            is not finite or a negative sigma for a reading that is delivered.
        """
        label = partial(label_of, self.name, self.kind, type(self))
        try:
            value, side, sigma, there = self._readings(tap)
        except (InstrumentError, MemoryError):
            raise
        except Exception as error:
            raise raised(label(), type(self), error) from error
        self._check(value, side, sigma, there, tap)
        added, variates = self.ahead(tap.time)
        if self._noises:
            added += sigma * variates
        for j, total in enumerate(self.totals):
            more = total.at(tap, value[:, j], self.surroundings)
            added[:, j] += more.error
            sigma[:, j] = np.sqrt(sigma[:, j] ** 2 + more.variance)
            there[:, j] &= ~more.lost
        row, channel = np.nonzero(there)
        lost, lost_channel = np.nonzero(~there)
        for j, total in enumerate(self.totals):
            value[:, j] = total.rounded(self.definition.add_error(value[:, j], added[:, j]))
        value = value[there] if self.totals else self.definition.add_error(value[there], added[there])
        n = len(value)
        return AidStream(
            self.name,
            self.kind,
            tap.time[row],
            value,
            np.zeros(n, np.uint32),
            np.zeros(value.shape),
            sigma[there],
            tap.time[lost],
            self.channels,
            channel.astype(np.int16),
            side[there],
            lost_channel.astype(np.int16),
        )

    def _readings(self, tap: TapStates) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Values, side information, sigma and mask, each of the right shape; NaN where nothing is delivered."""
        definition, shape = self.definition, (len(tap.time), len(self.channels))
        value = self._shaped("observe()", self.observe(tap), (*shape, len(definition.values)), definition.values)
        side = self._shaped(
            "side_information()", self.side_information(tap), (*shape, len(definition.side)), definition.side_names
        )
        mask = self.available(tap)
        there = np.ones(shape, np.bool_) if mask is None else np.asarray(mask)
        if there.shape != shape or there.dtype != np.bool_:
            raise InstrumentError(
                f"{label_of(self.name, self.kind, type(self))}: available() returned an array of {there.dtype} of "
                f"shape {there.shape}, where one of bool of shape {shape} is wanted: a row for each of {shape[0]} "
                f"times, an entry for each of {shape[1]} channels"
            )
        value, side = (np.where(there[..., None], array, np.nan) for array in (value, side))
        sigma = self.noise_sigma(value, side) if self._noises else np.zeros(value.shape)
        return value, side, self._shaped("noise_sigma()", sigma, value.shape, definition.values), there

    def _shaped(self, method: str, array: Array, shape: tuple[int, ...], components: tuple[str, ...]) -> Array:
        """The result of a method, after a check of its shape."""
        array = np.asarray(array, dtype=np.float64)
        if not shape[0] and not array.size:
            return array.reshape(shape)
        if array.shape != shape:
            raise InstrumentError(
                f"{label_of(self.name, self.kind, type(self))}: {method} returned an array of shape {array.shape}, "
                f"where {shape} is wanted: a row for each of {shape[0]} times, an entry for each of {shape[1]} "
                f"channels, a column for each component ({', '.join(components)})"
            )
        return array

    def _check(self, value: Array, side: Array, sigma: Array, there: NDArray[np.bool_], tap: TapStates) -> None:
        """InstrumentError for a reading that is delivered, but is no number."""
        for method, array, wanted, right in (
            ("observe()", value, np.isfinite(value), "finite; where nothing is delivered, available() says so"),
            ("side_information()", side, np.isfinite(side), "finite; where nothing is delivered, available() says so"),
            ("noise_sigma()", sigma, np.isfinite(sigma) & (sigma >= 0.0), "finite and not negative"),
        ):
            wrong = there & ~wanted.all(axis=2)
            if wrong.any():
                i, j = np.argwhere(wrong)[0]
                raise InstrumentError(
                    f"{label_of(self.name, self.kind, type(self))}: {method} returned {array[i, j].tolist()} for "
                    f"channel {self.channels[j]!r} at {tap.time[i]:g} s; it should be {right}"
                )
