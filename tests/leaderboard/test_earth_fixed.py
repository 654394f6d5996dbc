"""A velocity that is fixed to the Earth, in the error of a speed: it is found where there is one, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.leaderboard.identification.earth_fixed import earth_fixed
from simnav.scenario.residuals import ErrorSeries
from simnav.types import Array, TapStates

KEY = "sigma_m_s"
#: Velocity to the north and to the east in each of three recordings [m/s].
VELOCITIES = np.array([[0.008, -0.003], [-0.002, 0.009], [-0.006, -0.007]])


def voyage(seed: int, velocity: Array, components: int = 3, turns: float = 2.0, n: int = 600) -> ErrorSeries:
    """A slow error of 0.005 m/s over 20 s with a bias, beside a velocity that is fixed to the Earth."""
    rng = np.random.default_rng(seed)
    time, zeros = np.arange(n, dtype=np.float64), np.zeros((n, 3))
    heading = turns * 2.0 * np.pi * time / n
    slow = np.empty((n, components))
    slow[0] = 0.005 * rng.standard_normal(components)
    keep = np.exp(-1.0 / 20.0)
    for k in range(1, n):
        slow[k] = keep * slow[k - 1] + 0.005 * np.sqrt(1.0 - keep**2) * rng.standard_normal(components)
    (north, east), c, s = velocity, np.cos(heading), np.sin(heading)
    fixed = np.stack([north * c + east * s, east * c - north * s, np.zeros(n)], axis=1)[:, :components]
    taps = TapStates(time, zeros, zeros, np.stack([0.0 * heading, 0.0 * heading, heading], axis=1), zeros, zeros)
    return ErrorSeries(str(seed), time, slow + fixed + 0.01, 1.0, float(n), taps)


@pytest.mark.parametrize("components", [1, 3])
def test_the_velocity_is_found_and_taken_out(components: int):
    series = [voyage(k, velocity, components) for k, velocity in enumerate(VELOCITIES)]
    found = earth_fixed(series)
    assert found is not None
    assert found.size == pytest.approx(np.sqrt(np.mean(VELOCITIES**2)), rel=0.25)
    without = [voyage(k, np.zeros(2), components) for k in range(len(VELOCITIES))]
    for rest, told in zip(found.rest, without, strict=True):
        # What is left is the error without that velocity; a mean of the recording may go to either.
        off = (rest.error - rest.error.mean(axis=0)) - (told.error - told.error.mean(axis=0))
        assert np.sqrt(np.mean(off**2)) < 0.003
    one, other = found.processes(KEY, components)
    assert (one["proportional_to"], other["proportional_to"]) == ({"cos_heading": 1.0}, {"sin_heading": 1.0})
    size = float(f"{found.size:.3g}")
    assert one[KEY] == (size if components == 1 else [size, size, 0.0])


@pytest.mark.parametrize("seed", [0, 10, 20, 30])
def test_a_slow_error_alone_is_not_fixed_to_the_earth(seed: int):
    assert earth_fixed([voyage(seed + k, np.zeros(2)) for k in range(3)]) is None


def test_a_straight_course_tells_nothing():
    assert earth_fixed([voyage(k, velocity, turns=0.0) for k, velocity in enumerate(VELOCITIES)]) is None


def test_without_the_motion_nothing_is_found():
    one = voyage(0, VELOCITIES[0])
    assert earth_fixed([ErrorSeries("n", one.time, one.error, 1.0, one.duration)]) is None
