"""The Gymnasium ids of the catalogue, registered as soon as simnav and Gymnasium are both imported.

``gymnasium.make("simnav:simnav/OpenSea-v1")`` imports simnav after Gymnasium, and the ids are registered at once. If
simnav is imported first, they are registered when Gymnasium is imported, by whomever: its import takes longer than all
else that ``import simnav`` does, and most programs that use simnav make no environment.
"""

from __future__ import annotations

import contextlib
import importlib.util
import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

__all__ = ["register_scenarios", "register_with_gymnasium"]

_GYMNASIUM = "gymnasium"
# The library must not import the learning tasks (they belong to simnav.estimators): their entry points are strings.
_LEARNING = "simnav.estimators.learning"


def register_with_gymnasium() -> None:
    """Register the ids, at once if Gymnasium is imported, else when it is."""
    if "gymnasium.envs.registration" in sys.modules:
        register_scenarios()
    elif not any(isinstance(finder, _Waiting) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Waiting())


def register_scenarios() -> None:
    """Give every scenario of the catalogue, and the learning tasks over it, a Gymnasium id. It imports Gymnasium."""
    from gymnasium.envs.registration import EnvSpec, registry

    from simnav.scenario.catalogue import headers

    def add(name: str, entry: str, vector_entry: str, **options: str) -> None:
        # Not by `gymnasium.register`, which compares each id with all that are there.
        if name not in registry:
            registry[name] = EnvSpec(name, entry, vector_entry_point=vector_entry, kwargs=options)

    home = "simnav.environment"
    for header in headers():
        add(header.gym_id, f"{home}:NavigationEnv", f"{home}:NavigationVectorEnv", scenario=header.id)
        name, _, version = header.gym_id.rpartition("-v")
        single, several = f"{_LEARNING}.environment:FilterTaskEnv", f"{_LEARNING}.vector:FilterTaskVectorEnv"
        for task in () if header.channels else ("Tuning", "Detection", "Correction"):  # a filter takes no channels
            add(f"{name}-{task}-v{version}", single, several, scenario=header.id, task=task)
        if not header.recorded:
            single, several = f"{_LEARNING}.guidance:GuidanceEnv", f"{_LEARNING}.guidance_vector:GuidanceVectorEnv"
            add(f"{name}-Guidance-v{version}", single, several, scenario=header.id)


class _Waiting(MetaPathFinder):
    """Finds Gymnasium by the other finders, and has the ids registered after its import."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name != _GYMNASIUM:
            return None
        with contextlib.suppress(ValueError):  # another thread was faster
            sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            spec.loader = _Registering(spec.loader, self)
        return spec


class _Registering(Loader):
    """The loader of Gymnasium, after which the ids are registered."""

    def __init__(self, loader: Any, waiting: _Waiting):
        self._loader, self._waiting = loader, waiting

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        module: ModuleType | None = self._loader.create_module(spec)
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__loader__ = self._loader
        if module.__spec__ is not None:
            module.__spec__.loader = self._loader
        try:
            self._loader.exec_module(module)
        except BaseException:
            sys.meta_path.insert(0, self._waiting)  # it may be tried again
            raise
        register_scenarios()
