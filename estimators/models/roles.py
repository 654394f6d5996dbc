"""The division of instruments into fixes and logs."""

from __future__ import annotations

from simnav.types import Instruments

from .equations import equation_of

__all__ = ["fixes_and_logs"]


def fixes_and_logs(instruments: Instruments) -> dict[str, bool]:
    """For each instrument: True for fixes and the velocity of a receiver, False for logs."""
    fix = {name: sheet.role == "fix" or equation_of(sheet).is_fix for name, sheet in instruments.items()}
    return {name: fix[name] for name, sheet in instruments.items() if fix[name] or equation_of(sheet).is_log}
