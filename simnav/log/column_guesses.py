"""What the columns of a stream probably are, by their names and by the sizes of their values."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.log.channel import no_fix
from simnav.log.inspection import Stream, is_number
from simnav.log.table import LogError
from simnav.log.units import dimension, spelt
from simnav.types import Array

__all__ = ["Guess", "guesses", "left_out", "told_unit"]

_AXES = r"(?:_|\.|\[|\s|-)?"
_LABEL = {
    "angular_rate": r"gyr?o?|g|w|ang(ular)?[_.]?(vel(ocity)?|rate)|omega|imu[_.]g|w_rs_s|gyro_rad|"
    r"d_?theta|delta_?(theta|angle)",
    "specific_force": r"acc?(el)?(eration)?|a|f|specific[_.]force|linear[_.]acc(eleration)?|imu[_.]a|a_rs_s|"
    r"accelerometer_m_s2|d_?vel|delta_?vel(ocity)?",
}
#: Names of files and topics that say what their columns x, y, z are.
_OWN_NAME = {"angular_rate": r"gyr", "specific_force": r"acc(?!urac)", "dvl": r"dvl"}
#: Axes of a phone that lies flat with its top ahead: starboard, forward, up.
_PHONE = {"angular_rate": ("y", "x", "-z"), "specific_force": ("y", "x", "-z")}
#: Latitudes and longitudes of this size are in 1e-7 degrees.
_SCALED = 1e5
#: Specific force of a vessel, on the mean [m/s^2].
_PULL = 9.8
_DVL = (("x", "forward"), ("y", "starboard"), ("z", "down"))
#: Quantity -> regular expressions of the names of its columns, in order.
_NAMES: dict[str, tuple[str, ...]] = {
    "position": (
        r"^(gps|gnss|nav|location)?[_.]?lat(itude)?\b|^lat",
        r"^(gps|gnss|nav|location)?[_.]?(lon|lng)",
        r"^(height|hgt|h$|ellh)|^(gps|gnss|nav|location)?[_.]?(alt|ele)",
    ),
    **{
        q: tuple(
            rf"^({label}){_AXES}{axis}(?![a-z0-9])|^(?![agwf][_.])({label})_{i}$" for i, axis in enumerate("xyz", 1)
        )
        for q, label in _LABEL.items()
    },
    "heading": (r"^(true[_.]?)?(heading|hdg|yaw)\b|^(heading|yaw)_",),
    "level": (r"^roll\b|^roll_", r"^pitch\b|^pitch_"),
    "velocity": tuple(
        rf"^(vel(ocity)?[_.]?{name[0]}({name[1:]})?|v{name[0]})(_m_s)?\b" for name in ("north", "east", "down")
    ),
    "dvl": tuple(
        rf"^(dvl[_.]?(v|vel)?[_.]?{axis}|ground_{name}|v_?{name}|v{axis}|{name}_m_s)\b" for axis, name in _DVL
    ),
    "speed": (r"^(speed|stw|water_?speed)(_m_s)?\b",),
    "depth": (r"^depth\b|^depth_(m|meter)",),
    "quaternion": tuple(
        rf"^(q|quat(ernion)?|orientation|att(itude)?)[_.]?{axis}$|^q_?{i}$" for i, axis in enumerate("wxyz")
    ),
}
#: Sentences that say nothing of the vessel's own motion, though their columns have such names.
_NOT = {"depth": ("DPT", "DBT", "PSIMSSB"), "speed": ("RMC", "VTG", "GGA")}
#: A solution of Applanix has such columns, but no measurements of these.
_NOT_OF_SBET = ("angular_rate", "specific_force", "dvl", "speed")
#: Names of increments.
_INCREMENTS = re.compile(r"\b(d_?theta|d_?vel|delta_?(theta|angle|vel))", re.I)
_UNIT = re.compile(r"(?:\[([^\]]+)\]|\(([^)]+)\)|_((?:deg|rad|m|cm|mm)_s2?|[^_\W]+))\s*$")
_LENGTH, _SPEED = "length", "speed"
#: What each quantity is measured in; of a position the angle stands for the first two columns.
_DIMENSIONS = {
    "position": ("angle", "angle", _LENGTH), "angular_rate": ("angular rate",) * 3,
    "specific_force": ("acceleration",) * 3, "heading": ("angle",), "level": ("angle",) * 2, "velocity": (_SPEED,) * 3,
    "dvl": (_SPEED,) * 3, "speed": (_SPEED,), "depth": (_LENGTH,), "quaternion": ("",) * 4,
}  # fmt: skip


@dataclass(frozen=True)
class Guess:
    """What some columns of a stream probably are.

    Attributes
    ----------
    stream : Stream
        The stream.
    quantity : str
        A key of `_NAMES`.
    columns, units : tuple of str
        Columns with signs, and their units.
    """

    stream: Stream
    quantity: str
    columns: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def without_fix(self) -> NDArray[np.bool_]:
        """(n,) which rows of a position are no fixes."""
        return no_fix(np.stack([self.stream.table.column(c)[1] for c in self.columns[:2]], axis=-1))

    def sentence(self) -> str:
        """As text."""
        pairs = ", ".join(f"{c} [{u}]" for c, u in zip(self.columns, self.units, strict=True))
        none = int(np.sum(self.without_fix)) if self.quantity == "position" else 0
        left = f"; {none} with latitude 0 and longitude 0 are no fixes" if none else ""
        return f"{self.quantity.replace('_', ' ')}: {pairs}{left}"


def guesses(stream: Stream) -> Iterator[Guess]:
    """What the columns of a stream probably are; everything is to be checked by its user."""
    names = [n for n in stream.table.names if stream.table.columns[n].dtype != object]
    for quantity in _NAMES:
        found = _columns(stream, quantity)
        if not set(found) <= set(names) or not found:
            continue
        values = np.stack([stream.table.column(n)[1] for n in found], axis=-1)
        values = values[np.isfinite(values).all(axis=1)]
        if quantity == "position":
            values = values[~no_fix(values[:, :2])]
        if not len(values) or (quantity == "quaternion" and not _turns(values)):
            continue
        columns, units = _signed(quantity, found, values), _units(stream, quantity, values)
        if stream.form != "nmea":
            told = [told_unit(stream, name, what) for name, what in zip(found, _DIMENSIONS[quantity], strict=False)]
            if units[0] == "1e-7 deg":  # no matter that a name says degrees
                size = np.median(np.abs(values[:, :2]), axis=0)
                told[:2] = [u if s < _SCALED else units[0] for u, s in zip(told, size, strict=False)]
            units = *(a or b for a, b in zip(told, units, strict=False)), *units[len(found) :]
        yield Guess(stream, quantity, columns, units)
    numbered = [n for n in (f"q_{i}" for i in range(1, 5)) if n in names]  # PX4: scalar first
    if len(numbered) == 4 and _turns(np.stack([stream.table.column(n)[1] for n in numbered], axis=-1)):
        yield Guess(stream, "quaternion", tuple(numbered), ("1",) * 4)
    bare = _bare(stream, names)
    if bare is not None:
        yield bare
    magnetic, true = (
        n in names and bool(np.isfinite(stream.table.column(n)[1]).any()) for n in ("heading_magnetic", "heading")
    )
    if magnetic and not true:
        yield Guess(stream, "heading", ("heading_magnetic",), ("1",))


def _columns(stream: Stream, quantity: str) -> list[str]:
    """The columns of a quantity by their names, if all are there; a height or a vertical velocity may be missing."""
    if stream.sentence in _NOT.get(quantity, ()) or (stream.form == "sbet" and quantity in _NOT_OF_SBET):
        return []
    table = stream.table
    names = [n for n in table.names if table.columns[n].dtype != object or _is_mostly_numbers(table.columns[n])]
    found = [_first(names, pattern) for pattern in _NAMES[quantity]]
    needed = found[:2] if quantity in ("position", "velocity") else found
    return [name for part in found for name in part] if all(needed) else []


def _is_mostly_numbers(cells: NDArray[Any]) -> bool:
    """Whether a column with text is one of numbers, some of which are spoilt."""
    some = [c for c in cells[:: max(1, len(cells) // 1000)] if c is not None]
    return sum(is_number(str(c)) for c in some) > 0.8 * len(some)


def left_out(stream: Stream) -> Iterator[str]:
    """A sentence for each quantity of a stream that is left out, because a cell of its columns is no number."""
    for quantity in _NAMES:
        for name in _columns(stream, quantity):
            try:
                stream.table.column(name)
            except LogError as error:
                what = quantity.replace("_", " ")
                yield f"{error}; a draft has no {what} from this file before such rows are left out by 'where'"
                break


def _turns(quaternion: Array) -> bool:
    """Whether (n, 4) numbers are quaternions of a body that moves."""
    known = quaternion[np.isfinite(quaternion).all(axis=1)]
    length = np.linalg.norm(known, axis=1)
    return bool(len(known) and np.abs(length - 1.0).max() < 0.1 and np.ptp(known, axis=0).max() > 0.0)


def _bare(stream: Stream, names: Sequence[str]) -> Guess | None:
    """Columns x, y, z of a file or topic whose name says what they are, as those of phones."""
    label = stream.path.stem if stream.sentence is None else stream.sentence
    quantity = next((q for q, pattern in _OWN_NAME.items() if re.search(pattern, label, re.I)), None)
    fits = [re.compile(rf"(?:.*[./])?{axis}(?:\W.*)?$", re.I) for axis in "xyz"]
    found = [next((n for n in names if fit.match(n)), None) for fit in fits]
    if quantity is None or None in found:
        return None
    columns = [n for n in found if n is not None]
    values = np.stack([stream.table.column(n)[1] for n in columns], axis=-1)
    values = values[np.isfinite(values).all(axis=1)]
    if not len(values) or (quantity == "specific_force" and np.linalg.norm(values.mean(axis=0)) < 0.5):
        return None  # gravity was taken out
    units = _units(stream, quantity, values)
    units = tuple(told_unit(stream, n, _DIMENSIONS[quantity][0]) or u for n, u in zip(columns, units, strict=True))
    if stream.form == "csv" and quantity in _PHONE:
        own = dict(zip("xyz", columns, strict=True))
        axes = tuple(f"-{own[a[1:]]}" if a.startswith("-") else own[a] for a in _PHONE[quantity])
        return Guess(stream, quantity, axes, units)
    return Guess(stream, quantity, _signed(quantity, columns, values), units)


def told_unit(stream: Stream, name: str, what: str) -> str | None:
    """The unit that a row of units or the name of a column says, if it is one of what is measured."""
    unit = stream.units.get(name, "")
    if unit and dimension(unit) == what:
        return unit
    match = _UNIT.search(name.strip())
    if match is None:
        return None
    text = next(g for g in match.groups() if g is not None).strip()
    unit = spelt(text)
    return unit if dimension(unit) == what else None


def _first(names: Sequence[str], pattern: str) -> list[str]:
    """The first name that fits the first alternative that any name fits; empty for none."""
    for alternative in pattern.split("|^"):
        text = alternative if alternative.startswith("^") else f"^{alternative}"
        for whole in (True, False):  # of nested names also the last part
            shown = {n: n.strip().lstrip("#").strip() for n in names}
            if not whole:
                shown = {n: re.split(r"[./]", s)[-1] for n, s in shown.items()}
            found = [n for n, s in shown.items() if re.search(text, s, re.I)]
            if found:
                return found[:1]
    return []


def _signed(quantity: str, columns: Sequence[str], values: Array) -> tuple[str, ...]:
    """Signs of columns: gravity must point up, and axes forward, left, up become forward, starboard, down."""
    if quantity == "specific_force" and float(np.mean(values[:, 2])) > 0.0:
        return columns[0], f"-{columns[1]}", f"-{columns[2]}"
    if quantity in ("position", "velocity") and len(columns) == 2:
        return (*columns, "=0" if quantity == "position" else "=nan")
    return tuple(columns)


def _units(stream: Stream, quantity: str, values: Array) -> tuple[str, ...]:
    size, width = float(np.percentile(np.abs(values), 99.0)), int(values.shape[1])
    if stream.form == "nmea":
        return ("1",) * (3 if quantity in ("position", "velocity") else width)
    if quantity == "position":
        angle = "rad" if np.abs(values[:, 0]).max() < 1.58 and np.abs(values[:, 1]).max() < 3.15 else "deg"
        if np.median(np.abs(values[:, :2]).max(axis=1)) > _SCALED:
            angle = "1e-7 deg"
        return angle, angle, "mm" if angle == "1e-7 deg" and stream.form == "ulog" else "m"
    if quantity == "quaternion":
        return ("1",) * width
    if quantity == "angular_rate":
        return ("deg_s" if size > 4.0 else "rad_s",) * 3
    if quantity == "specific_force":
        norm = float(np.median(np.linalg.norm(values, axis=1)))
        spacing = float(np.median(np.diff(stream.time))) if len(stream.time) > 1 else 0.0
        named = _INCREMENTS.search(" ".join(stream.table.names)) is not None
        if 0.8 * _PULL * spacing < norm < 1.2 * _PULL * spacing and (named or not 0.8 < norm < 1.2):
            return ("m_s",) * 3  # increments of velocity
        return ("g" if norm < 2.0 else "m_s2" if norm < 50.0 else "mg",) * 3
    if quantity in ("heading", "level"):
        if stream.form in ("dataflash", "ulog"):
            return ("deg" if stream.form == "dataflash" else "rad",) * width
        return ("deg" if size > 6.3 else "rad",) * width
    return ("m" if quantity == "depth" else "m_s",) * (3 if quantity == "velocity" else width)
