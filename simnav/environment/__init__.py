"""The Gymnasium environment: the agent is the navigator.

`NavigationEnv` (``navigation.py``) is an adapter over the same sources of data that every campaign uses,
`NavigationVectorEnv` (``vector.py``) several of them side by side, and `EstimatorAgent` (``agent.py``) the bridge the
other way, from an estimator to an agent. ``rendering.py`` draws the chart of a run.
"""

from __future__ import annotations

from simnav.environment.agent import EstimatorAgent, unpack
from simnav.environment.navigation import REWARDS, NavigationEnv, Observation, checked_action
from simnav.environment.vector import NavigationVectorEnv, spawn_seeds

__all__ = [
    "REWARDS",
    "EstimatorAgent",
    "NavigationEnv",
    "NavigationVectorEnv",
    "Observation",
    "checked_action",
    "spawn_seeds",
    "unpack",
]
