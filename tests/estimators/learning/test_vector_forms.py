"""The vector form of every task: seeds, autoreset and infos are those of Gymnasium's own vector form."""

from __future__ import annotations

import tracemalloc
import warnings
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import simnav  # noqa: F401 (it registers)
from simnav.environment import spawn_seeds
from simnav.estimators.learning.bank import Steps, take
from simnav.estimators.learning.pool import Pool
from simnav.estimators.learning.reference import Linear
from simnav.estimators.learning.voyage import prepare

TASKS = ("Tuning", "Detection", "Correction", "Guidance")
N, STEPS = 2, 3


def made(task, **options):
    name = f"simnav/GnssNoiseStep-{task}-v1"
    return gymnasium.make_vec(name, N, vectorization_mode="vector_entry_point", steps=STEPS, **options)


def gymnasiums_own(task, mode=AutoresetMode.NEXT_STEP, **options):
    single = partial(gymnasium.make, f"simnav/GnssNoiseStep-{task}-v1", steps=STEPS, **options)
    return SyncVectorEnv([single] * N, autoreset_mode=mode)


def same(mine, theirs, where=""):
    """Whether two values of an info are alike."""
    if isinstance(theirs, np.ndarray) and theirs.dtype != object:
        np.testing.assert_array_equal(mine, theirs, where)
    elif isinstance(theirs, np.ndarray):
        for a, b in zip(mine, theirs, strict=True):
            same(a, b, where)
    elif hasattr(theirs, "position"):  # a start
        np.testing.assert_array_equal(mine.position, theirs.position, where)
    elif hasattr(theirs, "imu"):  # datasheets
        assert list(mine) == list(theirs)
    else:
        assert mine == theirs, where


def assert_infos(mine, theirs):
    assert mine.keys() == theirs.keys()
    for key, value in theirs.items():
        if key.startswith("_"):
            np.testing.assert_array_equal(mine[key], value, key)
        elif isinstance(value, dict):
            assert_infos(mine[key], value)
        else:
            for i in np.flatnonzero(theirs[f"_{key}"]):
                same(mine[key][i], value[i], key)


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP", "DISABLED"])
@pytest.mark.parametrize("task", TASKS)
def test_autoreset_is_gymnasiums(task, mode):
    envs = made(task, autoreset_mode=mode, reveal_truth=task == "Guidance")
    own = gymnasiums_own(task, AutoresetMode[mode], reveal_truth=task == "Guidance")
    assert envs.metadata["autoreset_mode"] == AutoresetMode[mode]
    assert envs.observation_space == own.observation_space
    assert envs.action_space == own.action_space
    observed = [e.reset(seed=5) for e in (envs, own)]
    envs.action_space.seed(1)
    for _ in range(2 * STEPS + 2):
        (observation, infos), (expected, theirs) = ((o[0], o[-1]) for o in observed)
        np.testing.assert_array_equal(observation, expected)
        assert observation.dtype == np.float32
        assert_infos(infos, theirs)
        for mine, other in zip(observed[0][1:-1], observed[1][1:-1], strict=True):
            np.testing.assert_array_equal(mine, other)
        if mode == "DISABLED" and len(observed[0]) == 5 and observed[0][3].all():
            mask = {"reset_mask": np.ones(N, np.bool_)}
            observed = [e.reset(options=mask) for e in (envs, own)]
        else:
            action = envs.action_space.sample()
            observed = [e.step(action) for e in (envs, own)]


@pytest.mark.parametrize("task", TASKS)
def test_seeds_that_are_spawned_are_independent(task):
    envs = made(task, independent_seeds=True)
    observation, infos = envs.reset(seed=5)
    assert infos["seed"].tolist() == spawn_seeds(5, N)
    np.testing.assert_array_equal(observation, gymnasiums_own(task).reset(seed=spawn_seeds(5, N))[0])
    assert not set(spawn_seeds(5, N)) & set(spawn_seeds(6, N))


@pytest.mark.parametrize("task", TASKS)
def test_one_voyage_begins_anew_while_the_other_goes_on(task):
    envs = made(task, autoreset_mode="DISABLED")
    with pytest.raises(gymnasium.error.ResetNeeded, match="the first reset begins all"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    first, _ = envs.reset(seed=5)
    action = np.zeros(envs.action_space.shape, envs.action_space.dtype)
    envs.step(action)
    expected, *_ = envs.step(action)
    observation, infos = envs.reset(seed=[5, None], options={"reset_mask": np.array([True, False])})
    np.testing.assert_array_equal(observation[0], first[0])
    np.testing.assert_array_equal(observation[1], expected[1])
    assert infos["_seed"].tolist() == [True, False]
    *_, truncated, _ = envs.step(action)
    assert truncated.tolist() == [False, True]


BAD = [
    (lambda shape: np.zeros((*shape, 1)), r"an array of shape \(.*\), not \(.*\)"),
    (lambda shape: np.zeros(shape[:-1]), r"an array of shape \(.*\), not \(.*\)"),
    (lambda shape: np.full(shape, np.nan), "finite, not"),
    (lambda shape: np.full(shape, np.inf), "finite, not"),
    (lambda _: "starboard", "an array of numbers of shape"),
]


@pytest.mark.parametrize("task", TASKS)
def test_bad_actions_are_refused_in_one_sentence_and_nothing_is_stepped(task):
    env, envs = gymnasium.make(f"simnav/GnssNoiseStep-{task}-v1", steps=STEPS).unwrapped, made(task)
    for e, what in ((env, f"an action of {task} is"), (envs, f"the actions of {N} agents in {task} are")):
        e.reset(seed=1)
        for bad, message in BAD:
            with pytest.raises(ValueError, match=f"{what} {message}") as refused:
                e.step(bad(e.action_space.shape))
            assert "\n" not in str(refused.value).partition("array(")[0]
        action = np.zeros(e.action_space.shape, e.action_space.dtype)
        for k in range(STEPS):  # none of them counted
            *_, truncated, _ = e.step(action)
            assert np.all(truncated == (k == STEPS - 1))


@pytest.mark.parametrize("task", ["Tuning", "Correction", "Guidance"])
def test_actions_out_of_bounds_are_clipped(task):
    envs = [gymnasium.make(f"simnav/GnssNoiseStep-{task}-v1", steps=STEPS).unwrapped for _ in range(2)]
    for env in envs:
        env.reset(seed=1)
    most = np.where(np.arange(envs[0].action_space.shape[0]) % 2, -1.0, 1.0)
    one, other = envs[0].step(most)[:2], envs[1].step(7.0 * most)[:2]
    np.testing.assert_array_equal(one[0], other[0])
    assert one[1] == other[1]


LONG = "simnav/CoastalVoyage-Tuning-v1"
BANK = {"vectorization_mode": "vector_entry_point"}


def test_the_memory_of_prepared_voyages_is_said_before_it_is_taken():
    tracemalloc.start()
    with pytest.raises(
        ValueError, match=r"coastal-voyage-v1: a prepared voyage takes up to \d+ MB, and 65 of them do not"
    ):
        gymnasium.make_vec(LONG, 64, **BANK)
    with pytest.raises(ValueError, match=r"and 30 of them do not fit into memory_gb = 2; .* or say memory_gb = 5.*"):
        gymnasium.make_vec(LONG, 2, cache=30, memory_gb=2, **BANK)
    with pytest.warns(UserWarning, match=r"so \d+ of 64 are kept in memory_gb = 4, .*; memory_gb = 1\d.\d keeps all"):
        gymnasium.make_vec(LONG, 2, voyages=64, **BANK)
    assert tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gymnasium.make_vec(LONG, 2, voyages=64, memory_gb=11, **BANK)
        gymnasium.make_vec(LONG, 64, steps=100, **BANK)


def test_a_bank_with_little_memory_sails_the_same_voyages():
    """Voyages that do not fit are prepared again when their turn comes."""
    options = {"steps": 20, "voyages": 6}
    everything = gymnasium.make_vec("simnav/GnssNoiseStep-Tuning-v1", 2, **options, **BANK)
    each = Pool.cost(everything.options) / 1e9
    with pytest.warns(UserWarning, match="so 3 of 6 are kept"):
        few = gymnasium.make_vec("simnav/GnssNoiseStep-Tuning-v1", 2, **options, memory_gb=5.5 * each, **BANK)
    for envs in (everything, few):
        envs.action_space.seed(1)
    np.testing.assert_array_equal(few.reset(seed=1)[0], everything.reset(seed=1)[0])
    for _ in range(90):
        action = everything.action_space.sample()
        for mine, theirs in zip(few.step(action)[:4], everything.step(action)[:4], strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_the_estimate_of_the_memory_is_an_upper_bound():
    envs = gymnasium.make_vec("simnav/GnssNoiseStep-Tuning-v1", 2, **BANK)
    options = envs.options
    voyage = prepare(options.scenario, 3, options.layout.watched, oracle=False)
    arrays = [*voyage.linear, voyage.edges, voyage.end, voyage.context, voyage.error, voyage.oracle, voyage.faulty]
    taken = sum(array.nbytes for array in arrays)
    assert taken < Pool.cost(options) < 4.0 * taken


@pytest.mark.parametrize("moving", [0, 4, 6])
def test_a_bank_propagates_constant_states_like_all_others(moving):
    """Phi P Phi' + Q by NumPy; the last states are constant and not multiplied."""
    n, rng = 6, np.random.default_rng(moving)
    linear, root, delta = Linear.empty(1, n), rng.normal(size=(n, n)), rng.normal(size=(1, n))
    phi, before = np.eye(n), delta[0].copy()
    phi[:moving, :moving] = rng.normal(size=(moving, moving)) * (rng.random((moving, moving)) < 0.6)
    linear.transition[0], linear.process_noise[0], linear.moves[0] = phi, np.diag(rng.random(n)), True
    covariance = (root @ root.T)[None].copy()
    expected = phi @ covariance[0] @ phi.T + 4.0 * linear.process_noise[0]
    steps = Steps(np.ones(1, np.bool_), np.zeros(1, np.int64), np.ones(1, np.int64))
    take(steps, linear, np.zeros(1, np.int64), np.ones((1, 1, 1)), np.array([2.0]), covariance, delta)
    np.testing.assert_allclose(covariance[0], expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(delta[0], phi @ before, rtol=1e-12, atol=1e-12)
