"""Writers of the logs of ArduPilot and PX4, other code than that which reads them."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import Any

__all__ = ["dataflash", "ulog"]


def dataflash(formats: Mapping[int, tuple[str, str, str]], messages: Iterable[tuple[int, tuple[Any, ...]]]) -> bytes:
    """A log of ArduPilot.

    Parameters
    ----------
    formats : mapping of int to (str, str, str)
        By number: name, letters of the types, and columns.
    messages : iterable of (int, tuple)
        Number and values as they are stored.
    """
    codes = {"b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "q": "q", "Q": "Q", "f": "f", "d": "d",
             "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B"}  # fmt: skip
    packed = {number: "<" + "".join(codes[c] for c in letters) for number, (_, letters, _) in formats.items()}
    formats = {128: ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns"), **formats}
    packed[128] = "<BB4s16s64s"
    out = b""
    for number, (name, letters, columns) in formats.items():
        told = struct.pack(packed[128], number, 3 + struct.calcsize(packed[number]), name.encode(), letters.encode(),
                           columns.encode())  # fmt: skip
        out += b"\xa3\x95\x80" + told
    for number, values in messages:
        out += b"\xa3\x95" + bytes([number]) + struct.pack(packed[number], *values)
    return out


def ulog(topics: Mapping[str, str], messages: Iterable[tuple[str, tuple[Any, ...]]]) -> bytes:
    """A log of PX4.

    Parameters
    ----------
    topics : mapping of str to str
        Fields of each topic, as the format writes them.
    messages : iterable of (str, tuple)
        Topic and values, in the order of the fields.
    """
    codes = {"uint64_t": "Q", "int32_t": "i", "uint32_t": "I", "float": "f", "double": "d", "uint8_t": "B",
             "bool": "?"}  # fmt: skip
    packed = {}
    for name, fields in topics.items():
        parts = [f.split() for f in fields.split(";") if f]
        packed[name] = "<" + "".join((k.partition("[")[2][:-1] or "1") + codes[k.partition("[")[0]] for k, _ in parts)

    def message(kind: str, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), ord(kind)) + content

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
    for name, fields in topics.items():
        out += message("F", f"{name}:{fields}".encode())
    for number, name in enumerate(topics):
        out += message("A", struct.pack("<BH", 0, number) + name.encode())
    numbers = {name: number for number, name in enumerate(topics)}
    for name, values in messages:
        out += message("D", struct.pack("<H", numbers[name]) + struct.pack(packed[name], *values))
    return out
