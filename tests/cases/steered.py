"""Where a vessel ends that is steered by its position, or by one that is wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from simnav.environment import NavigationEnv
from simnav.geometry.earth import displace
from simnav.scenario import Scenario
from simnav.types import Array


def ends_of(scenario: Scenario, north: Sequence[float]) -> list[Array]:
    """The last position of a run in closed loop, for each error of the position to the north [m]."""
    ends = []
    for error in north:
        env = NavigationEnv(scenario, closed_loop=True, reveal_truth=True)
        _, info = env.reset(seed=1)
        over = False
        while not over:
            action = info["truth"].copy()
            action[0] = displace(action[0], np.array([error, 0.0, 0.0]))
            _, _, _, over, info = env.step(action)
        ends.append(info["truth"][0])
    return ends
