"""Consistency: NEES of errors drawn from their covariance, bands, coverage, badges."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from simnav.recording import ImuLabels, Recording
from simnav.scoring import badge, nees, nees_band, score
from simnav.scoring.consistency import GROUPS, LARGEST, MARGIN, coverage, first_fault
from simnav.types import ImuSamples

N = 20_000


@pytest.fixture(scope="module")
def drawn() -> tuple[np.ndarray, np.ndarray]:
    """Errors of very different sizes, strongly correlated, drawn from their covariance."""
    rng = np.random.default_rng(5)
    root = np.diag([10.0, 3.0, 1.0, 0.1, 0.1, 0.01, 1e-4, 1e-4, 1e-3]) @ (rng.normal(size=(9, 9)) + 2.0)
    return rng.normal(size=(N, 9)) @ root.T, np.broadcast_to(root @ root.T, (N, 9, 9))


@pytest.mark.parametrize("group", GROUPS)
def test_nees_of_errors_drawn_from_the_covariance_is_chi_square(drawn: Any, group: str) -> None:
    error, covariance = drawn
    values, degrees = nees(error, covariance, GROUPS[group])
    d = len(GROUPS[group])
    assert (degrees == d).all()
    assert stats.kstest(values, stats.chi2(d).cdf).pvalue > 1e-3
    assert stats.kstest(1.2 * values, stats.chi2(d).cdf).pvalue < 1e-6  # the test has teeth


def test_nees_is_the_quadratic_form(drawn: Any) -> None:
    error, covariance = drawn
    p = covariance[0][3:6, 3:6]
    expected = error[7, 3:6] @ np.linalg.inv(p) @ error[7, 3:6]
    assert nees(error, covariance, (3, 4, 5))[0][7] == pytest.approx(expected, rel=1e-9)


def test_unknown_components_lower_the_degrees_of_freedom() -> None:
    error = np.full((2, 9), 2.0)
    error[0, 2] = np.nan
    error[1, :3] = np.nan
    values, degrees = nees(error, np.tile(np.eye(9), (2, 1, 1)), (0, 1, 2))
    assert degrees.tolist() == [2, 0]
    assert values[0] == pytest.approx(8.0)
    assert np.isnan(values[1])


def test_a_singular_covariance_is_infinitely_optimistic() -> None:
    p = np.eye(9)
    p[1, 1] = 0.0
    assert nees(np.ones((1, 9)), p[None], (0, 1))[0][0] == np.inf
    p[:2, :2] = 1.0
    assert nees(np.ones((1, 9)), p[None], (0, 1))[0][0] == np.inf


def test_consistency_scores_of_a_run(make_recording: Any, make_trial: Any, drawn: Any) -> None:
    recording = make_recording(steps=N)
    error, covariance = drawn
    s = score(make_trial(recording, error, covariance=covariance), recording)
    for group, components in GROUPS.items():
        low, high = nees_band(len(components), N, 0.999)
        assert low < s[f"nees_{group}"] < high
    assert s["coverage_50"] == pytest.approx(0.5, abs=0.012)
    assert s["coverage_95"] == pytest.approx(0.95, abs=0.006)
    twice = score(make_trial(recording, error, covariance=0.25 * covariance), recording)
    assert twice["nees_velocity"] == pytest.approx(4.0 * s["nees_velocity"], rel=1e-6)
    singular = score(make_trial(recording, error, covariance=0.0 * covariance), recording)
    assert singular["nees_position"] == LARGEST


def test_epochs_count_by_their_components(recording: Recording, make_trial: Any) -> None:
    """Three errors of one sigma at half of the epochs, two of two sigmas at the others: (3 + 8) / (3 + 2)."""
    error, estimated = np.ones((len(recording.data.truth), 9)), np.ones((len(recording.data.truth), 9), dtype=bool)
    error[::2], estimated[::2, 2] = 2.0, False
    covariance = np.tile(np.eye(9), (len(error), 1, 1))
    s = score(make_trial(recording, error, covariance=covariance, estimated=estimated), recording)
    assert s["nees_position"] == pytest.approx(11.0 / 5.0, rel=1e-6)
    assert s["nees_horizontal"] == pytest.approx(2.5, rel=1e-6)


def test_the_first_fault_is_that_of_any_instrument_or_of_the_imu(make_recording: Any) -> None:
    assert first_fault(make_recording()) == math.inf
    recording = make_recording(faulty=[(49, 5.0, 0)])
    assert first_fault(recording) == 50.0
    time, zeros = 0.5 * np.arange(1.0, 201.0), np.zeros((200, 3))
    for first in (30.5, 70.5):
        labels = ImuLabels((time >= first).astype(np.uint32), np.zeros((200, 6)))
        data = replace(recording.data, imu=ImuSamples(time, np.full(200, 0.5), zeros, zeros), imu_labels=labels)
        assert first_fault(replace(recording, data=data)) == min(first, 50.0)


def test_what_an_estimator_reports_of_itself_is_scored_over_the_run_and_over_its_last_tenth(
    recording: Recording, make_trial: Any
) -> None:
    reported = np.zeros(100)
    reported[0] = math.nan  # nothing said
    reported[-12:-4] = 1.0
    s = score(make_trial(recording, np.zeros(9), diagnostics={"inconsistent": reported}), recording)
    assert s["inconsistent"] == pytest.approx(8 / 99)
    assert s["inconsistent_end"] == pytest.approx(5 / 9)


def test_no_covariance_no_consistency(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording()
    s = score(make_trial(recording, np.ones(9)), recording)
    assert np.isnan([v for k, v in s.items() if k.startswith(("nees", "coverage"))]).all()


def test_coverage_uses_the_ellipse_of_two_degrees_of_freedom() -> None:
    quantile = stats.chi2(2).ppf(0.95)
    assert coverage(np.array([quantile - 1e-9, quantile + 1e-9, np.nan, 0.0]), 0.95) == pytest.approx(2 / 3)


def test_the_band_holds_its_level() -> None:
    low, high = nees_band(3, 10)
    means = np.random.default_rng(6).chisquare(3, (20_000, 10)).mean(axis=1) / 3
    assert np.mean((means > low) & (means < high)) == pytest.approx(0.95, abs=0.006)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([], "unknown"),
        ([np.nan, np.nan], "unknown"),
        ([1.0] * 50, "consistent"),
        ([0.99 * MARGIN] * 1000, "consistent"),  # outside the band, inside the margin
        ([1.01 * MARGIN] * 1000, "optimistic"),
        ([0.99 / MARGIN] * 1000, "pessimistic"),
        ([2.0], "consistent"),  # one run proves little
        ([2.0] * 50, "optimistic"),
        ([0.3] * 3, "consistent"),
        ([0.3] * 50, "pessimistic"),
        ([1.0] * 49 + [LARGEST], "optimistic"),
        ([5.0] * 20 + [np.nan], "optimistic"),
    ],
)
def test_badges(values: list[float], expected: str) -> None:
    assert badge(np.array(values)) == expected
