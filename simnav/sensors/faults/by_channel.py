"""The stream of an instrument with channels as a stream for each channel, for faults, and back.

A fault acts on each channel as on an instrument of its own: so it draws from random streams of the channel, and
continues from the channel's own last value.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.recording import AidStream

__all__ = ["each_channel"]

_ROWS = ("time", "value", "faults", "fault_error", "sigma", "channel", "side")
_LOST = ("dropped", "dropped_channel")


def each_channel(stream: AidStream, channels: tuple[str, ...], apply: Callable[[AidStream], AidStream]) -> AidStream:
    """A stream after a change of the streams of some of its channels.

    Parameters
    ----------
    stream : AidStream
        Readings of an instrument with channels.
    channels : tuple of str
        The channels to be changed; empty: all.
    apply : callable
        It takes the readings of one channel, as those of an instrument without channels whose name is
        ``INSTRUMENT:CHANNEL``, and returns them changed. It may leave out readings.

    Returns
    -------
    AidStream
        The argument itself if nothing has changed.
    """
    rest, lost = np.ones(len(stream), np.bool_), np.ones(len(stream.dropped), np.bool_)
    changed = []
    for c, channel in enumerate(stream.channels):
        if channels and channel not in channels:
            continue
        own, own_lost = stream.channel == c, stream.dropped_channel == c
        part = _part(stream, f"{stream.name}:{channel}", own, own_lost)
        result = apply(part)
        if result is part:
            continue
        rest &= ~own
        lost &= ~own_lost
        # A fault may leave out readings, and need not know of their side information, which it also may change.
        rows = slice(None) if len(result) == len(part) else np.searchsorted(part.time, result.time)
        own_side = result.side.shape == (len(result), part.side.shape[1])
        side = result.side if own_side else part.side[rows]
        changed.append(
            replace(
                result,
                channel=np.full(len(result), c, np.int16),
                side=side,
                dropped_channel=np.full(len(result.dropped), c, np.int16),
            )
        )
    if not changed:
        return stream
    parts = [_part(stream, stream.name, rest, lost), *changed]
    columns: dict[str, Any] = {n: np.concatenate([getattr(p, n) for p in parts]) for n in (*_ROWS, *_LOST)}
    order = np.lexsort((columns["channel"], columns["time"]))
    order_of_lost = np.lexsort((columns["dropped_channel"], columns["dropped"]))
    columns = {name: a[order if name in _ROWS else order_of_lost] for name, a in columns.items()}
    if len(stream.arrival):
        columns["arrival"] = stream.arrival[stream.places(columns["time"], columns["channel"])]
    return replace(stream, **columns)


def _part(stream: AidStream, name: str, rows: NDArray[np.bool_], lost: NDArray[np.bool_]) -> AidStream:
    """Some readings of a stream, as a stream of this name without channels."""
    columns: dict[str, Any] = {n: getattr(stream, n)[rows] for n in _ROWS}
    columns |= {n: getattr(stream, n)[lost] for n in _LOST}
    return replace(stream, name=name, channels=(), arrival=np.empty(0), **columns)
