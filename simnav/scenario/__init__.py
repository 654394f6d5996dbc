"""Scenarios: the declarative description of a run, read from TOML and validated.

A scenario describes the motion (vessel, manoeuvres, sea, current), the instruments and their faults. It is either
simulated, or recorded: then a ``[log]`` table describes the files. All random numbers are drawn from the seed of a run.

`load` finds a scenario by name or path; `simnav.scenario.catalogue` finds the scenario packages. The schema is
described in ``docs/reference/scenarios.md``.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simnav.scenario.catalogue import Header, headers
    from simnav.scenario.description import TRAINING_ROOT, Dial, InitialError
    from simnav.scenario.reading import load, names, parse
    from simnav.scenario.scenario import Scenario

__all__ = ["TRAINING_ROOT", "Dial", "Header", "InitialError", "Scenario", "headers", "load", "names", "parse"]

# A list of scenarios needs the heads of the files only. The description of a run is loaded when it is first used.
_HOMES = {
    "catalogue": ("Header", "headers"),
    "reading": ("load", "names", "parse"),
    "description": ("TRAINING_ROOT", "Dial", "InitialError"),
    "scenario": ("Scenario",),
}


def __getattr__(name: str) -> object:
    for module, found in _HOMES.items():
        if name in found:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
