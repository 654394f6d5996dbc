"""The Gymnasium environment: the agent is the navigator.

`NavigationEnv` (``navigation.py``) is an adapter over the same sources of data that every campaign uses.
`NavigationVectorEnv` (``vector.py``) runs several of them together, and `EstimatorAgent` (``agent.py``) makes an agent
of an estimator. ``wrappers.py`` holds relative actions and observations of order one, ``windowing.py`` cuts recordings,
``seeds.py`` the seeds of training, and ``rendering.py`` draws the chart of a run. Tasks around a running filter are in
`simnav.estimators.learning`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simnav.environment.agent import EstimatorAgent, unpack
    from simnav.environment.navigation import REWARDS, NavigationEnv, Observation, checked_action
    from simnav.environment.vector import NavigationVectorEnv, spawn_seeds
    from simnav.environment.windowing import windows
    from simnav.environment.wrappers import NormaliseObservation, RelativeAction

__all__ = [
    "REWARDS",
    "EstimatorAgent",
    "NavigationEnv",
    "NavigationVectorEnv",
    "NormaliseObservation",
    "Observation",
    "RelativeAction",
    "checked_action",
    "spawn_seeds",
    "unpack",
    "windows",
]

# An estimator that decides as an agent was trained to needs no environment, and none of Gymnasium.
_HOMES = {
    "agent": ("EstimatorAgent", "unpack"),
    "navigation": ("REWARDS", "NavigationEnv", "Observation", "checked_action"),
    "vector": ("NavigationVectorEnv", "spawn_seeds"),
    "windowing": ("windows",),
    "wrappers": ("NormaliseObservation", "RelativeAction"),
}


def __getattr__(name: str) -> object:
    for module, found in _HOMES.items():
        if name in found:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
