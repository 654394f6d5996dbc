"""The vector form of guidance: the numbers of the single environment, whose numbers are those of blocks."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from simnav.estimators.learning.guidance import GuidanceEnv
from simnav.estimators.learning.guidance_vector import GuidanceVectorEnv
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.kalman import KalmanEstimator

update = KalmanEstimator.update


def actions(n, seed=0):
    """The actions of n steps: a random walk about straight ahead."""
    walk = np.random.default_rng(seed).uniform(-0.5, 0.5, (n, 2))
    return walk.astype(np.float32)


def voyage(env, seed, turns):
    found = [env.reset(seed=seed)[0]]
    for action in turns:
        observation, reward, *flags, info = env.step(action)
        found.append((observation, reward, *flags, info["aside"], info["truth"]))
    return found


def assert_equal(one, other):
    for a, b in zip(one, other, strict=True):
        for x, y in zip(a, b, strict=True) if isinstance(a, tuple) else [(a, b)]:
            np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("name", ["gnss-multipath", "auv-survey", "ship-turn"])
def test_the_compiled_navigator_is_the_filter_that_works_on_packets(name, monkeypatch):
    """Bit for bit, and so is the world that goes in blocks."""
    turns = actions(25)
    packets = []
    monkeypatch.setattr(KalmanEstimator, "update", lambda self, p: packets.append(p) or update(self, p))
    expected = voyage(GuidanceEnv(name, reveal_truth=True), 3, turns)
    assert (packets == []) == (name != "ship-turn")  # which has no IMU
    by_packets = GuidanceEnv(name, navigator=KalmanEstimator(Suitable()), reveal_truth=True)
    assert_equal(voyage(by_packets, 3, turns), expected)
    assert len(packets) >= len(turns)
    monkeypatch.setattr("simnav.simulation.steps.CompiledInstrument", int)  # as if the instruments were those of others
    assert_equal(voyage(by_packets, 3, turns), expected)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("training-gnss-faults", {"steps": 6}),
        ("random-ships-v1", {"steps": 5, "route": "channel", "half_width": 2.0}),
        ("gnss-outage", {"steps": 5, "route": "dock", "navigator": "ekf"}),
    ],
)
def test_many_voyages_are_those_of_single_environments(name, options):
    """Over two episodes each; in the channel some touch the side, and end before the others."""
    n, turns = 3, actions(14, seed=1)
    envs = GuidanceVectorEnv(name, n, reveal_truth=True, **options)
    singles = [GuidanceEnv(name, reveal_truth=True, **options) for _ in range(n)]
    observation, infos = envs.reset(seed=11)
    over = [False] * n
    for i, env in enumerate(singles):
        mine, info = env.reset(seed=11 + i)
        np.testing.assert_array_equal(observation[i], mine)
        np.testing.assert_array_equal(infos["start"][i].position, info["start"].position)
    episodes = 0
    for action in turns:
        observation, rewards, terminated, truncated, infos = envs.step(np.tile(action, (n, 1)))
        for i, env in enumerate(singles):
            if over[i]:
                mine, _ = env.reset()
                assert (rewards[i], terminated[i], truncated[i]) == (0.0, False, False)
                over[i] = False
                episodes += 1
            else:
                mine, *worth, info = env.step(action)
                assert (rewards[i], terminated[i], truncated[i]) == tuple(worth)
                np.testing.assert_array_equal(infos["truth"][i], info["truth"])
                over[i] = worth[1] or worth[2]
                assert not over[i] or infos["scores"][i] == info["scores"]
            np.testing.assert_array_equal(observation[i], mine)
    assert episodes >= n


def test_bad_arguments_and_actions():
    with pytest.raises(ValueError, match="num_envs is a positive integer, not 0"):
        GuidanceVectorEnv("gnss-outage", 0)
    with pytest.raises(ValueError, match="Guidance: the vector form draws no charts"):
        GuidanceVectorEnv("gnss-outage", 2, render_mode="rgb_array")
    envs = GuidanceVectorEnv("gnss-outage", 2)
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(np.zeros((2, 2)))
    envs.reset(seed=1)
    for bad, message in ((np.zeros(2), r"of shape \(2, 2\), not \(2,\)"), (np.full((2, 2), np.nan), "finite, not")):
        with pytest.raises(ValueError, match=message):
            envs.step(bad)
