"""Hypotheses about positions: latitude and longitude exchanged or with another sign, and a height that is a depth."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.log.comparisons import Streams
from simnav.log.hypotheses import FLIPS, Reading, flip, with_series
from simnav.types import KINDS, Array

if TYPE_CHECKING:
    from simnav.log.spec import RecordedSpec

__all__ = ["ABOVE", "of_positions"]

#: Depths and heights up to this are about the surface of the sea [m].
ABOVE = 1.0


def of_positions(log: RecordedSpec, s: Streams) -> Iterator[Reading]:
    """Latitude and longitude exchanged or with another sign: of the reference, of each fix, and of all of one file."""
    fixes = [n for n, (kind, _, _) in s.instruments.items() if KINDS[kind].geodetic and log.instruments[n].columns]
    channels: dict[str, Any] = {n: log.instruments[n] for n in fixes}
    if log.reference.position.columns:
        channels["reference.position"] = log.reference.position
    groups: list[tuple[str, ...]] = [(n,) for n in channels]
    if len(channels) > 1:
        groups.append(tuple(channels))

    yield from _depth_as_height(log, s)

    def swapped(value: Array, swap: bool, north: float, east: float, local: Any) -> Array:
        new = value.copy()
        if local is None:
            new[:, :2] = value[:, 1::-1] if swap else value[:, :2]
            new[:, :2] *= north, east
            return new
        # Of a local frame the axes are exchanged about its origin.
        away = value[:, :2] - (local.latitude, local.longitude)
        across = np.cos(local.latitude)
        metres = away * (1.0, across)
        metres = (metres[:, ::-1] if swap else metres) * (north, east)
        new[:, :2] = metres / (1.0, across) + (local.latitude, local.longitude)
        return new

    for group in groups:
        for swap, north, east in itertools.product((False, True), FLIPS, FLIPS):
            if not swap and north > 0.0 and east > 0.0:
                continue
            ways: dict[str, Array] = {}
            changes: list[tuple[str, str, Any]] = []
            for name in group:
                channel = channels[name]
                local = None if channel.frame == "geodetic" else log.origin
                series = s.position if name == "reference.position" else s.instruments[name][1]
                ways[name] = swapped(series.value, swap, north, east, local)
                a, b = (1, 0) if channel.frame == "enu" else (0, 1)
                first, second = channel.columns[a], channel.columns[b]
                columns = list(channel.columns)
                columns[a], columns[b] = (second, first) if swap else (first, second)
                columns[a] = columns[a] if north > 0.0 else flip(columns[a])
                columns[b] = columns[b] if east > 0.0 else flip(columns[b])
                table = f"log.{name}" if name == "reference.position" else f"log.instruments.{name}"
                if channel.frame == "ned" and swap and north > 0.0 and east > 0.0:
                    ways[name][:, 2:] *= -1.0  # about the sea, near enough
                    changes.append((table, "frame", "enu"))
                else:
                    changes.append((table, "columns", columns))
            if any(np.abs(v[:, 0]).max() > 0.5 * np.pi for v in ways.values()):
                continue
            what = " and ".join(filter(None, [
                "latitude and longitude (north and east) are exchanged" if swap else "",
                "north has the other sign" if north < 0.0 else "",
                "east has the other sign" if east < 0.0 else ""]))  # fmt: skip
            yield Reading(
                group[0] if len(group) == 1 else "positions", group, _positions_as(ways),
                0.9 * swap + (north < 0.0) + (east < 0.0) + 0.4 * (len(group) > 1), f"{' and '.join(group)}: {what}",
                tuple(changes),
            )  # fmt: skip


def _depth_as_height(log: RecordedSpec, s: Streams) -> Iterator[Reading]:
    """The height of the reference counted downwards, where it is above the sea."""
    channel, value = log.reference.position, s.position.value
    if len(channel.columns) < 3 or str(channel.columns[2]).startswith("=") or np.nanmedian(value[:, 2]) < ABOVE:
        return
    name, columns = "reference.position", [*channel.columns[:2], flip(channel.columns[2])]
    yield Reading(name, (name,), with_series(name, value=value * (1.0, 1.0, -1.0)), 1.0,
                   "the height of the reference is counted downwards",
                   (("log.reference.position", "columns", columns),))  # fmt: skip


def _positions_as(ways: Mapping[str, Array]) -> Callable[[Streams], Streams]:
    def alter(t: Streams) -> Streams:
        for name, value in ways.items():
            t = with_series(name, value=value)(t)
        return t

    return alter
