"""MCAP files without an index, as a recorder leaves them that was switched off: their messages one after the other."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from simnav.log.table import LogError, LogWarning

__all__ = ["messages_in_order", "summary_of"]


def summary_of(path: Path) -> Any:
    """The summary at the end of an MCAP file; None where there is none, or no channel in it."""
    from mcap.reader import make_reader

    with open(path, "rb") as stream:
        try:
            summary = make_reader(stream).get_summary()
        except Exception:  # whatever the library meets where the summary should be
            return None
    return summary if summary is not None and summary.channels else None


def messages_in_order(path: Path) -> Iterator[tuple[Any, Any, Any]]:
    """Schema (None without one), channel and message of each message that is whole, in the order of the file.

    The end of such a file is told in a warning.

    Raises
    ------
    LogError
        If there is no message in it.
    """
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import StreamReader

    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    read, why = 0, ""
    with open(path, "rb") as stream:
        records = StreamReader(stream, record_size_limit=path.stat().st_size).records
        while True:
            try:
                record = next(records, None)
            except Exception as error:  # the library raises what it meets in a record that is cut off
                why = " ".join(str(error).split())[:100] or type(error).__name__
                break
            if record is None:
                break
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message) and record.channel_id in channels:
                read += 1
                channel = channels[record.channel_id]
                yield schemas.get(channel.schema_id), channel, record
    if not read:
        raise LogError(f"{path}: it is no MCAP file, or damaged before its first message ({why or 'it has none'})")
    end = f"it is cut off or damaged after message {read} ({why})" if why else f"all of its {read} messages are read"
    warnings.warn(f"{path}: the file has no index, since its recorder did not end well; {end}", LogWarning, 2)
