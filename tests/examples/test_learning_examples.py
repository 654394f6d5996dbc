"""The examples learn: a few steps of each, and what they learn beats the plain filter where it was record the truth."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from simnav.environment.seeds import FIRST_TRAINING_SEED
from simnav.estimators.learning.policy import Policy, PolicyError
from simnav.estimators.learning.policy_estimator import PolicyEstimator
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))

    def get(name):
        spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        return module

    return get


def runs_as_an_estimator(policy, path):
    policy.save(path)
    recording = record(load("gnss-noise-step").model_copy(update={"duration": 20.0, "faults": ()}), 1)
    trial = run_trial(PolicyEstimator(str(path)), recording)
    assert trial.status == "ok", trial.reason
    return Policy.load(path)


def test_the_cross_entropy_method_learns(example, tmp_path):
    module = example("cross_entropy")
    policy, curve = module.train(generations=6, population=32, repeats=1, voyages=1, length=150, seed=1)
    assert max(curve[3:]) > curve[0] + 5.0  # one and the same voyage: its return only needs to rise
    again = runs_as_an_estimator(policy, tmp_path / "policy.npz")
    assert again.trained_on["first_seed"] == FIRST_TRAINING_SEED
    assert again.trained_on["steps"] == 6 * 32 * 150
    assert len([line for line in (EXAMPLES / "cross_entropy.py").read_text().splitlines() if line.strip()]) < 100


@pytest.mark.parametrize(
    ("task", "length", "rise"), [("Detection", 160, 10.0), ("Correction", 160, -np.inf), ("Guidance", 80, 50.0)]
)  # of the return on voyages that are not seen; a good correction takes longer to find
def test_the_cross_entropy_method_on_other_tasks(example, tmp_path, task, length, rise):
    curve, agent = example("learning_curve"), example("cross_entropy")
    options = {"generations": 5, "population": 16, "repeats": 1, "voyages": 5, "length": length}
    steps, found = curve.curves(agent, [1], [1, 2, 3], tmp_path, task, **options)
    assert steps.tolist() == [0, 5 * 16 * length]
    assert found[0, 1] > found[0, 0] + rise
    assert found[0, 0] != found[0, 1]
    policy = Policy.load(tmp_path / f"cross_entropy-{task}-1.npz")
    assert policy.task == task
    assert policy.trained_on["first_seed"] == FIRST_TRAINING_SEED
    with pytest.raises(ValueError, match="for training, not for scoring"):
        curve.curves(agent, [2], [FIRST_TRAINING_SEED + 9], tmp_path, task, **(options | {"length": 5}))
    if task == "Guidance":
        with pytest.raises(PolicyError, match=r"a policy of Guidance steers a vessel and estimates nothing"):
            PolicyEstimator(str(tmp_path / "cross_entropy-Guidance-1.npz"))
    else:
        runs_as_an_estimator(policy, tmp_path / "policy.npz")


def test_one_policy_for_several_troubles(example, tmp_path):
    """It learns rules by role, which are the same numbers whatever instruments a family has."""
    example("cross_entropy")
    module = example("several_troubles")
    families, gains = ("training-gnss-faults", "training-ships"), []
    options = {"generations": 4, "population": 16, "voyages": 1, "length": 120, "seed": 2}
    policy, curve = module.train(families, after=lambda generation, gain, p: gains.append(gain), **options)
    assert curve == gains
    assert curve[0] == 0.0 < curve[-1]  # it begins as the plain filter
    assert policy.trained_on["voyages"] == 2
    path = tmp_path / "policy.npz"
    policy.save(path)
    for scenario in ("training-gnss-faults", "training-ships"):
        run = record(load(scenario).model_copy(update={"duration": 20.0, "faults": ()}), 3)
        trial = run_trial(PolicyEstimator(str(path)), run)
        assert trial.status == "ok", trial.reason


def test_learning_curves_over_training_seeds(example, tmp_path):
    curve, agent = example("learning_curve"), example("cross_entropy")
    options = {"generations": 5, "population": 8, "repeats": 1, "voyages": 1, "length": 20}
    steps, found = curve.curves(agent, range(2), [1, 2], tmp_path / "kept", **options)
    assert steps.tolist() == [0, 5 * 8 * 20]
    assert found.shape == (2, 2)
    assert (found[:, 0] == 0.0).all()
    agent.train = None  # what is there is not trained again
    np.testing.assert_array_equal(curve.curves(agent, range(2), [1, 2], tmp_path / "kept")[1], found)
    assert Policy.load(tmp_path / "kept" / "cross_entropy-Tuning-1.npz").trained_on["seed"] == 1
    two = np.array([1.0, 2.0]), np.array([[0.0, 1.0], [1.0, 3.0]])
    curve.draw({"one": two, "other": two}, "two seeds", tmp_path / "curve.png")
    assert (tmp_path / "curve.png").stat().st_size > 1000


def test_stable_baselines(example, tmp_path):
    pytest.importorskip("stable_baselines3", reason="the extra rl is not installed")
    module = example("stable_baselines")
    seen = []
    options = {"num_envs": 4, "same": 2, "voyages": 2, "length": 20, "parts": 3}
    policy = module.train(steps=480, after=lambda done, p: seen.append((done, p)), **options)
    assert [done for done, _ in seen] == [160, 320, 480]
    assert [p.trained_on["steps"] for _, p in seen] == [160, 320, 480]
    first, last = (p(np.ones(24)) for p in (seen[0][1], seen[-1][1]))
    assert np.abs(first - last).max() > 1e-4
    again = runs_as_an_estimator(policy, tmp_path / "policy.npz")
    np.testing.assert_array_equal(again(np.ones(24)), last)
    assert set(again.trained_on["versions"]) == {"simnav", "stable-baselines3", "torch", "numpy"}


def test_a_policy_in_plain_arrays_is_the_network_of_the_library(example):
    """With its normalisation of observations, after some of them; it begins as the plain filter."""
    pytest.importorskip("stable_baselines3", reason="the extra rl is not installed")
    module = example("stable_baselines")
    envs, model = module.made(num_envs=2, same=2, voyages=1, length=20)
    observation = np.random.default_rng(1).normal(size=(50, 24)).astype(np.float32)
    record = module.record_of_training(module.FAMILY, 1)
    assert np.abs(module.policy_of(model, envs, record)(observation)).max() < 0.1
    model.learn(80)
    normalisation = model.get_vec_normalize_env()
    assert normalisation.obs_rms.var.max() < 0.5  # it has seen observations, not only its start at 1
    actions = model.predict(normalisation.normalize_obs(observation), deterministic=True)[0]
    policy = module.policy_of(model, envs, record)
    assert np.abs(actions).max() > 0.01
    np.testing.assert_allclose(policy(observation)[:, :1], actions, atol=1e-5)
    assert (policy(observation)[:, 1] == 0.0).all()  # the process noise


def test_a_recurrent_policy(example):
    pytest.importorskip("sb3_contrib", reason="the extra rl is not installed")
    example("stable_baselines")
    module = example("recurrent_policy")
    seen = []
    options = {"num_envs": 4, "same": 2, "voyages": 2, "length": 20, "cells": 4}
    model = module.train(steps=160, parts=2, after=lambda done, model: seen.append(done), **options)
    assert seen == [80, 160]
    act, observation = module.agent_of(model, 3), np.ones((3, 24), np.float32)
    first, second = act(observation), act(observation)
    assert first.shape == (3, 2)
    assert (first[:, 1] == 0.0).all()
    assert np.abs(first - second).max() > 0.0  # it remembers
