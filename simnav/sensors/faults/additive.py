"""Faults that add an error to a measurement: noise step, gross errors, multipath, ramp, bias step."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import ClassVar, Literal, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simnav.recording import AidStream
from simnav.sensors.faults.fault import Effect, FaultSpec, register_fault
from simnav.sensors.faults.layer import ADDS, STEPS_NOISE, FaultLayer
from simnav.sensors.faults.sizes import Size, size_range
from simnav.sensors.processes import GaussMarkov
from simnav.spec import Positive, quantity
from simnav.types import KINDS, Array

__all__ = ["AdditiveLayer", "BiasStep", "GrossError", "Multipath", "NoiseStep", "Ramp"]


def _not_negative(spec: FaultSpec) -> None:
    for stem in spec.stems:
        for name, size in spec.sizes(stem).items():
            if size is not None and not np.all(np.asarray(size) >= 0.0):
                raise ValueError(f"{spec.key_of(name)} is not negative")


def _all_times(stream: AidStream) -> tuple[Array, NDArray[np.intp] | None]:
    """All sample times, delivered or dropped, and the indices of the delivered ones among them (None: all)."""
    if len(stream.dropped) == 0:
        return stream.time, None
    times = np.sort(np.concatenate([stream.time, stream.dropped]), kind="stable")
    return times, np.searchsorted(times, stream.time)


class AdditiveLayer(FaultLayer):
    """Adds an error to the measurements within the intervals; a subclass defines `error`."""

    @abstractmethod
    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        """The errors of the measurements within the intervals, delivered or not.

        Parameters
        ----------
        stream : AidStream
            The measurements of the instrument in the present block.
        time, since : (m,) array
            Times of the measurements since the start of the run, and since the start of their interval [s].

        Returns
        -------
        (m, d) array
            The errors; components as in ``KINDS[stream.kind].errors``, SI units. A measurement with a row of zeros is
            not changed and not labelled.
        """

    @staticmethod
    def readings(stream: AidStream, time: Array) -> Array:
        """The (m, d) values of a stream at (m,) times, for errors that depend on them; zeros where it has none."""
        place = np.searchsorted(stream.time, time)
        place[place == len(stream.time)] = 0
        values = np.zeros((len(time), stream.value.shape[1]))
        if len(stream.time):
            there = stream.time[place] == time
            values[there] = stream.value[place[there]]
        return values

    def ahead(self, name: str, kind: str, time: Array) -> tuple[NDArray[np.int64], Array]:
        """See `FaultLayer.ahead`. It requires that `error` uses only the name and kind of the stream."""
        interval, error = super().ahead(name, kind, time)
        rows = np.flatnonzero(interval >= 0)
        if len(rows):
            n = len(time)
            stream = AidStream(name, kind, time, error, np.zeros(n, np.uint32), error, error, np.empty(0))
            error = error.copy()
            error[rows] = self.error(stream, time[rows], time[rows] - self.activity.starts[interval[rows]])
        return interval, error

    def apply(self, stream: AidStream) -> AidStream:
        if not self.touches(stream):
            return stream
        times, delivered = _all_times(stream)
        found = self.activity.locate(times)
        if found is None:
            return stream
        active, interval = found
        error = np.asarray(self.error(stream, times[active], times[active] - self.activity.starts[interval]))
        components = KINDS[stream.kind].errors
        if error.shape != (len(active), len(components)):
            raise ValueError(
                f"error() returned an array of shape {error.shape}, where {(len(active), len(components))} is wanted: "
                f"a row for each of {len(active)} times, a column for each component ({', '.join(components)})"
            )
        rows = active
        if delivered is not None:
            # From all sample times back to the delivered ones.
            place = np.full(len(times), -1)
            place[delivered] = np.arange(len(delivered))
            rows = place[active]
        touched = (rows >= 0) & error.any(axis=1)
        if not touched.any():
            return stream
        return self.lay(stream, rows[touched], error[touched], interval[touched])

    def lay(self, stream: AidStream, rows: NDArray[np.intp], error: Array, interval: NDArray[np.intp]) -> AidStream:
        """Add errors to the rows of a stream, and label them with the numbers of their intervals."""
        value, faults, fault_error = stream.value.copy(), stream.faults.copy(), stream.fault_error.copy()
        value[rows] = KINDS[stream.kind].add_error(value[rows], error)
        faults[rows] |= self.bits(interval)
        fault_error[rows] += error
        return replace(stream, value=value, faults=faults, fault_error=fault_error)


@register_fault
class NoiseStep(FaultSpec):
    """The white noise grows, by a factor or to a new sigma.

    Noise is added to the measurement. Its variance is the difference between the new variance and the square of the
    measurement's own ``sigma``, so that the fault also works on real logs. If the measurement is noisier already,
    nothing is added.

    Attributes
    ----------
    factor : float or None
        The new sigma, as a multiple of the measurement's own.
    sigma_position, sigma_velocity, sigma_heading : float or tuple or None
        The new sigma [m, m/s, rad].
    """

    stems: ClassVar[tuple[str, ...]] = ("sigma",)
    effect: ClassVar[Effect] = "noise"
    kind: Literal["noise_step"] = "noise_step"
    factor: float | None = Field(None, ge=1.0)
    sigma_position: Size = quantity("m", None)
    sigma_velocity: Size = quantity("m_s", None)
    sigma_heading: Size = quantity("deg", None)

    @model_validator(mode="after")
    def _one(self) -> Self:
        sizes = [self.sigma_position, self.sigma_velocity, self.sigma_heading]
        if (self.factor is None) == all(s is None for s in sizes):
            raise ValueError("a noise_step has either a factor or a new sigma (sigma_m, sigma_m_s, sigma_deg)")
        _not_negative(self)
        return self

    @property
    def sizes_required(self) -> bool:
        """Whether every instrument needs its size."""
        return self.factor is None

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _NoiseStep(self, index, seed, self.key_of_streams(index, occurrence))


class _NoiseStep(AdditiveLayer):
    operation = STEPS_NOISE
    spec: NoiseStep

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        return self.rng(stream.name, "noise").standard_normal((len(time), stream.value.shape[1]))

    def lay(self, stream: AidStream, rows: NDArray[np.intp], error: Array, interval: NDArray[np.intp]) -> AidStream:
        old = stream.sigma[rows]
        if self.spec.factor is not None:
            new = self.spec.factor * old
        else:
            new = np.maximum(old, self.spec.size("sigma", stream.kind))
        sigma = stream.sigma.copy()
        sigma[rows] = new
        return super().lay(replace(stream, sigma=sigma), rows, np.sqrt(new**2 - old**2) * error, interval)


@register_fault
class GrossError(FaultSpec):
    """Single measurements have a gross error, each with the given ``probability``.

    The ``distribution`` is "uniform": size = [minimum, maximum], with a random sign; "normal": size is the standard
    deviation; or "fixed": size is the error itself. With ``common`` one random number is drawn for all axes, otherwise
    one for each axis.

    Attributes
    ----------
    probability : float
        Share of the measurements that have one.
    distribution : str
        ``uniform``, ``normal`` or ``fixed``.
    common : bool
        Whether all axes have the same random number.
    size_position, size_velocity, size_heading : float or tuple or None
        Size [m, m/s, rad].
    """

    stems: ClassVar[tuple[str, ...]] = ("size",)
    effect: ClassVar[Effect] = "gross"
    kind: Literal["gross_error"] = "gross_error"
    probability: float = Field(ge=0.0, le=1.0)
    distribution: Literal["uniform", "normal", "fixed"] = "uniform"
    common: bool = False
    size_position: Size = quantity("m", None)
    size_velocity: Size = quantity("m_s", None)
    size_heading: Size = quantity("deg", None)

    @model_validator(mode="after")
    def _sizes(self) -> Self:
        for name, size in self.sizes("size").items():
            key = self.key_of(name)
            if size is None:
                continue
            if self.distribution == "uniform" and not (
                isinstance(size, tuple) and len(size) == 2 and 0.0 <= size[0] <= size[1]
            ):
                raise ValueError(f"{key} of a uniform gross_error is [minimum, maximum], minimum from 0 on")
            if self.distribution == "normal" and np.any(np.asarray(size) < 0.0):
                raise ValueError(f"{key} of a normal gross_error is a sigma and not negative")
        return self

    def _check_axes(self, stem: str, name: str, kind: str) -> None:
        if self.distribution != "uniform":
            super()._check_axes(stem, name, kind)

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _GrossError(self, index, seed, self.key_of_streams(index, occurrence))


class _GrossError(AdditiveLayer):
    operation = ADDS
    spec: GrossError

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        occurrence, sizes = self.rng(stream.name, "occurrence"), self.rng(stream.name, "size")
        n, d = len(time), stream.value.shape[1]
        hit = occurrence.random(n) < self.spec.probability
        if self.spec.distribution == "uniform":
            draws = sizes.random((n, d, 2))
            if self.spec.common:
                draws[:] = draws[:, :1]
            low, high = size_range(self.spec.sizes("size"), "size", stream.kind)
            error = np.where(draws[..., 1] < 0.5, -1.0, 1.0) * (low + (high - low) * draws[..., 0])
        elif self.spec.distribution == "normal":
            draws = sizes.standard_normal((n, d))
            if self.spec.common:
                draws[:] = draws[:, :1]
            error = draws * self.spec.size("size", stream.kind)
        else:
            error = self.spec.size("size", stream.kind)[None].repeat(n, axis=0)
        return cast(Array, np.where(hit[:, None], error, 0.0))


@register_fault
class Multipath(FaultSpec):
    """A time-correlated error: a first-order Gauss-Markov process, stationary from the start.

    Attributes
    ----------
    correlation_time : float
        Correlation time of the error [s].
    sigma_position, sigma_velocity, sigma_heading : float or tuple or None
        Standard deviation of the error [m, m/s, rad].
    """

    stems: ClassVar[tuple[str, ...]] = ("sigma",)
    effect: ClassVar[Effect] = "lasting"
    kind: Literal["multipath"] = "multipath"
    correlation_time: Positive = quantity("s")
    sigma_position: Size = quantity("m", None)
    sigma_velocity: Size = quantity("m_s", None)
    sigma_heading: Size = quantity("deg", None)

    @model_validator(mode="after")
    def _sizes(self) -> Self:
        _not_negative(self)
        return self

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _Multipath(self, index, seed, self.key_of_streams(index, occurrence))


class _Multipath(AdditiveLayer):
    operation = ADDS
    spec: Multipath

    def __init__(self, spec: Multipath, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key)
        self._processes: dict[str, GaussMarkov] = {}

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        if stream.name not in self._processes:
            sigma = self.spec.size("sigma", stream.kind)
            rng = self.rng(stream.name, "process")
            self._processes[stream.name] = GaussMarkov(sigma, self.spec.correlation_time, rng)
        return self._processes[stream.name].sample(time)


@register_fault
class Ramp(FaultSpec):
    """An error that grows from zero at the start of each interval, with the rate ``slope``.

    Attributes
    ----------
    slope_position, slope_velocity, slope_heading : float or tuple or None
        How fast the error grows [m/s, m/s^2, rad/s].
    """

    stems: ClassVar[tuple[str, ...]] = ("slope",)
    effect: ClassVar[Effect] = "growing"
    kind: Literal["ramp"] = "ramp"
    slope_position: Size = quantity("m_s", None)
    slope_velocity: Size = quantity("m_s2", None)
    slope_heading: Size = quantity("deg_s", None)

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _Ramp(self, index, seed, self.key_of_streams(index, occurrence))


class _Ramp(AdditiveLayer):
    operation = ADDS
    spec: Ramp

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        return np.maximum(since, 0.0)[:, None] * self.spec.size("slope", stream.kind)


@register_fault
class BiasStep(FaultSpec):
    """A constant error, ``offset``, by axis: north-east-down for positions and GNSS velocity, body axes for a DVL.

    Attributes
    ----------
    offset_position, offset_velocity, offset_heading : float or tuple or None
        The error [m, m/s, rad].
    """

    stems: ClassVar[tuple[str, ...]] = ("offset",)
    effect: ClassVar[Effect] = "lasting"
    kind: Literal["bias_step"] = "bias_step"
    offset_position: Size = quantity("m", None)
    offset_velocity: Size = quantity("m_s", None)
    offset_heading: Size = quantity("deg", None)

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _BiasStep(self, index, seed, self.key_of_streams(index, occurrence))


class _BiasStep(AdditiveLayer):
    operation = ADDS
    spec: BiasStep

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        offset = self.spec.size("offset", stream.kind)
        return np.broadcast_to(offset, (len(time), len(offset)))
