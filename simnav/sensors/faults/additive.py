"""Faults that add an error to a measurement: noise step, gross errors, multipath, ramp, bias step."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import ClassVar, Literal, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simnav.recording import AidStream
from simnav.sensors.faults.fault import Effect, FaultLayer, FaultSpec, Size, register_fault, size_range
from simnav.sensors.processes import GaussMarkov
from simnav.spec import Positive, quantity
from simnav.types import KINDS, Array

__all__ = ["BiasStep", "GrossError", "Multipath", "NoiseStep", "Ramp"]


def _not_negative(spec: FaultSpec) -> None:
    for stem in spec.stems:
        for name, size in spec.sizes(stem).items():
            if size is not None and not np.all(np.asarray(size) >= 0.0):
                raise ValueError(f"{spec.key_of(name)} is not negative")


def _all_times(stream: AidStream) -> tuple[Array, NDArray[np.intp] | None]:
    """All sample times, delivered or dropped, and where among them the delivered ones are (None: all)."""
    if len(stream.dropped) == 0:
        return stream.time, None
    times = np.sort(np.concatenate([stream.time, stream.dropped]), kind="stable")
    return times, np.searchsorted(times, stream.time)


class _Additive(FaultLayer):
    """Lays ``error`` over the measurements within the intervals."""

    @abstractmethod
    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        """The (m, d) errors at the times within intervals; ``since`` is the time since the interval's start.

        A row of zeros does not touch its measurement.
        """

    def apply(self, stream: AidStream) -> AidStream:
        if not self.touches(stream):
            return stream
        times, delivered = _all_times(stream)
        found = self.activity.locate(times)
        if found is None:
            return stream
        active, interval = found
        error = self.error(stream, times[active], times[active] - self.activity.starts[interval])
        rows = active
        if delivered is not None:
            # Back from all sample times to those that are in the stream.
            place = np.full(len(times), -1)
            place[delivered] = np.arange(len(delivered))
            rows = place[active]
        touched = (rows >= 0) & error.any(axis=1)
        if not touched.any():
            return stream
        return self._lay(stream, rows[touched], error[touched], interval[touched])

    def _lay(self, stream: AidStream, rows: NDArray[np.intp], error: Array, interval: NDArray[np.intp]) -> AidStream:
        value, faults, fault_error = stream.value.copy(), stream.faults.copy(), stream.fault_error.copy()
        value[rows] = KINDS[stream.kind].add_error(value[rows], error)
        faults[rows] |= self._bits(interval)
        fault_error[rows] += error
        return replace(stream, value=value, faults=faults, fault_error=fault_error)


@register_fault
class NoiseStep(FaultSpec):
    """The white noise grows, by a factor or to a new sigma.

    Noise is added whose variance is the difference of the new one and the measurement's own ``sigma``, so that it works
    on real logs too; where the measurement is noisier already, nothing is added.
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
        return _NoiseStep(self, index, seed, self._key_of_streams(index, occurrence))


class _NoiseStep(_Additive):
    _spec: NoiseStep

    def __init__(self, spec: NoiseStep, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key)
        self._noise: dict[str, np.random.Generator] = {}

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        if stream.name not in self._noise:
            self._noise[stream.name] = self._rng(stream.name, "noise")
        return self._noise[stream.name].standard_normal((len(time), stream.value.shape[1]))

    def _lay(self, stream: AidStream, rows: NDArray[np.intp], error: Array, interval: NDArray[np.intp]) -> AidStream:
        old = stream.sigma[rows]
        if self._spec.factor is not None:
            new = self._spec.factor * old
        else:
            new = np.maximum(old, self._spec.size("sigma", stream.kind))
        sigma = stream.sigma.copy()
        sigma[rows] = new
        return super()._lay(replace(stream, sigma=sigma), rows, np.sqrt(new**2 - old**2) * error, interval)


@register_fault
class GrossError(FaultSpec):
    """Single measurements go wrong, each with a ``probability``.

    ``distribution`` "uniform": size = [minimum, maximum], with a random sign; "normal": size is the sigma; "fixed":
    size is added as it is. With ``common`` all axes share one draw, else each has its own.
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
        return _GrossError(self, index, seed, self._key_of_streams(index, occurrence))


class _GrossError(_Additive):
    _spec: GrossError

    def __init__(self, spec: GrossError, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key)
        self._streams: dict[str, tuple[np.random.Generator, np.random.Generator]] = {}

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        if stream.name not in self._streams:
            self._streams[stream.name] = self._rng(stream.name, "occurrence"), self._rng(stream.name, "size")
        occurrence, sizes = self._streams[stream.name]
        n, d = len(time), stream.value.shape[1]
        hit = occurrence.random(n) < self._spec.probability
        if self._spec.distribution == "uniform":
            draws = sizes.random((n, d, 2))
            if self._spec.common:
                draws[:] = draws[:, :1]
            low, high = size_range(self._spec.sizes("size"), "size", stream.kind)
            error = np.where(draws[..., 1] < 0.5, -1.0, 1.0) * (low + (high - low) * draws[..., 0])
        elif self._spec.distribution == "normal":
            draws = sizes.standard_normal((n, d))
            if self._spec.common:
                draws[:] = draws[:, :1]
            error = draws * self._spec.size("size", stream.kind)
        else:
            error = self._spec.size("size", stream.kind)[None].repeat(n, axis=0)
        return cast(Array, np.where(hit[:, None], error, 0.0))


@register_fault
class Multipath(FaultSpec):
    """Time-correlated error: a first-order Gauss-Markov process, stationary from the start."""

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
        return _Multipath(self, index, seed, self._key_of_streams(index, occurrence))


class _Multipath(_Additive):
    _spec: Multipath

    def __init__(self, spec: Multipath, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key)
        self._processes: dict[str, GaussMarkov] = {}

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        if stream.name not in self._processes:
            sigma = self._spec.size("sigma", stream.kind)
            rng = self._rng(stream.name, "process")
            self._processes[stream.name] = GaussMarkov(sigma, self._spec.correlation_time, rng)
        return self._processes[stream.name].sample(time)


@register_fault
class Ramp(FaultSpec):
    """An error that grows from zero at the start of each interval, by ``slope`` a second."""

    stems: ClassVar[tuple[str, ...]] = ("slope",)
    effect: ClassVar[Effect] = "growing"
    kind: Literal["ramp"] = "ramp"
    slope_position: Size = quantity("m_s", None)
    slope_velocity: Size = quantity("m_s2", None)
    slope_heading: Size = quantity("deg_s", None)

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _Ramp(self, index, seed, self._key_of_streams(index, occurrence))


class _Ramp(_Additive):
    _spec: Ramp

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        return np.maximum(since, 0.0)[:, None] * self._spec.size("slope", stream.kind)


@register_fault
class BiasStep(FaultSpec):
    """A constant error, ``offset``, by axis: north-east-down for positions and GNSS velocity, body axes for a DVL."""

    stems: ClassVar[tuple[str, ...]] = ("offset",)
    effect: ClassVar[Effect] = "lasting"
    kind: Literal["bias_step"] = "bias_step"
    offset_position: Size = quantity("m", None)
    offset_velocity: Size = quantity("m_s", None)
    offset_heading: Size = quantity("deg", None)

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _BiasStep(self, index, seed, self._key_of_streams(index, occurrence))


class _BiasStep(_Additive):
    _spec: BiasStep

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        offset = self._spec.size("offset", stream.kind)
        return np.broadcast_to(offset, (len(time), len(offset)))
