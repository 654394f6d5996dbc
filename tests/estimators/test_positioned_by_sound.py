"""Estimators with fixes of a ship and ranges to beacons: consistency, late readings, one beacon beside the bound."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.bound import bound_of_run
from simnav.scoring.navigation_error import errors
from simnav.simulation.simulator import ideal
from simnav.source import record
from simnav.trial import run_trial
from tests.audit.acoustic import nees_at_the_end
from tests.cases.positioned_by_sound import positioned_by_sound


@pytest.mark.parametrize("instrument", ["usbl", "lbl", "one-way"])
def test_filter_and_window_agree_and_are_consistent(instrument: str) -> None:
    """Two runs show no more; ``python -m tests.audit acoustic`` measures 0.9 to 1.1 over many."""
    scenario = positioned_by_sound(instrument, 40.0)
    found = {row: [nees_at_the_end(row, scenario, seed) for seed in (11, 12)] for row in ("ekf", "sw-fgo")}
    np.testing.assert_allclose(found["sw-fgo"], found["ekf"], rtol=0.15, atol=0.1)
    assert 0.18 < np.mean(found["ekf"]) < 2.8  # chi-square of 12 degrees of freedom: 2 in 1000 are outside


def test_late_fixes_count_at_their_time() -> None:
    recording = record(positioned_by_sound("usbl", 60.0, timing={"latency_s": 1.5}), 21)
    stream = recording.data.aids["sound"]
    assert (stream.arrivals - stream.time > 1.6).all()
    rms = {}
    for late in ("replay", "arrival"):
        trial = run_trial(make("ekf", late=late), recording)
        rms[late] = np.sqrt(np.mean(errors(trial, recording)[20:, :2] ** 2))
    assert rms["replay"] < rms["arrival"]


def test_one_beacon_is_enough_where_the_vehicle_turns() -> None:
    """The bound shows what one range cannot see: the direction across, until the line of sight has turned."""
    scenario = positioned_by_sound("one beacon", 120.0)
    seeds = range(31, 35)
    clean = ideal(scenario, seeds[0])
    covariance = bound_of_run(clean, "clean")[:, :2, :2]
    axes = np.sort(np.sqrt(np.linalg.eigvalsh(covariance)), axis=1)
    assert axes[15, 0] < 0.5
    assert axes[15, 1] > 3.9  # as much as at the start
    assert axes[40:, 1].max() < 2.0
    squares, expected = [], np.trace(covariance[60:], axis1=1, axis2=2).mean()
    for seed in seeds:
        recording = record(scenario, seed)
        trial = run_trial(make("ekf"), recording)
        squares.append(np.sum(errors(trial, recording)[60:, :2] ** 2, axis=1).mean())
    assert 0.4 < np.sqrt(np.mean(squares) / expected) < 1.6
