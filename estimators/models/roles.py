"""The division of instruments into fixes and logs."""

from __future__ import annotations

from simnav.types import Instruments

from .equations import equation_of

__all__ = ["fixes_and_logs", "witnesses"]


def fixes_and_logs(instruments: Instruments) -> dict[str, bool]:
    """For each instrument: True for fixes and the velocity of a receiver, False for logs."""
    fix = {name: sheet.role == "fix" or equation_of(sheet).is_fix for name, sheet in instruments.items()}
    return {name: fix[name] for name, sheet in instruments.items() if fix[name] or equation_of(sheet).is_log}


def witnesses(instruments: Instruments) -> dict[str, tuple[str, ...]]:
    """For each fix, log and depth sensor the others that notice it if the prediction of its readings is wrong.

    A log notices the error of a position, because it grows by a wrong velocity, and fixes notice that of a log. The
    vertical error of a depth sensor is noticed by fixes with a height and by logs with a vertical component. A compass
    is left out: gyroscopes hold the heading longer than accelerometers hold velocity or height, so that a lasting
    disagreement is more often the error of the compass.
    """
    group = fixes_and_logs(instruments)
    vertical = [n for n in group if (e := equation_of(instruments[n])).has_height or e.in_body or e.is_fix]
    found = {name: tuple(n for n in group if group[n] != fix) for name, fix in group.items()}
    others = [n for n, s in instruments.items() if n not in group and s.role == "depth"]
    return found | dict.fromkeys(others, tuple(vertical))
