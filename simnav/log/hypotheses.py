"""A hypothesis about a stream of a log: read so, what it alters, and what to write (`simnav.log.readings`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.log.comparisons import Streams
from simnav.types import Array

if TYPE_CHECKING:
    from simnav.log.spec import RecordedSpec

__all__ = ["FLIPS", "Reading", "flip", "shown", "with_series", "written"]

#: Signs that an axis may have.
FLIPS = (1.0, -1.0)


@dataclass(frozen=True, eq=False)
class Reading:
    """A hypothesis: the streams read so, the streams that it alters, how many changes it is, and what to write.

    With nothing to write, the stream is no such instrument. Comparisons with the stream ``apart`` say nothing of it.
    The reading multiplies the values of the stream by ``times``; ``usual`` are axes in which many instruments speak.
    """

    stream: str
    parts: tuple[str, ...]
    alter: Callable[[Streams], Streams]
    number: float
    what: str
    changes: tuple[tuple[str, str, Any], ...]
    delay: float = 0.0
    apart: str = ""
    times: float = 1.0
    usual: bool = False
    mistakes: int = 1

    def late(self, other: Reading) -> Reading:
        """This reading, and also the delay of another one of the same stream."""
        return replace(
            other,
            alter=lambda s: other.alter(self.alter(s)),
            number=self.number + other.number,
            what=f"{self.what}, and {other.what}",
            changes=(*self.changes, *other.changes),
            times=self.times,
            mistakes=self.mistakes + other.mistakes,
        )


def flip(column: int | str) -> int | str:
    if isinstance(column, int):
        return -column
    if column.startswith("="):
        return f"={-float(column[1:]):g}" if column != "=nan" else column
    return column[1:] if column.startswith("-") else f"-{column}"


def shown(columns: list[int | str]) -> str:
    return ", ".join(map(str, columns))


def with_series(name: str, **changes: Array) -> Callable[[Streams], Streams]:
    """The streams with another series of an instrument, or of a part of the reference."""

    def alter(t: Streams) -> Streams:
        part = name.removeprefix("reference.")
        return t.with_instrument(name, **changes) if part == name else t.with_reference(part, **changes)

    return alter


def written(log: RecordedSpec, changes: tuple[tuple[str, str, Any], ...]) -> RecordedSpec:
    """The ``[log]`` with some keys written anew."""
    for table, key, value in changes:
        name, scale = key, 1.0
        if key.endswith("_deg"):
            name, scale = key.removesuffix("_deg"), np.pi / 180.0
        elif key.endswith("_s"):
            name = key.removesuffix("_s")
        new = tuple(v * scale if scale != 1.0 else v for v in value) if isinstance(value, list) else value
        log = _set(log, [*table.split(".")[1:], name], new)
    return log


def _set(spec: Any, path: list[str], value: Any) -> Any:
    if not path:
        return value
    if isinstance(spec, Mapping):
        return {**spec, path[0]: _set(spec[path[0]], path[1:], value)}
    return spec.model_copy(update={path[0]: _set(getattr(spec, path[0]), path[1:], value)})
