"""A window whose IMU fails: the motion is suspected before aids that agree are left out."""

from __future__ import annotations

import pytest

from simnav import make, run_trial
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record


@pytest.mark.parametrize(
    ("scenario", "seed"), [("imu-clipping", 700), ("imu-warm-up", 706), ("gyroscope-bias-step", 703)]
)
def test_robust_windows_stay_beside_the_plain_filter_when_the_imu_is_wrong(scenario: str, seed: int):
    recording = record(load(scenario), seed)
    error = {}
    for row in ("ekf", "gnc-fgo", "tukey-fgo"):
        trial = run_trial(make(row), recording)
        assert trial.status == "ok", trial.reason
        error[row] = score(trial, recording)["horizontal_rmse"]
    assert max(error["gnc-fgo"], error["tukey-fgo"]) < 1.6 * error["ekf"], error
