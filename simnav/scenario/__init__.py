"""Scenarios: the declarative description of a run, read from TOML and validated.

A scenario says what happens (vessel, manoeuvres, sea, current), with what it is observed
(instruments) and what goes wrong (faults). It is either simulated, or recorded: then a ``[log]``
table says which files hold what. Everything random is drawn from a run's seed, nothing from here.

`load` finds one by name or path; `simnav.scenario.catalogue` knows where the packs are. The schema is
described in ``docs/reference/scenarios.md``.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simnav.scenario.catalogue import Header, headers
    from simnav.scenario.reading import load, names, parse
    from simnav.scenario.scenario import TRAINING_ROOT, Dial, InitialError, Scenario

__all__ = ["TRAINING_ROOT", "Dial", "Header", "InitialError", "Scenario", "headers", "load", "names", "parse"]

# A list of scenarios needs their heads alone: what describes and validates a run loads with its first use.
_HOMES = {
    "catalogue": ("Header", "headers"),
    "reading": ("load", "names", "parse"),
    "scenario": ("TRAINING_ROOT", "Dial", "InitialError", "Scenario"),
}


def __getattr__(name: str) -> object:
    for module, found in _HOMES.items():
        if name in found:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
