"""Rays of sound against closed forms and the ray equations, and the profiles of the speed of sound."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from simnav.spec import SpecError
from simnav.types import Array
from simnav.world import SoundSpeedProfile
from simnav.world.rays import trace
from simnav.world.sound_speed import Profile

#: A surface layer that was warmed, a thermocline, and cold water below: depths [m], speeds [m/s].
SUMMER = Profile(np.array([0.0, 20.0, 60.0, 100.0, 300.0]), np.array([1510.0, 1508.0, 1485.0, 1480.0, 1483.0]))


def one(profile: Profile, first: float, second: float, distance: float, bottom: float = np.inf) -> tuple[float, float]:
    """Time and depression of one ray."""
    rays = trace(profile, np.array([first]), np.array([second]), np.array([distance]), bottom)
    return float(rays.time[0]), float(rays.depression[0])


@pytest.mark.parametrize("gradient", [0.017, -0.2, 0.0])
def test_a_ray_in_a_constant_gradient_is_an_arc(gradient: float) -> None:
    # t = 2 arcsinh(g sqrt((x^2 + z^2) / (4 c1 c2))) / g, also where the arc turns on its way.
    profile = Profile(np.array([0.0, 1000.0]), np.array([1500.0, 1500.0 + 1000.0 * gradient]))
    first = np.array([400.0, 400.0, 400.0, 450.0, 700.0, 400.0])
    second = np.array([460.0, 400.0, 402.0, 400.0, 100.0, 400.0001])
    distance = np.array([100.0, 1000.0, 1500.0, 900.0, 1000.0, 5.0])
    square = distance**2 + (second - first) ** 2
    expected = np.sqrt(square) / 1500.0
    if gradient:
        ends = profile.at(first) * profile.at(second)
        expected = 2.0 * np.arcsinh(abs(gradient) * np.sqrt(square / (4.0 * ends))) / abs(gradient)
    np.testing.assert_allclose(trace(profile, first, second, distance).time, expected, rtol=3e-8)


def shoot(profile: Profile, depth: float, depression: float, distance: float) -> Array:
    """Depth [m] and time [s] of a ray at a distance, by the ray equations: d theta / ds = p dc/dz."""

    def equations(s: float, state: Array) -> list[float]:
        _, z, angle, _ = state
        speed = float(profile.at(np.array([z]))[0])
        slope = float(np.diff(profile.at(np.array([z - 1e-3, z + 1e-3])))[0]) / 2e-3
        return [np.cos(angle), np.sin(angle), -np.cos(angle) / speed * slope, 1.0 / speed]

    def there(s: float, state: Array) -> float:
        return float(state[0] - distance)

    there.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        equations, [0.0, 3.0 * distance], [0.0, depth, depression, 0.0], events=there, rtol=1e-9, max_step=4.0
    )
    return np.asarray(found.y[[1, 3], -1])


@pytest.mark.parametrize(
    ("first", "second", "distance"),
    [(5.0, 90.0, 400.0), (90.0, 5.0, 400.0), (5.0, 250.0, 1000.0), (80.0, 100.0, 1000.0), (15.0, 40.0, 800.0)],
)
def test_ranges_are_those_of_the_ray_equations(first: float, second: float, distance: float) -> None:
    """The range that a device makes of the time by the true ray is right to 0.05 % up to 1 km; here to 0.002 %."""
    time, depression = one(SUMMER, first, second, distance)
    depth, integrated = shoot(SUMMER, first, depression, distance)
    assert depth == pytest.approx(second, abs=0.05)
    assert time == pytest.approx(integrated, rel=2e-5)


def test_a_device_with_one_speed_is_wrong() -> None:
    time, _ = one(SUMMER, 5.0, 90.0, 400.0)
    length = np.hypot(85.0, 400.0)
    mean = SUMMER.harmonic_mean(np.array([5.0]), np.array([90.0]))[0]
    takes = quad(lambda z: 1.0 / SUMMER.at(np.array([z]))[0], 5.0, 90.0, points=[20.0, 60.0])[0]
    assert mean == pytest.approx(85.0 / takes, rel=1e-9)
    assert 1e-6 < abs(mean * time / length - 1.0) < 1e-3  # the bend only
    assert 1510.0 * time / length - 1.0 > 0.008


def test_there_are_shadows() -> None:
    peak = Profile(np.array([0.0, 100.0, 200.0]), np.array([1480.0, 1500.0, 1480.0]))
    assert np.isfinite(one(peak, 90.0, 110.0, 100.0)[0])
    assert np.isnan(one(peak, 90.0, 110.0, 3000.0)[0])
    upwards = Profile(np.array([0.0, 400.0]), np.array([1440.0, 1446.0]))
    assert np.isfinite(one(upwards, 100.0, 100.0, 3000.0)[0])
    assert np.isnan(one(upwards, 100.0, 100.0, 3000.0, bottom=105.0)[0])  # it would turn 11.7 m below
    assert np.isfinite(one(Profile(np.array([0.0]), np.array([1500.0])), 10.0, 10.0, 3000.0)[0])


def mackenzie(depth: float, temperature: float, salinity: float) -> float:
    """Nine-term equation for the sound speed in the oceans (Mackenzie, J. Acoust. Soc. Am. 70, 1981) [m/s]."""
    t, s, z = temperature, salinity - 35.0, depth
    return (
        1448.96 + 4.591 * t - 5.304e-2 * t**2 + 2.374e-4 * t**3 + 1.340 * s + 1.630e-2 * z + 1.675e-7 * z**2
        - 1.025e-2 * t * s - 7.139e-13 * t * z**3
    )  # fmt: skip


def test_the_speed_by_salinity_and_temperature_agrees_with_another_formula() -> None:
    import gsw

    table = {"depth_m": [0, 50, 800], "salinity_g_kg": [34.5, 34.8, 35.2], "temperature_celsius": [16, 9, 4]}
    profile = SoundSpeedProfile.from_toml(table).build("sound_speed_profile", 1)
    for depth, absolute, conservative in zip(*table.values(), strict=True):
        pressure = gsw.p_from_z(-depth, 45.0)
        practical = gsw.SP_from_SA(absolute, pressure, 0.0, 45.0)
        expected = mackenzie(depth, gsw.t_from_CT(absolute, conservative, pressure), practical)
        assert profile.at(np.array([depth]))[0] == pytest.approx(expected, abs=0.35)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"speed_m_s": 0.0}, "speed_m_s = 0: sound in water has 1350 to 1700 m/s"),
        ({"depth_m": [0, 10], "speed_m_s": 1500.0}, "speed_m_s has 1 numbers and depth_m 2; each depth has one"),
        ({}, "give speed_m_s, or salinity_g_kg and temperature_celsius"),
        ({"depth_m": [10, 0], "speed_m_s": [1500, 1490]}, "depths are ascending"),
        ({"salinity_g_kg": 35.0, "temperature_celsius": 50.0}, "sea water has -2 to 40"),
    ],
)
def test_bad_input_gets_a_sentence(table: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        SoundSpeedProfile.from_toml(table)
