"""A copy of an estimator, made in mid-run, goes on as the estimator itself does: nothing is shared or left behind."""

from __future__ import annotations

import copy
import pickle

import gymnasium
import numpy as np
import pytest

from simnav.estimator import find, lacking, make, names
from simnav.scenario import load
from simnav.source import record

GTSAM = [name for name in names() if name.startswith("gtsam-")]  # a graph of GTSAM cannot be copied
ROWS = [name for name in names() if name not in GTSAM]


@pytest.fixture(scope="module")
def recordings():
    return [
        record(load(name).model_copy(update={"duration": 20.0}), 3)
        for name in ("auv-survey", "ship-field", "satellites-open-sea", "auv-and-ship", "terrain-rough")
    ]


def numbers(estimator, packets):
    estimates = [estimator.update(packet) for packet in packets]
    parts = [(e.position, e.velocity, e.attitude, e.covariance) for e in estimates]
    return np.concatenate([np.ravel(part) for four in parts for part in four if part is not None])


def trajectory(estimator):
    smoothed = estimator.smooth()
    if smoothed is None:
        return np.empty(0)
    return np.concatenate([np.ravel(part) for part in (smoothed.position, smoothed.velocity, smoothed.attitude)])


@pytest.mark.parametrize("name", ROWS)
def test_a_copy_goes_on_as_the_row_itself(name, recordings):
    estimator = make(name)
    recording = next(r for r in recordings if not lacking(estimator.needs, r.instruments))
    if find(name).reference:
        estimator.reveal(recording)
    estimator.reset(recording.start, recording.instruments)
    packets = list(recording.steps())
    numbers(estimator, packets[:8])
    copies = copy.deepcopy(estimator), pickle.loads(pickle.dumps(estimator))
    expected, smoothed = numbers(estimator, packets[8:]), trajectory(estimator)
    for copied in copies:
        np.testing.assert_array_equal(numbers(copied, packets[8:]), expected)
        np.testing.assert_array_equal(trajectory(copied), smoothed)


@pytest.mark.parametrize("name", GTSAM)
def test_a_row_with_a_graph_of_gtsam_is_copied_before_the_run_and_says_so_in_it(name, recordings):
    estimator = make(name)
    copied = pickle.loads(pickle.dumps(copy.deepcopy(estimator)))
    packets = list(recordings[0].steps())
    for row in (estimator, copied):
        row.reset(recordings[0].start, recordings[0].instruments)
    np.testing.assert_array_equal(numbers(copied, packets), numbers(estimator, packets))
    for way in (copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match=f"{name}: a graph of GTSAM can be neither copied nor pickled; do so"):
            way(estimator)


TASKS = ["-Tuning", "-Detection", "-Correction", "-Guidance"]
FORMS = {"open loop": ("", {}), "closed loop": ("", {"closed_loop": True}), **{task[1:]: (task, {}) for task in TASKS}}


def played(env, actions):
    """What the steps give, one list for each."""
    return [list(env.step(action)[:4]) for action in actions]


@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
@pytest.mark.parametrize("form", FORMS)
def test_a_copy_goes_on_as_the_environment_itself(form, vector):
    """In the middle of a block of steps, and beyond its end: a block of a closed loop has 64 steps."""
    task, options = FORMS[form]
    name = f"simnav/AuvSurvey{task}-v1"
    if task in TASKS[:3] and vector:
        options = {**options, "steps": 90}  # the vector form prepares all of them
    if vector:
        env = gymnasium.make_vec(name, num_envs=2, vectorization_mode="vector_entry_point", **options)
    else:
        env = gymnasium.make(name, **options)
    env.reset(seed=3)
    env.action_space.seed(1)
    played(env, [env.action_space.sample() for _ in range(5)])
    copies = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    actions = [env.action_space.sample() for _ in range(70)]
    expected = played(env, actions)
    for copied in copies:
        np.testing.assert_equal(played(copied, actions), expected)


def test_the_measurements_are_there_in_the_copy_of_a_closed_loop():
    env = gymnasium.make("simnav/AuvSurvey-v1", closed_loop=True)
    env.reset(seed=3)
    env.action_space.seed(1)
    copied = copy.deepcopy(env)
    seen = set()
    for _ in range(20):
        observation, *_ = copied.step(env.action_space.sample())
        seen |= {name for name, part in observation.items() if name != "interval" and part["valid"].any()}
    assert seen == set(observation) - {"interval"}
