"""Point solutions: exact without errors, as RTKLIB's, with a covariance and a test of integrity that are true."""

from __future__ import annotations

from datetime import datetime

import numpy as np
import pytest
from scipy.stats import binom

from simnav.geometry.earth import relative_position
from simnav.geometry.ecef import ecef_from_geodetic
from simnav.satellites.orbit import SPEED_OF_LIGHT
from simnav.satellites.point_solution import Ranges, monitored, solve
from simnav.satellites.rinex_navigation import read_navigation
from simnav.satellites.sky import Sky
from simnav.satellites.time_scales import gps_time
from simnav.sensors.gnss_raw import SHIPPED

EPOCH = datetime(2023, 3, 12, 12)
PLACE, VELOCITY = np.array([np.radians(54.0), np.radians(7.9), 30.0]), np.array([5.0, 3.0, 0.2])
SATELLITES = ("G02", "G11", "G12", "G25", "G28", "G29", "G31", "E02", "E27", "E30")


@pytest.fixture(scope="module")
def seen():
    return Sky(read_navigation(SHIPPED), SATELLITES, EPOCH).sight(np.array([600.0]), PLACE[None], VELOCITY[None])


def ranges(seen, error=0.0, rate_error=0.0, *, count=10, sigma=None) -> Ranges:
    """Observations with a clock that is 250 m and 70 m/s off."""
    n = count
    sigma = np.ones(n) if sigma is None else sigma
    return Ranges(
        seen.position[0, :n], seen.velocity[0, :n], seen.range[0, :n] + 250.0 + error,
        seen.range_rate[0, :n] + 70.0 + rate_error, np.diag(sigma**2), np.full(n, 0.05),
    )  # fmt: skip


@pytest.mark.parametrize("count", [4, 10])
def test_without_errors_the_solution_is_the_truth(seen, count):
    found = solve(ranges(seen, count=count))
    np.testing.assert_allclose(relative_position(found.position, PLACE), 0.0, atol=1e-5)
    np.testing.assert_allclose(found.velocity, VELOCITY, atol=1e-7)
    assert (found.clock, found.drift) == pytest.approx((250.0, 70.0), abs=1e-5)
    assert found.statistic == pytest.approx(0.0, abs=1e-8)
    assert solve(ranges(seen, count=3)) is None


def test_errors_have_the_covariance_that_it_states(seen):
    rng = np.random.default_rng(1)
    sigma = np.linspace(0.5, 2.0, 10)
    errors, speeds, statistics = [], [], []
    for _ in range(400):
        found = solve(ranges(seen, sigma * rng.standard_normal(10), 0.05 * rng.standard_normal(10), sigma=sigma))
        errors.append(relative_position(found.position, PLACE))
        speeds.append(found.velocity - VELOCITY)
        statistics.append(found.statistic)
    for sample, covariance in ((errors, found.covariance), (speeds, found.velocity_covariance)):
        normal = np.linalg.solve(np.linalg.cholesky(covariance), np.array(sample).T)
        np.testing.assert_allclose(np.cov(normal), np.eye(3), atol=0.25)
    assert np.mean(statistics) == pytest.approx(6.0, abs=0.7)


def test_dilution_of_precision(seen):
    """From the definition, with rows of direction cosines in east, north, up."""
    found = solve(ranges(seen))
    elevation, azimuth = seen.elevation[0], seen.azimuth[0]
    level = np.cos(elevation)
    design = np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation), np.ones(10)], axis=1)
    variance = np.diag(np.linalg.inv(design.T @ design))
    wanted = np.sqrt([variance[:2].sum(), variance[2], variance[:3].sum()])
    np.testing.assert_allclose(found.dilution, wanted, rtol=1e-6)


def test_false_alarms_of_the_integrity_test(seen):
    """Within the 99.9 % binomial interval of the setting."""
    rng, runs, rate = np.random.default_rng(2), 1500, 0.02
    alarms = 0
    for _ in range(runs):
        found = monitored(ranges(seen, rng.standard_normal(10)), rate)
        alarms += found is None or not found.used.all()
    low, high = binom.ppf([0.0005, 0.9995], runs, rate)
    assert low <= alarms <= high


def test_a_wrong_satellite_is_excluded(seen):
    rng, right = np.random.default_rng(3), 0
    for k in range(50):
        error = rng.standard_normal(10)
        error[k % 10] += 25.0
        found = monitored(ranges(seen, error), 1e-4)
        right += found is not None and np.flatnonzero(~found.used).tolist() == [k % 10]
    assert right >= 48


def test_with_one_satellite_too_many_a_fault_is_found_but_not_its_satellite(seen):
    error = np.zeros(5)
    error[2] = 200.0
    assert monitored(ranges(seen, error, count=5), 1e-4) is None
    assert monitored(ranges(seen, error, count=5), 0.0) is not None


def test_point_solution_of_rtklib(seen):
    """RTKLIB solves the same pseudoranges with its own orbits, clocks and ionosphere to a centimetre."""
    rtklib = pytest.importorskip("tests.simnav.satellites.rtklib")
    table, begin, bias = read_navigation(SHIPPED), gps_time(EPOCH), 250.0
    delay = np.array([table.group_delay[table.rows(name)[0]] for name in SATELLITES])
    raw = seen.range[0] + bias + seen.ionosphere[0] - SPEED_OF_LIGHT * (seen.clock[0] - delay)
    theirs = rtklib.point(str(SHIPPED), begin.week, begin.seconds + 600.0 + bias / SPEED_OF_LIGHT, SATELLITES, raw)
    assert np.linalg.norm(theirs - ecef_from_geodetic(solve(ranges(seen)).position)) < 0.01
