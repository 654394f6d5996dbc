"""The error model of a log: what was put in is found, intervals hold it, and what the log does not tell is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import simnav
from simnav.estimator import make
from simnav.geometry.earth import relative_position
from simnav.leaderboard.identification.assumption import Assumption, Parameter, with_all
from simnav.leaderboard.identification.choices import places
from simnav.leaderboard.identification.innovations import Likelihood
from simnav.leaderboard.identification.prediction import Predictions, widened
from simnav.leaderboard.identification.report import Identification, identify
from simnav.leaderboard.identification.scoring import log_likelihood, maximise
from simnav.leaderboard.identification.twin import twin_of
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.scenario.reading import parse
from simnav.source import record
from simnav.spec import SpecError
from simnav.trial import run_trial

TOLD = """
name = "runabout"
version = 1
title = "fixes, a DVL and a compass on a boat that turns"
duration_s = 120.0

[start]
latitude_deg = 50.0
longitude_deg = 4.0
speed_m_s = 4.0

[initial_error]
position_m = [1.0, 1.0, 2.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.2, 0.2, 1.0]

[vessel]
kind = "ship"
turn_rate_deg_s = 4.0

[[manoeuvre]]
kind = "zigzag"
angle_deg = 40.0
duration_s = 120.0

[instruments.imu]
rate_hz = 20.0

[instruments.imu.gyroscope]
bias_deg_h = 3.0
random_walk_deg_sqrt_h = 0.1

[instruments.imu.accelerometer]
bias_ug = 300.0
random_walk_ug_sqrt_hz = 60.0

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [1.0, 1.0, 2.0]

[instruments.dvl]
rate_hz = 2.0
phase_s = 0.3
sigma_m_s = [0.05, 0.05, 0.05]

[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.3
"""


@pytest.fixture(scope="module")
def told() -> Scenario:
    return parse(TOLD, source="told")


@pytest.fixture(scope="module")
def recording(told: Scenario) -> Recording:
    """Fixes are coloured, the DVL has a scale and a mounting; its noise is a fifth of what its datasheet says."""
    table = told.to_toml()
    table["instruments"]["gnss"] |= {
        "sigma_m": [0.2, 0.2, 0.4], "bias_instability_m": [1.5, 1.5, 2.0], "correlation_time_s": 15.0,
    }  # fmt: skip
    table["instruments"]["dvl"] |= {
        "sigma_m_s": [0.01] * 3, "fixed_scale_percent": 2.0, "fixed_misalignment_deg": [0.0, 0.0, 3.0],
    }  # fmt: skip
    true = record(Scenario.from_toml(table, source="true"), 5)
    return replace(true, instruments=told.instruments_sheet(), actual=None)


@pytest.fixture(scope="module")
def found(told: Scenario, recording: Recording) -> Identification:
    return identify(told, recording)


def test_the_likelihood_is_that_of_the_row(recording: Recording) -> None:
    streams = Likelihood(recording).innovations(Assumption(recording.instruments), heading=False)
    trial = run_trial(make("ekf"), recording)
    assert set(streams) == {"gnss", "dvl", "gyrocompass"}
    for name in ("gnss", "gyrocompass"):  # the row reports the last reading of a step only, and the DVL has two
        nis = trial.diagnostics[f"nis.{name}"]
        assert streams[name].nis == pytest.approx(nis[np.isfinite(nis)], rel=1e-6)
    gnss = streams["gnss"]
    by_hand = sum(
        -0.5 * (v @ np.linalg.solve(s, v) + np.log(np.linalg.det(s)))
        for v, s in zip(gnss.value, gnss.covariance, strict=True)
    )
    assert gnss.log_likelihood == pytest.approx(by_hand)
    assert np.sum(gnss.white**2, axis=1) == pytest.approx(gnss.nis)


def test_scoring_finds_the_maximum(recording: Recording) -> None:
    likelihood, given = Likelihood(recording), Assumption(recording.instruments)
    sigma = Parameter("gyrocompass", "sigma", (0,), np.radians(2.0), 3.0)
    best = maximise(likelihood, given, [sigma])
    around = [
        log_likelihood(likelihood.innovations(with_all(given, [sigma], best.x + d))) - 0.5 * (best.x[0] + d) ** 2 / 9.0
        for d in (-0.1, -0.02, 0.0, 0.02, 0.1)
    ]
    assert max(around) - around[2] < 0.02
    assert best.covariance[0, 0] == pytest.approx(1.0 / (2.0 * 121.0), rel=0.3)  # of a sigma from 121 readings
    assert best.log_likelihood > log_likelihood(likelihood.innovations(with_all(given, [sigma], np.zeros(1))))


def test_the_height_of_a_mast_is_found(told: Scenario) -> None:
    table = told.to_toml()
    table["sea"] = {"significant_height_m": 3.0, "peak_period_s": 8.0, "direction_deg": 60.0}
    table["instruments"]["gnss"]["sigma_m"] = [0.5, 0.5, 1.0]
    told = Scenario.from_toml(table, source="told")
    table["instruments"]["gnss"]["lever_arm_m"] = [0.0, 0.0, -15.0]
    true = record(Scenario.from_toml(table, source="true"), 3)
    given = Assumption(told.instruments_sheet())
    [height] = [p for p in places(told, given) if p.label == "gnss.lever_arm (down)"]
    best = maximise(Likelihood(replace(true, instruments=given.instruments, actual=None)), given, [height])
    sigma = float(np.sqrt(best.covariance[0, 0]))
    assert sigma < 1.5
    assert abs(height.value(best.x[0]) + 15.0) < 2.5 * sigma


def test_what_was_put_in_is_found(found: Identification) -> None:
    known = {e.label: e for e in found.estimates}
    for label, true in {
        "instruments.gnss.bias_instability_m (horizontal)": 1.5,
        "instruments.gnss.correlation_time_s": 15.0,
        "instruments.dvl.sigma_m_s (horizontal)": 0.01,
        "instruments.dvl.scale_percent": 2.0,
        "instruments.dvl.misalignment_deg (down)": 3.0,
        "instruments.gyrocompass.sigma_deg": 0.3,
    }.items():
        e = known[label]
        wide = e.high / e.low if not e.constant else (e.high - e.low) / true
        assert e.told, label
        assert wide < 8.0, label
        middle, half = 0.5 * (e.low + e.high), 0.5 * (e.high - e.low)
        assert abs(true - middle) < 2.0 * half, label
    assert found.gain > 100.0
    sheets = Scenario.from_toml(found.table, source="found").instruments_sheet()
    slow = known["instruments.gnss.bias_instability_m (horizontal)"].value
    assert 0.99 < sheets["gnss"].bias_instability[0] / slow < 1.3  # more by what the log does not tell of it
    scale = known["instruments.dvl.scale_percent"]
    assert 0.99 * abs(scale.value) < 100.0 * sheets["dvl"].scale < abs(scale.value) + 0.5 * (scale.high - scale.low)
    assert sheets["dvl"].misalignment[2] == pytest.approx(np.radians(3.0), rel=0.3)
    assert "[instruments.gnss]\n" in found.toml


def test_what_the_log_does_not_tell_is_said(found: Identification) -> None:
    # The heading at the start and a constant error of the compass have one effect, but for the course by the fixes.
    assert any("heading.error and gyrocompass.bias cannot be told apart" in said for said in found.remarks)
    assert any(said.startswith("gnss: a coloured error fits") for said in found.remarks)


def test_innovations_are_white_afterwards(found: Identification) -> None:
    from simnav.leaderboard.identification.innovations import neighbours

    assert neighbours(found.before["gnss"].white) > 0.3
    assert abs(neighbours(found.after["gnss"].white)) < 0.25
    assert found.after["dvl"].nis.mean() / 3.0 == pytest.approx(1.0, abs=0.25)
    assert len(found.plot().axes) == 6


def test_too_few_readings_are_one_sentence(told: Scenario) -> None:
    with pytest.raises(simnav.RequestError, match=r"runabout-v1: the filter used \d+ readings in 5 s; 60 or more"):
        simnav.identify(told, until=5.0)
    with pytest.raises(simnav.RequestError, match="until = 0: it should be a time of the log above 0 s"):
        simnav.identify(told, until=0.0)


def test_a_slow_error_that_innovations_do_not_show_is_enlarged(told: Scenario) -> None:
    table = told.to_toml()
    table["duration_s"] = 300.0
    known = Scenario.from_toml(table, source="known")
    table["instruments"]["dvl"] |= {"bias_instability_m_s": [0.05] * 3, "correlation_time_s": 100.0}
    true = Scenario.from_toml(table, source="true")
    recording = replace(record(true, 3), instruments=known.instruments_sheet(), actual=None)
    predictions, given = Predictions(recording, 300.0, reference=False), Assumption(recording.instruments)
    wider = widened(known, predictions, given)
    assert wider[0][0] == "dvl"
    before, after = predictions.judged(given), predictions.judged(wider[-1][1])
    assert after.log_likelihood > before.log_likelihood + 1.0
    assert before.nis > 2.0
    assert after.nis < 1.2
    sheet = wider[0][1].instruments["dvl"]
    assert 0.02 < sheet.bias_instability[0] < 0.2
    # With the reference of a log, and with datasheets that are right, nothing has to be enlarged by much.
    right = Predictions(recording, 300.0, reference=True)
    assert 0.3 < right.judged(Assumption(true.instruments_sheet())).nis < 2.0


def test_a_constant_that_a_log_does_not_tell_is_not_taken_for_zero(found: Identification, told: Scenario) -> None:
    sheets = Scenario.from_toml(found.table, source="found").instruments_sheet()
    assert not told.instruments_sheet()["dvl"].misalignment.any()
    assert (sheets["dvl"].misalignment > np.radians(0.05)).all()


def test_a_twin_follows_the_track_with_the_errors_that_were_found(
    found: Identification, told: Scenario, recording: Recording, tmp_path: Path
) -> None:
    made = twin_of(told, recording, found).save(tmp_path / "twin.toml")
    twin = load(str(made.files[0]))
    assert made.from_reference == []
    assert twin.instruments_sheet()["gnss"].bias_instability == pytest.approx(
        Scenario.from_toml(found.table, source="found").instruments_sheet()["gnss"].bias_instability
    )
    voyage = record(twin, 1)
    aside = relative_position(voyage.data.truth.position, recording.data.truth.position)
    assert np.abs(aside).max() < 0.01
    assert voyage.data.truth.attitude[:, 2] == pytest.approx(recording.data.truth.attitude[:, 2], abs=1e-3)
    assert {"gnss", "dvl", "gyrocompass"} == set(voyage.data.aids)


def test_a_twin_of_a_vessel_in_waves_can_be_simulated_without_a_fast_imu(
    found: Identification, told: Scenario, recording: Recording, tmp_path: Path
) -> None:
    made = twin_of(told, recording, found)
    made.track[:, 3] += 0.2 * (-1.0) ** np.arange(len(made.track))  # heave, of which the track has one value a second
    voyage = record(load(str(made.save(tmp_path / "twin.toml").files[0])), 1)
    moment = np.rint(voyage.data.truth.time).astype(int)
    assert voyage.data.truth.position[:, 2] == pytest.approx(made.track[moment, 3], abs=0.01)


def test_a_twin_needs_a_track(found: Identification, told: Scenario, recording: Recording) -> None:
    data = recording.data
    lost = replace(data.truth, position=np.full_like(data.truth.position, np.nan))
    with pytest.raises(SpecError, match="1 poses; a track needs 8 or more"):
        twin_of(told, replace(recording, data=replace(data, truth=lost)), found)
