"""A file of what was measured of rows beside a plain row: where it was measured, and a line of JSON for each row."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Protocol, TypeVar

from simnav.leaderboard.results.errors import RequestError, sentence
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.provenance import Provenance, here

__all__ = ["FORMAT", "checked_names", "read_measured", "save_measured", "short_number"]

FORMAT = 1
_DIGITS = 4


class _Pair(Protocol):
    """What is measured of one estimator beside one plain row."""

    @property
    def estimator(self) -> str: ...

    @property
    def plain(self) -> str: ...


R = TypeVar("R", bound=_Pair)


def short_number(value: float) -> float:
    """A number with as many digits as such a file keeps.

    >>> short_number(1.234567)
    1.235
    """
    return float(f"{value:.{_DIGITS}g}")


def save_measured(rows: Iterable[Mapping[str, Any]], path: Path, measured: Provenance | None = None) -> Path:
    """Write a file; an older one is replaced.

    Parameters
    ----------
    rows : iterable of mapping
        The fields of each row, as JSON holds them.
    path : Path
        The file.
    measured : Provenance, optional
        Machine, versions and day of the measurement; default: those of now.

    Raises
    ------
    OSError
        If writing fails.
    """
    lines = ["  " + json.dumps(row, allow_nan=False) for row in rows]
    known = {k: v for k, v in (measured or here()).to_dict().items() if v not in ("", None) and k != "id"}
    head = json.dumps({"format": FORMAT, "measured": known}, indent=1)
    return write_whole(path, head[: head.rindex("}")].rstrip() + ',\n "rows": [\n' + ",\n".join(lines) + "\n ]\n}\n")


def read_measured(
    path: Path, row: Callable[[str, Any], R], *, what: str, rows: str, wanted: str
) -> tuple[Provenance, tuple[R, ...]]:
    """Read a file.

    Parameters
    ----------
    path : Path
        The file.
    row : callable
        Makes a row from its place, for messages, and its entry; ValueError with the field that is wrong.
    what, rows : str
        What the file is, and what its rows are, for messages.
    wanted : str
        How such a file is written, for messages.

    Raises
    ------
    RequestError
        If the file is missing or is none of this kind: one sentence with the file, the field and the value.
    """
    try:
        content = json.loads(path.read_bytes())
        if not isinstance(content, Mapping) or content.get("format") != FORMAT:
            found = content.get("format") if isinstance(content, Mapping) else content
            raise ValueError(f"format is {found!r}, and this version reads {FORMAT}")
        if not isinstance(content.get("rows"), list) or not isinstance(content.get("measured"), Mapping):
            raise ValueError("'rows' should be a list, and 'measured' an object with machine, versions and day")
        known = {f.name for f in fields(Provenance)}
        measured = Provenance(**{k: v for k, v in content["measured"].items() if k in known})
        made = tuple(row(f"rows[{k}]", entry) for k, entry in enumerate(content["rows"]))
        pairs = set[tuple[str, str]]()
        for k, one in enumerate(made):
            if (one.estimator, one.plain) in pairs:
                raise ValueError(f"rows[{k}]: there are two {rows} of {one.estimator} beside {one.plain}")
            pairs.add((one.estimator, one.plain))
        return measured, made
    except (OSError, ValueError, TypeError) as error:
        raise RequestError(f"{path} is no {what}: {sentence(error)}; {wanted}") from error


def checked_names(where: str, entry: Any) -> Mapping[str, Any]:
    """The entry of a row, if it is an object that names the estimator, the plain row and the scenario."""
    if not isinstance(entry, Mapping):
        raise ValueError(f"{where} is {entry!r}, and should be an object")
    for name in ("estimator", "plain", "scenario"):
        if not isinstance(entry.get(name), str) or not entry[name]:
            raise ValueError(f"{where}.{name} is {entry.get(name)!r}, and should be a text")
    return entry
