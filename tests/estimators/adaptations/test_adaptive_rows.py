"""The adaptive rows as whole estimators: gross errors, a disturbed IMU, a paper's table, bad input.

What they cost on clean data is in `test_clean_cost.py`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import EstimatorError, UnsuitableScenario, find, make, names
from simnav.geometry.earth import displace
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Instruments

#: But for the one with states of a DVL.
ROWS = [name for name in names() if find(name).__module__ == "simnav.estimators.rows.adaptive" and name != "adkf-23"]
PAPER = [name for name in ROWS if name.endswith("-paper")]
DEFAULTS = [name for name in ROWS if name not in PAPER]
#: Rows that are to withstand gross errors; Sage-Husa and its kin estimate a noise that lasts.
ROBUST = ("adkf", "igg3", "huber-kf", "gated-ekf", "vb-akf", "mckf", "imm")


def sigma_rmse(trial, recording) -> np.ndarray:
    """Mao, Wang and Fu (2025), eq. 21: RMSE of the estimated sigma, north and east."""
    stream = recording.data.aids["gnss"]
    at = np.searchsorted(stream.time, trial.time + 1e-6) - 1
    found = np.stack([trial.diagnostics[f"sigma_{c}.gnss"] for c in ("north", "east")], axis=1)
    return np.sqrt(np.mean((found - stream.sigma[at, :2]) ** 2, axis=0))


@pytest.fixture(scope="module")
def noise_step():
    """Mean sigma RMSE (north, east) over seeds of the simulation of Mao, Wang and Fu (2025)."""
    rows = {name: [] for name in ("sage-husa", "sage-husa-paper", "iae", "iae-fixed", "imm")}
    for seed in range(5):
        recording = record(load("gnss-noise-step"), 40 + seed)
        for name, found in rows.items():
            found.append(sigma_rmse(run_trial(make(name), recording, keep_covariance=False), recording))
    return {name: np.mean(found, axis=0) for name, found in rows.items()}


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("iae", 1.5, 2.1), ("iae-fixed", 1.5, 2.1), ("sage-husa", 2.1, 2.8), ("sage-husa-paper", 3.3, 4.0)],
)
def test_table_2_of_paper_001(noise_step, name: str, low: float, high: float):
    """Printed, east and north: IAE 1.86, 1.65; Sage-Husa 3.65, 3.55 (not fading; a fading one: 2.4)."""
    assert np.all((low < noise_step[name]) & (noise_step[name] < high)), noise_step[name]


def test_levels_find_the_step_sooner_than_a_window(noise_step):
    assert noise_step["imm"].max() < noise_step["iae"].min()


@pytest.fixture(scope="module")
def spoilt(recording_of):
    """Recordings with a gross error of 15 to 60 m in every tenth fix from 20 s on."""
    recordings = []
    for seed in range(2):
        recording = recording_of(seed, 150.0)
        stream = recording.data.aids["gnss"]
        rng = np.random.default_rng(seed)
        hit = (rng.random(len(stream.time)) < 0.1) & (stream.time > 20.0)
        error = rng.uniform(15.0, 60.0, (len(stream.time), 3)) * rng.choice([-1.0, 1.0], (len(stream.time), 3))
        stream.value[hit] = displace(stream.value, error)[hit]
        recordings.append(recording)
    return recordings


@pytest.fixture(scope="module")
def spoilt_ekf(spoilt, run_over):
    return [run_over(make("ekf"), r)[0] for r in spoilt]


@pytest.mark.parametrize("name", ROBUST)
def test_gross_errors_hurt_a_robust_filter_less(spoilt, spoilt_ekf, run_over, name: str):
    for recording, plain in zip(spoilt, spoilt_ekf):
        errors, _ = run_over(make(name), recording)
        assert np.sqrt(np.mean(errors[20:, :3] ** 2)) < 0.75 * np.sqrt(np.mean(plain[20:, :3] ** 2))


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("imu", [True, False], ids=["inertial", "ship"])
def test_every_row_runs_on_both_models(recording_of, name: str, imu: bool):
    """Valid estimates (checked by the trial), sigmas reported; a second run of the same instance is the same."""
    recording = recording_of(3, 40.0) if imu else recording_of(3, 40.0, imu=None, sea=0.0)
    estimator = make(name)
    first, second = run_trial(estimator, recording), run_trial(estimator, recording)
    assert first.status == "ok", first.reason
    np.testing.assert_array_equal(first.position, second.position)
    sigma = first.diagnostics["sigma_north.gnss"]
    assert sigma.shape == (40,)
    assert np.all(sigma > 0.3)
    assert ("sigma_down.gnss" in first.diagnostics) is True


@pytest.mark.parametrize("name", [n for n in DEFAULTS if n != "fading-ekf"])
def test_a_disturbed_imu_does_not_lock_the_aids_out(recording_of, run_over, name: str):
    """0.3 m/s^2 on an accelerometer for 30 s, 300 times its datasheet: fixes and DVL disagree with the prediction."""
    recording = recording_of(4, 120.0)
    imu = recording.data.imu
    force = imu.specific_force.copy()
    force[(imu.time > 30.0) & (imu.time <= 60.0), 0] += 0.3
    recording = replace(recording, data=replace(recording.data, imu=replace(imu, specific_force=force)))
    errors, _ = run_over(make(name), recording)
    assert np.hypot(errors[100:, 0], errors[100:, 1]).max() < 15.0


def test_a_gate_lets_a_wrong_filter_come_back(recording_of, run_over):
    """A start 300 m off with a covariance of 2 m: no fix passes, and for ever without the way back."""
    recording = recording_of(5, 240.0)
    start = replace(recording.start, position=displace(recording.start.position, np.array([300.0, 0.0, 0.0])))
    recording = replace(recording, start=start)
    locked, _ = run_over(make("gated-ekf", patience=1e9), recording)
    back, _ = run_over(make("gated-ekf"), recording)
    assert abs(locked[-1, 0]) > 200.0
    assert abs(back[-1, 0]) < 30.0


@pytest.mark.parametrize("name", ROWS)
def test_instruments_that_are_not_enough(name: str):
    with pytest.raises(UnsuitableScenario, match="compass"):
        make(name).reset(None, Instruments())


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("sage-husa", {"fading": 1.5}, "fading = 1.5"),
        ("sage-husa", {"lowest": 0.0}, "lowest = 0"),
        ("iae", {"shortest": 30}, "shortest = 30 and longest = 20"),
        ("iae-fixed", {"forgetting": 0.0}, "forgetting = 0"),
        ("adkf", {"c0": 9.0}, "c0 = 9 and c1 = 8"),
        ("adkf", {"statistic": "mood"}, "mood"),
        ("igg3", {"k0": 9.0}, "k0 = 9 and k1 = 8"),
        ("huber-kf", {"k": 0.0}, "k = 0"),
        ("gated-ekf", {"probability": 1.0}, "probability = 1"),
        ("fading-ekf", {"memory": 0.0}, "memory = 0"),
        ("vb-akf", {"iterations": 0}, "iterations = 0"),
        ("mckf", {"bandwidth": -1.0}, "bandwidth = -1"),
    ],
)
def test_parameters_that_cannot_be(name: str, parameters: dict, message: str):
    with pytest.raises(EstimatorError, match=message):
        make(name, **parameters)


@pytest.mark.parametrize("name", DEFAULTS)
def test_absurd_and_noiseless_instruments(recording_of, name: str):
    """1e9, infinity and NaN are skipped; a datasheet that claims no noise at all divides by nothing."""
    recording = recording_of(6, 30.0)
    stream = recording.data.aids["gnss"]
    stream.value[5], stream.value[6], stream.value[7] = 1e9, np.inf, np.nan
    trial = run_trial(make(name), recording)
    assert trial.status == "ok", trial.reason
    assert trial.diagnostics["skipped"][-1] >= 3
    sheets = [
        replace(sheet, sigma=0.0 * sheet.sigma) if sheet.name == "compass" else sheet
        for sheet in recording.instruments.values()
    ]
    noiseless = replace(recording, instruments=Instruments(sheets, recording.instruments.imu, 1.0))
    trial = run_trial(make(name), noiseless)
    assert trial.status == "ok", trial.reason


def test_a_log_that_reads_zero_is_not_taken_for_a_wrong_motion():
    """Fixes and log fail together, for the log pulls the velocity down; the attitude stays what it was."""
    recording = record(load("training-voyages").with_values({"duration_s": 300.0}), 103)
    trials = [run_trial(make(name), recording) for name in ("ekf", "adkf")]
    plain, robust = (score(trial, recording, ["horizontal_rmse", "heading_rmse"]) for trial in trials)
    assert robust["horizontal_rmse"] < 0.5 * plain["horizontal_rmse"]
    assert robust["heading_rmse"] < 1.5 * plain["heading_rmse"]
