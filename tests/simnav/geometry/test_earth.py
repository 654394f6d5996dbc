"""The WGS-84 Earth, against python-ins and against itself."""

from __future__ import annotations

import numpy as np
import pyins.earth
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simnav.geometry import earth

LATITUDES = np.radians(np.linspace(-89.0, 89.0, 41))


def test_radii_agree_with_an_independent_implementation():
    meridian, prime_vertical = earth.principal_radii(LATITUDES)
    theirs = pyins.earth.principal_radii(np.degrees(LATITUDES), 0.0)
    np.testing.assert_allclose(meridian, theirs[0], rtol=1e-14)
    np.testing.assert_allclose(prime_vertical, theirs[1], rtol=1e-14)


@pytest.mark.parametrize("height", [-5000.0, 0.0, 3000.0])
def test_gravity_agrees_with_an_independent_implementation(height):
    # They take the free-air gradient of a sphere, 2/a; ours adds flattening and rotation, at most 1% of it.
    theirs = pyins.earth.gravity(np.degrees(LATITUDES), height)
    np.testing.assert_allclose(earth.gravity(LATITUDES, height), theirs, rtol=1e-9 + 0.01 * 2 * abs(height) / 6.378e6)
    np.testing.assert_allclose(earth.gravity(LATITUDES), pyins.earth.gravity(np.degrees(LATITUDES), 0.0), rtol=1e-9)


def test_kernels_agree_with_the_functions():
    for latitude in LATITUDES[::7]:
        m, n = earth.radii_scalar(np.sin(latitude))
        g = earth.gravity_scalar(np.sin(latitude), 120.0)
        np.testing.assert_allclose((m, n), earth.principal_radii(latitude), rtol=1e-14)
        assert g == pytest.approx(float(earth.gravity(latitude, 120.0)), rel=1e-15)


def test_gravity_at_the_equator_and_the_pole():
    """NIMA TR8350.2, table 3.4: 9.7803253359 and 9.8321849378 m/s^2."""
    assert earth.gravity(0.0) == pytest.approx(9.7803253359, abs=1e-12)
    assert earth.gravity(np.pi / 2) == pytest.approx(9.8321849378, abs=1e-9)


def test_earth_rate_is_along_the_axis():
    rate = earth.earth_rate(LATITUDES)
    np.testing.assert_allclose(np.linalg.norm(rate, axis=-1), earth.ROTATION_RATE, rtol=1e-15)
    np.testing.assert_allclose(rate, np.radians(0) + pyins.earth.rate_n(np.degrees(LATITUDES)), atol=1e-18)


@given(
    st.floats(-1.4, 1.4), st.floats(-np.pi, np.pi), st.floats(-500, 500),
    st.tuples(*[st.floats(-2000, 2000)] * 3),
)  # fmt: skip
def test_displace_and_relative_position_are_inverse(latitude, longitude, height, offset):
    origin = np.array([latitude, longitude, height])
    back = earth.relative_position(earth.displace(origin, np.array(offset)), origin)
    np.testing.assert_allclose(back, offset, atol=2e-8)


def test_relative_position_across_the_date_line():
    a, b = np.array([0.3, np.pi - 1e-7, 0.0]), np.array([0.3, -np.pi + 1e-7, 0.0])
    assert earth.relative_position(b, a)[1] == pytest.approx(2e-7 * 6383480.0 * np.cos(0.3), rel=1e-3)
