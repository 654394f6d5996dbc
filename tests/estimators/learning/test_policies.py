"""A policy file fits or is refused by name; a policy as an estimator is the environment's filter."""

from __future__ import annotations

import numpy as np
import pytest

import simnav
from simnav.environment.seeds import FIRST_TRAINING_SEED, require_disjoint, training_seed
from simnav.estimators.learning import policy as policies
from simnav.estimators.learning.environment import FilterTaskEnv
from simnav.estimators.learning.features import observation_size
from simnav.estimators.learning.policy import Policy, PolicyError, record_of_training
from simnav.estimators.learning.policy_estimator import PolicyEstimator
from simnav.scenario import load
from simnav.scoring.navigation_error import errors, horizontal
from simnav.source import record
from simnav.trial import run_trial

TOLD = record_of_training("training-gnss-faults", 4, algorithm="none: drawn at random")


def made(task="Tuning", size=None, actions=None, **changes):
    rng = np.random.default_rng(0)
    size = size or 8 + 4 + 12
    actions = actions or {"Correction": 7, "Detection": 1}.get(task, 2)
    layers = [
        (rng.normal(0, 0.3, (6, size)), rng.normal(0, 0.3, 6)),
        (rng.normal(0, 0.3, (actions, 6)), rng.normal(0, 0.3, actions)),
    ]
    told = {"task": task, "kinds": ["gnss_position"], "most": 1, "instruments": "fixes", "trained_on": TOLD}
    return Policy(layers, **(told | changes))


@pytest.mark.parametrize("task", ["Tuning", "Detection", "Correction"])
def test_a_policy_as_an_estimator_is_the_filter_of_the_environment(tmp_path, task):
    made(task).save(tmp_path / "policy.npz")
    estimator = PolicyEstimator(str(tmp_path / "policy.npz"))
    scenario = load("training-gnss-faults").drawn(3).model_copy(update={"duration": 40.0, "faults": ()})
    recording = record(scenario, 3)
    trial = run_trial(estimator, recording)
    assert trial.status == "ok", trial.reason
    alone = horizontal(errors(trial, recording))
    env = FilterTaskEnv(scenario, task, instruments="fixes", reveal_truth=True)
    observation, _ = env.reset(seed=3)
    seen, over = [], False
    while not over:
        observation, _, _, over, info = env.step(estimator.policy(observation))
        seen.append(info["error"])
    assert np.abs(alone - seen).max() < 1e-5 * (1.0 + alone.max())
    if task == "Tuning":
        assert "sigma_north.gnss" in trial.diagnostics
    if task == "Detection":
        assert len({round(e, 9) for e in seen}) > 10


def test_a_policy_comes_back_from_its_file(tmp_path):
    policy = made()
    policy.save(tmp_path / "policy.npz")
    again = Policy.load(tmp_path / "policy.npz")
    observation = np.linspace(-1.0, 1.0, 24)
    np.testing.assert_array_equal(policy(observation), again(observation))
    assert again.trained_on == TOLD


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"task": "Turning"}, "it is for the task 'Turning'; there are: Tuning, Detection, Correction"),
        ({"version": 7}, "it was trained on version 7 of Tuning, but this is version 1; train it again"),
        ({"size": 30}, "it takes 30 numbers and gives 2; Tuning with gnss_position has 24 and 2"),
        (
            {"task": "Correction", "actions": 3},
            "it takes 24 numbers and gives 3; Correction with gnss_position has 24 and 7",
        ),
        ({"trained_on": {"scenario": "training-gnss-faults"}}, "should state first_seed, voyages and streams"),
        ({"trained_on": {**TOLD, "streams": [5, 4]}}, "should state first_seed, voyages and streams"),
        ({"mean": np.zeros(3)}, "mean and deviation should be of the observation's length"),
        ({"deviation": np.zeros(24)}, "its numbers should be finite, and the deviations positive"),
    ],
)
def test_a_policy_that_does_not_fit_is_refused(change, message):
    with pytest.raises(PolicyError, match=message):
        made(**change)


def test_a_file_of_another_task_version_or_shape_is_named(tmp_path, monkeypatch):
    path = tmp_path / "policy.npz"
    made(kinds=["terrain_fix"]).save(path)
    recording = record(load("gnss-noise-step").model_copy(update={"duration": 5.0, "faults": ()}), 1)
    trial = run_trial(PolicyEstimator(str(path)), recording)
    assert trial.status == "unsuitable"
    assert "terrain_fix" in trial.reason
    path.write_bytes(b"nothing of the kind")
    with pytest.raises(PolicyError, match=r"policy\.npz: not a policy of simnav, or damaged"):
        Policy.load(path)
    monkeypatch.setattr(policies, "FORMAT", 9)
    made().save(path)
    monkeypatch.undo()
    with pytest.raises(PolicyError, match=r"policy\.npz: written in format 9 of policies; this version reads 2"):
        PolicyEstimator(str(path))


def test_a_policy_sees_the_first_receiver_and_leaves_the_others_alone(tmp_path):
    """Needs say what is enough: a second receiver, or a faster one, is no reason to refuse a run."""
    made().save(tmp_path / "policy.npz")
    scenario = load("gnss-noise-step")
    gnss = scenario.instruments["gnss"]
    second = {**scenario.instruments, "second": gnss, "gnss": gnss.model_copy(update={"rate": 4.0})}
    recording = record(scenario.model_copy(update={"duration": 8.0, "faults": (), "instruments": second}), 1)
    trial = run_trial(PolicyEstimator(str(tmp_path / "policy.npz")), recording)
    assert trial.status == "ok", trial.reason
    assert "sigma_north.gnss" in trial.diagnostics
    assert "sigma_north.second" not in trial.diagnostics


def test_a_policy_for_several_kinds_is_asked_about_those_that_are_there(tmp_path):
    size = observation_size(2, 1)
    weights = np.zeros((3, size)), np.array([0.5, -0.5, 0.0])
    about = {"task": "Tuning", "kinds": ["gnss_position", "magnetic_compass"], "most": 1, "instruments": "all"}
    Policy([weights], trained_on=TOLD, **about).save(tmp_path / "policy.npz")
    recording = record(load("gnss-noise-step").model_copy(update={"duration": 8.0, "faults": ()}), 1)
    assert not recording.instruments.of_kind("magnetic_compass")
    trial = run_trial(PolicyEstimator(str(tmp_path / "policy.npz")), recording)
    assert trial.status == "ok", trial.reason
    sigma = trial.diagnostics["sigma_north.gnss"] / recording.instruments["gnss"].sigma[0]
    np.testing.assert_allclose(sigma, np.sqrt(30.0))
    assert not [name for name in trial.diagnostics if "compass" in name]


def test_layers_that_do_not_follow_each_other():
    with pytest.raises(PolicyError, match=r"layer 1 has a weight of shape \(2, 5\).*should take 6 numbers"):
        Policy(
            [(np.zeros((6, 24)), np.zeros(6)), (np.zeros((2, 5)), np.zeros(2))], task="Tuning",
            kinds=["gnss_position"], most=1, instruments="fixes", trained_on=TOLD,
        )  # fmt: skip


def test_training_and_scoring_never_meet():
    policy = made()
    policy.require_unseen(range(1000))
    require_disjoint([training_seed(i) for i in range(5)], range(5))
    with pytest.raises(ValueError, match=r"seeds \[1099511627777\] are trained on and scored on"):
        policy.require_unseen([1, FIRST_TRAINING_SEED + 1])
    with pytest.raises(ValueError, match="they are for scoring, not for training"):
        require_disjoint([5], [6])
    with pytest.raises(ValueError, match="they are for training, not for scoring"):
        require_disjoint([training_seed(0)], [training_seed(1)])
    with pytest.raises(ValueError, match="numbered from 0, not -1"):
        training_seed(-1)


def test_the_policy_that_comes_along_says_what_it_learned_from():
    estimator = simnav.make("policy-ekf")
    told = estimator.policy.trained_on
    assert load(told["scenario"]).training
    assert told["first_seed"] == FIRST_TRAINING_SEED
    estimator.policy.require_unseen(range(1000))
    words = " ".join(type(estimator).__doc__.split())
    assert f"on {told['voyages']} training voyages of ``{told['scenario'].rpartition('-v')[0]}``" in words
    assert f"{told['steps']:,} steps".replace(",", " ") in words
    assert "simnav" in told["versions"]
