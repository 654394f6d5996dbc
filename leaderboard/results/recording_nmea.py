"""The measurements of a recording as NMEA 0183, for plotters and for the reader of simnav.

GGA (positions), VTG (velocities over the ground), HDT (headings), VHW (speed through the water), VBW (a velocity log).
Each line stands behind a stamp; times count from 1970-01-01. Instruments that no sentence can hold are left out: an
IMU, depth, ranges. Talkers tell instruments of one kind apart: GP, G1, G2, ...
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.types import KINDS, Array

from .files import write_whole
from .formats import writes

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["write_nmea"]

_KNOT = 1852.0 / 3600.0


def _angle(radians: float, width: int, positive: str, negative: str) -> str:
    """``ddmm.mmmmmmmm,N``."""
    degrees = abs(math.degrees(radians))
    whole = math.floor(degrees)
    minutes = 60.0 * (degrees - whole)
    if minutes >= 59.999999995:
        whole, minutes = whole + 1, 0.0
    return f"{whole:0{width}d}{minutes:011.8f},{negative if radians < 0.0 else positive}"


def _gga(value: Array, clock: str) -> str:
    height = float(value[2]) if len(value) == 3 else 0.0
    place = f"{_angle(float(value[0]), 2, 'N', 'S')},{_angle(float(value[1]), 3, 'E', 'W')}"
    return f"GGA,{clock},{place},1,10,1.0,{height:.6f},M,0.0,M,,"


def _vtg(value: Array, clock: str) -> str:
    course = math.degrees(math.atan2(value[1], value[0])) % 360.0
    speed = math.hypot(value[0], value[1])
    return f"VTG,{course:.9f},T,,M,{speed / _KNOT:.9f},N,{3.6 * speed:.9f},K,A"


def _hdt(value: Array, clock: str) -> str:
    return f"HDT,{math.degrees(value[0]) % 360.0:.9f},T"


def _vhw(value: Array, clock: str) -> str:
    return f"VHW,,T,,M,{value[0] / _KNOT:.9f},N,{3.6 * value[0]:.9f},K"


def _vbw(value: Array, clock: str) -> str:
    return f"VBW,,,V,{value[0] / _KNOT:.9f},{value[1] / _KNOT:.9f},A"


#: Equation of a kind -> its sentence and talker.
_SENTENCES: Mapping[str, tuple[str, Callable[[Array, str], str]]] = {
    "position": ("GP", _gga),
    "horizontal_position": ("GP", _gga),
    "velocity": ("GP", _vtg),
    "heading": ("HE", _hdt),
    "water_speed": ("VW", _vhw),
    "body_velocity": ("VD", _vbw),
}


@writes("recording", "nmea")
def write_nmea(recording: Recording, path: Path) -> list[Path]:
    """Sentences in the order of time.

    Raises
    ------
    ValueError
        If no instrument has a sentence.
    """
    begin, lines, used = datetime(1970, 1, 1, tzinfo=UTC), [], set[tuple[str, str]]()
    for each in recording.data.aids.values():
        stream = each.as_delivered()
        equation = KINDS[stream.kind].equation
        if not isinstance(equation, str) or equation not in _SENTENCES or stream.channels:
            continue
        talker, sentence = _SENTENCES[equation]
        number = 0
        while (talker, sentence.__name__) in used:
            number += 1
            talker = f"{talker[0]}{number}"
        used.add((talker, sentence.__name__))
        for time, value in zip(stream.time, stream.value, strict=True):
            moment = begin + timedelta(microseconds=round(1e6 * float(time)))
            body = talker + sentence(value, moment.strftime("%H%M%S.%f"))
            total = 0
            for character in body:
                total ^= ord(character)
            stamp = moment.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
            lines.append((float(time), f"{stamp} ${body}*{total:02X}"))
    if not lines:
        raise ValueError("the recording has no instrument that a sentence of NMEA 0183 can hold")
    lines.sort(key=lambda line: line[0])
    return [write_whole(path, "\n".join(line for _, line in lines) + "\n")]
