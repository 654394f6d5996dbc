"""Which kernels an estimator may call: those of the modules that its own modules refer to, directly or indirectly.

To load all kernels takes a second; most estimators call less than half of them. What is missed here is loaded by the
estimator's own process, when it is called.
"""

from __future__ import annotations

import sys
import types
from collections.abc import Iterable
from typing import Any

from simnav.compiled import Kernel, kernels

__all__ = ["ALL", "reachable_kernels"]

#: Stands for all kernels: of an estimator whose modules are not known.
ALL = "simnav"
#: How readings are predicted: estimators call it through the kind of an instrument, and name no module.
_EQUATIONS = ("simnav.sensors.gnss_observation", "simnav.sensors.observation", "simnav.world.depth_grid")
#: A window finds the chain of its model in a registry, and names none.
_CHAINS = ("simnav.estimators.solvers.window", "simnav.estimators.models.chains")


def reachable_kernels(modules: Iterable[str]) -> list[Kernel[..., Any]]:
    """The kernels of modules of simnav, of what these refer to, and of the equations of instruments.

    Parameters
    ----------
    modules : iterable of str
        Names of modules, or of what is in them, such as ``simnav.geometry.earth.displace``. `ALL`: all kernels.
    """
    given = [_imported(name) for name in modules]
    found = kernels()
    if ALL in given:
        return found
    reached = _reached(given)
    if not any(kernel.__module__ in reached for kernel in found):
        return []
    reached |= _reached(_EQUATIONS)
    return [kernel for kernel in found if kernel.__module__ in reached]


def _imported(name: str) -> str:
    """The module that has something, as far as it is imported here."""
    while name not in sys.modules and "." in name:
        name = name.rpartition(".")[0]
    return name


def _reached(modules: Iterable[str]) -> set[str]:
    """Modules of simnav, and those that their contents come from."""
    found = set(modules)
    todo = list(found)
    while todo:
        module = todo.pop()
        contents = list(vars(sys.modules.get(module, sys)).values())
        contents += [sys.modules.get(_CHAINS[1], sys)] if module == _CHAINS[0] else []
        contents += [part for value in contents if isinstance(value, tuple) for part in value]  # functions of a model
        for value in contents:
            name = value.__name__ if isinstance(value, types.ModuleType) else getattr(value, "__module__", None)
            if isinstance(name, str) and name.startswith("simnav.") and name not in found:
                found.add(name)
                todo.append(name)
    return found
