"""A ship without dead reckoning: it stands still where there is no fix, and goes on afterwards."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial

OUTAGE = {"kind": "outage", "instruments": ["gnss"], "start_s": 60.0, "end_s": 120.0}


@pytest.mark.parametrize("seed", [3, 4])
def test_its_error_is_the_distance_of_the_outage(seed):
    recording = record(load("ship-straight").with_values({"duration_s": 240.0, "fault": [OUTAGE]}), seed)
    found = {name: score(run_trial(make(name), recording), recording) for name in ("ship-ekf", "ship-ekf-standing")}
    standing = found["ship-ekf-standing"]["outage_end_error_max"]
    truth = recording.data.truth
    away = (truth.time >= OUTAGE["start_s"]) & (truth.time <= OUTAGE["end_s"])
    distance = 60.0 * float(np.hypot(*truth.velocity[away, :2].T).mean())
    assert 0.9 * distance < standing < 1.1 * distance
    assert found["ship-ekf"]["outage_end_error_max"] < 0.1 * standing


def test_without_an_outage_it_is_the_plain_filter():
    recording = record(load("ship-turn").with_values({"duration_s": 60.0}), 1)
    a, b = (run_trial(make(name), recording) for name in ("ship-ekf", "ship-ekf-standing"))
    assert (a.position == b.position).all()


def test_bad_patience():
    with pytest.raises(ValueError, match="patience is 0"):
        make("ship-ekf-standing", patience=0.0)
