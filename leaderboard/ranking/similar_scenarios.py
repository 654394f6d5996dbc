"""Which scenarios say something about a vessel with certain instruments.

A scenario speaks for the instruments of a vessel if it

- always has no other ones (those that only some of its runs have do not count, unless they are a fix or a velocity);
- has an IMU if, and only if, the vessel has one;
- has a fix, and a velocity, if and only if the vessel has one. A range counts as a fix.

A compass or a depth sensor more or less is accepted: rows of all kinds do without them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from simnav.kinds import KINDS

if TYPE_CHECKING:
    from simnav.scenario.catalogue import Header

__all__ = ["IMU", "Carried", "carried", "speaks_for"]

IMU = "imu"


@dataclass(frozen=True)
class Carried:
    """Kinds of instruments that a scenario has in all of its runs, and those that it has in some of them."""

    always: frozenset[str]
    sometimes: frozenset[str]


def carried(header: Header) -> Carried:
    """The kinds of instruments of a scenario of the catalogue.

    Only the table of its file is read, because to validate all scenarios takes seconds.
    """
    table = tomllib.loads(header.path.read_text(encoding="utf-8")).get("instruments", {})
    kinds = {name: str(spec.get("kind", name)) for name, spec in table.items()}
    drawn = {name for name, spec in table.items() if spec.get("present", True) is not True}
    always = frozenset(kind for name, kind in kinds.items() if name not in drawn)
    return Carried(always, frozenset(kinds.values()) - always)


def speaks_for(scenario: Carried, mine: Iterable[str]) -> bool:
    """Whether a scenario says something about a vessel with some kinds of instruments.

    Examples
    --------
    >>> ship = Carried(frozenset({"imu", "gnss_position", "dvl"}), frozenset({"gyrocompass"}))
    >>> speaks_for(ship, ["imu", "gnss_position", "dvl", "depth"]), speaks_for(ship, ["imu", "gnss_position"])
    (True, False)
    """
    own = frozenset(mine)
    if not scenario.always <= own or (IMU in own) != (IMU in scenario.always):
        return False
    return _aids(scenario.always | scenario.sometimes) == _aids(own)


def _aids(kinds: Iterable[str]) -> set[str]:
    """Whether there is a fix, and a velocity."""
    roles: set[str] = {KINDS[kind].role for kind in kinds if kind in KINDS}
    return {"fix" if role == "range" else role for role in roles} & {"fix", "velocity"}
