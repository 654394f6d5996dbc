"""The IMU's errors against closed forms, by process, and their independence of each other and of blocks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simnav.sensors.imu import AccelerometerSpec, GyroscopeSpec, ImuSpec
from simnav.spec import SpecError
from simnav.types import ImuSamples

DEG_H = np.pi / 180.0 / 3600.0
UG = 9.80665e-6
NAVIGATION_GRADE = {
    "rate_hz": 100,
    "gyroscope": {
        "bias_deg_h": 0.01,
        "bias_instability_deg_h": 0.005,
        "correlation_time_s": 50,
        "random_walk_deg_sqrt_h": 0.002,
        "rate_random_walk_deg_h_sqrt_h": 0.001,
        "scale_ppm": 10,
        "misalignment_deg": 0.001,
        "quantization_arcsec": 0.1,
        "range_deg_s": 300,
    },
    "accelerometer": {
        "bias_ug": 50,
        "bias_instability_ug": 10,
        "correlation_time_s": 0.5,
        "random_walk_ug_sqrt_hz": 10,
        "rate_random_walk_ug_sqrt_s": 0.1,
        "scale_ppm": 100,
        "misalignment_deg": 0.005,
        "quantization_m_s": 1e-5,
        "range_g": 5,
    },
}


def samples(n: int, dt: float = 0.01, angular_rate=(0.0, 0.0, 0.0), specific_force=(0.0, 0.0, 0.0)) -> ImuSamples:
    return ImuSamples(
        dt * np.arange(1, n + 1),
        np.full(n, dt),
        np.tile(np.asarray(angular_rate, float), (n, 1)),
        np.tile(np.asarray(specific_force, float), (n, 1)),
    )


def spec(gyroscope=None, accelerometer=None) -> ImuSpec:
    return ImuSpec.from_toml({"rate_hz": 100, "gyroscope": gyroscope or {}, "accelerometer": accelerometer or {}})


def test_datasheet_is_in_si_and_leaves_out_the_fixed_parts():
    sheet = ImuSpec.from_toml(
        {**NAVIGATION_GRADE, "gyroscope": {**NAVIGATION_GRADE["gyroscope"], "fixed_bias_deg_h": [1, 2, 3]}}
    ).datasheet()
    g, a = sheet.gyroscope, sheet.accelerometer
    assert sheet.rate == 100.0
    assert g.bias == pytest.approx(0.01 * DEG_H)
    assert g.random_walk == pytest.approx(0.002 * np.pi / 180 / 60)
    assert g.rate_random_walk == pytest.approx(0.001 * DEG_H / 60)
    assert g.quantization == pytest.approx(0.1 * DEG_H)
    assert g.range == pytest.approx(np.radians(300))
    assert a.bias == pytest.approx(50 * UG)
    assert a.random_walk == pytest.approx(10 * UG)
    assert a.correlation_time == 0.5
    assert a.range == pytest.approx(5 * 9.80665)


def test_perfect_imu_gives_the_ideal_samples():
    ideal = samples(100, angular_rate=(0.1, -0.2, 0.3), specific_force=(1, 2, -9.8))
    real = spec().build(1).sense(ideal)
    assert np.array_equal(real.angular_rate, ideal.angular_rate)
    assert np.array_equal(real.specific_force, ideal.specific_force)
    assert np.array_equal(real.time, ideal.time)


def test_random_walk_of_the_integrated_noise():
    n = 200_000
    real = spec({"random_walk_deg_sqrt_h": 0.3}, {"random_walk_ug_sqrt_hz": 50}).build(3).sense(samples(n))
    for rate, density in ((real.angular_rate, np.radians(0.3) / 60), (real.specific_force, 50 * UG)):
        assert np.std(rate) == pytest.approx(density / np.sqrt(0.01), rel=0.01)
        # Over 10 s, 200 clusters of three axes: the standard deviation of the integral is density * sqrt(10).
        integral = (rate * 0.01).reshape(-1, 1000, 3).sum(axis=1)
        assert np.std(integral) == pytest.approx(density * np.sqrt(10.0), rel=0.1)


def test_noise_of_irregular_intervals_scales_with_their_length():
    interval = np.tile([0.01, 0.04], 20_000)
    zeros = np.zeros((len(interval), 3))
    real = spec({"random_walk_deg_sqrt_h": 60}).build(3).sense(ImuSamples(np.cumsum(interval), interval, zeros, zeros))
    sigma = np.array([np.std(real.angular_rate[k::2]) for k in (0, 1)])
    assert sigma == pytest.approx(np.radians(1.0) / np.sqrt([0.01, 0.04]), rel=0.02)


def test_turn_on_errors_over_many_runs_have_their_sigma():
    build = spec({"bias_deg_h": 2.0, "scale_ppm": 1000, "misalignment_deg": 0.5}).build
    still, turning = samples(1), samples(1, angular_rate=(1.0, 0.0, 0.0))
    bias, gain = [], []
    for seed in range(400):
        b = build(seed).sense(still).angular_rate[0]
        bias.append(b)
        gain.append(build(seed).sense(turning).angular_rate[0] - b - [1.0, 0.0, 0.0])
    assert np.std(bias) == pytest.approx(2.0 * DEG_H, rel=0.08)
    sigma = np.sqrt(np.mean(np.square(gain), axis=0))
    assert sigma == pytest.approx([1e-3, np.radians(0.5), np.radians(0.5)], rel=0.12)


def test_bias_instability_is_stationary_from_the_first_sample():
    build = spec({"bias_instability_deg_h": 5.0, "correlation_time_s": 100}).build
    ideal = samples(3000)
    rate = np.array([build(s).sense(ideal).angular_rate[[0, -1]] for s in range(400)])
    assert np.std(rate, axis=(0, 2)) == pytest.approx([5 * DEG_H, 5 * DEG_H], rel=0.08)
    first, last = rate[:, 0].ravel(), rate[:, 1].ravel()
    assert np.corrcoef(first, last)[0, 1] == pytest.approx(np.exp(-0.3), abs=0.06)


def test_bias_instability_integrates_like_the_continuous_process():
    # Var of the integral over t: 2 sigma^2 T (t - T (1 - exp(-t / T))); the bias is held for T / 100 at a time.
    build = spec({"bias_instability_deg_h": 5.0, "correlation_time_s": 10}).build
    ideal = samples(5000)
    angle = [build(s).sense(ideal).angular_rate.sum(axis=0) * 0.01 for s in range(300)]
    sigma = 5 * DEG_H * np.sqrt(2 * 10 * (50 - 10 * (1 - np.exp(-5.0))))
    assert np.std(angle) == pytest.approx(sigma, rel=0.08)


@pytest.mark.parametrize(
    "accelerometer",
    [{"bias_instability_ug": 3.0, "correlation_time_s": float("inf")}, {"rate_random_walk_ug_sqrt_s": 3.0}],
)
def test_random_walks_start_at_zero_and_grow_with_the_root_of_time(accelerometer):
    build = spec(accelerometer=accelerometer).build
    ideal = samples(1600)
    force = np.array([build(s).sense(ideal).specific_force[[0, 399, 1599]] for s in range(300)])
    assert np.all(force[:, 0] == 0.0)
    assert np.std(force[:, 1:], axis=(0, 2)) == pytest.approx([6 * UG, 12 * UG], rel=0.1)


def test_fixed_parts_are_added():
    real = spec({"fixed_bias_deg_h": [1, 2, 3], "fixed_scale_ppm": [0, 1000, 0]}).build(1)
    rate = real.sense(samples(1, angular_rate=(0, 0.5, 0))).angular_rate[0]
    assert rate == pytest.approx(np.array([1, 2, 3]) * DEG_H + [0, 0.5005, 0], rel=1e-12)


def test_range_saturates():
    real = spec(accelerometer={"range_g": 2, "fixed_bias_ug": [1e6, 0, 0]}).build(1)
    force = real.sense(samples(2, specific_force=(12.0, -30.0, 5.0))).specific_force
    assert force[0] == pytest.approx([2 * 9.80665, -2 * 9.80665, 5.0])


def test_quantization_gives_whole_increments_and_a_bounded_integral():
    step = 2.0 * DEG_H  # of two arc seconds
    ideal = samples(5000, angular_rate=(1e-4, -3e-3, 0.2))
    rate = spec({"quantization_arcsec": 2.0}).build(1).sense(ideal).angular_rate
    pulses = rate * 0.01 / step
    assert np.abs(pulses - np.round(pulses)).max() < 1e-6
    angle = np.cumsum((rate - ideal.angular_rate) * 0.01, axis=0)
    assert 0.25 * step < np.abs(angle).max() <= 0.5 * step + 1e-12


@given(cuts=st.lists(st.integers(0, 700), max_size=8))
@settings(max_examples=25)
def test_blocks_of_any_length_give_the_same_bits(cuts):
    ideal = samples(700, angular_rate=(0.1, 0.2, -0.1), specific_force=(0.1, 0.2, -9.8))
    build = ImuSpec.from_toml(NAVIGATION_GRADE).build
    whole, parts = build(11).sense(ideal), build(11)
    edges = [0, *sorted(cuts), 700]
    blocks = [parts.sense(ideal[a:b]) for a, b in itertools.pairwise(edges)]
    assert np.array_equal(np.concatenate([b.angular_rate for b in blocks]), whole.angular_rate)
    assert np.array_equal(np.concatenate([b.specific_force for b in blocks]), whole.specific_force)


def test_chunks_within_a_long_block_leave_no_trace():
    ideal = samples(9000)
    build = ImuSpec.from_toml(NAVIGATION_GRADE).build
    whole, parts = build(5).sense(ideal), build(5)
    rest = np.concatenate([parts.sense(ideal[:1]).angular_rate, parts.sense(ideal[1:]).angular_rate])
    assert np.array_equal(whole.angular_rate, rest)


@pytest.mark.parametrize("off", ["random_walk_ug_sqrt_hz", "bias_ug", "scale_ppm", "rate_random_walk_ug_sqrt_s"])
def test_switching_one_process_off_leaves_the_others(off):
    full = {k: v for k, v in NAVIGATION_GRADE["accelerometer"].items() if "quantization" not in k}
    less = {k: v for k, v in full.items() if k != off}
    only = {off: full[off]}
    ideal = samples(500, specific_force=(1.0, 2.0, -9.8))

    def error(table) -> np.ndarray:
        real = spec(NAVIGATION_GRADE["gyroscope"], table).build(2).sense(ideal)
        return real.specific_force - ideal.specific_force

    assert error(full) - error(less) == pytest.approx(error(only), abs=1e-12)
    assert np.abs(error(only)).max() > 1e-7


def test_runs_differ_and_repeat():
    ideal = samples(10)
    build = spec({"random_walk_deg_sqrt_h": 0.01, "bias_deg_h": 1.0}).build
    a, b, c = (build(s).sense(ideal).angular_rate for s in (1, 1, 2))
    assert np.array_equal(a, b)
    assert not np.any(a == c)


def test_ideal_samples_are_left_alone_even_where_read_only():
    ideal = samples(50)
    for array in (ideal.time, ideal.interval, ideal.angular_rate, ideal.specific_force):
        array.setflags(write=False)
    real = ImuSpec.from_toml(NAVIGATION_GRADE).build(1).sense(ideal)
    assert np.all(ideal.angular_rate == 0.0)
    assert np.isfinite(real.specific_force).all()


def test_overwriting_the_ideal_samples_gives_the_same():
    build = ImuSpec.from_toml(NAVIGATION_GRADE).build
    kept = build(1).sense(samples(5000, angular_rate=(0.1, 0.2, 0.3)))
    ideal = samples(5000, angular_rate=(0.1, 0.2, 0.3))
    over = build(1).sense(ideal, overwrite=True)
    assert over.angular_rate is ideal.angular_rate
    assert np.array_equal(over.angular_rate, kept.angular_rate)
    assert np.array_equal(over.specific_force, kept.specific_force)


def test_mistakes_are_named():
    with pytest.raises(SpecError, match="correlation_time_s"):
        GyroscopeSpec.from_toml({"bias_instability_deg_h": 1.0})
    with pytest.raises(SpecError, match="bias_ug"):
        AccelerometerSpec.from_toml({"bias_deg_h": 1.0})
    with pytest.raises(SpecError, match="random_walk_deg_sqrt_h = -1"):
        GyroscopeSpec.from_toml({"random_walk_deg_sqrt_h": -1})
    with pytest.raises(SpecError, match="rate_hz"):
        ImuSpec.from_toml({"rate_hz": 0})
