"""Scores with a lag: closed forms on made trials, names of any lag, and what has none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import EstimatorError, make
from simnav.estimator.looking_back import LookingBack, lag_text, lags_of
from simnav.scoring import SCORES, score
from simnav.scoring.lagged import seconds_of
from tests.cases.given_errors import make_recording, make_trial


def late_trial(recording, correction):
    """3 m north, 4 m east and 2 m down wrong at first; the estimate 10 s later has a part of this removed."""
    trial = make_trial(recording, [3.0, 4.0, 2.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.1])
    change = np.tile(correction, (len(trial), 1))
    change[:10] = np.nan
    return replace(trial, diagnostics={"lagged.10": change, "sigma_north.gnss": np.arange(len(trial)) / 10.0})


def test_errors_are_those_of_the_earlier_time():
    recording = make_recording()
    trial = late_trial(recording, [-3.0, -1.0, -2.0, -0.1, 0.0, 0.0, 0.0, 0.0, -0.04])
    found = score(trial, recording)
    assert found["horizontal_rmse"] == pytest.approx(5.0, rel=1e-6)
    assert found["horizontal_rmse_lag_10"] == pytest.approx(3.0, rel=1e-4)
    assert found["vertical_rmse_lag_10"] == pytest.approx(0.0, abs=1e-6)
    assert found["position_rmse_lag_10"] == pytest.approx(3.0, rel=1e-4)
    assert found["velocity_north_rmse_lag_10"] == pytest.approx(0.2)
    assert found["heading_rmse_lag_10"] == pytest.approx(0.06, rel=0.02)


def test_a_sigma_is_compared_with_the_noise_of_the_earlier_time():
    """The reported sigma grows by 0.1 m a step, and the true one is 1 m: closed form of the mean square."""
    recording = make_recording(steps=50)
    found = score(late_trial(recording, np.zeros(9)), recording)
    newest = [k / 10.0 - 1.0 for k in range(50)]
    assert found["sigma_north_rmse"] == pytest.approx(math.sqrt(np.mean(np.square(newest))))
    assert found["sigma_north_rmse_lag_10"] == pytest.approx(math.sqrt(np.mean(np.square(newest[10:]))))


def test_any_lag_has_a_score_and_other_names_have_none():
    assert SCORES["horizontal_rmse_lag_29"].title == "Horizontal RMSE, 29 s late"
    assert SCORES["north_rmse_lag_0p5"].unit == "m"
    for name in ("horizontal_rmse_lag_", "horizontal_rmse_lag_x", "nees_lag_10", "horizontal_rmse_lag_1p2p3", "_lag_1"):
        assert name not in SCORES
    assert not any("_lag_" in name for name in SCORES)  # they are found, and not listed
    plain = make_trial(make_recording(), np.zeros(9))
    assert math.isnan(score(plain, make_recording(), ["horizontal_rmse_lag_10"])["horizontal_rmse_lag_10"])
    assert seconds_of(lag_text(0.5)) == 0.5


@pytest.mark.parametrize("given", ["", "a/b", "-1", "1e9", "nan", [1.0, "x"], None])
def test_lags_that_are_none_are_one_sentence(given):
    with pytest.raises(EstimatorError, match="should be times from 0 to 3600 s") as error:
        lags_of(given)
    assert "\n" not in str(error.value)


def test_every_estimator_takes_lags():
    made = make("gnss-only", lags="5/1")
    assert isinstance(made, LookingBack)
    assert made.lags == (1.0, 5.0)
    assert (made.name, made.needs) == ("gnss-only", make("gnss-only").needs)
