"""Logs of ArduPilot (DataFlash, ``.bin``): the messages of one name as a table, ``sentence = "GPS"``.

``sentence`` of a channel, or ``options = { topic = "IMU" }`` of the file, names the messages; of the second and further
instruments of a kind the number stands behind, as in ``IMU[1]``. Columns are those of the log (``GyrX``, ``Lat``), in
its units: degrees of latitude and longitude, of roll, pitch and yaw; rad/s and m/s^2 of the IMU. Times are seconds
since the autopilot started. The log describes its messages itself (``FMT``); ArduPilot,
``libraries/AP_Logger/LogStructure.h`` has the letters of the types.
"""

from __future__ import annotations

import struct
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.formats.packed import Field, messages_of, rows_of_message, topic_of
from simnav.log.kept import kept
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table
from simnav.watchers import tell

__all__ = ["read_dataflash"]

_HEAD = b"\xa3\x95"
#: The message that describes the others: its number and its length.
_FORMAT, _LENGTH = 128, 89
_TOLD = 100_000
#: Letter of a type -> type of NumPy and factor; and of those that are no numbers their length.
_TYPES = {
    "b": ("<i1", 1.0), "B": ("<u1", 1.0), "M": ("<u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0), "i": ("<i4", 1.0),
    "I": ("<u4", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "g": ("<f2", 1.0),
    "c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01), "E": ("<u4", 0.01), "L": ("<i4", 1e-7),
}  # fmt: skip
_NO_NUMBERS = {"n": 4, "N": 16, "Z": 64, "a": 64}
#: Columns that number the instruments of a kind, where they are of one byte.
_INSTANCE = ("I", "C", "Instance")


@dataclass(frozen=True)
class _Format:
    """How the messages of a number are laid out, with the head of three bytes."""

    name: str
    length: int
    fields: tuple[Field, ...]

    @property
    def instance(self) -> int | None:
        """Where the number of the instrument stands; None for messages without one."""
        return next((f.offset for f in self.fields if f.name in _INSTANCE and f.kind == "<u1"), None)


@register_reader("dataflash", title="an ArduPilot log")
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    tables = read_dataflash(path)
    return rows_of_message(path, tables, file, sentence, "TimeUS", 1e-6)


@kept(4)
def read_dataflash(path: Path) -> dict[str, Table]:
    """All messages with a time, by their names.

    Raises
    ------
    LogError
        If the file is absent, or has no such message.
    """
    content = path.read_bytes()
    formats: dict[int, _Format] = {}
    found: dict[str, tuple[_Format, list[int]]] = {}
    at = count = lost = first_lost = 0
    while at + 3 <= len(content):
        number = content[at + 2]
        known = formats.get(number) if content.startswith(_HEAD, at) else None
        if number == _FORMAT and content.startswith(_HEAD, at) and at + _LENGTH <= len(content):
            described = _described(content[at + 3 : at + _LENGTH])
            if described is not None:
                formats[described[0]] = described[1]
                at += _LENGTH
                continue
        if known is None or at + known.length > len(content):
            following = content.find(_HEAD, at + 1)
            lost += 1
            first_lost = first_lost or at
            if following < 0:
                break
            at = following
            continue
        instance = 0 if known.instance is None else content[at + known.instance]
        found.setdefault(topic_of(known.name, instance), (known, []))[1].append(at)
        at += known.length
        count += 1
        if count % _TOLD == 0:
            tell(path, at, len(content))
    timed = {n: (form, where) for n, (form, where) in found.items() if any(f.name == "TimeUS" for f in form.fields)}
    if not timed:
        raise LogError(f"{path}: there is no whole message with a time (TimeUS) of an ArduPilot log in it")
    if lost:
        warnings.warn(
            f"{path}: {lost} stretches of bytes are no messages of the log and are left out, the first is at offset "
            f"{first_lost}",
            LogWarning,
            5,
        )
    return {n: messages_of(f"{path} ({n})", content, where, form.fields) for n, (form, where) in timed.items()}


def _described(content: bytes) -> tuple[int, _Format] | None:
    """Number and layout of messages, of a message ``FMT``; None where it is damaged."""
    number, length, *texts = struct.unpack("<BB4s16s64s", content)
    name, letters, columns = (t.split(b"\0")[0].decode("latin-1") for t in texts)
    names = columns.split(",")
    if not name.isalnum() or len(names) != len(letters) or len(set(names)) != len(names) or length < 3:
        return None
    fields, offset = [], 3
    for column, letter in zip(names, letters, strict=True):
        if letter in _TYPES:
            kind, factor = _TYPES[letter]
            fields.append(Field(column, kind, offset, factor))
            offset += np.dtype(kind).itemsize
        elif letter in _NO_NUMBERS:
            offset += _NO_NUMBERS[letter]
        else:
            return None
    return (number, _Format(name, length, tuple(fields))) if offset == length else None
