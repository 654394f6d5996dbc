"""Logs of PX4 (ULog, ``.ulg``): the messages of one topic as a table, ``sentence = "sensor_gps"``.

``sentence`` of a channel, or ``options = { topic = "sensor_combined" }`` of the file, names the topic; of the second
and further instruments of a kind the number stands behind, as in ``sensor_gps[1]``. Columns are the numbers of a
message by their names, of arrays as ``gyro_rad_1``, of messages in messages as ``outer.inner``. Times are seconds since
the autopilot started. The log describes its messages itself (PX4, "ULog File Format").
"""

from __future__ import annotations

import re
import struct
import warnings
from pathlib import Path

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.formats.packed import Field, messages_of, rows_of_message, topic_of
from simnav.log.kept import kept
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table
from simnav.watchers import tell

__all__ = ["read_ulog"]

_MAGIC = b"ULog\x01\x12\x35"
_TOLD = 100_000
_TYPES = {
    "int8_t": "<i1", "uint8_t": "<u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4",
    "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "<u1", "char": "<u1",
}  # fmt: skip
#: Messages in messages go no deeper; longer arrays are left out.
_DEEPEST, _LONGEST = 4, 64


@register_reader("ulog", title="a PX4 log")
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    return rows_of_message(path, read_ulog(path), file, sentence, "timestamp", 1e-6)


@kept(4)
def read_ulog(path: Path) -> dict[str, Table]:
    """All topics of the log, by their names.

    Raises
    ------
    LogError
        If the file is absent, is no log of PX4, or has no messages of a topic.
    """
    content = path.read_bytes()
    if not content.startswith(_MAGIC):
        raise LogError(f"{path}: it does not begin like a PX4 log (ULog)")
    layouts: dict[str, str] = {}
    names: dict[int, tuple[str, str]] = {}
    found: dict[int, list[int]] = {}
    at, count = 16, 0
    while at + 3 <= len(content):
        size, kind = struct.unpack_from("<HB", content, at)
        begin, at = at + 3, at + 3 + size
        if at > len(content):
            warnings.warn(f"{path}: the last message, at offset {begin - 3}, is cut off and left out", LogWarning, 5)
            break
        if kind == ord("F"):
            name, _, layout = content[begin:at].decode("latin-1").partition(":")
            layouts[name] = layout
        elif kind == ord("A") and size > 3:
            instance, number = struct.unpack_from("<BH", content, begin)
            name = content[begin + 3 : at].decode("latin-1")
            names[number] = name, topic_of(name, instance)
        elif kind == ord("D") and size >= 2:
            found.setdefault(struct.unpack_from("<H", content, begin)[0], []).append(begin)
        count += 1
        if count % _TOLD == 0:
            tell(path, at, len(content))
    tables: dict[str, Table] = {}
    for number, begins in found.items():
        if number not in names or names[number][0] not in layouts:
            continue
        name, topic = names[number]
        fields, length = _fields(layouts, name, "", 2, 0)
        # A log leaves out the padding at the end of a message.
        last = max((f.offset + np.dtype(f.kind).itemsize for f in fields), default=length)
        whole = [b for b in begins if struct.unpack_from("<H", content, b - 3)[0] >= last]
        if any(f.name == "timestamp" for f in fields) and whole:
            tables[topic] = messages_of(f"{path} ({topic})", content, whole, fields)
    if not tables:
        raise LogError(f"{path}: there is no whole message of a topic in this PX4 log")
    return tables


def _fields(layouts: dict[str, str], name: str, before: str, offset: int, depth: int) -> tuple[list[Field], int]:
    """The numbers of a message and where it ends; those behind a field of an unknown type are left out."""
    fields: list[Field] = []
    for declared in layouts[name].split(";"):
        match = re.fullmatch(r"\s*(\w+)(?:\[(\d+)\])?\s+(\w+)\s*", declared)
        if match is None:
            continue
        kind, many, label = match[1], int(match[2] or 1), match[3]
        for i in range(many):
            own = before + label + (f"_{i + 1}" if match[2] else "")
            if kind in layouts and depth < _DEEPEST and many <= _LONGEST:
                inner, offset = _fields(layouts, kind, f"{own}.", offset, depth + 1)
                fields += inner
            elif kind in _TYPES:
                if not label.startswith("_padding") and kind != "char" and many <= _LONGEST:
                    fields.append(Field(own, _TYPES[kind], offset))
                offset += np.dtype(_TYPES[kind]).itemsize
            else:
                return fields, offset
    return fields, offset
