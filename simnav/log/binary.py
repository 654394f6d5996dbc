"""What kind of binary file a file is, or which code of text it has, by its first bytes."""

from __future__ import annotations

from pathlib import Path

from simnav.log.reader import READERS
from simnav.log.table import LogError

__all__ = ["refuse_binary", "signature", "utf16_of"]

#: First bytes of a file -> what it is, and the format that reads it (empty: none of simnav).
_SIGNATURES: tuple[tuple[bytes, str, str], ...] = (
    (b"MATLAB 5.0", "a MATLAB file", "mat"),
    (b"MATLAB 7.3", "a MATLAB file of version 7.3 (HDF5)", "hdf5"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file", "hdf5"),
    (b"PAR1", "a Parquet file", "parquet"),
    (b"#ROSBAG V2.0", "a ROS 1 bag", "rosbag"),
    (b"\x89MCAP0\r\n", "an MCAP file", "mcap"),
    (b"SQLite format 3\0", "an SQLite database, such as a ROS 2 bag", "rosbag"),
    (b"\x7f\x7f", "a Teledyne PD0 file", "pd0"),
    (b"\xb5\x62", "a u-blox UBX file", "ubx"),
    (b"ULog", "a PX4 ULog file", "ulog"),
    (b"\xa3\x95", "an ArduPilot log", "dataflash"),
    (b"\xa5\x05", "a Nortek file", ""),
    (b"\xa5\x0a", "a Nortek file", ""),
    (b"PK\x03\x04", "a zip archive or a spreadsheet; unpack it, or save the sheet as CSV", ""),
    (b"\x1f\x8b", "a gzip archive; unpack it", ""),
    (b"BZh", "a bzip2 archive; unpack it", ""),
    (b"\xfd7zXZ", "an xz archive; unpack it", ""),
    (b"%PDF", "a PDF document", ""),
)
_LOOKED_AT = 4096
#: Part of the characters of a table that are ASCII, at least.
_ASCII = 0.9
_TEXT_CONTROLS = frozenset(b"\t\n\r\f\x1a\x02\x03")


def signature(path: Path) -> tuple[str, str] | None:
    """What a binary file is, and the format that reads it (empty: unknown); None for text.

    Raises
    ------
    LogError
        If there is no such file.
    """
    try:
        with open(path, "rb") as file:
            head = file.read(_LOOKED_AT)
    except FileNotFoundError:
        raise LogError(f"{path}: there is no such file") from None
    except OSError as error:
        raise LogError(f"{path} cannot be read: {error.strerror}") from None
    for mark, what, form in _SIGNATURES:
        if head.startswith(mark):
            return what, form
    if utf16_of(head) is not None:
        return None
    controls = sum(byte < 32 and byte not in _TEXT_CONTROLS for byte in head)
    return ("a binary file", "") if controls > 0.02 * len(head) else None


def utf16_of(content: bytes) -> str | None:
    """The codec of a text in UTF-16: by its mark, or by the zero byte of nearly each character; None for another."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    head = content[:_LOOKED_AT]
    even, odd = head[0::2].count(0), head[1::2].count(0)
    if min(even, odd) > 0 or max(even, odd) < _ASCII * (len(head) // 2) or len(head) < 2:
        return None
    return "utf-16-le" if odd else "utf-16-be"


def refuse_binary(path: Path, form: str) -> None:
    """Raise a `LogError` for a binary file where text is wanted.

    Parameters
    ----------
    path : Path
        The file.
    form : str
        The format that it was declared to have.
    """
    found = signature(path)
    if found is None:
        return
    what, right = found
    if right and READERS.get(right) is not None:
        advice = f"; say format = {right!r}"
    elif what == "a binary file":
        advice = f"; the formats that are read: {', '.join(sorted(READERS.items()))}"
    else:
        advice = ""
    raise LogError(f"{path}: it is {what}, and no text as format = {form!r} wants{advice}")
