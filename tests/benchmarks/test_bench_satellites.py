"""Satellites: the sky of a run, and an epoch of a tightly coupled filter and window."""

from __future__ import annotations

import time
from datetime import datetime

import numpy as np
import pytest

from simnav.estimator import make
from simnav.geometry import earth
from simnav.satellites.rinex_navigation import read_navigation
from simnav.satellites.sky import Sky
from simnav.satellites.time_scales import gps_time
from simnav.scenario import load
from simnav.sensors.gnss_raw import SHIPPED, GnssRaw
from simnav.source import record
from simnav.types import TapStates
from tests.cases import TWENTY_SATELLITES
from tests.cases.gtsam_channels import ChannelFixedLag

#: A voyage of 6000 s with 40 satellites at 1 Hz; it should take less than a second.
SATELLITES, SAMPLES = 40, 6000
EPOCH = datetime(2023, 3, 12, 12)


@pytest.fixture(scope="module")
def names() -> tuple[str, ...]:
    """Satellites of all three systems that are above the horizon at the start, then others."""
    ephemerides = read_navigation(SHIPPED)
    usable = ephemerides.usable(gps_time(EPOCH), float(SAMPLES))
    place = np.array([[np.radians(54.0), np.radians(7.9), 0.0]])
    elevation = Sky(ephemerides, usable, EPOCH).sight(np.zeros(1), place, np.zeros((1, 3))).elevation[0]
    return tuple(usable[j] for j in np.argsort(-elevation)[:SATELLITES])


@pytest.fixture(scope="module")
def tap() -> TapStates:
    time, still = np.arange(1.0, SAMPLES + 1.0), np.zeros((SAMPLES, 3))
    place = still + np.array([np.radians(54.0), np.radians(7.9), 0.0])
    return TapStates(time, place, still, still, still, still)


@pytest.mark.benchmark(group="satellites")
def test_orbits_and_directions_of_a_run(benchmark, names, tap):
    sky = Sky(read_navigation(SHIPPED), names, EPOCH)
    seen = benchmark(sky.sight, tap.time, tap.position, tap.velocity)
    assert seen.range.shape == (SAMPLES, SATELLITES)


@pytest.mark.benchmark(group="satellites")
def test_observations_of_a_run(benchmark, names, tap):
    """With all errors and their random numbers."""
    spec = GnssRaw.from_toml({"satellites": list(names), "sigma_pseudorange_m": 0.3, "sigma_range_rate_m_s": 0.05})
    stream = benchmark(lambda: spec.build("gnss", 1).sense(tap))
    assert len(stream) + len(stream.dropped) == SAMPLES * SATELLITES


@pytest.mark.benchmark(group="satellites")
def test_reading_of_a_navigation_file(benchmark):
    assert len(benchmark(read_navigation, SHIPPED)) == 98


@pytest.fixture(scope="module")
def recording():
    return record(load(TWENTY_SATELLITES), 1)


@pytest.mark.benchmark(group="tight coupling", timer=time.process_time)
@pytest.mark.parametrize("name", ["ekf", "sw-fgo", "gtsam"])
def test_an_epoch_with_twenty_satellites(benchmark, recording, name):
    """Beside GTSAM's fixed-lag smoother over factors of our own, on a window of the same length; 60 epochs a round."""
    pytest.importorskip("gtsam")
    estimator, steps = ChannelFixedLag() if name == "gtsam" else make(name), list(recording.steps())

    def run():
        return [estimator.update(step) for step in steps][-1]

    last = benchmark.pedantic(
        run, setup=lambda: estimator.reset(recording.start, recording.instruments), rounds=3 if name == "gtsam" else 10
    )
    error = earth.relative_position(last.position, recording.data.truth.position[-1])
    assert error @ np.linalg.solve(last.covariance[:3, :3], error) < 16.0
    if benchmark.stats:
        benchmark.extra_info["us_per_epoch"] = 1e6 * benchmark.stats["min"] / len(steps)
