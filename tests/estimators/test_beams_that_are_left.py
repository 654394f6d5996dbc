"""What an estimator gains from the beams that are left when a DVL has too few of them for a velocity."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.scoring.navigation_error import errors
from simnav.source import record
from simnav.trial import run_trial
from tests.golden.cases import table_of

LOST, AFTER = 90.0, 120.0


def survey(channels: list[str]) -> Scenario:
    """Lines of 100 m; some beams are lost after a minute and a half, and none is false."""
    table = table_of("lawnmower-beams")
    for name in ("draw", "dial"):
        table.pop(name)
    table["instruments"]["imu"]["rate_hz"] = 50.0
    table["instruments"]["beams"] |= {"false_beams": 0.0, "rate_hz": 1.0}
    table["manoeuvre"][1]["leg_m"] = 100.0
    lost = {"kind": "outage", "instruments": ["beams"], "channels": channels, "start_s": LOST}
    return Scenario.from_toml(table | {"duration_s": LOST + AFTER, "fault": [lost]})


def drift(row: str, recording: Recording) -> float:
    """Growth of the horizontal error while beams are lost [m]."""
    trial = run_trial(make(row), recording)
    assert trial.status == "ok", trial.reason
    error = errors(trial, recording)[:, :2]
    return float(np.linalg.norm(error[-1] - error[np.searchsorted(trial.time, LOST) - 1]))


@pytest.mark.parametrize("channels", [["1", "2"], ["2", "3", "4"]], ids=["two beams left", "one beam left"])
def test_beams_that_are_left_hold_the_error_to_a_third_of_coasting(channels: list[str]) -> None:
    """``ekf-loose`` has the velocity that the DVL solves: none, so it coasts."""
    runs = [record(survey(channels), seed) for seed in (71, 72, 73)]
    beams, coasting = (np.array([drift(row, run) for run in runs]) for row in ("ekf", "ekf-loose"))
    assert np.sqrt(np.mean(beams**2)) < np.sqrt(np.mean(coasting**2)) / 3.0
