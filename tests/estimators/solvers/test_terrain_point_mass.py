"""The point-mass filter over soundings: the Kalman filter over a plane, the bound over terrain, false soundings."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import UnsuitableScenario, make
from simnav.estimators.bound import bound_of_run
from simnav.estimators.solvers.terrain_point_mass import TerrainPointMass
from simnav.recording import Recording
from simnav.scoring.navigation_error import errors
from simnav.simulation.simulator import ideal
from simnav.source import record
from simnav.trial import Trial, run_trial
from simnav.types import Array
from tests.cases.over_terrain import over_terrain

PLANE = {"roughness_m": 0.0, "slope_percent": 8.0, "slope_direction_deg": 20.0, "extent_m": [1500.0, 1500.0]}


def run(row: str, recording: Recording, **parameters: float) -> Trial:
    trial = run_trial(make(row, **parameters), recording)
    assert trial.status == "ok", trial.reason
    return trial


def test_over_a_plane_it_is_the_kalman_filter() -> None:
    """Also with states of the instrument that a sounding depends on, and several beams at one time."""
    sounder = {
        "sound_speed_percent": 0.5,
        "chart_error_m": 0.3,
        "kind": "multibeam_profile",
        "beams": 2,
        "rate_hz": 0.5,
    }
    recording = record(over_terrain(24.0, bottom=PLANE, position=5.0, sounder=sounder), 3)
    ours, ekf = run("terrain-pmf", recording, outliers=0.0), run("ekf", recording)
    sigma = np.sqrt(np.diagonal(ekf.covariance, axis1=1, axis2=2))
    apart = errors(ours, recording) - errors(ekf, recording)
    assert abs(apart / sigma).max() < 0.1
    np.testing.assert_allclose(np.sqrt(np.diagonal(ours.covariance, axis1=1, axis2=2)) / sigma, 1.0, atol=0.04)
    assert sigma[-1, 0] < 4.2  # the slope tells the north by 0.3 m / 8 %


def test_it_finds_its_place_over_terrain_and_keeps_the_bound() -> None:
    """Two runs show no more; ``python -m tests.audit terrain`` measures over many."""
    scenario = over_terrain(70.0, position=25.0)
    bound = np.trace(bound_of_run(ideal(scenario, 61), "clean")[45:, :2, :2], axis1=1, axis2=2).mean()
    squares: list[Array] = []
    for seed in (61, 62):
        recording = record(scenario, seed)
        trial = run("terrain-pmf", recording, nodes=4000)
        error = errors(trial, recording)[:, :2]
        squares.append(np.mean(np.sum(error[45:] ** 2, axis=1)))
        assert np.hypot(*error[0]) > 5.0
    assert 0.3 < np.sqrt(np.mean(squares) / bound) < 1.8


def test_false_soundings_do_not_move_it() -> None:
    """A quarter of the soundings is of something above the bottom."""
    recording = record(over_terrain(40.0, position=8.0, sounder={"false_readings": 0.25}), 9)
    assert 5 < np.count_nonzero(recording.data.aids["sounder"].faults) < 20
    trial = run("terrain-pmf", recording, nodes=4000)
    error = errors(trial, recording)[20:, :2]
    assert np.hypot(*error.T).max() < 5.0


def test_it_says_what_it_needs_and_which_parameters_are_wrong() -> None:
    assert ("altimeter", "multibeam_profile") in make("terrain-pmf").needs
    recording, row = record(over_terrain(2.0), 1), make("terrain-pmf")
    with pytest.raises(UnsuitableScenario, match="altimeter"):
        row.reset(recording.start, recording.instruments.without({"sounder"}))
    for wrong, words in (({"nodes": 10}, "nodes = 10: should be 100 or more"), ({"outliers": 1.0}, "outliers = 1")):
        with pytest.raises(ValueError, match=words):
            TerrainPointMass(model=None, **wrong)  # type: ignore[arg-type]
