"""Faults of the signals of satellites: a spoofer that moves all of them together, and a jammer.

They act on instruments whose readings say where each satellite stands and how strong its signal is (`simnav.kinds`, the
side information ``elevation``, ``azimuth`` and ``density_ratio``).

A spoofer makes the receiver believe in a false position p + d(t). Of a satellite in the direction u from the antenna it
gives the range that is right there, so the pseudorange changes by ``-u' d + b`` and its rate by ``-u' d' + b'``, with
an offset b of the clock that is common to all: no test of the satellites against one another finds it.

A jammer raises the noise floor. C/N0 falls by the same number of decibels for all satellites (E. D. Kaplan and C. J.
Hegarty (eds.), *Understanding GPS/GNSS*, 3rd ed., 2017, section 9.2), the white noise grows with it, and the weakest
satellites are lost first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from simnav.recording import AidStream
from simnav.satellites.signal_errors import noise_factor
from simnav.sensors.faults.additive import AdditiveLayer
from simnav.sensors.faults.fault import Effect, FaultSpec, register_fault
from simnav.sensors.faults.layer import FaultLayer
from simnav.spec import NonNegative, Positive, SpecError, Vector, quantity
from simnav.types import KINDS, Array

__all__ = ["Jamming", "Spoofing"]

_STILL: Vector = (0.0, 0.0, 0.0)
_NEEDED = ("elevation", "azimuth", "density_ratio")


def _check_signals(spec: FaultSpec, instruments: Mapping[str, str]) -> None:
    """SpecError for an instrument that does not say where its satellites stand."""
    for name in spec.touched(instruments):
        kind = instruments[name]
        if KINDS[kind].components[0].name != "pseudorange" or not set(_NEEDED) <= set(KINDS[kind].side_names):
            raise SpecError(
                f"fault {spec.kind!r} on {name!r} ({kind}): it acts on pseudoranges of satellites, as of the kind "
                "'gnss_raw'; on a position a ramp or a noise_step does"
            )


def _sides(stream: AidStream, *names: str) -> list[Array]:
    """Columns of the side information of a stream, by the names of the components."""
    known = KINDS[stream.kind].side_names
    return [stream.side[:, known.index(name)] for name in names]


@register_fault
class Spoofing(FaultSpec):
    """A spoofer gives all satellites the ranges of a false position, which drifts away from the true one.

    Attributes
    ----------
    offset : (float, float, float)
        The false position minus the true one at the beginning: north, east, down [m].
    drift : (float, float, float)
        Velocity with which it moves away: north, east, down [m/s].
    clock_offset, clock_drift : float
        What the spoofer's clock adds to all ranges [m], and to all rates [m/s].
    """

    effect: ClassVar[Effect] = "replaced"
    kind: Literal["spoofing"] = "spoofing"
    offset: Vector = quantity("m", _STILL)
    drift: Vector = quantity("m_s", _STILL)
    clock_offset: float = quantity("m", 0.0)
    clock_drift: float = quantity("m_s", 0.0)

    def check(self, instruments: Mapping[str, str], *, imu: bool = True) -> None:
        """See `FaultSpec.check`; SpecError for an instrument without pseudoranges, and for a spoofer without effect."""
        super().check(instruments, imu=imu)
        _check_signals(self, instruments)
        if not any((*self.offset, *self.drift, self.clock_offset, self.clock_drift)):
            raise SpecError("fault 'spoofing': offset_m, drift_m_s and the figures of the clock are all zero")

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _Spoofing(self, index, seed, self.key_of_streams(index, occurrence))


class _Spoofing(AdditiveLayer):
    spec: Spoofing

    def error(self, stream: AidStream, time: Array, since: Array) -> Array:
        elevation, azimuth = _sides(stream, "elevation", "azimuth")
        place = np.searchsorted(stream.time, time)
        there = place < len(stream.time)
        there[there] = stream.time[place[there]] == time[there]
        e, a = elevation[place[there]], azimuth[place[there]]
        direction = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), -np.sin(e)], axis=1)
        s, drift = self.spec, np.asarray(self.spec.drift)
        away = np.asarray(s.offset) + since[there, None] * drift
        error = np.zeros((len(time), stream.value.shape[1]))
        error[there, 0] = s.clock_offset + s.clock_drift * since[there] - np.sum(direction * away, axis=1)
        # No matrix product: its sums depend on the number of rows, and pieces of a run must give the same as the whole.
        error[there, 1] = s.clock_drift - np.sum(direction * drift, axis=1)
        return error


@register_fault
class Jamming(FaultSpec):
    """A jammer weakens all signals: the noise grows, and satellites are lost, the weakest first.

    Attributes
    ----------
    loss : float
        By how much C/N0 falls [dB].
    rise : float
        Time in which it falls so far, from the beginning of the fault on, at an even rate in decibels [s].
    lock : float
        Below this C/N0 the receiver loses a satellite [dB-Hz].
    """

    effect: ClassVar[Effect] = "noise"
    kind: Literal["jamming"] = "jamming"
    loss: Positive
    rise: NonNegative = quantity("s", 0.0)
    lock: float = Field(28.0, ge=0.0)

    def check(self, instruments: Mapping[str, str], *, imu: bool = True) -> None:
        """See `FaultSpec.check`; SpecError for an instrument without pseudoranges."""
        super().check(instruments, imu=imu)
        _check_signals(self, instruments)

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _Jamming(self, index, seed, self.key_of_streams(index, occurrence))


class _Jamming(FaultLayer):
    spec: Jamming

    def apply(self, stream: AidStream) -> AidStream:
        found = self.activity.locate(stream.time) if self.touches(stream) else None
        if found is None:
            return stream
        rows, interval = found
        since = stream.time[rows] - self.activity.starts[interval]
        loss = self.spec.loss * (np.minimum(1.0, since / self.spec.rise) if self.spec.rise else np.ones(len(since)))
        at = KINDS[stream.kind].side_names.index("density_ratio")
        side, sigma, value = stream.side.copy(), stream.sigma.copy(), stream.value.copy()
        faults, fault_error = stream.faults.copy(), stream.fault_error.copy()
        growth = noise_factor(side[rows, at] - loss) / noise_factor(side[rows, at])
        variates = self.rng(stream.name, "noise").standard_normal((len(rows), value.shape[1]))
        more = sigma[rows] * np.sqrt(growth**2 - 1.0)[:, None] * variates
        side[rows, at] -= loss
        sigma[rows] *= growth[:, None]
        value[rows] += more
        fault_error[rows] += more
        faults[rows] |= self.bits(interval)
        keep: NDArray[np.bool_] = np.ones(len(stream), np.bool_)
        keep[rows] = side[rows, at] >= self.spec.lock
        dropped = np.sort(np.concatenate([stream.dropped, stream.time[~keep]]), kind="stable")
        return replace(
            stream, time=stream.time[keep], value=value[keep], faults=faults[keep], fault_error=fault_error[keep],
            sigma=sigma[keep], side=side[keep], dropped=dropped,
        )  # fmt: skip
