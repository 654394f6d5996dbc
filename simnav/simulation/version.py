"""The version of the simulator: of all code that decides a recording, for a given scenario and seed.

It is raised whenever a change of code alters a number of a recording; `tests.golden` says when. What comes with simnav
is addressed by it.

Versions
--------
1
    The first one that is declared.
"""

from __future__ import annotations

__all__ = ["SIMULATOR_VERSION"]

#: Version of the simulator, of the instruments and faults, and of what reads logs.
SIMULATOR_VERSION = 1
