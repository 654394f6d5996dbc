"""The sentences of NMEA 0183 that are understood, standard and proprietary: from fields to named values.

All values are in SI units and radians. A magnetic heading has the column ``heading_magnetic``, and the variation where
the sentence has it; the true heading follows in `simnav.log.nmea`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

__all__ = ["SENTENCES", "Fields", "InvalidError", "Row"]

_DEG = math.pi / 180.0
_KNOT = 1852.0 / 3600.0
#: The numbers of the standard. Python would also read ``inf``, ``1e9``, ``1_0`` and digits of other scripts.
_DECIMAL = re.compile(r"[+-]?(\d{1,15}(\.\d*)?|\.\d+)", re.ASCII)

Fields = list[str]
#: Named values of a sentence; text is a name, such as that of a transponder.
Row = dict[str, float | str]


#: Positions of GGA that no satellite gave: none, estimated (dead reckoning), entered by hand, of a simulator.
_NO_FIX = ("", "0", "6", "7", "8")
#: The same as a mode of RMC, GLL, VTG and THS; an empty one, or none, is of a receiver before version 2.3.
_NO_MODE = ("N", "E", "M", "S", "V")


class InvalidError(Exception):
    """A well-formed sentence that says that it holds no measurement; its time is good."""

    def __init__(self, time_of_day: float = math.nan):
        super().__init__()
        self.time_of_day = time_of_day


def _number(text: str) -> float:
    """A field as a number, NaN where it is empty; ValueError where it is no decimal number."""
    text = text.strip()
    if not text:
        return math.nan
    if not _DECIMAL.fullmatch(text):
        raise ValueError(f"number {text!r}")
    return float(text)


def _angle(text: str, hemisphere: str, positive: str, negative: str, largest: float) -> float:
    """``ddmm.mmmm`` and the hemisphere, in radians."""
    if not text:
        return math.nan
    if hemisphere not in (positive, negative):
        raise ValueError(f"hemisphere {hemisphere!r}")
    value = _number(text)
    degrees = math.floor(value / 100.0)
    minutes = value - 100.0 * degrees
    if not 0.0 <= minutes < 60.0 or not 0.0 <= degrees + minutes / 60.0 <= largest:
        raise ValueError(f"angle {text!r}")
    angle = (degrees + minutes / 60.0) * _DEG
    return -angle if hemisphere == negative else angle


def _place(f: Fields) -> Row:
    """Latitude, its hemisphere, longitude, its hemisphere."""
    return {"latitude": _angle(f[0], f[1], "N", "S", 90.0), "longitude": _angle(f[2], f[3], "E", "W", 180.0)}


def _direction(text: str) -> float:
    """Degrees, in radians."""
    angle = _number(text)
    if abs(angle) > 360.0:
        raise ValueError(f"direction {text!r}")
    return angle * _DEG


def _signed(text: str, side: str) -> float:
    """Degrees with a side, E or W, in radians, positive east; NaN where one of them is empty."""
    side = side.strip()
    if not text.strip() or not side:
        return math.nan
    if side not in ("E", "W"):
        raise ValueError(f"side {side!r}")
    return _direction(text) * (-1.0 if side == "W" else 1.0)


def _mode(f: Fields, at: int) -> str:
    return f[at].strip() if len(f) > at else ""


def _time_of_day(text: str) -> float:
    text = text.strip()
    if not text:
        return math.nan
    if len(text) < 6 or not text[:6].isdecimal() or not _DECIMAL.fullmatch(text):
        raise ValueError(f"time of day {text!r}")
    hours, minutes, seconds = int(text[:2]), int(text[2:4]), float(text[4:])
    if hours > 23 or minutes > 59 or not seconds < 61.0:  # a leap second is the 60th
        raise ValueError(f"time of day {text!r}")
    return hours * 3600.0 + minutes * 60.0 + seconds


def _track(course: str, knots: str) -> Row:
    angle, speed = _direction(course), _number(knots) * _KNOT
    if speed == 0.0 and math.isnan(angle):
        angle = 0.0  # a ship at rest has no course
    return {
        "course": angle,
        "speed": speed,
        "velocity_north": speed * math.cos(angle),
        "velocity_east": speed * math.sin(angle),
    }


def _gga(f: Fields) -> Row:
    time_of_day = _time_of_day(f[0])
    if f[5] in _NO_FIX:
        raise InvalidError(time_of_day)
    separation = _number(f[10])
    altitude = _number(f[8])
    return {
        "time_of_day": time_of_day,
        **_place(f[1:5]),
        "quality": _number(f[5]),
        "satellites": _number(f[6]),
        "hdop": _number(f[7]),
        "altitude": altitude,
        "separation": separation,
        "height": altitude + (0.0 if math.isnan(separation) else separation),
    }


def _gll(f: Fields) -> Row:
    time_of_day = _time_of_day(f[4]) if len(f) > 4 else math.nan
    if _mode(f, 5) == "V" or _mode(f, 6) in _NO_MODE:
        raise InvalidError(time_of_day)
    return {"time_of_day": time_of_day, **_place(f[:4])}


def _rmc(f: Fields) -> Row:
    time_of_day = _time_of_day(f[0])
    if f[1] == "V" or _mode(f, 11) in _NO_MODE:
        raise InvalidError(time_of_day)
    variation = _signed(f[9], f[10]) if len(f) > 10 else math.nan
    return {"time_of_day": time_of_day, **_place(f[2:6]), **_track(f[7], f[6]), "variation": variation}


def _zda(f: Fields) -> Row:
    return {"time_of_day": _time_of_day(f[0])}


def _vtg(f: Fields) -> Row:
    if _mode(f, 8) in _NO_MODE:
        raise InvalidError
    return _track(f[0], f[4])


def _gns(f: Fields) -> Row:
    """One mode for each satellite system, such as ``AAN``; the position is invalid where none of them has a fix."""
    time_of_day = _time_of_day(f[0])
    if all(mode in _NO_MODE for mode in f[5].strip()):
        raise InvalidError(time_of_day)
    separation, altitude = _number(f[9]), _number(f[8])
    return {
        "time_of_day": time_of_day,
        **_place(f[1:5]),
        "satellites": _number(f[6]),
        "hdop": _number(f[7]),
        "altitude": altitude,
        "separation": separation,
        "height": altitude + (0.0 if math.isnan(separation) else separation),
    }


def _gst(f: Fields) -> Row:
    """Standard deviations of the position [m]."""
    return {
        "time_of_day": _time_of_day(f[0]),
        "sigma_latitude": _number(f[5]),
        "sigma_longitude": _number(f[6]),
        "sigma_height": _number(f[7]),
    }


def _hdt(f: Fields) -> Row:
    return {"heading": _direction(f[0])}


def _hdg(f: Fields) -> Row:
    """Heading of a magnetic sensor, its deviation and the variation, each of the latter two with its side."""
    deviation = _signed(f[1], f[2]) if len(f) > 2 else math.nan
    magnetic = _direction(f[0]) + (0.0 if math.isnan(deviation) else deviation)
    return {"heading_magnetic": magnetic, "variation": _signed(f[3], f[4]) if len(f) > 4 else math.nan}


def _hdm(f: Fields) -> Row:
    return {"heading_magnetic": _direction(f[0]), "variation": math.nan}


def _ths(f: Fields) -> Row:
    if _mode(f, 1) in _NO_MODE:
        raise InvalidError
    return _hdt(f)


def _vhw(f: Fields) -> Row:
    return {
        "heading": _direction(f[0]),
        "heading_magnetic": _direction(f[2]),
        "variation": math.nan,
        "speed": _number(f[4]) * _KNOT,
    }


def _vbw(f: Fields) -> Row:
    """Speeds through the water and over the ground; each pair has a status, A (valid) or V."""
    water, ground = (math.nan if _mode(f, at) == "V" else _KNOT for at in (2, 5))
    return {
        "speed": _number(f[0]) * water,
        "speed_starboard": _number(f[1]) * water,
        "ground_forward": _number(f[3]) * ground,
        "ground_starboard": _number(f[4]) * ground,
    }


def _dpt(f: Fields) -> Row:
    return {"depth": _number(f[0]), "offset": _number(f[1]) if len(f) > 1 else math.nan}


def _dbt(f: Fields) -> Row:
    """Depth below the transducer in feet, metres and fathoms; the first that is given."""
    for at, metres in ((2, 1.0), (0, 0.3048), (4, 1.8288)):
        if len(f) > at and f[at].strip():
            return {"depth": _number(f[at]) * metres}
    raise InvalidError


def _rot(f: Fields) -> Row:
    """Rate of turn in degrees per minute, positive to starboard."""
    if _mode(f, 1) == "V":
        raise InvalidError
    return {"rate_of_turn": _number(f[0]) * _DEG / 60.0}


def _mtw(f: Fields) -> Row:
    """Temperature of the water [deg C]."""
    return {"temperature": _number(f[0])}


def _pashr(f: Fields) -> Row:
    """Attitude of a motion sensor: time, heading, T, roll, pitch, heave, and their standard deviations."""
    return {
        "time_of_day": _time_of_day(f[0]),
        "heading": _direction(f[1]),
        "roll": _direction(f[3]),
        "pitch": _direction(f[4]),
        "heave": _number(f[5]),
        "sigma_roll": _direction(f[6]),
        "sigma_pitch": _direction(f[7]),
        "sigma_heading": _direction(f[8]),
    }


def _prdid(f: Fields) -> Row:
    """Pitch, roll, heading."""
    return {"pitch": _direction(f[0]), "roll": _direction(f[1]), "heading": _direction(f[2])}


#: A velocity that a Nortek DVL gives where it has none [m/s].
_NORTEK_NONE = -32.768


def _pnorbt(f: Fields) -> Row:
    """Bottom track of a Nortek DVL (6 and 8 with tags, 7 and 9 without): axes forward, starboard, down.

    Time [s since 1970], two time differences, three velocities, figure of merit, distances of four beams.
    """
    values = [_number(x.rpartition("=")[2]) for x in f[:11]]
    moment, velocity = values[0], values[3:6]
    if any(v <= _NORTEK_NONE for v in velocity):
        raise InvalidError(moment % 86400.0)
    return {
        "time_of_day": moment % 86400.0,
        **dict(zip(("ground_forward", "ground_starboard", "ground_down"), velocity, strict=True)),
        "fom": values[6],
        **{f"distance_{i}": values[6 + i] for i in range(1, 5)},
    }


def _psimssb(f: Fields) -> Row:
    """Position of a transponder by a USBL system of Kongsberg, Cartesian coordinates only.

    The axes are those of the vessel (H), or north (N) or east (E) is up: x is to the right, y ahead or up.
    """
    time_of_day = _time_of_day(f[0])
    up = f[5].strip()
    if f[2].strip() != "A" or f[4].strip() != "C" or up not in ("H", "N", "E"):
        raise InvalidError(time_of_day)
    x, y = _number(f[7]), _number(f[8])
    return {
        "time_of_day": time_of_day,
        "transponder": f[1].strip(),
        "error": f[3].strip(),
        "forward": y if up == "H" else math.nan,
        "starboard": x if up == "H" else math.nan,
        "north": {"N": y, "E": -x}.get(up, math.nan),
        "east": {"N": x, "E": y}.get(up, math.nan),
        "depth": _number(f[9]),
        "sigma": _number(f[10]),
    }


def _psxn23(f: Fields) -> Row:
    return {
        "roll": _number(f[0]) * _DEG,
        "pitch": _number(f[1]) * _DEG,
        "heading": _direction(f[2]),
        "heave": _number(f[3]) if len(f) > 3 else math.nan,
    }


def _uvh(f: Fields) -> Row:
    east, north, heading = _number(f[0]) * _KNOT, _number(f[1]) * _KNOT, _direction(f[2])
    return {
        "east": east,
        "north": north,
        "heading": heading,
        "speed": north * math.cos(heading) + east * math.sin(heading),
        "speed_starboard": east * math.cos(heading) - north * math.sin(heading),
    }


#: Decoder of each sentence: its fields after the name, to named values in SI units and radians.
SENTENCES: Mapping[str, Callable[[Fields], Row]] = {
    "GGA": _gga,
    "GLL": _gll,
    "GNS": _gns,
    "GST": _gst,
    "RMC": _rmc,
    "ZDA": _zda,
    "VTG": _vtg,
    "HDT": _hdt,
    "HDG": _hdg,
    "HDM": _hdm,
    "THS": _ths,
    "ROT": _rot,
    "VHW": _vhw,
    "VBW": _vbw,
    "DPT": _dpt,
    "DBT": _dbt,
    "MTW": _mtw,
    "PASHR": _pashr,
    "PRDID": _prdid,
    **dict.fromkeys(("PNORBT6", "PNORBT7", "PNORBT8", "PNORBT9"), _pnorbt),
    "PSIMSSB": _psimssb,
    "PSXN,23": _psxn23,
    "PUHAW,UVH": _uvh,
}
