"""What the instruments cost: the IMU per sample, the aiding instruments per block of a minute."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.sensors import AidSpec, Dvl, GnssPosition, ImuSpec
from simnav.types import ImuSamples, TapStates
from simnav.world import FlatBottom, Surroundings

IMU = ImuSpec.from_toml(
    {
        "rate_hz": 100,
        "gyroscope": {
            "bias_deg_h": 0.1,
            "bias_instability_deg_h": 0.05,
            "correlation_time_s": 1000,
            "random_walk_deg_sqrt_h": 0.01,
            "rate_random_walk_deg_h_sqrt_h": 0.001,
            "scale_ppm": 100,
            "misalignment_deg": 0.01,
        },
        "accelerometer": {
            "bias_ug": 100,
            "bias_instability_ug": 10,
            "correlation_time_s": 1000,
            "random_walk_ug_sqrt_hz": 10,
            "rate_random_walk_ug_sqrt_s": 0.1,
            "scale_ppm": 100,
            "misalignment_deg": 0.01,
        },
    }
)


@pytest.mark.benchmark(group="sensors")
@pytest.mark.parametrize("overwrite", [False, True], ids=["fresh memory", "overwriting"])
def test_imu_errors(benchmark, overwrite):
    n = 200_000
    ideal = ImuSamples(0.01 * np.arange(1, n + 1), np.full(n, 0.01), np.full((n, 3), 0.01), np.full((n, 3), 9.8))
    real = benchmark(lambda: IMU.build(1).sense(ideal, overwrite=overwrite))
    if benchmark.enabled:
        benchmark.extra_info["ns_per_sample"] = benchmark.stats.stats.min / n * 1e9
    assert len(real) == n


@pytest.mark.benchmark(group="sensors")
@pytest.mark.parametrize(
    "spec",
    [
        GnssPosition(sigma=2.0, bias_instability=1.0, correlation_time=60.0, lever_arm=(1, 2, -3)),
        Dvl(sigma=0.01, scale=0.01, misalignment=0.01, lever_arm=(1, 2, 3), maximum_altitude=60.0),
    ],
    ids=["gnss_position", "dvl"],
)
def test_a_minute_of_an_aiding_instrument(benchmark, spec: AidSpec):
    n = 60
    row = np.ones((n, 1))
    tap = TapStates(
        np.arange(1.0, n + 1), row * [0.9, 0.1, -20.0], row * [5.0, 0.1, 0.0], row * [0.01, 0.02, 0.3],
        row * [0.01, 0.02, 0.03], np.zeros((n, 3)),
    )  # fmt: skip
    stream = benchmark(lambda: spec.install("x", 1, Surroundings({"bottom": FlatBottom(50.0)})).sense(tap))
    assert len(stream) == n
