"""States of earlier times: against the smoothers of the whole run, between windows and filters, and step by step."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from simnav.estimator import make
from simnav.geometry.earth import relative_position
from simnav.recording import Recording
from simnav.scenario import load
from simnav.scoring import score
from simnav.simulation.simulator import simulate
from simnav.trial import run_trial

LAGS = (1.0, 4.0, 10.0)


def drive(seconds: float, rate: float = 1.0) -> Recording:
    """The beginning of a drive with IMU and GNSS, without faults."""
    return simulate(
        load("gnss-noise-step").with_values(
            {"name": "late", "duration_s": seconds, "fault": [], "instruments.gnss.rate_hz": rate}
        ),
        3,
    )


@pytest.fixture(scope="module")
def recording() -> Recording:
    return drive(40.0)


def last_states(name: str, recording: Recording, lags) -> tuple[np.ndarray, object]:
    """What an estimator says of earlier times after the last step, and its smoothed trajectory."""
    estimator = make(name[0], **name[1]) if isinstance(name, tuple) else make(name)
    estimator.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        estimator.update(packet)
        states = estimator.earlier(lags)
    return states, estimator.smooth()


@pytest.mark.parametrize("name", ["ekf-rts", "ekf-two-filter", "fgo-full"])
def test_at_the_end_they_are_the_smoothed_trajectory(name, recording):
    """After the last step the fixed-lag estimate has all measurements, as the smoother of the whole run."""
    states, smoothed = last_states(name, recording, LAGS)
    for row, lag in zip(states, LAGS, strict=True):
        k = int(np.searchsorted(smoothed.time, smoothed.time[-1] - lag - 1e-6))
        apart = relative_position(row[:3], smoothed.position[k])
        assert np.abs(apart).max() < 2e-3
        assert np.abs(row[3:6] - smoothed.velocity[k]).max() < 2e-3
        assert np.abs(row[6:] - smoothed.attitude[k]).max() < 1e-4
    first = relative_position(states[0, :3], smoothed.position[-1])
    assert np.abs(first).max() > 1.0  # the ship moves: another epoch would be seen


def test_a_window_and_a_fixed_lag_smoother_agree_at_every_step(recording):
    """Two solvers, the same measurements and states: the estimates of the past agree, as those of the present do."""
    late = {"lags": "4/10"}
    window = run_trial(make("sw-fgo", window=31, **late), recording)
    smoother = run_trial(make("ekf-rts", **late), recording)
    for name in ("lagged.4", "lagged.10"):
        steps = int(name.partition(".")[2])
        past = [relative_position(t.position[:-steps], window.position[:-steps]) + t.diagnostics[name][steps:, :3]
                for t in (window, smoother)]  # fmt: skip
        assert np.abs(past[0] - past[1])[:, :2].max() < 0.05
        assert np.abs(window.diagnostics[name][steps:, :2]).max() > 0.2  # later measurements have a say


def test_the_newest_state_is_as_without_lags(recording):
    plain, late = (run_trial(make("sw-fgo", **more), recording) for more in ({}, {"lags": 5}))
    assert np.array_equal(plain.position, late.position)
    assert score(plain, recording)["horizontal_rmse"] == score(late, recording)["horizontal_rmse"]


def test_nothing_is_known_before_it_is_measured(recording):
    """What is said of a time with a lag does not change with what is measured after the lag."""
    whole = run_trial(make("sw-fgo", lags=5), recording)
    half = run_trial(make("sw-fgo", lags=5), drive(20.0))
    n = len(half)
    assert np.array_equal(whole.diagnostics["lagged.5"][:n], half.diagnostics["lagged.5"], equal_nan=True)
    assert np.isnan(whole.diagnostics["lagged.5"][:5]).all()


def test_a_lag_beyond_the_window_is_an_error(recording):
    trial = run_trial(make("sw-fgo", window=5, lags=10), recording)
    assert trial.status == "error"
    assert "a lag of 10 s is longer than the window, which holds the last 4 s" in trial.reason


def test_an_epoch_of_a_window_is_a_step_or_the_interval_of_its_fastest_instrument(recording):
    window = make("sw-fgo", window=5)
    assert window.longest_lag(recording.instruments) == 4.0
    assert window.longest_lag(drive(10.0, rate=0.2).instruments) == 20.0
    assert make("fgo-full").longest_lag(recording.instruments) == make("ekf").longest_lag(recording.instruments) == inf


def test_a_step_may_end_after_its_last_node():
    """Fixes come between the ends of the steps: the late estimates are still better than the newest ones."""
    late = drive(60.0, rate=0.8)
    scores = score(run_trial(make("sw-fgo", lags=10), late), late)
    smoother = score(run_trial(make("ekf-rts", lags=10), late), late)
    assert scores["horizontal_rmse_lag_10"] == pytest.approx(smoother["horizontal_rmse_lag_10"], rel=0.05)
