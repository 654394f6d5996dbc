"""Closed loop: on every simulated scenario an error of the estimate becomes one of the track."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.catalogue import headers
from simnav.environment import NavigationEnv
from simnav.geometry.earth import displace, relative_position
from simnav.scenario import load

SIMULATED = [h.id for h in headers() if not h.recorded]
QUICK = [name for name in SIMULATED if not name.startswith(("training", "random"))]


def sailed(name, offset, heading=0.0, steps=45):
    """Where she is, having believed herself so far aside all the time."""
    env = NavigationEnv(load(name), closed_loop=True, reveal_truth=True)
    _, info = env.reset(seed=1)
    for _ in range(steps):
        action = info["truth"].copy()
        action[0] = displace(action[0], np.array([*offset, 0.0]))
        action[2, 2] += heading
        _, _, _, over, info = env.step(action)
        if over:
            break
    return info["truth"][0]


@pytest.mark.parametrize("name", [*QUICK, "random-ships-v1"])  # the other families are of the same kind
def test_a_wrong_estimate_takes_her_off_her_track(name):
    right, north, east = sailed(name, (0.0, 0.0)), sailed(name, (300.0, 0.0)), sailed(name, (0.0, 300.0))
    moved = [np.hypot(*relative_position(p, right)[:2]) for p in (north, east)]
    assert max(moved) > 0.5


def test_the_catalogue_knows_which_are_logs():
    assert all(load(h.id).recorded == h.recorded for h in headers() if not h.training)


def test_a_wrong_heading_does_too():
    right, wrong = sailed("open-sea", (0.0, 0.0)), sailed("open-sea", (0.0, 0.0), heading=0.1)
    assert np.hypot(*relative_position(wrong, right)[:2]) > 5.0


def test_a_log_is_refused():
    with pytest.raises(ValueError, match="is a recorded log: its vessel cannot steer by the estimate"):
        NavigationEnv("car-kitti", closed_loop=True)
