"""The robust smoother: it is the plain smoother where all weights are 1, and undoes what a filter has to follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.solvers.student_t_smoother import StudentTSmoother
from simnav.geometry import earth
from simnav.scoring import score, smoothed_errors
from simnav.trial import run_trial


@pytest.mark.parametrize("seed", [1, 2])
def test_with_gaussian_noise_it_is_the_rauch_tung_striebel_smoother(recording_of, seed: int):
    """An independent forward and backward pass over the same linear problem, and its covariance."""
    recording = recording_of(seed, 60.0)
    gaussian = make("student-t-rts", adaptation__dof=float("inf"), smoother__dof=float("inf"))
    plain = make("ekf-rts")
    ours, theirs = (smoothed_errors(run_trial(e, recording), recording) for e in (gaussian, plain))
    sigma = np.sqrt(np.diagonal(plain.smoothed_covariance, axis1=1, axis2=2))
    assert np.abs((ours - theirs) / sigma).max() < 1e-5
    correlation = sigma[:, :, None] * sigma[:, None, :]
    assert np.abs((gaussian.smoothed_covariance - plain.smoothed_covariance) / correlation).max() < 1e-5


def faulty(recording, first: float, last: float, size: float):
    """A GNSS that stands off by so many metres for a while, and is right before and after."""
    gnss = recording.data.aids["gnss"]
    off = np.where((gnss.time >= first) & (gnss.time < last), size, 0.0)[:, None] * np.array([1.0, -1.0, 0.0])
    moved = replace(gnss, value=earth.displace(gnss.value, off))
    aids = {name: s for name, s in recording.data.aids.items() if name != "gnss_velocity"}
    return replace(recording, data=replace(recording.data, aids={**aids, "gnss": moved}))


def test_a_jump_that_comes_back_is_undone(recording_of):
    """The filter follows a jump of half a minute in part; the smoother knows the fixes after it."""
    recording = faulty(recording_of(5, 200.0), 90.0, 120.0, 15.0)
    found = {}
    for name in ("student-t-rts", "ekf-rts"):
        trial = run_trial(make(name), recording)
        assert trial.status == "ok", trial.reason
        found[name] = score(trial, recording)["smoothed_horizontal_rmse"]
    assert found["student-t-rts"] < 0.5 * found["ekf-rts"]


def test_weights_tell_the_wrong_fixes(recording_of):
    recording = faulty(recording_of(5, 200.0), 90.0, 120.0, 15.0)
    estimator = make("student-t-rts")
    run_trial(estimator, recording)
    low = [stop for stop, weights in estimator.smoother.weights.items() if min(weights) < 0.2]
    assert 25 <= len(low) <= 30  # of 30 wrong fixes, and of no other measurement


def test_the_filter_in_front_is_not_touched(recording_of):
    recording = recording_of(2, 40.0)
    alone, with_smoother = (run_trial(make(n), recording) for n in ("student-t", "student-t-rts"))
    np.testing.assert_allclose(with_smoother.position, alone.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(with_smoother.covariance, alone.covariance, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("name", "value"), [("dof", 0.0), ("passes", 0)])
def test_a_senseless_parameter_is_refused(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        StudentTSmoother(**{name: value})
