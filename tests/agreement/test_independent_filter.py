"""The EKF against a filter of another author and another formulation: python-ins's, on the same measurements.

Theirs has position, velocity and attitude errors by the modified phi-angle model (B. M. Scherzinger and D. B. Reid,
"Modified strapdown inertial navigator error models", IEEE PLANS 1994), its own strapdown integration and its own
Earth. With an IMU and position fixes only, both are the same estimator to first order.
"""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest
from pyins import _numba_integrate, filters, inertial_sensor, measurements, strapdown

import simnav
from simnav.estimator import make
from simnav.geometry import earth
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.types import Array, TriadDatasheet
from tests.agreement.kf_gins import imu_and_fixes

STATE = ["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"]


def equal_in_all_directions(duration: float) -> Scenario:
    """``open-sea`` with IMU and fixes only, equally good in all directions: their filter takes one sigma for three."""
    scenario = load("open-sea").with_values(
        {
            "duration_s": duration,
            "initial_error.position_m": [2.0, 2.0, 2.0],
            "instruments.gnss.sigma_m": [1.5, 1.5, 1.5],
        }
    )
    return imu_and_fixes(scenario)


def triad(sheet: TriadDatasheet) -> inertial_sensor.EstimationModel:
    """Their model of three gyroscopes or accelerometers, of our datasheet."""
    return inertial_sensor.EstimationModel(sheet.bias, sheet.random_walk, sheet.rate_random_walk or None)


def theirs(recording: Recording, times: Array) -> tuple[Array, Array]:
    """Their positions at some times: latitude, longitude [rad], height [m]; and sigmas north, east, down [m]."""
    imu, start, fixes = recording.data.imu, recording.start, recording.data.aids["gnss"]
    sheet, interval = recording.instruments["gnss"], imu.interval[:, None]
    raw = pd.DataFrame(
        np.hstack([imu.angular_rate * interval, imu.specific_force * interval]),
        index=imu.time,
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )
    raw = pd.concat([raw.iloc[:1].set_axis([start.time]), raw])
    begin = [*np.degrees(start.position[:2]), start.position[2], *start.velocity, *np.degrees(start.attitude)]
    positions = np.column_stack([np.degrees(fixes.value[:, :2]), fixes.value[:, 2]])
    sigma = np.sqrt(np.diag(start.covariance))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pandas, about python-ins
        found = filters.run_feedback_filter(
            pd.Series(begin, index=STATE, name=start.time), sigma[0], sigma[3], *np.degrees(sigma[[6, 8]]),
            strapdown.compute_increments_from_imu(raw, "increment"),
            triad(recording.instruments.imu.gyroscope), triad(recording.instruments.imu.accelerometer),
            [measurements.Position(pd.DataFrame(positions, fixes.time, STATE[:3]), sheet.sigma[0], sheet.lever_arm)],
            time_step=1.0,
        )  # fmt: skip
    found_at = [frame.index.get_indexer(times, "nearest") for frame in (found.trajectory, found.trajectory_sd)]
    positions = found.trajectory.iloc[found_at[0]][STATE[:3]].to_numpy()
    sigmas = found.trajectory_sd.iloc[found_at[1]][["north", "east", "down"]].to_numpy()
    assert np.abs(found.trajectory.index[found_at[0]] - times).max() < 1e-6
    return np.column_stack([np.radians(positions[:, :2]), positions[:, 2]]), sigmas


@pytest.fixture(autouse=True)
def as_python(monkeypatch: pytest.MonkeyPatch):
    """Their integration without Numba, which takes twenty seconds to compile it, and a second to run it once."""
    for name in ("gravity", "mat_from_rotvec", "integrate"):
        function = getattr(_numba_integrate, name)
        monkeypatch.setattr(_numba_integrate, name, function.py_func)
    monkeypatch.setattr(strapdown, "integrate", _numba_integrate.integrate)


@pytest.mark.parametrize("seed", [1000, 1001])
def test_the_filter_of_another_author_has_the_same_estimates(seed: int):
    recording = simnav.record(equal_in_all_directions(60.0), seed)
    trial = simnav.run_trial(make("ekf"), recording)
    now = slice(0, -1)  # theirs ends before its last measurement
    times, ours = trial.time[now], trial.position[now]
    positions, sigmas = theirs(recording, times)
    sigma = np.sqrt(np.diagonal(trial.covariance, axis1=1, axis2=2))[now, :3]
    truth = recording.data.truth
    true = truth.position[np.searchsorted(truth.time, times - 1e-6)]
    np.testing.assert_allclose(sigmas, sigma, rtol=2e-3)
    np.testing.assert_allclose(earth.relative_position(positions, ours) / sigma, 0.0, atol=0.05)
    rmse = [np.sqrt(np.mean(earth.relative_position(p, true)[:, :2] ** 2)) for p in (ours, positions)]
    assert rmse[1] / rmse[0] == pytest.approx(1.0, abs=0.005)
