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

ROWS = [name for name in names() if not name.startswith("gtsam-")]  # a graph of GTSAM cannot be copied


@pytest.fixture(scope="module")
def recordings():
    return [record(load(name).model_copy(update={"duration": 20.0}), 3) for name in ("auv-survey", "ship-field")]


def numbers(estimator, packets):
    estimates = [estimator.update(packet) for packet in packets]
    parts = [(e.position, e.velocity, e.attitude, e.covariance) for e in estimates]
    return np.concatenate([np.ravel(part) for four in parts for part in four if part is not None])


@pytest.mark.parametrize("name", ROWS)
def test_a_copy_goes_on_as_the_row_itself(name, recordings):
    estimator = make(name)
    recording = next(r for r in recordings if not lacking(estimator.needs, r.instruments))
    if find(name).reference:
        estimator.reveal(recording)
    estimator.reset(recording.start, recording.instruments)
    packets = list(recording.steps())
    numbers(estimator, packets[:8])
    copied, pickled = copy.deepcopy(estimator), pickle.loads(pickle.dumps(estimator))
    expected = numbers(estimator, packets[8:])
    np.testing.assert_array_equal(numbers(copied, packets[8:]), expected)
    np.testing.assert_array_equal(numbers(pickled, packets[8:]), expected)


@pytest.mark.parametrize("task", ["", "-Tuning", "-Detection", "-Correction", "-Guidance"])
def test_a_copy_goes_on_as_the_environment_itself(task):
    env = gymnasium.make(f"simnav/AuvSurvey{task}-v1")
    env.reset(seed=3)
    env.action_space.seed(1)
    for _ in range(5):
        env.step(env.action_space.sample())
    copied = copy.deepcopy(env)
    for action in [env.action_space.sample() for _ in range(20)]:
        (o, r, *_), (p, q, *_) = env.step(action), copied.step(action)
        np.testing.assert_equal(p, o)
        assert q == r
