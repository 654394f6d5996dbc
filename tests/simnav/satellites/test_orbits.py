"""Orbits, clocks and delays agree with RTKLIB, and derivatives with differences."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from simnav.geometry.earth import displace
from simnav.geometry.ecef import ecef_from_geodetic, geodetic_from_ecef, ned_from_ecef
from simnav.satellites.orbit import SPEED_OF_LIGHT
from simnav.satellites.rinex_navigation import read_navigation
from simnav.satellites.sky import Sky
from simnav.satellites.time_scales import gps_time
from simnav.sensors.gnss_raw import SHIPPED
from simnav.spec import SpecError

DATA = Path(os.environ.get("SIMNAV_DATA") or Path(__file__).parents[4] / "shared" / "data")
RINEX = DATA / "rinex" / "SEPT078M.21P"
EPOCH = datetime(2023, 3, 12, 12)
PLACE, VELOCITY = np.array([np.radians(54.0), np.radians(7.9), 30.0]), np.array([5.0, 3.0, 0.2])


@pytest.fixture(scope="module")
def ephemerides():
    return read_navigation(SHIPPED)


@pytest.fixture(scope="module")
def sky(ephemerides):
    return Sky(ephemerides, ephemerides.usable(gps_time(EPOCH), 7200.0), EPOCH)


@pytest.mark.parametrize("path", [SHIPPED, RINEX], ids=lambda path: path.name)
def test_positions_velocities_and_clocks_are_those_of_rtklib(path):
    rtklib = pytest.importorskip("tests.simnav.satellites.rtklib")
    if not path.is_file():
        pytest.skip(f"no {path.name} in {path.parent} (SIMNAV_DATA)")
    table = read_navigation(path)
    rows = {(s, t): k for k, (s, t) in enumerate(zip(table.satellite, table.numbers[:, 0], strict=True))}
    compared = set()
    for satellite, week, second, message in rtklib.messages(rtklib.navigation(str(path))):
        toe = (week - table.week) * 604800.0 + second
        k = rows[satellite, toe]
        if message.iode != table.issue[k]:
            continue  # the same reference time, sent again
        one = replace(table, satellite=(satellite,), numbers=table.numbers[[k]], healthy=table.healthy[[k]])
        for later in (-6000.0, 0.0, 1800.0, 6000.0):
            states = one.states([satellite], np.array([toe + later]))
            before, after = (rtklib.state(message, later + h) for h in (-5e-4, 5e-4))
            position, clock = rtklib.state(message, later)
            np.testing.assert_allclose(states.position[0, 0], position, rtol=0, atol=1e-3)
            np.testing.assert_allclose(states.velocity[0, 0], (after[0] - before[0]) / 1e-3, rtol=0, atol=1e-3)
            assert SPEED_OF_LIGHT * states.clock[0, 0] == pytest.approx(SPEED_OF_LIGHT * clock, abs=1e-3)
            drift = SPEED_OF_LIGHT * (after[1] - before[1]) / 1e-3
            assert SPEED_OF_LIGHT * states.drift[0, 0] == pytest.approx(drift, abs=1e-3)
        compared.add(satellite)
    systems = {satellite[0] for satellite in compared}
    assert len(compared) > 20
    assert systems == {s[0] for s in table.satellite}


def test_delays_are_those_of_rtklib(ephemerides, sky):
    rtklib = pytest.importorskip("tests.simnav.satellites.rtklib")
    for place in (PLACE, np.array([-0.4, 2.0, 300.0])):
        seen = sky.sight(np.array([600.0]), place[None], VELOCITY[None])
        up = np.flatnonzero(seen.elevation[0] > 0.05)
        assert len(up) > 15
        begin = gps_time(EPOCH)
        for j in up:
            direction = seen.azimuth[0, j], seen.elevation[0, j]
            wanted = rtklib.delays(begin.week, begin.seconds + 600.0, place, direction, ephemerides.klobuchar)
            found = seen.ionosphere[0, j], seen.troposphere[0, j], seen.mapping[0, j]
            np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_rates_are_the_derivatives_of_ranges(sky):
    half = 0.5
    before, now, after = (
        sky.sight(np.array([600.0 + h]), displace(PLACE, h * VELOCITY)[None], VELOCITY[None])
        for h in (-half, 0.0, half)
    )
    np.testing.assert_allclose(now.range_rate, (after.range - before.range) / (2 * half), rtol=0, atol=1e-5)
    np.testing.assert_allclose(now.velocity, (after.position - before.position) / (2 * half), rtol=0, atol=1e-5)


def test_the_signal_took_as_long_as_its_way(ephemerides, sky):
    """Light time in an inertial frame, with the Earth turned back by hand."""
    time = np.array([1234.5])
    seen = sky.sight(time, PLACE[None], VELOCITY[None])
    antenna, rate = ecef_from_geodetic(PLACE), 7.292115e-5
    for j, satellite in enumerate(sky.satellites[:30]):
        tau = seen.range[0, j] / SPEED_OF_LIGHT
        sent = gps_time(EPOCH).since(ephemerides.week) + time - tau
        x, y, z = ephemerides.states([satellite], sent).position[0, 0]
        angle = rate * tau  # by which the Earth turned on
        moved = antenna @ np.array(
            [[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
        )
        assert np.linalg.norm(np.array([x, y, z]) - moved) == pytest.approx(seen.range[0, j], abs=1e-6)


def test_geodetic_positions_come_back():
    rng = np.random.default_rng(1)
    position = np.stack([rng.uniform(-np.pi / 2, np.pi / 2, 200), rng.uniform(-np.pi, np.pi, 200),
                         rng.uniform(-9e3, 2.7e7, 200)], axis=1)  # fmt: skip
    position[0, 0] = np.pi / 2
    back = geodetic_from_ecef(ecef_from_geodetic(position))
    np.testing.assert_allclose(back[:, :2], position[:, :2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(back[:, 2], position[:, 2], rtol=0, atol=1e-6)


def test_axes_north_east_down():
    h = 1e-6
    position = np.array([0.9, -1.3, 50.0])
    axes = ned_from_ecef(position[0], position[1])
    north, east, down = ((ecef_from_geodetic(position + step) - ecef_from_geodetic(position)) for step in
                         (np.array([h, 0, 0]), np.array([0, h, 0]), np.array([0, 0, -1.0])))  # fmt: skip
    for row, step in zip(axes, (north, east, down), strict=True):
        np.testing.assert_allclose(row, step / np.linalg.norm(step), atol=1e-6)


def test_an_ephemeris_of_another_day(ephemerides):
    with pytest.raises(SpecError, match=r"2023-03-12-noon\.rnx: .* none is valid from day 1\.50 to 1\.51 of that week"):
        ephemerides.usable(gps_time(datetime(2023, 3, 13, 12)), 600.0)
    assert np.isnan(ephemerides.states(["G12"], np.array([86400.0])).position).all()


def test_a_satellite_that_is_not_healthy_is_not_used(ephemerides):
    healthy = ephemerides.healthy.copy()
    healthy[ephemerides.rows("G12")] = False
    ill = replace(ephemerides, healthy=healthy)
    usable = ephemerides.usable(gps_time(EPOCH), 600.0)
    assert set(usable) - set(ill.usable(gps_time(EPOCH), 600.0)) == {"G12"}
