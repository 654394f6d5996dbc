"""The noise that an estimator believes in, against the noise that there was."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from simnav.recording import Recording
from simnav.scenario import load
from simnav.scoring import score
from simnav.scoring.noise_estimation import noise_estimation, sigma_errors
from simnav.source import record


def with_sigma(recording: Recording, sigma: np.ndarray) -> Recording:
    gnss = replace(recording.data.aids["gnss"], sigma=np.column_stack([sigma, 2.0 * sigma, sigma]))
    return replace(recording, data=replace(recording.data, aids={"gnss": gnss}))


def test_closed_form(make_recording, make_trial):
    """1 m for 80 s, 10 m for 20 s; an estimate that stays at 1 m errs by 9 m in a fifth of the epochs."""
    true = np.where(np.arange(100) < 80, 1.0, 10.0)
    recording = with_sigma(make_recording(), true)
    known = {"sigma_north.gnss": np.ones(100), "sigma_east.gnss": 2.0 * true + 0.5}
    found = noise_estimation(make_trial(recording, np.zeros(9), diagnostics=known), recording)
    assert found["sigma_north_rmse"] == pytest.approx(9.0 * math.sqrt(0.2))
    assert found["sigma_east_rmse"] == pytest.approx(0.5)


def test_gaps_of_either_are_left_out(make_recording, make_trial):
    true = np.ones(100)
    true[:10] = np.nan
    recording = with_sigma(make_recording(), true)
    estimate = np.full(100, 4.0)
    estimate[50:] = np.nan
    found = noise_estimation(make_trial(recording, np.zeros(9), diagnostics={"sigma_north.gnss": estimate}), recording)
    assert found["sigma_north_rmse"] == pytest.approx(3.0)
    assert math.isnan(found["sigma_east_rmse"])


def test_who_does_not_say_is_not_scored(make_recording, make_trial):
    recording = make_recording()
    for diagnostics in ({}, {"sigma_north.dvl": np.ones(100)}, {"sigma_north.gnss": np.ones((100, 2))}):
        found = score(make_trial(recording, np.zeros(9), diagnostics=diagnostics), recording)
        assert math.isnan(found["sigma_north_rmse"])


def test_a_trial_that_ended_early_counts_up_to_its_end(make_recording, make_trial):
    recording = with_sigma(make_recording(), np.arange(1.0, 101.0))
    trial = make_trial(recording, np.zeros((40, 9)), diagnostics={"sigma_north.gnss": np.arange(1.0, 41.0) + 2.0})
    time, error = sigma_errors(trial, recording.data.aids["gnss"], "north")
    np.testing.assert_array_equal(time, np.arange(1.0, 41.0))
    np.testing.assert_allclose(error, 2.0)


def test_in_an_outage_there_is_nothing_to_estimate(make_recording, make_trial):
    recording = make_recording(outages=[(20.0, 60.0)])
    estimate = np.where((recording.data.truth.time >= 20.0) & (recording.data.truth.time < 60.0), 50.0, 1.0)
    found = noise_estimation(make_trial(recording, np.zeros(9), diagnostics={"sigma_north.gnss": estimate}), recording)
    assert found["sigma_north_rmse"] == 0.0


def test_a_noise_step_is_in_the_truth():
    """The simulation of Mao, Wang and Fu (2025): 10 m between 160 and 240 s, and 1 m at other times."""
    recording = record(load("gnss-noise-step"), 0)
    stream = recording.data.aids["gnss"]
    inside = (stream.time >= 160.0) & (stream.time < 240.0)
    np.testing.assert_allclose(stream.sigma[:, :2], np.where(inside, 10.0, 1.0)[:, None] * np.ones(2))
