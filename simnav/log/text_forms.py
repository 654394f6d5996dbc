"""Which format a text file probably has, by its first lines."""

from __future__ import annotations

import re
from pathlib import Path

__all__ = ["form_of_text"]

_LINES = 40
#: What most lines of a format look like.
_LINES_OF = {
    "nmea": re.compile(r".*[$!][A-Z]{4,6},"),
    "n2k": re.compile(r"\d{4}-\d\d-\d\d[T-][\d:.]+Z?,\d+,\d{5,6},\d+,\d+,\d+,[0-9a-f]{2}", re.I),
    "pd6": re.compile(r"\s*:(SA|TS|W[ISED]|B[ISED]),"),
}


def form_of_text(path: Path) -> str | None:
    """The format of a text file that says of itself what it is; None for other ones, such as tables."""
    with open(path, encoding="latin-1") as text:
        head = [line for _, line in zip(range(_LINES), text, strict=False)]
    if any(re.match(r"%\s+(GPST|UTC|JST)\s", line) for line in head):
        return "rtklib"
    if head and head[0][60:].startswith("RINEX VERSION / TYPE") and head[0][20:21] == "O":
        return "rinex"
    for form, pattern in _LINES_OF.items():
        if sum(bool(pattern.match(line)) for line in head) > 0.3 * len(head):
            return form
    return None
