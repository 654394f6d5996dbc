"""The rows with nine states: closed-loop filter and sigma points agree with the EKF."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.solvers.linear import LinearKalmanEstimator
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial


@pytest.fixture(scope="module")
def recording():
    return record(load("coastal-voyage").with_values({"duration_s": 120.0, "fault": []}), 7)


@pytest.mark.parametrize("row", ["kf-9", "ukf-9"])
def test_they_agree_with_the_ekf(recording, row):
    """Within centimetres: at errors of this size the model is almost linear."""
    plain, other = (run_trial(make(name), recording) for name in ("ekf-9", row))
    assert other.status == "ok"
    metres = np.array([6.37e6, 6.37e6 * 0.78, 1.0])
    apart = np.abs(other.position - plain.position) * metres
    assert 0.0 < apart.max() < 0.05
    sigmas, expected = (np.sqrt(t.covariance[-1].diagonal()) for t in (other, plain))
    np.testing.assert_allclose(sigmas, expected, rtol=0.02)


def test_feedback_keeps_the_nominal_trajectory_near(recording):
    """In open loop the correction grows with the error of free inertial navigation; in closed loop it stays small."""

    def error(feedback: float) -> float:
        trial = run_trial(LinearKalmanEstimator(NineStateModel(), feedback=feedback), recording)
        return float(trial.diagnostics["nominal_error"][-20:].max())

    assert error(0.0) > 20.0
    assert error(1.0) < 5.0
    assert error(10.0) < 20.0


def test_bad_feedback():
    with pytest.raises(ValueError, match="feedback is -1"):
        make("kf-9", feedback=-1.0)
