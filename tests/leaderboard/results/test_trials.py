"""Trials that are kept: small, and as good as the trial itself for any score."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import make
from simnav.leaderboard.results import trials
from simnav.leaderboard.results.store import StoreError
from simnav.recording import Recording
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record
from simnav.trial import Trial, run_trial
from simnav.types import NavigationStates


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(load("harbour-multipath"), 3)


@pytest.fixture(scope="module")
def trial(recording: Recording) -> Trial:
    return run_trial(make("gated-ekf"), recording)


def back(folder: Path, trial: Trial, recording: Recording, **options: float) -> Trial:
    trials.write(folder, "k-3", trial, recording, **options)
    return trials.read(folder, "k-3", recording)[0]


def test_every_score_is_the_same(tmp_path: Path, trial: Trial, recording: Recording) -> None:
    smoothed = NavigationStates(trial.time, trial.position, trial.velocity, trial.attitude)
    given = replace(trial, smoothed=smoothed)
    assert trials.is_kept(tmp_path, "k-3") is False
    found = back(tmp_path, given, recording)
    expected = score(given, recording)
    assert trial.flagged
    assert sum(np.isfinite(list(expected.values()))) > 40
    assert score(found, recording) == pytest.approx(expected, rel=1e-6, nan_ok=True)
    assert found.flagged == trial.flagged
    assert (found.estimator, found.status, found.reason) == (trial.estimator, "ok", "")
    for name, values in trial.diagnostics.items():
        np.testing.assert_allclose(found.diagnostics[name], values, rtol=1e-6, err_msg=name)
    np.testing.assert_allclose(found.position[:, :2], trial.position[:, :2], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.position[:, 2], trial.position[:, 2], rtol=0.0, atol=1e-5)
    assert trials.size(tmp_path) < 260 * len(trial)


def test_covariances_at_a_chosen_rate(tmp_path: Path, trial: Trial, recording: Recording) -> None:
    found = back(tmp_path, trial, recording, covariance_interval=10.0)
    assert found.covariance is not None
    known = np.isfinite(found.covariance[:, 0, 0])
    np.testing.assert_array_equal(np.diff(found.time[known]), 10.0)
    np.testing.assert_allclose(found.covariance[known], trial.covariance[known], rtol=1e-6)
    assert trials.read(tmp_path, "k-3", recording)[1] is True
    assert trials.size(tmp_path) < 120 * len(trial)


def test_what_was_not_estimated_or_failed_stays_so(tmp_path: Path, trial: Trial, recording: Recording) -> None:
    n = 40
    short = replace(
        trial, status="error", reason="lost", time=trial.time[:n], position=trial.position[:n],
        velocity=np.full((n, 3), np.nan), attitude=np.full((n, 3), np.nan), covariance=None, diagnostics={}, flagged=[],
        estimated=np.repeat([[True] * 3 + [False] * 6], n, axis=0), update_seconds=trial.update_seconds[:n],
    )  # fmt: skip
    found = back(tmp_path, short, recording)
    assert (found.status, found.reason, len(found), found.covariance, found.smoothed) == (
        "error",
        "lost",
        n,
        None,
        None,
    )
    np.testing.assert_array_equal(found.estimated, short.estimated)
    assert np.isnan(found.velocity).all()


def test_a_reference_with_gaps_and_the_date_line(tmp_path: Path, trial: Trial, recording: Recording) -> None:
    """Where no truth is known, an estimate is kept relative to the last one."""
    truth = recording.data.truth
    position = truth.position.copy()
    position[100:150] = np.nan
    gaps = replace(recording, data=replace(recording.data, truth=replace(truth, position=position)))
    found = back(tmp_path, trial, gaps)
    np.testing.assert_allclose(found.position[:, :2], trial.position[:, :2], rtol=0.0, atol=1e-9)
    turned = trial.position.copy()
    turned[:, 1] += 2.0 * np.pi
    found = back(tmp_path, replace(trial, position=turned), recording)
    np.testing.assert_allclose(found.position[:, 1], trial.position[:, 1], rtol=0.0, atol=1e-12)


def test_a_file_that_is_no_trial_of_this_recording_is_named(tmp_path: Path, trial: Trial, recording: Recording) -> None:
    trials.write(tmp_path, "k-3", trial, recording)
    short = replace(recording, data=replace(recording.data, truth=recording.data.truth[:100]))
    with pytest.raises(StoreError, match=r"k-3.parquet holds no trial .*900 epochs, the recording 100"):
        trials.read(tmp_path, "k-3", short)
    path = tmp_path / "trials" / "k-3.parquet"
    path.write_bytes(path.read_bytes()[:-50])
    with pytest.raises(StoreError, match=r"k-3.parquet holds no trial"):
        trials.read(tmp_path, "k-3", recording)
    trials.discard(tmp_path, "k-3")
    with pytest.raises(StoreError, match=r"k-3.parquet holds no trial"):
        trials.read(tmp_path, "k-3", recording)
