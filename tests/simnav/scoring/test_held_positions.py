"""Epochs without a position count with the last one that was given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav import Estimate, Estimator, record, run_trial
from simnav.scoring import score
from simnav.scoring.consistency import first_fault


class Teller(Estimator):
    """Gives a position that is off by a metre in some epochs, and none in the others."""

    def __init__(self, silent=(), height=True):
        self.silent, self.height = set(silent), height

    def reset(self, start, instruments):
        self.k = -1

    def reveal(self, recording):
        self.truth = recording.data.truth.position

    def update(self, measurements):
        self.k += 1
        if self.k in self.silent:
            return Estimate(measurements.time)
        mask = np.arange(9) < (3 if self.height else 2)
        position = self.truth[self.k] + [1.0 / 6371e3, 0.0, 2.0]
        return Estimate(measurements.time, position, covariance=np.eye(9), estimated=mask)


Teller.reference = True


@pytest.fixture(scope="module")
def recording():
    return record("harbour-multipath", seed=1)


def scores(recording, silent=(), **fields):
    return score(run_trial(Teller(silent, **fields), recording), recording)


def test_the_last_position_counts_where_there_is_none(recording):
    whole, gap = scores(recording), scores(recording, silent=range(100, 150))
    assert whole["horizontal_rmse"] == pytest.approx(1.0, rel=0.01)
    assert (whole["availability"], gap["availability"]) == (1.0, pytest.approx(1.0 - 50 / len(recording.data.truth)))
    truth = recording.data.truth
    moved = np.linalg.norm(
        (truth.position[149] - truth.position[99])[:2] * [6371e3, 6371e3 * np.cos(truth.position[0, 0])]
    )
    assert moved > 50.0
    assert gap["horizontal_max"] == pytest.approx(moved, rel=0.02)
    assert gap["horizontal_rmse"] > 2.0
    assert gap["vertical_max"] >= whole["vertical_max"]


def test_before_the_first_position_the_start_counts(recording):
    late = scores(recording, silent=range(100))
    assert late["horizontal_max"] > 50.0


def test_withholding_epochs_never_pays(recording):
    """Half of the epochs, the hardest or any other: the error is never smaller than with an error of a metre in all."""
    whole = scores(recording)["horizontal_rmse"]
    rng = np.random.default_rng(1)
    n = len(recording.data.truth)
    for _ in range(3):
        silent = rng.permutation(n)[: n // 2]
        assert scores(recording, silent=silent)["horizontal_rmse"] >= whole
    assert scores(recording, silent=[n - 1])["final_error"] > scores(recording)["final_error"]


def test_horizontal_position_and_height_are_held_each_by_itself(make_recording, make_trial):
    """For ten seconds at 5 m/s one of the two is missing; the other counts as it is given."""
    recording, time = make_recording(), np.arange(1.0, 101.0)
    error = np.zeros((100, 9))
    error[:, 2] = 0.1 * time
    for missing, expected in (((2,), (0.0, 10.0)), ((0, 1), (50.0, 10.0))):
        estimated = np.ones((100, 9), dtype=bool)
        estimated[50:60, missing] = False
        found = score(make_trial(recording, error, estimated=estimated), recording)
        assert (found["horizontal_max"], found["vertical_max"]) == pytest.approx(expected, abs=1e-3)
    assert found["vertical_mae"] == pytest.approx(0.1 * time.mean())


def test_what_is_never_estimated_is_not_held(recording):
    found = scores(recording, height=False)
    assert np.isnan(found["vertical_rmse"])
    assert np.isfinite(found["horizontal_rmse"])
    assert np.isnan(scores(recording, silent=range(10**6))["horizontal_rmse"])


def test_consistency_is_scored_before_and_from_the_first_fault(recording):
    start = first_fault(recording)
    assert 0.0 < start < recording.duration
    found = scores(recording)
    assert found["nees_horizontal_clean"] == pytest.approx(0.5, rel=0.02)  # a metre of one sigma, two components
    assert found["nees_horizontal_faulty"] == pytest.approx(0.5, rel=0.02)
    assert found["coverage_95_clean"] == found["coverage_95_faulty"] == 1.0
    k = int(np.searchsorted(recording.data.truth.time, start))
    late = scores(recording, silent=range(k + 1, 10**6))
    assert np.isfinite(late["nees_horizontal_clean"])
    assert late["nees_horizontal_faulty"] == pytest.approx(found["nees_horizontal_faulty"], rel=0.02)
    silent = {name: replace(s, faults=np.zeros_like(s.faults)) for name, s in recording.data.aids.items()}
    clean = replace(recording, data=replace(recording.data, aids=silent, imu_labels=None))
    assert first_fault(clean) == np.inf
    assert np.isnan(scores(clean)["nees_horizontal_faulty"])
