"""Real logs: files of a vessel, mapped by a scenario's ``[log]`` table to instruments and a reference."""

from __future__ import annotations

from simnav.log.spec import RecordedSpec
from simnav.log.table import LogError, LogWarning

__all__ = ["LogError", "LogSource", "LogWarning", "RecordedSpec", "list_recordings"]


def __getattr__(name: str) -> object:
    # Late: these need more than reading a scenario does.
    if name == "LogSource":
        from simnav.log.source import LogSource

        return LogSource
    if name == "list_recordings":
        from simnav.log.channel import list_recordings

        return list_recordings
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
