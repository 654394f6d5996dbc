"""Closed loop: on every simulated scenario an error of the estimate becomes one of the track."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.environment import NavigationEnv
from simnav.geometry.earth import displace, relative_position
from simnav.scenario import load
from simnav.scenario.catalogue import headers
from simnav.simulation.simulator import Simulator

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


@pytest.mark.parametrize("name", [*QUICK[::6], "random-ships-v1"])  # the others are of the same kinds
def test_a_wrong_estimate_takes_her_off_her_track(name):
    right, north, east = sailed(name, (0.0, 0.0)), sailed(name, (300.0, 0.0)), sailed(name, (0.0, 300.0))
    moved = [np.hypot(*relative_position(p, right)[:2]) for p in (north, east)]
    assert max(moved) > 0.5


def test_a_wrong_heading_does_too():
    right, wrong = sailed("open-sea", (0.0, 0.0)), sailed("open-sea", (0.0, 0.0), heading=0.1)
    assert np.hypot(*relative_position(wrong, right)[:2]) > 5.0


def test_a_log_is_refused():
    with pytest.raises(ValueError, match="is a recorded log: its vessel cannot steer by the estimate"):
        NavigationEnv("car-kitti", closed_loop=True)


def test_a_step_by_itself_gives_the_numbers_of_a_block(monkeypatch):
    """Steered by an estimate that is off, over a change of stretch and to the end of the run."""
    scenario = load("gnss-multipath").model_copy(update={"duration": 70.0})
    envs = [NavigationEnv(scenario, closed_loop=True, reveal_truth=True, reward="position") for _ in range(2)]
    _, info = envs[0].reset(seed=5)
    with monkeypatch.context() as patched:
        patched.setattr("simnav.simulation.steps.CompiledInstrument", int)  # as if the instruments were those of others
        envs[1].reset(seed=5)
    blocks = []
    advance = Simulator.advance
    monkeypatch.setattr(Simulator, "advance", lambda self, until: blocks.append(until) or advance(self, until))
    over = False
    while not over:
        action = info["truth"].copy()
        action[0] = displace(action[0], np.array([20.0, -30.0, 0.0]))
        (one, reward, _, over, info), (two, *rest) = (env.step(action) for env in envs)
        assert (reward, over) == (rest[0], rest[2])
        np.testing.assert_array_equal(info["truth"], rest[3]["truth"])
        assert one.keys() == two.keys()
        for name, entries in one.items():
            if name == "interval":
                np.testing.assert_array_equal(entries, two[name])
                continue
            for key, array in entries.items():
                np.testing.assert_array_equal(array, two[name][key], f"{name} {key}")
    assert one["interval"].tolist() == [70.0, 70.0]
    assert len(blocks) == 69  # of the second alone; the first step of each is older than the count
