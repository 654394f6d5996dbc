"""Kinds of trouble: what goes wrong in a scenario. The file ``troubles.toml`` says it for each scenario that is ranked.

========================  ==============================================================================================
``nothing``               All instruments are as their datasheets say, and none is away.
``noisy-fixes``           Fixes are noisier than their datasheet for a while, are gross errors, or jump and jump back.
``lying-fixes``           Fixes are wrong in the same way for a minute or more: multipath, a bias that lasts, spoofing.
``outage``                An instrument is away; what comes before and after it may be bad, too.
``velocity``              A log or a DVL is wrong.
``heading``               The start is worse than it is said to be, or a compass is wrong.
``datasheet``             An instrument is better or worse than its datasheet throughout.
``imu``                   The IMU is disturbed, or worse than its datasheet.
``several``               At least two instruments have troubles of different kinds.
========================  ==============================================================================================

An outage beside another trouble does not make it several: it only lets an error of dead reckoning show.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

__all__ = ["FILE", "Trouble", "trouble_of", "troubles", "within"]

FILE = Path(__file__).with_name("troubles.toml")


@dataclass(frozen=True)
class Trouble:
    """A kind of trouble.

    Attributes
    ----------
    name, title : str
        Name in commands and documents, and title in tables.
    scenarios : frozenset of str
        Names of its scenarios, without their versions.
    """

    name: str
    title: str
    scenarios: frozenset[str]


@cache
def troubles() -> Mapping[str, Trouble]:
    """All kinds of trouble by name, in the order in which they are shown."""
    content = tomllib.loads(FILE.read_text(encoding="utf-8"))
    return {name: Trouble(name, entry["title"], frozenset(entry["scenarios"])) for name, entry in content.items()}


def trouble_of(scenario: str) -> str:
    """The kind of trouble of a scenario; empty for one that is not in the file, such as one of your own.

    Parameters
    ----------
    scenario : str
        Versioned id, or name.

    Examples
    --------
    >>> trouble_of("gnss-spoofing-v1"), trouble_of("gnss-outage"), trouble_of("my-fjord-v2")
    ('lying-fixes', 'outage', '')
    """
    name, _, version = scenario.rpartition("-v")
    name = name if name and version.isdigit() else scenario
    return next((t.name for t in troubles().values() if name in t.scenarios), "")


def within(title: str) -> str:
    """A title as it stands within a sentence.

    >>> within("The IMU wrong")
    'the IMU wrong'
    """
    return title[:1].lower() + title[1:]
