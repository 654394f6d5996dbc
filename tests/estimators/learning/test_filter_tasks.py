"""The tasks around a running filter: the filter is the plain one, the vector form the single one, bit for bit."""

from __future__ import annotations

import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import simnav
from simnav.environment.seeds import FIRST_TRAINING_SEED
from simnav.estimators.learning.environment import FilterTaskEnv
from simnav.estimators.learning.evaluation import plain, scoring_envs, worth
from simnav.estimators.learning.features import observation_names
from simnav.estimators.learning.tasks import CORRECTIONS, TASKS
from simnav.estimators.learning.vector import FilterTaskVectorEnv
from simnav.scenario import parse
from simnav.scoring.navigation_error import errors, horizontal
from simnav.source import record
from simnav.trial import run_trial

TOML = """
name = "small"
version = 1
title = "a ship with a bad receiver"
duration_s = 30.0
[start]
latitude_deg = 50.0
longitude_deg = -5.0
speed_m_s = 5.0
[[manoeuvre]]
kind = "turn"
angle_deg = 60.0
[instruments.imu]
rate_hz = 20.0
gyroscope = { random_walk_deg_sqrt_h = 0.1, bias_deg_h = 5.0 }
accelerometer = { random_walk_ug_sqrt_hz = 100.0, bias_ug = 200.0 }
[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [2.0, 2.0, 4.0]
[instruments.dvl]
rate_hz = 2.0
phase_s = 0.15
sigma_m_s = 0.02
scale_percent = 0.3
[[fault]]
kind = "noise_step"
instruments = ["gnss"]
start_s = 8.0
end_s = 20.0
factor = 15.0
[[fault]]
kind = "outage"
instruments = ["gnss"]
start_s = 25.0
end_s = 27.0
"""


@pytest.fixture(scope="module")
def scenario():
    return parse(TOML)


def episode(env, seed, agent):
    observation, info = env.reset(seed=seed)
    rewards, truncated, infos = [], False, []
    while not truncated:
        observation, reward, _, truncated, info = env.step(agent(observation))
        rewards.append(reward)
        infos.append(info)
    return np.array(rewards), infos


def test_a_filter_that_is_left_alone_is_the_plain_one(scenario):
    env = FilterTaskEnv(scenario, reveal_truth=True)
    nothing = np.zeros(3, np.float32)
    _, infos = episode(env, 4, lambda _: nothing)
    recording = record(scenario, 4)
    for name, key in (("ekf", "error"), ("oracle", "oracle_error")):
        estimator = simnav.make(name)
        alone = horizontal(errors(run_trial(estimator, recording), recording))
        assert np.abs(alone - [info[key] for info in infos]).max() < 1e-6


def test_the_noise_that_the_agent_sets_is_the_noise_of_the_filter(scenario):
    """Setting the noise of the step in the noise makes the error less; a filter that trusts it the more, larger."""
    env = FilterTaskEnv(scenario, reveal_truth=True, instruments="fixes")
    k = np.log(15.0) / np.log(30.0)
    rms = []
    for setting in (k, 0.0, -k):
        sums = []
        for seed in range(5):
            steps = iter(range(100))
            _, infos = episode(
                env, seed, lambda _, s=setting, i=steps: np.array([s if 7 <= next(i) < 20 else 0.0, 0.0], np.float32)
            )
            sums += [info["error"] ** 2 for info in infos]
        rms.append(np.mean(sums) ** 0.5)
    assert rms[0] < 0.7 * rms[1]
    assert rms[1] < 0.9 * rms[2]


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
@pytest.mark.parametrize("task", TASKS)
def test_the_vector_form_is_gymnasiums_over_single_environments_bit_for_bit(scenario, task, mode):
    options = {"steps": 12, "reward": "likelihood"} if task == "Tuning" else {"steps": 12}
    envs = FilterTaskVectorEnv(scenario, task, 3, autoreset_mode=mode, **options)
    alone = SyncVectorEnv([lambda: FilterTaskEnv(scenario, task, **options)] * 3, autoreset_mode=AutoresetMode[mode])
    ours, infos = envs.reset(seed=5)
    theirs, others = alone.reset(seed=5)
    assert infos["seed"].tolist() == others["seed"].tolist() == [5, 6, 7]
    envs.action_space.seed(0)
    seen = 0.0
    for _ in range(16):
        np.testing.assert_array_equal(ours, theirs)
        actions = envs.action_space.sample()
        ours, *got, infos = envs.step(actions)
        theirs, *wanted, others = alone.step(actions)
        for a, b in zip(got, wanted, strict=True):
            np.testing.assert_array_equal(a, b)
        assert ("final_obs" in infos) == ("final_obs" in others)
        if "seed" in infos:
            assert infos["seed"].tolist() == others["seed"].tolist()
        seen += np.abs(got[0]).sum()
    assert seen > 0.0


def test_runs_of_a_family_may_differ_in_their_instruments():
    envs = FilterTaskVectorEnv("random-voyages", "Tuning", 4, steps=4)
    alone = [FilterTaskEnv("random-voyages", steps=4) for _ in range(4)]
    ours, _ = envs.reset(seed=1)
    begun = [env.reset(seed=1 + i) for i, env in enumerate(alone)]
    assert len({tuple(info["instruments"]) for _, info in begun}) > 1
    actions = np.full((4, envs.single_action_space.shape[0]), 0.3, np.float32)
    for _ in range(4):
        theirs = [env.step(a) for env, a in zip(alone, actions, strict=True)]
        ours, rewards, *_ = envs.step(actions)
        np.testing.assert_array_equal(ours, [t[0] for t in theirs])
        np.testing.assert_array_equal(rewards, [t[1] for t in theirs])


def test_disabled_voyages_stand_still_until_they_are_begun_anew(scenario):
    envs = FilterTaskVectorEnv(scenario, "Tuning", 2, steps=3, autoreset_mode="DISABLED", independent_seeds=True)
    _, infos = envs.reset(seed=1)
    assert infos["seed"].tolist() == simnav.environment.spawn_seeds(1, 2)
    actions = np.zeros((2, 3), np.float32)
    for _ in range(3):
        *_, truncated, _ = envs.step(actions)
    assert truncated.all()
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(actions)
    envs.reset(options={"reset_mask": np.array([True, False])})
    actions[1] = np.nan  # not read
    _, rewards, _, truncated, _ = envs.step(actions)
    assert truncated.tolist() == [False, True]
    assert rewards[1] == 0.0


def test_the_gain_is_relative_to_the_plain_filter_and_to_what_errors_are_usual(scenario):
    def plain_filter(_):
        return np.zeros(3, np.float32)

    def agent(_):
        return np.array([0.5, -0.4, 0.3], np.float32)

    env = FilterTaskEnv(scenario, reward="gain", reveal_truth=True)
    nothing, before = episode(env, 3, plain_filter)
    gain, infos = episode(env, 3, agent)
    assert np.abs(nothing).max() < 1e-6
    assert np.abs(gain).max() > 0.02
    alone, error = (np.array([info["error"] for info in found]) ** 2 for found in (before, infos))
    ratio = np.exp(-2.0 * gain)  # (e^2 + r^2) / (p^2 + r^2)
    moved = np.abs(ratio - 1.0) > 1e-3
    usual = ((error - ratio * alone) / (ratio - 1.0))[moved]
    least = np.cumsum(alone)[moved] / (1.0 + np.flatnonzero(moved))  # without the oracle's variance
    assert (usual > least).all()
    assert (usual < least + 100.0).all()
    assert (np.sign(gain) == np.sign(alone - error))[moved].all()


def test_the_labels_give_the_reward_of_detection(scenario):
    env = FilterTaskEnv(scenario, "Detection")
    assert isinstance(env.action_space, gymnasium.spaces.MultiBinary)
    none, _ = episode(env, 3, lambda _: np.zeros(4, np.int8))
    gnss, _ = episode(env, 3, lambda _: np.array([1, 1, 0, 0], np.int8))
    # Twelve fixes of the noise step: missed, or found; and false alarms at the other sixteen fixes that come.
    assert none.sum() == -12.0
    assert gnss.sum() == 12.0 - (30 - 2 - 12)
    assert none[7:19].tolist() == [-1.0] * 12


def test_corrections_are_worth_what_the_error_becomes_less(scenario):
    env = FilterTaskEnv(scenario, "Correction", reveal_truth=True)
    nothing, infos = episode(env, 3, lambda _: np.zeros(7, np.float32))
    assert np.abs(nothing).max() < 1e-9
    north = np.zeros(7, np.float32)
    north[0] = 5.0  # out of bounds: as 1
    moved, changed = episode(env, 3, lambda _: north)
    assert (np.abs(moved) <= CORRECTIONS[0] + 1e-9).all()
    assert any(abs(a["error"] - b["error"]) > 1.0 for a, b in zip(infos, changed, strict=True))


def test_what_is_observed(scenario):
    env = FilterTaskEnv(scenario)
    names = observation_names(env.options.layout.names, env.options.layout.most)
    assert len(names) == env.observation_space.shape[0]
    seen, before = {name: [] for name in names}, np.array([0.0, 0.0, 0.0], np.float32)
    observation, _ = env.reset(seed=2)
    for _ in range(30):
        assert observation in env.observation_space
        for name, value in zip(names, observation, strict=True):
            seen[name].append(float(value))
        observation, *_ = env.step(before)
    surprise = np.array(seen["gnss.innovation[0]"])
    assert surprise[8:20].mean() > 2.0 * surprise[:8].mean()  # the noise step shows
    assert seen["gnss.age"][25] > seen["gnss.age"][24]
    assert seen["gnss.number"][24:28] == [0.0, 0.0, 0.5, 0.5] or 0.0 in seen["gnss.number"][24:28]
    assert seen["start_speed"] == pytest.approx([0.5] * 30, abs=0.05)


def test_training_voyages_have_seeds_of_their_own(scenario):
    env = FilterTaskEnv(scenario, steps=2, voyages=3)
    runs = {env.reset(seed=9)[1]["seed"]} | {env.reset()[1]["seed"] for _ in range(12)}
    assert runs == {FIRST_TRAINING_SEED + i for i in range(3)}
    with pytest.raises(ValueError, match="seed 1099511627777 is one of training"):
        scoring_envs(scenario, [1, FIRST_TRAINING_SEED + 1])
    envs = scoring_envs(scenario, [1, 2, 3], steps=5)
    assert worth(envs, [1, 2, 3], plain(envs)).error.shape == (3,)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: FilterTaskEnv(s, "Turning"), "task is one of Tuning, Detection, Correction, not 'Turning'"),
        (lambda s: FilterTaskEnv(s, reward="labels"), "reward of Tuning is one of error, gain, likelihood, not"),
        (lambda s: FilterTaskEnv(s, steps=0), "steps is a positive integer or None, not 0"),
        (lambda s: FilterTaskEnv(s, instruments="some"), "instruments is 'all' or 'fixes', not 'some'"),
        (lambda s: FilterTaskEnv(s, render_mode="ascii"), "render_mode is 'human', 'rgb_array' or None"),
        (lambda s: FilterTaskVectorEnv(s, "Tuning", 0), "num_envs is a positive integer, not 0"),
        (lambda s: FilterTaskVectorEnv(s, "Tuning", 2, autoreset_mode="never"), "autoreset_mode is one of NEXT_STEP"),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(scenario, call, message):
    with pytest.raises(ValueError, match=message):
        call(scenario)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros(2), r"an action of Tuning is an array of shape \(3,\), not \(2,\)"),
        (np.array([0.0, np.nan, 0.0]), "an action of Tuning is finite, not"),
        ("up", "an action of Tuning is an array of numbers"),
    ],
)
def test_bad_actions_are_refused_and_step_nothing(scenario, action, message):
    env = FilterTaskEnv(scenario, steps=3)
    env.reset(seed=1)
    with pytest.raises(ValueError, match=message):
        env.step(action)
    assert not env.step(np.zeros(3, np.float32))[3]
    envs = FilterTaskVectorEnv(scenario, "Tuning", 2, steps=3)
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(np.zeros((2, 3)))
    envs.reset(seed=1)
    with pytest.raises(ValueError, match="the actions of 2 agents in Tuning are"):
        envs.step(np.zeros((2, 4)))


def test_an_environment_can_be_pickled_under_way(scenario):
    env = FilterTaskEnv(scenario, steps=6)
    env.reset(seed=1)
    env.step(np.zeros(3, np.float32))
    copy = pickle.loads(pickle.dumps(env))
    action = np.full(3, 0.2, np.float32)
    for _ in range(4):
        for a, b in zip(env.step(action)[:4], copy.step(action)[:4], strict=True):
            np.testing.assert_array_equal(a, b)
