"""Estimators and an instrument of a third party, whose kind brings its own observation: filters, points, graphs."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from simnav.estimator import find, make, names
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_chain import InertialChain
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.models.nine_state import NineStateModel
from simnav.kinds import KINDS
from simnav.recording import Recording
from simnav.scenario import load, parse
from simnav.scoring import score
from simnav.sensors import GnssPosition, register_instrument
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Measurement
from tests.cases.derivatives import innovation

#: Steps of the finite differences: position, velocity, attitude, biases, calibration.
STEPS = np.concatenate([np.repeat([1.0, 1e-2, 1e-5, 1e-5, 1e-3], 3), np.full(2, 1e-3)])


@pytest.fixture
def lagoon(plugins):
    """The scenario of the plug-in files, with a beacon that has a bias."""
    text = (plugins / "lagoon.toml").read_text()
    text = text.replace(
        "sigma_bearing_deg = 1.0", "sigma_bearing_deg = 1.0\nbias_range_m = 0.3\nbias_bearing_deg = 0.5"
    )
    return parse(text, folder=plugins)


@pytest.fixture
def recording(lagoon) -> Recording:
    return record(lagoon.model_copy(update={"faults": ()}), 2)


def tilted(model: InertialModel, recording: Recording) -> Measurement:
    """Begin a model with a heavy roll and pitch; a measurement of the beacon near the state."""
    start = replace(recording.start, attitude=np.array([0.3, -0.2, 2.5]))
    covariance = model.begin(start, recording.instruments)
    packet = next(recording.steps())
    model.load(packet.imu)
    model.propagate(covariance, 1.0)
    model.calibration += 0.01
    stream = recording.data.aids["transponder"]
    return Measurement(1.0, "transponder", "beacon", stream.value[0])


def test_the_model_has_the_jacobian_of_the_file_and_of_the_bias(recording):
    model = InertialModel()
    m = tilted(model, recording)
    assert model.size == len(STEPS)
    jacobian = model.measure(m).jacobian
    numeric = np.empty_like(jacobian)
    for k, h in enumerate(STEPS):
        e = np.zeros(model.size)
        e[k] = h
        numeric[:, k] = (innovation(model, m, -e) - innovation(model, m, e)) / (2.0 * h)
    # The file leaves out that metres per radian change over the distance to the beacon: 200 m of the Earth's radius.
    np.testing.assert_allclose(jacobian, numeric, atol=1e-4, rtol=1e-4)
    assert np.array_equal(jacobian[:, 15:], np.eye(2))


def test_nine_states_have_nine_columns(recording):
    model = NineStateModel()
    assert model.measure(tilted(model, recording)).jacobian.shape == (2, 9)


def test_points_are_the_model_s_own_prediction_at_each(recording):
    model = InertialPoints()
    m = tilted(model, recording)
    rng = np.random.default_rng(3)
    scale = np.concatenate([np.repeat([20.0, 0.5, 0.2, 1e-4, 1e-2], 3), [0.5, 0.05]])
    errors = scale * rng.standard_normal((20, model.size))
    expected = [innovation(model, m, np.zeros(model.size)) - innovation(model, m, e) for e in errors]
    assert model.observe_points(m, errors) == pytest.approx(np.array(expected), abs=1e-6)
    linear = errors @ model.measure(m).jacobian.T
    assert np.abs(linear - expected).max() > 0.05  # they are far enough for the difference to matter


def test_a_chain_linearises_them_beside_its_own(recording):
    chain = InertialChain(InertialModel())
    chain.begin(recording.start, recording.instruments)
    for packet, _ in zip(recording.steps(), range(5)):
        chain.load(packet.imu)
        chain.propagate(packet.time)
        chain.extend()
        for m in packet.aids:
            chain.attach([m], chain.nominal_noise(m)[None])
    chain.linearise_motion()
    chain.linearise_aids()
    assert {chain.names[i] for i in chain.aids["instrument"]} == {"depth", "transponder"}
    before = {c: chain.aids[c].copy() for c in ("residual", "jacobian")}
    for i in (-2, -1):  # those of the newest node, where the front still is
        name, d = chain.names[chain.aids["instrument"][i]], chain.aids["components"][i]
        value = chain.aids["value"][i, :d].copy()
        linearised = chain.front.measure(Measurement(chain.time, name, recording.instruments[name].kind, value))
        assert before["residual"][i, :d] == pytest.approx(linearised.innovation, abs=1e-9)
        assert before["jacobian"][i, :d] == pytest.approx(linearised.jacobian, abs=1e-12)
        assert not before["residual"][i, d:].any()
        assert not before["jacobian"][i, d:].any()
    step = np.zeros((len(chain.nodes), chain.size))
    step[:, :9] = 1e-3
    chain.retract(step)
    chain.linearise_aids()
    predicted = np.einsum("ijk,k->ij", before["jacobian"], step[0])
    assert chain.aids["residual"] == pytest.approx(before["residual"] - predicted, abs=1e-5)


def nees(trial, recording) -> float:
    return score(trial, recording)["nees_horizontal"]


def test_filters_points_graphs_and_the_oracle_agree_and_are_consistent(recording):
    trials = {name: run_trial(make(name), recording) for name in ("ekf", "ukf", "sw-fgo", "oracle", "inertial")}
    assert {t.status for t in trials.values()} == {"ok"}
    rmse = {name: score(t, recording)["horizontal_rmse"] for name, t in trials.items()}
    assert rmse["oracle"] == pytest.approx(rmse["ekf"], rel=0.1)  # there is no fault to be told of
    assert rmse["ukf"] == pytest.approx(rmse["ekf"], rel=0.05)
    assert rmse["sw-fgo"] == pytest.approx(rmse["ekf"], rel=0.3)
    assert rmse["ekf"] < 3.0 < rmse["inertial"]
    assert all(0.2 < nees(trials[name], recording) < 2.0 for name in ("ekf", "ukf", "sw-fgo"))


def test_the_oracle_is_told_of_the_fault_of_a_third_party(lagoon):
    recording = record(lagoon, 2)
    ekf, oracle, huber = (run_trial(make(name), recording) for name in ("ekf", "oracle", "huber-fgo"))
    touched = recording.data.aids["transponder"].faults != 0
    assert touched.sum() > 5
    assert score(oracle, recording)["horizontal_rmse"] < 0.8 * score(ekf, recording)["horizontal_rmse"]
    assert nees(oracle, recording) < 3.0 < nees(ekf, recording)
    assert score(huber, recording)["horizontal_rmse"] < score(ekf, recording)["horizontal_rmse"]


def test_every_estimator_meets_the_kind_and_runs_or_says_what_it_needs(lagoon):
    recording = record(lagoon.model_copy(update={"duration": 8.0, "faults": ()}), 1)
    trials = [run_trial(make(name), recording) for name in names() if not find(name).slow]
    failed = {t.estimator: t.reason for t in trials if t.failed}
    assert not failed
    assert sum(t.status == "ok" for t in trials) > 20


def test_an_observation_of_the_wrong_shape_is_named(plugins, tmp_path):
    for name in ("beacon.py", "echo.py", "lagoon.toml"):
        (tmp_path / name).write_text((plugins / name).read_text().replace("np.zeros((2, 9))", "np.zeros((2, 10))"))
    recording = record(load(tmp_path / "lagoon.toml").model_copy(update={"duration": 2.0, "faults": ()}), 1)
    trial = run_trial(make("ekf"), recording)
    assert trial.status == "error"
    assert "kind 'beacon' (observe() in beacon.py, line 20), for the instrument 'transponder', should" in trial.reason
    assert "return a reading of shape (2,) and its Jacobian of shape (2, 9)" in trial.reason
    assert "not shapes (2,) and (2, 10)" in trial.reason


@pytest.mark.parametrize(
    ("new", "message"),
    [
        ("raise RuntimeError('boom')", "raised RuntimeError: boom"),
        ("return reading * np.nan, jacobian", "should return finite numbers, or None where the state has no reading"),
        ("return reading, jacobian + np.inf", "should return finite numbers, or None where the state has no reading"),
    ],
)
def test_an_observation_that_fails_is_named(plugins, tmp_path, new, message):
    for name in ("beacon.py", "echo.py", "lagoon.toml"):
        (tmp_path / name).write_text((plugins / name).read_text().replace("return reading, jacobian", new))
    recording = record(load(tmp_path / "lagoon.toml").model_copy(update={"duration": 2.0, "faults": ()}), 1)
    for estimator in ("ekf", "ukf"):
        trial = run_trial(make(estimator), recording)
        assert trial.status == "error"
        assert "(observe() in beacon.py, line 20), for the instrument 'transponder'" in trial.reason
        assert message in trial.reason


def test_a_kind_that_names_a_compiled_equation_is_as_good_as_ours(plugins):
    class Usbl(GnssPosition):
        """A position from an acoustic array."""

        kind: Literal["usbl"] = "usbl"

    register_instrument(KINDS["gnss_position"], example=GnssPosition.example)(Usbl)
    text = (plugins / "lagoon.toml").read_text().partition("[instruments.transponder]")[0]
    text = text.replace("duration_s = 120", "duration_s = 20")
    estimates = []
    for kind in ("gnss_position", "usbl"):
        table = f'[instruments.fix]\nkind = "{kind}"\nsigma_m = 2.0\nlever_arm_m = [1, 0, -2]\n'
        recording = record(parse(text + table, folder=plugins), 1)
        trials = [run_trial(make(name), recording) for name in ("ekf", "sw-fgo", "gtsam-isam2")]
        estimates.append([(t.status, t.position.tobytes(), t.covariance.tobytes()) for t in trials])
    assert estimates[0] == estimates[1]
    assert {status for status, *_ in estimates[0]} == {"ok"}
