"""The groups of instruments that a network tells apart: those of each role that it knows, and all others."""

from __future__ import annotations

from simnav.types import KINDS

__all__ = ["GROUPS", "group_of"]

_ROLES = ("fix", "velocity", "heading")
#: Number of groups; the last one is that of the other roles.
GROUPS = len(_ROLES) + 1


def group_of(kind: str) -> int:
    """The group of a kind of instrument, from 0 to ``GROUPS - 1``."""
    role = KINDS[kind].role
    return _ROLES.index(role) if role in _ROLES else GROUPS - 1
