"""The strapdown algebra: against itself, against closed forms, and against python-ins."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pyins.sim
import pyins.strapdown
import pytest

from simnav.geometry import earth
from simnav.geometry.rotation import dcm_from_rpy, rotation_vector_from_dcm
from simnav.inverse_strapdown import increments
from simnav.strapdown import integrate
from simnav.types import ImuSamples, NavigationStates

POSITION = np.array([np.radians(58.0), np.radians(-5.0), 0.0])
DEG_H = np.radians(1.0) / 3600.0
UG = 9.80665e-6


def attitude(t):
    """A ship in a seaway: closed form, with first derivative."""
    angle = np.stack([0.15 * np.sin(0.6 * t), 0.05 * np.sin(0.8 * t + 1.0), 0.3 * np.sin(0.1 * t) + 0.05 * t], axis=-1)
    rate = np.stack([0.09 * np.cos(0.6 * t), 0.04 * np.cos(0.8 * t + 1.0), 0.03 * np.cos(0.1 * t) + 0.05], axis=-1)
    return angle, rate


def velocity(t):
    """North-east-down velocity and acceleration along the heading of `attitude`, with waves on top."""
    angle, rate = attitude(t)
    psi, r = angle[..., 2], rate[..., 2]
    v = np.stack([8 * np.cos(psi) + 0.3 * np.sin(0.7 * t), 8 * np.sin(psi), 0.5 * np.cos(0.7 * t)], axis=-1)
    a = np.stack([-8 * np.sin(psi) * r + 0.21 * np.cos(0.7 * t), 8 * np.cos(psi) * r, -0.35 * np.sin(0.7 * t)], axis=-1)
    return v, a


def instantaneous(t, position):
    """Angular rate and specific force from the textbook equations (Groves eqs. 2.58, 5.53), without any increment."""
    (roll, pitch, _), (dr, dp, dy) = np.moveaxis(attitude(t)[0], -1, 0), np.moveaxis(attitude(t)[1], -1, 0)
    body = np.stack(
        [
            dr - dy * np.sin(pitch),
            dp * np.cos(roll) + dy * np.sin(roll) * np.cos(pitch),
            -dp * np.sin(roll) + dy * np.cos(roll) * np.cos(pitch),
        ],
        axis=-1,
    )
    v, a = velocity(t)
    c = dcm_from_rpy(attitude(t)[0])
    latitude, height = position[..., 0], position[..., 2]
    m, n = earth.principal_radii(latitude)
    ie = earth.earth_rate(latitude)
    en = np.stack(
        [v[..., 1] / (n + height), -v[..., 0] / (m + height), -v[..., 1] * np.tan(latitude) / (n + height)], axis=-1
    )
    g = np.zeros_like(v)
    g[..., 2] = earth.gravity(latitude, height)
    force = a - g + np.cross(2 * ie + en, v)
    to_body = np.swapaxes(c, -1, -2)
    return body + (to_body @ (ie + en)[..., None])[..., 0], (to_body @ force[..., None])[..., 0]


def mean_of_analytic(dt, n):
    """Means of the analytic angular rate and specific force over n intervals, by Gauss-Legendre quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    t = (np.arange(n)[:, None] + 0.5 * (nodes + 1.0)) * dt
    fine = np.linspace(0.0, n * dt, 20 * n + 1)
    v = velocity(fine)[0]
    # The position enters through gravity and rates only: a trapezoid is good to 1e-6 m here.
    travelled = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(fine)[:, None], axis=0)])
    at = np.stack([np.interp(t, fine, travelled[:, i]) for i in range(3)], axis=-1)
    rate, force = instantaneous(t, earth.displace(POSITION, at))
    return (rate * weights[:, None]).sum(1) / 2, (force * weights[:, None]).sum(1) / 2


def deviation(dt, duration=120.0):
    """Rms difference of the increments from the analytic means, [deg/h] and [ug]."""
    n = round(duration / dt)
    t = np.arange(n + 1) * dt
    samples, _ = increments(t, POSITION, velocity(t)[0], attitude(t)[0])
    rate, force = mean_of_analytic(dt, n)
    # The first sample has no predecessor to correct its coning with.
    return (
        np.sqrt(np.mean((samples.angular_rate - rate)[1:] ** 2)) / DEG_H,
        np.sqrt(np.mean((samples.specific_force - force)[1:] ** 2)) / UG,
    )


def test_increments_agree_with_the_analytic_integrals():
    gyroscope, accelerometer = deviation(0.01)
    assert gyroscope < 0.001
    assert accelerometer < 1.0


def test_increments_converge_at_third_order():
    errors = np.array([deviation(dt) for dt in (0.08, 0.04, 0.02)])
    order = np.log2(errors[:-1] / errors[1:])
    np.testing.assert_allclose(order, 3.0, atol=0.25)


def test_hour_in_a_seaway_returns_to_the_truth():
    t = np.arange(360_001) * 0.01
    v, angle = velocity(t)[0], attitude(t)[0]
    samples, positions = increments(t, POSITION, v, angle)
    states = integrate(POSITION, v[0], angle[0], samples)
    assert np.abs(earth.relative_position(states.position, positions[1:])).max() < 1e-3
    assert np.abs(states.velocity - v[1:]).max() < 1e-5
    last = slice(None, None, 1000)
    turned = dcm_from_rpy(states.attitude[last]) @ np.swapaxes(dcm_from_rpy(angle[1:][last]), -1, -2)
    assert np.abs(rotation_vector_from_dcm(turned)).max() < 1e-7


def test_at_rest_only_gravity_and_the_earth_are_felt():
    t = np.arange(101) * 0.01
    level = np.zeros((101, 3))
    samples, positions = increments(t, POSITION, level, level)
    np.testing.assert_allclose(samples.angular_rate, np.tile(earth.earth_rate(POSITION[0]), (100, 1)), atol=1e-13)
    np.testing.assert_allclose(samples.specific_force[:, 2], -float(earth.gravity(POSITION[0])), atol=1e-10)
    np.testing.assert_array_equal(positions, np.tile(POSITION, (101, 1)))


def test_schuler_oscillation():
    """A level error of 1e-4 rad swings at the Schuler period: 84.4 minutes (Groves section 5.7.2).

    Height is held by aiding in practice; here a run of half a period shows the swing before the vertical channel
    diverges.
    """
    n = 12_000
    t = np.arange(n + 1) * 0.1
    still = np.zeros((n + 1, 3))
    position = np.array([0.0, 0.0, 0.0])
    samples, _ = increments(t, position, still, still)
    tilted = integrate(position, np.zeros(3), np.array([0.0, 1e-4, 0.0]), samples)
    schuler = np.sqrt(earth.gravity(0.0) / earth.principal_radii(0.0)[0])
    # Nose up by 1e-4: the vessel seems to be accelerated backwards by g times the tilt.
    expected = -1e-4 * np.sqrt(earth.gravity(0.0) * earth.principal_radii(0.0)[0]) * np.sin(schuler * t[1:])
    np.testing.assert_allclose(tilted.velocity[:, 0], expected, atol=2e-3 * np.abs(expected).max())


def as_pyins(states: NavigationStates, k: int) -> pd.Series:
    return pd.Series(
        [
            *np.degrees(states.position[k, :2]),
            states.position[k, 2],
            *states.velocity[k],
            *np.degrees(states.attitude[k]),
        ],
        index=["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"],
    )


def python_ins_minus_ours(dt, duration=600.0):
    """End point of python-ins's integration of our samples, minus ours: position, velocity, attitude."""
    n = round(duration / dt)
    t = np.arange(n + 1) * dt
    v, angle = velocity(t)[0], attitude(t)[0]
    samples, positions = increments(t, POSITION, v, angle)
    interval = samples.interval[:, None]
    raw = pd.DataFrame(
        np.hstack([samples.angular_rate * interval, samples.specific_force * interval]),
        index=samples.time,
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )
    corrected = pyins.strapdown.compute_increments_from_imu(pd.concat([raw.iloc[:1].set_axis([0.0]), raw]), "increment")
    pva = as_pyins(NavigationStates(t[:1], POSITION[None], v[:1], angle[:1]), 0)
    pva.name = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pandas, about python-ins
        end = pyins.strapdown.Integrator(pva).integrate(corrected).iloc[-1]
    last = np.array([np.radians(end.lat), np.radians(end.lon), end.alt])
    theirs = dcm_from_rpy(np.radians(end[["roll", "pitch", "heading"]].to_numpy(dtype=float)))
    return (
        earth.relative_position(last, positions[-1]),
        end[["VN", "VE", "VD"]].to_numpy(dtype=float) - v[-1],
        rotation_vector_from_dcm(theirs @ dcm_from_rpy(angle[-1]).T),
    )


def test_python_ins_integrates_our_samples_to_our_trajectory():
    """An independent integrator ends where we do, up to its own truncation.

    Ours returns to rounding; theirs is of second order in the vertical, so that halving the interval quarters the
    difference.
    """
    coarse, fine = python_ins_minus_ours(0.02), python_ins_minus_ours(0.01)
    assert np.abs(fine[0][:2]).max() < 0.005
    assert np.abs(fine[0][2]) < 0.3
    assert coarse[0][2] / fine[0][2] == pytest.approx(4.0, rel=0.1)
    assert np.abs(fine[1]).max() < 1e-3
    assert np.abs(fine[2]).max() < 1e-7


def test_python_ins_simulates_our_samples():
    """Their increments come from splines through the trajectory; at 100 Hz the two agree to their own truncation."""
    t = np.arange(12_001) * 0.01
    v, angle = velocity(t)[0], attitude(t)[0]
    samples, _ = increments(t, POSITION, v, angle)
    lla = [np.degrees(POSITION[0]), np.degrees(POSITION[1]), POSITION[2]]
    _, imu = pyins.sim.generate_imu(t, lla, np.degrees(angle), v, sensor_type="increment")
    theirs = imu.to_numpy()[1:] / 0.01
    inner = slice(200, -200)  # spline ends
    gyroscope = np.sqrt(np.mean((theirs[inner, :3] - samples.angular_rate[inner]) ** 2))
    accelerometer = np.sqrt(np.mean((theirs[inner, 3:] - samples.specific_force[inner]) ** 2))
    assert gyroscope < 0.001 * DEG_H
    assert accelerometer < 40e-6


@pytest.mark.parametrize("bad", [1, 2])
def test_times_that_do_not_ascend_are_named(bad):
    t = np.array([0.0, 0.01, 0.02])
    t[bad] = t[bad - 1]
    with pytest.raises(ValueError, match=f"times must ascend; they do not at index {bad}"):
        increments(t, POSITION, np.zeros((3, 3)), np.zeros((3, 3)))


def test_empty_run():
    empty = ImuSamples(np.empty(0), np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
    assert len(integrate(POSITION, np.zeros(3), np.zeros(3), empty)) == 0
