"""Raw observations of satellites as a RINEX observation file, for programs such as RTKLIB and for the reader of simnav.

Each epoch has pseudorange (C), Doppler shift (D) and C/N0 (S) of the signal on 1575.42 MHz: C1C of GPS and Galileo, C1P
of BeiDou. As RINEX has it, epochs are times of the receiver's clock, and pseudoranges contain the errors of both
clocks; the error of the receiver's clock stands behind each epoch, so GPS time is the epoch less this error. It is that
of a point solution, or of the nearest ones where there is none. The satellite's clock comes from the navigation file of
the scenario, which the other program needs, too; for the ephemerides of simnav it is the file
`simnav.sensors.gnss_raw.SHIPPED`.

Source: International GNSS Service, *RINEX version 3.05*, 2020, sections 5, 6 and A2.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simnav.types import KINDS, Array

from .files import write_whole
from .formats import writes

if TYPE_CHECKING:
    from simnav.compiled import Integers
    from simnav.recording import AidStream, Recording
    from simnav.satellites.ephemeris import Ephemerides
    from simnav.types import Datasheet

__all__ = ["write_rinex"]

_CODES = {"G": "C1C D1C S1C", "E": "C1C D1C S1C", "C": "C1P D1P S1P"}
_FREQUENCY = 1575.42e6  # [Hz]
#: Typical time that a signal is on its way [s]: a satellite's clock changes by less than 1e-11 s/s * 0.02 s meanwhile.
_ON_ITS_WAY = 0.075
#: Epochs count multiples of this [s].
_TICK = 1e-7


@writes("recording", "rinex")
def write_rinex(recording: Recording, path: Path) -> list[Path]:
    """An observation file; of several receivers one each, with the name of the instrument.

    Raises
    ------
    ValueError
        If there are no raw observations of one frequency, or at no time a solution with the receiver's clock.
    """
    found = {
        name: stream.as_delivered()
        for name, stream in recording.data.aids.items()
        if stream.kind == "gnss_raw" and name in recording.origins
    }
    if not found:
        raise ValueError("the recording has no raw observations of satellites (an instrument of the kind gnss_raw)")
    written = []
    for name, stream in found.items():
        place = path if len(found) == 1 else path.with_name(f"{path.stem}-{name}{path.suffix}")
        written.append(write_whole(place, _text(recording, stream)))
    return written


def _text(recording: Recording, stream: AidStream) -> str:
    from simnav.sensors.gnss_raw import ephemerides_of

    sheet, origin = recording.instruments[stream.name], recording.origins[stream.name]
    if sheet.details["frequencies"] != 1:
        raise ValueError(
            f"{stream.name}: RINEX has no code for the combination of two frequencies; it holds frequencies = 1"
        )
    begin, ephemerides = datetime.fromisoformat(origin["epoch"]), ephemerides_of(origin["navigation"])
    epochs, first = np.unique(stream.time, return_index=True)
    offset, place = _clock(stream, first, sheet)
    lines = [*_header(recording, stream, begin + timedelta(seconds=float(epochs[0])), place)]
    observed = _observed(stream, begin, ephemerides)
    last = [*first[1:], len(stream)]
    for time, i, j, bias in zip(epochs, first, last, offset, strict=True):
        lines.append(_epoch(begin, float(time), bias, j - i))
        for k in range(i, j):
            values = "".join(f"{value:14.3f}  " for value in observed[k])
            lines.append(f"{stream.channels[stream.channel[k]]}{values}".rstrip())
    return "\n".join(lines) + "\n"


def _clock(stream: AidStream, first: Integers, sheet: Datasheet) -> tuple[Array, Array]:
    """The error of the receiver's clock at each epoch [s], and the first position, Earth-fixed [m]."""
    from simnav.geometry.ecef import ecef_from_geodetic
    from simnav.satellites.orbit import SPEED_OF_LIGHT
    from simnav.satellites.point_solution import solve
    from simnav.sensors.gnss_receiver import corrected_ranges

    last = [*first[1:], len(stream)]
    solved = [solve(corrected_ranges(stream, slice(i, j), sheet)) for i, j in zip(first, last, strict=True)]
    there = [k for k, solution in enumerate(solved) if solution is not None]
    if not there:
        raise ValueError(f"{stream.name}: no epoch has the four satellites from which the receiver's clock follows")
    time = stream.time[first]
    known = [solution for solution in solved if solution is not None]
    bias, drift = np.array([s.clock for s in known]), np.array([s.drift for s in known])
    nearest = np.argmin(abs(time[:, None] - time[there]), axis=1)
    clock = bias[nearest] + drift[nearest] * (time - time[there][nearest])
    return clock / SPEED_OF_LIGHT, np.asarray(ecef_from_geodetic(known[0].position))


def _observed(stream: AidStream, begin: datetime, ephemerides: Ephemerides) -> Array:
    """(n, 3) pseudoranges [m], Doppler shifts [Hz] and C/N0 [dB-Hz] of the readings."""
    from simnav.satellites.orbit import SPEED_OF_LIGHT
    from simnav.satellites.time_scales import gps_time

    epochs, at = np.unique(stream.time, return_inverse=True)
    sent = gps_time(begin).since(ephemerides.week) + epochs - _ON_ITS_WAY
    states = ephemerides.states(stream.channels, sent)
    delay = np.array([ephemerides.group_delay[ephemerides.rows(name)[0]] for name in stream.channels])
    late = states.clock[at, stream.channel] - delay[stream.channel]
    drift = states.drift[at, stream.channel]
    strength = stream.side[:, KINDS["gnss_raw"].side_names.index("density_ratio")]
    pseudorange = stream.value[:, 0] - SPEED_OF_LIGHT * late
    rate = stream.value[:, 1] - SPEED_OF_LIGHT * drift
    return np.stack([pseudorange, -rate * (_FREQUENCY / SPEED_OF_LIGHT), strength], axis=1)


def _header(recording: Recording, stream: AidStream, begin: datetime, place: Array) -> Iterator[str]:
    def line(content: str, label: str) -> str:
        return f"{content:<60.60}{label}"

    systems = sorted({name[0] for name in stream.channels}, key="GEC".index)
    yield line(f"{3.05:9.2f}{'':11}{'OBSERVATION DATA':<20}{systems[0] if len(systems) == 1 else 'M'}", _FIRST)
    yield line(f"{'simnav':<20}{'simnav':<20}", "PGM / RUN BY / DATE")
    yield line(f"simulated: {recording.scenario}, {stream.name}", "COMMENT")
    yield line(stream.name, "MARKER NAME")
    yield line("SHIP", "MARKER TYPE")
    yield line("", "OBSERVER / AGENCY")
    yield line(f"{'':20}{'simnav':<20}", "REC # / TYPE / VERS")
    yield line("", "ANT # / TYPE")
    yield line("".join(f"{x:14.4f}" for x in place), "APPROX POSITION XYZ")
    yield line("".join(f"{0.0:14.4f}" for _ in range(3)), "ANTENNA: DELTA H/E/N")
    for system in systems:
        codes = _CODES[system].split()
        yield line(f"{system}  {len(codes):3d}" + "".join(f" {code}" for code in codes), "SYS / # / OBS TYPES")
    yield line("DBHZ", "SIGNAL STRENGTH UNIT")
    date = f"{begin.year:6d}{begin.month:6d}{begin.day:6d}{begin.hour:6d}{begin.minute:6d}"
    yield line(f"{date}{begin.second + 1e-6 * begin.microsecond:13.7f}{'GPS':>8}", "TIME OF FIRST OBS")
    yield line(f"{0:6d}", "RCV CLOCK OFFS APPL")
    for system in systems:
        yield line(system, "SYS / PHASE SHIFT")
    yield line("", "END OF HEADER")


_FIRST = "RINEX VERSION / TYPE"


def _epoch(begin: datetime, time: float, bias: float, count: int) -> str:
    """The line of an epoch by the receiver's clock, which is rounded to the digits of the file; so is its error."""
    ticks = round((time + bias) / _TICK)
    whole, rest = divmod(ticks, round(60.0 / _TICK))
    start = begin.replace(second=0, microsecond=0)
    rest += round((begin.second + 1e-6 * begin.microsecond) / _TICK)
    more, rest = divmod(rest, round(60.0 / _TICK))
    minute = start + timedelta(minutes=whole + more)
    return (
        f"> {minute.year:4d} {minute.month:02d} {minute.day:02d} {minute.hour:02d} {minute.minute:02d}"
        f"{rest * _TICK:11.7f}  0{count:3d}      {bias:15.12f}"
    )
