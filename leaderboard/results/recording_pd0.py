"""The readings of Doppler velocity logs as PD0, a format of Teledyne RDI, for programs and for the reader of simnav.

An instrument ``dvl_beams`` is in beam coordinates, a velocity in body axes in ship coordinates. Beam 3 of PD0 is beam 1
of simnav, then follow clockwise 2, 4 and 1; the heading alignment is the azimuth of beam 3. A velocity is that of the
bottom relative to the instrument: along a beam positive towards the transducer, in ship coordinates to starboard,
forward, up. Water track is in the fields of the water-mass layer. Ranges are slant ranges times the cosine of the slant
angle, as PD0 has it. Heading and depth are the last readings of a compass and a depth sensor; the mask of the sensors
says whether there are any. Fields of what is not simulated are 0. Times count from 2000-01-01.

Sources: Teledyne RD Instruments, *Pathfinder DVL guide*, April 2018 (signs of the axes), and *Workhorse commands and
output data format*, chapter 8 (fields).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from datetime import datetime, timedelta
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simnav.types import KINDS, Array

from .files import write_whole
from .formats import writes

if TYPE_CHECKING:
    from simnav.recording import AidStream, Recording
    from simnav.types import Datasheet

__all__ = ["write_pd0"]

_START = datetime(2000, 1, 1)
_MISSING = -32768
_BEAM, _SHIP = 0, 2
#: Which channel of simnav is beam 1 to 4 of PD0.
_CHANNEL = (3, 1, 0, 2)
#: Codes of frequencies [kHz] and of slant angles [deg].
_FREQUENCIES = (75.0, 150.0, 300.0, 600.0, 1200.0, 2400.0)
_ANGLES = (15, 20, 30)
_CONVEX, _ATTACHED, _FOUR_BEAMS = 0x08, 0x40, 0x40
_DEPTH_SENSOR, _HEADING_SENSOR = 0x20, 0x10


@writes("recording", "pd0")
def write_pd0(recording: Recording, path: Path) -> list[Path]:
    """A file with an ensemble for each ping; of several instruments one each, with the name of the instrument.

    Raises
    ------
    ValueError
        If there is no Doppler velocity log.
    """
    found = {}
    for name, whole in recording.data.aids.items():
        kind = KINDS[whole.kind]
        if whole.kind == "dvl_beams" or kind.equation == "body_velocity":
            found[name] = whole.as_delivered()
    if not found:
        raise ValueError(
            "the recording has no Doppler velocity log (an instrument such as dvl_beams, dvl_solution, dvl)"
        )
    written = []
    for name, stream in found.items():
        place = path if len(found) == 1 else path.with_name(f"{path.stem}-{name}{path.suffix}")
        written.append(write_whole(place, b"".join(_ensembles(recording, stream))))
    return written


def _ensembles(recording: Recording, stream: AidStream) -> Iterator[bytes]:
    sheet = recording.instruments[stream.name]
    beams = stream.kind == "dvl_beams"
    fixed = _fixed_leader(sheet, stream) if beams else _leader_of(_SHIP, 600.0, 30.0, 0.0)
    water = beams and sheet.details["track"] == "water"
    times, velocity, ranges = _beams(stream) if beams else _ship(stream)
    heading, depth = _last(recording, "heading", times), _last(recording, "depth", times)
    fixed[30] = fixed[31] = (_HEADING_SENSOR if len(heading) else 0) | (_DEPTH_SENSOR if len(depth) else 0)
    nothing = np.full(4, np.nan)
    for k, time in enumerate(times):
        course, deep = (float(a[k]) if len(a) else 0.0 for a in (heading, depth))
        leader = _variable_leader(k + 1, float(time), course, deep)
        bottom, layer = (nothing, velocity[k]) if water else (velocity[k], nothing)
        yield _whole(bytes(fixed), leader, _bottom_track(bottom, layer, ranges[k]))


def _beams(stream: AidStream) -> tuple[Array, Array, Array]:
    """Times (n,), velocities [m/s] and ranges [m] (n, 4) in the order of PD0; NaN where a beam is lost."""
    times, row = np.unique(stream.time, return_inverse=True)
    velocity, ranges = np.full((2, len(times), 4), np.nan)
    velocity[row, stream.channel] = stream.value[:, 0]
    ranges[row, stream.channel] = stream.side[:, 2] * np.cos(stream.side[:, 1])
    return times, velocity[:, _CHANNEL], ranges[:, _CHANNEL]


def _ship(stream: AidStream) -> tuple[Array, Array, Array]:
    """Times (n,), bottom to starboard, forward and up [m/s] with a missing error velocity, and no ranges."""
    starboard, forward, down = -stream.value[:, 1], -stream.value[:, 0], stream.value[:, 2]
    none = np.full(len(stream), np.nan)
    return stream.time, np.stack([starboard, forward, down, none], axis=1), np.full((len(stream), 4), np.nan)


def _last(recording: Recording, wanted: str, times: Array) -> Array:
    """(n,) last reading of a heading or depth at each time, before the first one that; empty without an instrument."""
    for whole in recording.data.aids.values():
        kind = KINDS[whole.kind]
        if len(whole) and not whole.channels and (kind.equation == wanted or kind.role == wanted):
            stream = whole.as_delivered()
            at = np.searchsorted(stream.time, times, side="right") - 1
            return np.asarray(stream.value[np.maximum(at, 0), 0])
    return np.empty(0)


def _fixed_leader(sheet: Datasheet, stream: AidStream) -> bytearray:
    """That of an instrument of beams."""
    if not len(stream):
        return _leader_of(_BEAM, sheet.details["frequency_khz"], 30.0, 0.0)
    first = stream.side[0]
    azimuth = degrees(first[0]) - 90.0 * int(stream.channel[0])
    return _leader_of(_BEAM, sheet.details["frequency_khz"], degrees(first[1]), azimuth)


def _leader_of(frame: int, frequency: float, slant: float, alignment: float) -> bytearray:
    """The fixed leader: axes, frequency [kHz], slant angle and heading alignment [deg]."""
    part = bytearray(59)
    code = int(np.argmin(abs(np.log(np.array(_FREQUENCIES) / frequency))))
    angle = _ANGLES.index(round(slant)) if round(slant) in _ANGLES else 3
    part[4], part[5] = code | _CONVEX | _ATTACHED, angle | _FOUR_BEAMS
    part[6] = 1  # simulated
    part[8] = 4
    part[25] = frame << 3
    struct.pack_into("<h", part, 26, round(100.0 * ((alignment + 180.0) % 360.0 - 180.0)))
    part[58] = round(slant)
    return part


def _variable_leader(number: int, time: float, heading: float, depth: float) -> bytes:
    moment = _START + timedelta(milliseconds=10 * round(100.0 * time))
    clock = (moment.month, moment.day, moment.hour, moment.minute, moment.second, moment.microsecond // 10_000)
    part = bytearray(65)
    struct.pack_into("<HH7BB", part, 0, 0x0080, number & 0xFFFF, moment.year % 100, *clock, number >> 16 & 0xFF)
    course = round(100.0 * (degrees(heading) % 360.0)) % 36000
    struct.pack_into("<3H", part, 14, 1500, min(max(round(10.0 * depth), 0), 9999), course)
    struct.pack_into("<8B", part, 57, moment.year // 100, moment.year % 100, *clock)
    return bytes(part)


def _bottom_track(bottom: Array, layer: Array, ranges: Array) -> bytes:
    part = bytearray(81)
    struct.pack_into("<HH", part, 0, 0x0600, 1)
    far = [0 if np.isnan(r) else round(100.0 * float(r)) for r in ranges]
    struct.pack_into("<4H", part, 16, *(r & 0xFFFF for r in far))
    struct.pack_into("<4h", part, 24, *map(_millimetres, bottom))
    struct.pack_into("<4B", part, 40, *(0 if np.isnan(v) else 100 for v in bottom))
    struct.pack_into("<4h", part, 50, *map(_millimetres, layer))
    struct.pack_into("<4B", part, 66, *(0 if np.isnan(v) else 100 for v in layer))
    struct.pack_into("<4B", part, 77, *(r >> 16 & 0xFF for r in far))
    return bytes(part)


def _millimetres(velocity: float) -> int:
    return _MISSING if np.isnan(velocity) else min(max(round(1000.0 * float(velocity)), -32767), 32767)


def _whole(*parts: bytes) -> bytes:
    """An ensemble of parts with its header and checksum."""
    offsets, at = [], 6 + 2 * len(parts)
    for part in parts:
        offsets.append(at)
        at += len(part)
    body = struct.pack(f"<2sHBB{len(parts)}H", b"\x7f\x7f", at, 0, len(parts), *offsets) + b"".join(parts)
    return body + struct.pack("<H", sum(body) & 0xFFFF)
