"""Lever arms that were measured badly are states: in the simulator, and in every solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.blocks import LEVER_ARM
from simnav.estimator import make
from simnav.estimators.models.channels import by_channel, reading_of
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.lever_arms import with_lever_arms
from simnav.estimators.models.measurement_functions import MeasurementFunction
from simnav.estimators.models.measurements import State
from simnav.estimators.models.truth_linearised import TruthLinearisedModel
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.geometry.rotation import dcm_from_rpy
from simnav.recording import Recording
from simnav.scenario import Scenario, parse
from simnav.scoring import errors
from simnav.source import record
from simnav.trial import Trial, run_trial
from simnav.types import Instruments
from tests.cases.raw_gnss import raw_gnss

TEXT = """name = "arms"
version = 1
title = "lever arms that were measured badly"
duration_s = 140.0
water_depth_m = 60.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
speed_m_s = 4.0
[vessel]
kind = "uuv"
[[manoeuvre]]
kind = "turn"
angle_deg = 300.0
rate_deg_s = 3.0
[sea]
significant_height_m = 1.5
peak_period_s = 6.0
[instruments.imu]
rate_hz = 10.0
gyroscope = { bias_deg_h = 1.0, random_walk_deg_sqrt_h = 0.05 }
accelerometer = { bias_ug = 200.0, random_walk_ug_sqrt_hz = 50.0 }
[instruments.gnss]
kind = "gnss_position"
sigma_m = 0.2
lever_arm_m = [4.0, 1.0, -8.0]
lever_arm_sigma_m = 2.0
[instruments.speed]
kind = "gnss_velocity"
sigma_m_s = 0.1
rate_hz = 0.2
lever_arm_sigma_m = 1.0
[instruments.dvl]
sigma_m_s = 0.02
scale_percent = 0.5
misalignment_deg = 0.3
lever_arm_m = [1.0, 0.0, 2.0]
lever_arm_sigma_m = [1.5, 1.0, 0.5]
[instruments.gyrocompass]
sigma_deg = 0.3
[instruments.depth]
sigma_m = 0.1
lever_arm_sigma_m = 0.5
[instruments.terrain_fix]
sigma_m = 5.0
rate_hz = 0.05
lever_arm_sigma_m = 1.0
"""
NAMES = ("gnss", "speed", "dvl", "depth", "terrain_fix")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return parse(TEXT)


@pytest.fixture(scope="module")
def recording(scenario: Scenario) -> Recording:
    return record(scenario, 1)


def test_the_simulator_mounts_the_instrument_somewhere_else(scenario: Scenario):
    spec = scenario.instruments["dvl"]
    arms = np.array([spec.build("dvl", seed).lever_arm for seed in range(400)])
    np.testing.assert_allclose(arms.mean(0), [1.0, 0.0, 2.0], atol=0.25)
    np.testing.assert_allclose(arms.std(0), [1.5, 1.0, 0.5], rtol=0.15)
    ideal = spec.ideal()
    assert ideal.blocks() == ()
    np.testing.assert_array_equal(ideal.build("dvl", 1).lever_arm, spec.lever_arm)
    np.testing.assert_array_equal(spec.datasheet("dvl").lever_arm, spec.lever_arm)


@pytest.mark.parametrize("name", NAMES)
def test_the_jacobians_are_those_of_differences(recording: Recording, name: str):
    sheet = with_lever_arms(recording.instruments)[name]
    assert sheet.blocks[0].name == LEVER_ARM
    places = dict(zip((b.name for b in sheet.blocks), np.cumsum([0, *(b.size for b in sheet.blocks)]).tolist()))
    own, values = MeasurementFunction(sheet, places), np.array([0.4, -0.3, 0.2, 0.01, 0.002, -0.001, 0.003])
    values = values[: sum(b.size for b in sheet.blocks)]
    dcm, zero = dcm_from_rpy(np.array([0.1, -0.05, 2.0])), np.zeros(3)
    position, velocity, rate = np.array([0.9, 0.1, -5.0]), np.array([3.0, -2.0, 0.3]), np.array([0.2, -0.1, 0.3])
    point = own.point(0.0, State(position, velocity, dcm, rate, zero, values))
    _, given = own.predict(point)
    bare = MeasurementFunction(sheet, places)
    bare._observation = lambda p, s: own.read(p)
    _, slopes = bare.predict(point)
    np.testing.assert_allclose(given, slopes, atol=0.02 * np.abs(slopes).max())  # without terms of second order
    small = [b for b in sheet.blocks if b.name != LEVER_ARM]
    if not small:
        np.testing.assert_allclose(given, slopes, atol=1e-4)


def nees(trial: Trial, recording: Recording) -> tuple[float, float]:
    """Horizontal RMSE [m] and mean normalised error squared of a component."""
    assert trial.status == "ok", trial.reason
    e, P = errors(trial, recording)[20:, :2], trial.covariance[20:, :2, :2]
    squared = np.einsum("ki,kij,kj->k", e, np.linalg.inv(P), e)
    return float(np.sqrt(np.mean(e**2))), float(np.mean(squared)) / 2.0


def test_filters_windows_and_smoothers_find_them(scenario: Scenario, recording: Recording):
    rows = ("ekf", "ukf", "iekf", "ekf-rts", "sw-fgo", "oracle", "ship-ekf")
    trials = {name: run_trial(make(name), recording) for name in rows}
    scores = {name: nees(trial, recording) for name, trial in trials.items()}
    for name in ("ukf", "iekf", "sw-fgo"):
        assert scores[name][0] == pytest.approx(scores["ekf"][0], rel=0.05), name
    assert scores["ekf"][0] < 0.4  # the antenna is 2 m off, one sigma
    for name, trial in trials.items():
        assert 0.1 < scores[name][1] < 4.0, name
        known = slice(0, 2 if name == "ship-ekf" else 3)  # a ship is taken for level, at the height of the start
        for instrument in ("gnss", "dvl"):
            arm = scenario.instruments[instrument].build(instrument, recording.seed).lever_arm
            off = arm - recording.instruments[instrument].lever_arm
            estimate = trial.diagnostics[f"state.{instrument}.lever_arm"][-1]
            sigma = trial.diagnostics[f"sigma.{instrument}.lever_arm"][-1]
            assert np.all((np.abs(estimate - off) < 4.0 * sigma)[known]), (name, instrument)
    assert np.all(trials["ekf"].diagnostics["sigma.gnss.lever_arm"][-1][:2] < 0.3)


def test_without_states_it_counts_as_noise(recording: Recording):
    model = InertialModel(calibrate=False)
    told = nees(run_trial(KalmanEstimator(model), recording), recording)[1]
    sheets = [replace(sheet, blocks=()) for sheet in recording.instruments.values()]
    wrong = replace(recording, instruments=Instruments(sheets, recording.instruments.imu, recording.instruments.step))
    assert told < 0.2 * nees(run_trial(KalmanEstimator(model), wrong), recording)[1]


def test_the_row_with_23_states_takes_the_figure_of_the_datasheet(recording: Recording):
    estimator = make("ekf-23")
    estimator.reset(recording.start, recording.instruments)
    np.testing.assert_allclose(np.sqrt(np.diag(estimator.solver.covariance)[18:21]), [1.5, 1.0, 0.5])


def test_without_such_figures_nothing_changes(recording: Recording):
    plain = Instruments([replace(s, blocks=()) for s in recording.instruments.values()], recording.instruments.imu)
    assert with_lever_arms(plain) is plain


@pytest.mark.parametrize(("scenario", "source"), [(parse(TEXT), "dvl"), (raw_gnss(), "gnss:E30")], ids=["dvl", "raw"])
def test_the_oracle_has_the_swing_by_the_bias_of_the_gyroscopes(scenario, source):
    """Its nominal rate is as measured: a bias of the rate moves the innovation by the Jacobian times the bias."""
    recording = record(scenario.model_copy(update={"duration": 2.0}), 1)
    model = TruthLinearisedModel(recording.data.truth)
    model.begin(recording.start, by_channel(recording.instruments))
    stream = recording.data.aids[source.partition(":")[0]]
    reading = reading_of(next(m for m in stream.measurements() if source.endswith(m.channel)))
    before, bias = model.measure(reading), np.array([0.01, -0.02, 0.03])
    model.nominal.raw_rate += bias
    moved = model.measure(reading).innovation - before.innovation
    assert abs(moved).max() > 0.01
    np.testing.assert_allclose(moved, before.jacobian[:, 9:12] @ bias, rtol=1e-6, atol=1e-9)
