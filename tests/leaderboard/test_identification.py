"""The error model of a log: what was put in is found, intervals hold it, and what the log does not tell is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import simnav
from simnav.estimator import make
from simnav.leaderboard.identification.assumption import Assumption, Parameter, with_all
from simnav.leaderboard.identification.innovations import Likelihood
from simnav.leaderboard.identification.report import Identification, identify
from simnav.leaderboard.identification.scoring import log_likelihood, maximise
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.scenario.reading import parse
from simnav.source import record
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
    assert sheets["gnss"].bias_instability[0] == pytest.approx(slow, rel=0.01)
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
