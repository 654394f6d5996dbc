"""The division of instruments into fixes and logs."""

from __future__ import annotations

from simnav.kinds import BODY_VELOCITY, VELOCITY, WATER_SPEED
from simnav.types import Instruments

__all__ = ["fixes_and_logs"]

#: Velocities that a satellite receiver gives beside its position, and those that a log measures.
_OF_RECEIVERS, _OF_LOGS = (VELOCITY,), (BODY_VELOCITY, WATER_SPEED)


def fixes_and_logs(instruments: Instruments) -> dict[str, bool]:
    """For each instrument: True for fixes and the velocity of a receiver, False for logs."""
    fix = {name: sheet.role == "fix" or sheet.equation in _OF_RECEIVERS for name, sheet in instruments.items()}
    return {name: fix[name] for name, sheet in instruments.items() if fix[name] or sheet.equation in _OF_LOGS}
