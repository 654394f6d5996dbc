"""Wrappers for learning agents, and an estimator as an agent behind flat observations."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import FlattenObservation, FrameStackObservation

import simnav
from simnav.environment import EstimatorAgent, NavigationEnv, NormaliseObservation, RelativeAction
from simnav.geometry.earth import displace
from simnav.scenario import parse
from tests.cases import SHORT

TOML = (
    SHORT.replace("duration_s = 12.0", "duration_s = 20.0")
    + """
[instruments.gyrocompass]
rate_hz = 2.0
sigma_deg = 0.5
"""
)


@pytest.fixture
def env():
    return NavigationEnv(parse(TOML), reveal_truth=True)


def test_a_relative_action_moves_the_last_estimate_on(env):
    wrapped = RelativeAction(env)
    _, info = wrapped.reset(seed=1)
    start = info["start"].position
    answers = []
    env.step = lambda action, step=env.step: answers.append(action) or step(action)
    wrapped.step(np.array([0.05, 0, 0, 0, 0, 0, 0, 0, 0.1], np.float32))
    wrapped.step(np.array([0.05, 0, 0, 7.0, 0, 0, 0, 0, 0.0], np.float32))  # clipped
    north = displace(displace(start, np.array([5.0, 0, 0])), np.array([5.0, 0, 0]))
    np.testing.assert_allclose(answers[1][0], north, atol=1e-9)
    assert answers[1][1, 0] == pytest.approx(info["start"].velocity[0] + 10.0, abs=1e-5)
    assert answers[1][2, 2] == pytest.approx(info["start"].attitude[2] + 0.1, abs=1e-6)
    for action in (np.zeros(8), np.full(9, np.nan)):
        with pytest.raises(ValueError, match=r"a relative action is a \(9,\) array of finite numbers"):
            wrapped.step(action)


def test_normalised_observations_are_of_order_one_and_hold_the_start(env):
    wrapped = NormaliseObservation(env)
    observation, info = wrapped.reset(seed=1)
    assert observation in wrapped.observation_space
    np.testing.assert_allclose(observation["start"][3:6], info["start"].attitude, atol=1e-6)
    for _ in range(3):
        observation, *_ = wrapped.step(np.zeros((3, 3)))
        assert observation in wrapped.observation_space
        assert all(np.abs(array).max() < 3.0 for name, array in observation.items() if name != "start")
    assert observation["gnss.valid"].tolist() == [1.0]
    assert abs(observation["gnss.value"][0, 0]) < 0.05  # kilometres from the start
    assert observation["gyrocompass.age"].tolist() == pytest.approx([0.5, 0.0])


@pytest.mark.filterwarnings("ignore:.*not within:UserWarning")
def test_gymnasiums_checker_and_windows(env):
    check_env(RelativeAction(NormaliseObservation(NavigationEnv(parse(TOML)))), skip_render_check=True)
    stacked = FrameStackObservation(FlattenObservation(NormaliseObservation(env)), 3)
    assert stacked.reset(seed=1)[0].shape[0] == 3


def test_an_estimator_is_an_agent_behind_flat_observations(env):
    flat, agent = FlattenObservation(NavigationEnv(parse(TOML))), EstimatorAgent(simnav.make("ekf"))
    with pytest.raises(ValueError, match="a flat observation needs the space"):
        agent.act(flat.reset(seed=1)[0])
    agents = [agent, EstimatorAgent(simnav.make("ekf"), env.observation_space)]
    given = []
    for e, a in zip((env, flat), agents, strict=True):
        observation, info = e.reset(seed=1)
        a.reset(info)
        rewards, over = [], False
        while not over:
            observation, reward, _, over, _ = e.step(a.act(observation))
            rewards.append(reward)
        given.append(rewards)
    assert given[0] == given[1]
