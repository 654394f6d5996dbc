"""How a run ended: lost by its errors, whatever the estimator says of itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from simnav.recording import Recording
from simnav.scoring import score
from simnav.scoring.ending import FAR, SHARE, ending, outcome

#: Sigmas of position [m], velocity [m/s] and attitude [rad].
SIGMA = np.array([2.0, 2.0, 4.0, 0.1, 0.1, 0.1, 0.001, 0.001, 0.002])
COVARIANCE = np.diag(SIGMA**2)
N = 100


def beyond(recording: Recording, make_trial: Any, error: Any, **fields: Any) -> float:
    covariance = np.tile(COVARIANCE, (N, 1, 1))
    return score(make_trial(recording, error, covariance=covariance, **fields), recording)["beyond_sigma"]


@pytest.mark.parametrize("component", range(9))
def test_each_of_four_is_looked_at_epoch_by_epoch(recording: Recording, make_trial: Any, component: int) -> None:
    error = np.zeros((N, 9))
    root = {0: math.sqrt(2.0), 1: math.sqrt(2.0), 3: math.sqrt(3.0), 4: math.sqrt(3.0), 5: math.sqrt(3.0)}
    error[:30, component] = 0.98 * FAR * SIGMA[component] * root.get(component, 1.0)
    assert beyond(recording, make_trial, error) == 0.0
    error[:30, component] *= 1.05
    seen = component not in (6, 7)  # roll and pitch are none of the four
    assert beyond(recording, make_trial, error) == (0.3 if seen else 0.0)


def test_an_epoch_counts_once_and_only_with_a_covariance(recording: Recording, make_trial: Any) -> None:
    error = np.zeros((N, 9))
    error[:20, [2, 4]] = 1000.0
    assert beyond(recording, make_trial, error) == 0.2
    estimated = np.ones((N, 9), dtype=bool)
    estimated[50:] = False  # nothing is known of the second half
    assert beyond(recording, make_trial, error, estimated=estimated) == 0.4
    estimated[:, [2, 3, 4, 5]] = False
    assert beyond(recording, make_trial, error, estimated=estimated) == 0.0


def test_without_a_covariance_no_run_is_lost(recording: Recording, make_trial: Any) -> None:
    scores = score(make_trial(recording, np.full(9, 0.5)), recording)
    assert math.isnan(scores["beyond_sigma"])
    assert outcome("ok", scores) == "ok"


def test_more_than_a_tenth_is_lost_whatever_it_says_of_itself() -> None:
    assert outcome("ok", {"beyond_sigma": SHARE}) == "ok"
    assert outcome("ok", {"beyond_sigma": SHARE + 1e-9}) == "lost"
    assert ending("ok", {"beyond_sigma": 0.5, "inconsistent": 1.0}) == "lost"
    assert ending("ok", {"beyond_sigma": 0.05, "inconsistent": 1.0}) == "inconsistent"
    assert ending("diverged", {"beyond_sigma": 0.5}) == "diverged"
