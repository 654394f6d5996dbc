"""The clock of an aiding instrument: time stamps with errors, and readings that arrive late.

The table ``[instruments.NAME.timing]`` of a scenario has the figures of `simnav.timing`, and two that no datasheet has,
``fixed_offset_s`` and ``fixed_drift_ppm``. Without the table the stamp is the time of validity, and a reading arrives
at this time. Every random number is drawn for each sample, delivered or not. So a fault changes no stamp of another
reading, and a run without the table is what it was.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from simnav.recording import AidStream
from simnav.spec import NonNegative, Spec, quantity, unit_of
from simnav.streams import stream as random_stream
from simnav.timing import TAIL, Stamped, TimingSheet
from simnav.types import Array

__all__ = ["Clock", "TimingSpec"]

#: A clock that is wrong by more than this is broken [-].
_LARGEST_DRIFT = 0.01
_TOLERANCE = 1e-9


class TimingSpec(Spec):
    """The table ``[instruments.NAME.timing]``."""

    stamped: Stamped = Field("validity", description="when the stamp is set: at the time of validity, or at arrival")
    latency: NonNegative = quantity("s", 0.0, description="time from validity to arrival, its constant part")
    latency_random: NonNegative = quantity("s", 0.0, description="mean of its random part, exponential up to 5 times")
    offset: NonNegative = quantity("s", 0.0, description="offset of the stamps, one sigma, constant in a run")
    drift: NonNegative = quantity("ppm", 0.0, le=_LARGEST_DRIFT, description="growth of the offset, one sigma")
    jitter: NonNegative = quantity("s", 0.0, description="white error of each stamp, one sigma")
    resolution: NonNegative = quantity("s", 0.0, description="step of the stamps; 0: none")
    fixed_offset: float = quantity("s", 0.0, description="offset that is added and that no datasheet knows")
    fixed_drift: float = quantity(
        "ppm", 0.0, ge=-_LARGEST_DRIFT, le=_LARGEST_DRIFT, description="drift that is added and that no datasheet knows"
    )
    stated: bool = Field(True, description="false: the datasheet says nothing of the clock")

    @model_validator(mode="after")
    def _finite(self) -> Self:
        for name, (field, info) in type(self).toml_keys().items():
            value = getattr(self, field)
            if unit_of(info) == "s" and not isfinite(value):
                raise ValueError(f"{name} = {value:g}: should be a finite time")
        return self

    def check(self, rate: float) -> None:
        """ValueError if a figure does not fit the rate [Hz] of the instrument."""
        interval = 1.0 / rate
        for name in ("jitter", "resolution"):
            value = getattr(self, name)
            if value > interval + _TOLERANCE:
                raise ValueError(
                    f"timing.{name}_s = {value:g}: should be at most the interval between readings, {interval:g} s "
                    f"(rate_hz = {rate:g})"
                )

    def sheet(self) -> TimingSheet | None:
        """What the datasheet says; None for nothing."""
        if not self.stated:
            return None
        return TimingSheet(
            self.stamped, self.latency, self.latency_random, self.offset, self.drift, self.jitter, self.resolution
        )

    @property
    def spread(self) -> float:
        """By how much the latencies of two readings may differ [s]."""
        return TAIL * self.latency_random


class Clock:
    """The clock of one instrument in one run.

    Parameters
    ----------
    spec : TimingSpec
        The table of the scenario.
    name : str
        Name of the instrument; the random streams are named after it.
    seed : int
        Seed of the run.

    Attributes
    ----------
    offset, drift : float
        Offset at the start [s] and drift [-] of this run.
    """

    def __init__(self, spec: TimingSpec, name: str, seed: int):
        self.spec = spec
        drawn = random_stream(seed, "instrument", name, "clock").standard_normal(2)
        self.offset = float(spec.offset * drawn[0] + spec.fixed_offset)
        self.drift = float(spec.drift * drawn[1] + spec.fixed_drift)
        self._jitter = random_stream(seed, "instrument", name, "jitter") if spec.jitter else None
        self._latency = random_stream(seed, "instrument", name, "latency") if spec.latency_random else None

    def stamp(self, stream: AidStream, time: Array) -> AidStream:
        """The readings of a block with stamps and times of arrival.

        Parameters
        ----------
        stream : AidStream
            The readings. A fault may have given them stamps; the errors of the clock are added. If they have times of
            arrival, the latency comes on top.
        time : (n,) array
            All sample times of the block, delivered or not [s].
        """
        spec, n = self.spec, len(time)
        arrival = time + spec.latency
        if self._latency is not None:  # the inverse of the cut exponential distribution
            share = -np.expm1(-TAIL) * self._latency.random(n)
            arrival = arrival - spec.latency_random * np.log1p(-share)
        jitter = None if self._jitter is None else spec.jitter * self._jitter.standard_normal(n)
        rows = np.searchsorted(time, stream.time - _TOLERANCE)
        arrival = arrival[rows] + (stream.arrivals - stream.time)
        set_at = arrival if spec.stamped == "arrival" else time[rows]
        error: Any = self.offset + self.drift * set_at
        if jitter is not None:
            error = error + jitter[rows]
        stamp = set_at + (stream.stamps - stream.time) + error
        if spec.resolution:
            stamp = np.round(stamp / spec.resolution) * spec.resolution
        return replace(stream, stamp=stamp, arrival=arrival)
