"""The error of an instrument that cannot be built or read, and the beginnings of its messages."""

from __future__ import annotations

from pathlib import Path

from simnav.plugins import exception_of, place_of
from simnav.spec import SpecError

__all__ = ["InstrumentError", "label_of", "raised"]


class InstrumentError(SpecError):
    """An instrument cannot be built or read. The message names it, its file, and what would be right."""


def label_of(name: str, kind: str, cls: type) -> str:
    """An instrument and its file, for a message."""
    file = Path(place_of(cls)[0]).name
    return f"instrument {name!r} of kind {kind!r} ({cls.__qualname__} in {file})"


def raised(label: str, cls: type, error: Exception) -> InstrumentError:
    """The error for an exception in the code of an instrument."""
    return InstrumentError(f"{label}: {exception_of(cls, error)}")
