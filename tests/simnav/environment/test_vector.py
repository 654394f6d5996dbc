"""The vector form: each run is the one that its seed gives alone."""

from __future__ import annotations

from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from simnav.environment import NavigationEnv
from simnav.environment.vector import NavigationVectorEnv, spawn_seeds
from simnav.scenario import parse
from tests.cases import SHORT


@pytest.fixture(scope="module")
def scenario():
    return parse(SHORT)


def start_of(infos):
    return np.stack([np.stack([s.position, s.velocity, s.attitude]) for s in infos["start"]])


def assert_run(batch, i, observation):
    np.testing.assert_array_equal(batch["interval"][i], observation["interval"])
    for name in ("imu", "gnss"):
        assert batch[name].keys() == observation[name].keys()
        for key, array in observation[name].items():
            np.testing.assert_array_equal(batch[name][key][i], array)


def test_every_run_is_the_one_of_its_seed(scenario):
    envs = NavigationVectorEnv(scenario, 3, reveal_truth=True, autoreset_mode="DISABLED")
    seeds = [5, 99, 5]
    batch, infos = envs.reset(seed=seeds)
    assert infos["seed"].tolist() == seeds
    assert batch in envs.observation_space
    alone = [NavigationEnv(scenario, reveal_truth=True) for _ in seeds]
    for i, (env, seed) in enumerate(zip(alone, seeds, strict=True)):
        assert_run(batch, i, env.reset(seed=seed)[0])
    rates = batch["imu"]["angular_rate"]
    np.testing.assert_array_equal(rates[0], rates[2])
    assert (rates[0] != rates[1]).all()
    actions = start_of(infos)
    for k in range(12):
        batch, rewards, terminated, truncated, infos = envs.step(actions)
        assert not terminated.any()
        assert truncated.tolist() == [k == 11] * 3
        for i, env in enumerate(alone):
            observation, reward, _, _, info = env.step(actions[i])
            assert_run(batch, i, observation)
            assert rewards[i] == reward
            np.testing.assert_array_equal(infos["truth"][i], info["truth"])
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(actions)


def test_spawned_seeds_do_not_overlap_between_neighbours():
    seeds = [seed for base in range(100) for seed in spawn_seeds(base, 50)]
    assert len(set(seeds)) == len(seeds)
    assert all(0 <= seed < 2**63 for seed in seeds)
    assert spawn_seeds(7, 50)[:10] == spawn_seeds(7, 10)


def test_an_integer_seed_is_what_gymnasium_makes_of_it_or_spawns(scenario):
    envs = NavigationVectorEnv(scenario, 4)
    _, infos = envs.reset(seed=1)
    assert infos["seed"].tolist() == [1, 2, 3, 4]
    _, fresh = envs.reset()
    _, infos = envs.reset(seed=1)
    _, again = envs.reset()
    assert fresh["seed"].tolist() == again["seed"].tolist()
    assert len({*fresh["seed"].tolist(), *infos["seed"].tolist()}) == 8
    _, infos = envs.reset(seed=[3, None, 4, None])
    assert infos["seed"][[0, 2]].tolist() == [3, 4]
    _, infos = NavigationVectorEnv(scenario, 4, independent_seeds=True).reset(seed=1)
    assert infos["seed"].tolist() == spawn_seeds(1, 4)


@pytest.mark.parametrize("closed_loop", [False, True], ids=["open loop", "closed loop"])
@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP", "DISABLED"])
def test_a_run_that_is_over_begins_anew_as_in_gymnasiums_own_vector_form(scenario, mode, closed_loop):
    envs = NavigationVectorEnv(scenario, 2, autoreset_mode=mode, closed_loop=closed_loop)
    single = partial(NavigationEnv, scenario, closed_loop=closed_loop)
    theirs = SyncVectorEnv([single] * 2, autoreset_mode=AutoresetMode[mode])
    batch, infos = envs.reset(seed=7)
    other, _ = theirs.reset(seed=7)
    actions = start_of(infos)
    actions[:, 0, 0] += [2e-6, -1e-6]  # a wrong estimate takes a vessel that steers by it off its track
    for _ in range(12 if mode == "DISABLED" else 15):
        for i in range(2):
            assert_run(
                batch, i, {k: v[i] if k == "interval" else {n: a[i] for n, a in v.items()} for k, v in other.items()}
            )
        batch, rewards, _, truncated, infos = envs.step(actions)
        other, *expected, others = theirs.step(actions)
        np.testing.assert_array_equal(rewards, expected[0])
        np.testing.assert_array_equal(truncated, expected[2])
        assert ("final_obs" in infos) == ("final_obs" in others)
        for i in np.flatnonzero(truncated if mode == "SAME_STEP" else []):
            assert_run({k: {n: [a] for n, a in v.items()} if isinstance(v, dict) else [v]
                        for k, v in infos["final_obs"][i].items()}, 0, others["final_obs"][i])  # fmt: skip
        assert infos.get("seed", np.zeros(2)).tolist() == others.get("seed", np.zeros(2)).tolist()


@pytest.mark.parametrize("closed_loop", [False, True], ids=["open loop", "closed loop"])
def test_a_mask_begins_some_runs_anew_and_the_others_go_on(scenario, closed_loop):
    envs = NavigationVectorEnv(scenario, 2, autoreset_mode="DISABLED", closed_loop=closed_loop)
    _, infos = envs.reset(seed=[1, 2])
    actions = start_of(infos)
    for _ in range(4):
        before, *_ = envs.step(actions)
    batch, infos = envs.reset(seed=[8, 9], options={"reset_mask": np.array([False, True])})
    assert batch["interval"].tolist() == [[4.0, 5.0], [0.0, 1.0]]
    assert infos["seed"].tolist() == [0, 9]
    assert infos["_seed"].tolist() == [False, True]
    assert_run(batch, 0, {k: v[0] if k == "interval" else {n: a[0] for n, a in v.items()} for k, v in before.items()})

    # The first run ends eight steps on; it stands still while the second is followed to its end.
    for k in range(12):
        if k == 8:
            actions[0] = np.nan  # not read
        batch, rewards, _, truncated, _ = envs.step(actions)
        assert truncated.tolist() == [k >= 7, k == 11]
        assert batch["interval"].tolist() == [[min(5.0 + k, 12.0), min(6.0 + k, 12.0)], [1.0 + k, min(2.0 + k, 12.0)]]
        assert (rewards[0] == 0.0) == (k >= 8)
        assert rewards[1] < 0.0


@pytest.mark.parametrize("closed_loop", [False, True], ids=["open loop", "closed loop"])
def test_batches_do_not_share_memory(scenario, closed_loop):
    envs = NavigationVectorEnv(scenario, 2, closed_loop=closed_loop, autoreset_mode="DISABLED")
    first, infos = envs.reset(seed=1)
    kept = first["imu"]["angular_rate"].copy()
    second, *_ = envs.step(start_of(infos))
    second["imu"]["angular_rate"][...] = 0.0
    np.testing.assert_array_equal(first["imu"]["angular_rate"], kept)
    assert envs.reset(options={"reset_mask": np.array([True, False])})[0]["imu"]["valid"].all()
    assert not second["imu"]["angular_rate"].any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda e, a: e.step(a[:1]), r"\(2, 3, 3\) array, one for each run, not 1"),
        (lambda e, a: e.step(np.where(np.arange(2)[:, None, None] == 1, np.nan, a)), "run 1: an action must be finite"),
        (lambda e, a: e.step(a.reshape(2, 9)), r"run 0: .*shape \(9,\)"),
        (lambda e, a: e.reset(seed=[1, 2, 3]), "2 runs need as many seeds, not 3"),
        (lambda e, a: e.reset(options={"reset_mask": np.array([1, 0])}), "reset_mask is an"),
        (lambda e, a: e.reset(options={"reset_mask": np.array([False, False])}), "reset_mask is an"),
    ],
)
def test_bad_input_is_one_sentence_and_steps_no_run(scenario, call, message):
    envs = NavigationVectorEnv(scenario, 2)
    _, infos = envs.reset(seed=1)
    actions = start_of(infos)
    with pytest.raises(ValueError, match=message):
        call(envs, actions)
    batch, *_ = envs.step(actions)
    assert batch["interval"].tolist() == [[1.0, 2.0], [1.0, 2.0]]


def test_the_number_of_runs_is_positive(scenario):
    with pytest.raises(ValueError, match="num_envs is a positive integer, not 0"):
        NavigationVectorEnv(scenario, 0)


def test_the_first_reset_begins_all(scenario):
    with pytest.raises(gymnasium.error.ResetNeeded):
        NavigationVectorEnv(scenario, 2).reset(options={"reset_mask": np.array([True, False])})


def test_make_vec_uses_it():
    envs = gymnasium.make_vec("simnav:simnav/OpenSea-v1", num_envs=4, reward="position")
    assert isinstance(envs, NavigationVectorEnv)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    batch, infos = envs.reset(seed=3)
    assert batch in envs.observation_space
    assert envs.action_space.shape == (4, 3, 3)
    _, rewards, *_ = envs.step(start_of(infos))
    assert rewards.shape == (4,)
    envs.close()
