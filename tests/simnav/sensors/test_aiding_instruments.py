"""Aiding instruments: geometry against finite differences, statistics against their datasheets."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simnav.geometry import earth
from simnav.geometry.rotation import dcm_from_rpy
from simnav.sensors import (
    AidSpec,
    Depth,
    Dvl,
    GnssPosition,
    GnssVelocity,
    Gyrocompass,
    MagneticCompass,
    SpeedLog,
    TerrainFix,
)
from simnav.sensors.instrument import turn_to_body, turn_to_ned
from simnav.spec import SpecError
from simnav.types import KINDS, Array, TapStates
from simnav.world import FlatBottom, Surroundings

LEVER_ARM = (3.0, -2.0, 4.0)
#: One of each kind, with every error that it can have.
FULL: dict[str, AidSpec] = {
    "gnss": GnssPosition(
        sigma=2.0, bias=1.0, bias_instability=1.5, correlation_time=60.0, lever_arm=LEVER_ARM, fixed_bias=(1, 2, 3)
    ),
    "gnss_velocity": GnssVelocity(
        sigma=0.1, bias=0.01, bias_instability=0.02, correlation_time=60.0, lever_arm=LEVER_ARM
    ),
    "dvl": Dvl(
        sigma=0.01, speed_noise=0.002, bias=0.01, bias_instability=0.01, correlation_time=np.inf, scale=0.01,
        misalignment=0.01, lever_arm=LEVER_ARM, maximum_altitude=60.0,
    ),
    "compass": MagneticCompass(
        sigma=0.02, bias=0.02, bias_instability=0.01, correlation_time=100.0, deviation=0.02
    ),
    "gyro": Gyrocompass(sigma=0.01, bias=0.01, bias_instability=0.001, correlation_time=600.0, speed_error=True),
    "log": SpeedLog(
        sigma=0.1, bias=0.05, bias_instability=0.02, correlation_time=300.0, scale=0.01, lever_arm=LEVER_ARM
    ),
    "depth": Depth(sigma=0.1, bias=0.2, bias_instability=0.1, correlation_time=50.0, scale=0.01, lever_arm=LEVER_ARM),
    "terrain": TerrainFix(
        sigma=10.0, bias=3.0, bias_instability=5.0, correlation_time=300.0, lever_arm=LEVER_ARM, fixed_bias=(1, 2)
    ),
}  # fmt: skip


def states(time: Array) -> TapStates:
    """A manoeuvring vehicle in closed form, with angular rates from Euler's kinematics."""
    t = np.asarray(time, float)
    latitude, rate_latitude = 0.9 + 1e-5 * np.sin(0.05 * t), 5e-7 * np.cos(0.05 * t)
    longitude, rate_longitude = 0.1 + 8e-7 * t, np.full_like(t, 8e-7)
    height, rate_height = -20.0 + 3.0 * np.sin(0.2 * t), 0.6 * np.cos(0.2 * t)
    roll, rate_roll = 0.2 * np.sin(0.7 * t), 0.14 * np.cos(0.7 * t)
    pitch, rate_pitch = 0.1 * np.sin(0.5 * t + 1), 0.05 * np.cos(0.5 * t + 1)
    yaw, rate_yaw = 3.0 + 0.5 * np.sin(0.1 * t), 0.05 * np.cos(0.1 * t)
    meridian, prime_vertical = earth.principal_radii(latitude)
    velocity = np.column_stack(
        [
            rate_latitude * (meridian + height),
            rate_longitude * (prime_vertical + height) * np.cos(latitude),
            -rate_height,
        ]
    )
    attitude = np.column_stack([roll, pitch, yaw])
    relative_to_ned = np.column_stack(
        [
            rate_roll - rate_yaw * np.sin(pitch),
            rate_pitch * np.cos(roll) + rate_yaw * np.cos(pitch) * np.sin(roll),
            -rate_pitch * np.sin(roll) + rate_yaw * np.cos(pitch) * np.cos(roll),
        ]
    )
    east_rate = velocity[:, 1] / (prime_vertical + height)
    transport = np.column_stack([east_rate, -velocity[:, 0] / (meridian + height), -east_rate * np.tan(latitude)])
    angular_rate = relative_to_ned + np.einsum("nij,ni->nj", dcm_from_rpy(attitude), transport)
    current = np.tile([0.3, -0.4, 0.0], (len(t), 1))
    position = np.column_stack([latitude, longitude, height])
    return TapStates(t, position, velocity, attitude, angular_rate, current)


def cut(tap: TapStates, a: int, b: int) -> TapStates:
    return TapStates(
        *(getattr(tap, n)[a:b] for n in ("time", "position", "velocity", "attitude", "angular_rate", "water_velocity"))
    )


def mounted_velocity(time: Array) -> Array:
    """NED velocity of a point at LEVER_ARM, by central differences of its position."""
    h = 1e-3

    def position(t: Array) -> Array:
        tap = states(t)
        return earth.displace(tap.position, np.einsum("nij,j->ni", dcm_from_rpy(tap.attitude), np.array(LEVER_ARM)))

    return earth.relative_position(position(time + h), position(time - h)) / (2 * h)


TIME = np.linspace(1.0, 60.0, 60)
TAP = states(TIME)


def perfect(spec: AidSpec) -> Array:
    return spec.build("x", 1).sense(TAP).value


def test_turns_agree_with_the_matrix():
    v = np.random.default_rng(1).normal(size=(60, 3))
    dcm = dcm_from_rpy(TAP.attitude)
    assert turn_to_ned(TAP.attitude, v) == pytest.approx(np.einsum("nij,nj->ni", dcm, v), abs=1e-14)
    assert turn_to_body(TAP.attitude, v) == pytest.approx(np.einsum("nji,nj->ni", dcm, v), abs=1e-14)


def test_gnss_position_is_the_antenna_s():
    offset = earth.relative_position(perfect(GnssPosition(sigma=0.0, lever_arm=LEVER_ARM)), TAP.position)
    assert offset == pytest.approx(np.einsum("nij,j->ni", dcm_from_rpy(TAP.attitude), np.array(LEVER_ARM)), abs=1e-6)
    assert np.array_equal(perfect(TerrainFix(sigma=0.0)), TAP.position[:, :2])
    antenna = perfect(GnssPosition(sigma=0.0, lever_arm=LEVER_ARM))
    assert np.array_equal(perfect(TerrainFix(sigma=0.0, lever_arm=LEVER_ARM)), antenna[:, :2])
    assert perfect(Depth(sigma=0.0, lever_arm=LEVER_ARM)) == pytest.approx(-antenna[:, 2:], abs=1e-12)


def test_gnss_velocity_is_the_antenna_s():
    value = perfect(GnssVelocity(sigma=0.0, lever_arm=LEVER_ARM))
    assert value == pytest.approx(mounted_velocity(TIME), abs=2e-5)
    assert np.abs(value - TAP.velocity).max() > 0.1


def test_dvl_is_the_transducer_s_velocity_in_body_axes():
    expected = np.einsum("nji,nj->ni", dcm_from_rpy(TAP.attitude), mounted_velocity(TIME))
    assert perfect(Dvl(sigma=0.0, lever_arm=LEVER_ARM)) == pytest.approx(expected, abs=2e-5)


def test_speed_log_is_the_forward_velocity_through_the_water():
    through_water = mounted_velocity(TIME) - [0.3, -0.4, 0.0]
    expected = np.einsum("nji,nj->ni", dcm_from_rpy(TAP.attitude), through_water)[:, :1]
    assert perfect(SpeedLog(sigma=0.0, lever_arm=LEVER_ARM)) == pytest.approx(expected, abs=2e-5)
    slow = perfect(SpeedLog(sigma=0.0, lever_arm=LEVER_ARM, fixed_scale=-0.1, fixed_bias=0.5))
    assert slow == pytest.approx(0.9 * expected + 0.5, abs=2e-5)


def test_dvl_scale_and_misalignment_as_realised():
    eta = np.radians([0.028, -0.010, -0.266])
    ideal = perfect(Dvl(sigma=0.0))
    value = perfect(Dvl(sigma=0.0, fixed_scale=0.0255, fixed_misalignment=tuple(eta)))
    # To first order in the misalignment; the second order is 1e-5 of the speed.
    assert value == pytest.approx(1.0255 * (ideal - np.cross(eta, ideal)), abs=2e-4)
    assert np.linalg.norm(value, axis=1) == pytest.approx(1.0255 * np.linalg.norm(ideal, axis=1), rel=1e-12)


def test_dvl_noise_grows_with_speed():
    t = np.zeros(20_000)
    tap = states(t)
    stream = Dvl(sigma=0.01, speed_noise=0.02).build("dvl", 1).sense(tap)
    speed = np.linalg.norm(tap.velocity[0])
    sigma = np.hypot(0.01, 0.02 * speed)
    assert stream.sigma[0] == pytest.approx(np.full(3, sigma))
    assert np.std(stream.value, axis=0) == pytest.approx(np.full(3, sigma), rel=0.02)


def test_dvl_loses_the_bottom_out_of_range_and_its_noise_goes_on():
    always = Dvl(sigma=0.01).build("dvl", 1).sense(TAP)
    spec = Dvl(sigma=0.01, minimum_altitude=29.0, maximum_altitude=31.0)
    stream = spec.install("dvl", 1, Surroundings({"bottom": FlatBottom(50.0)})).sense(TAP)
    altitude = 50.0 + TAP.position[:, 2]
    lock = (altitude >= 29.0) & (altitude <= 31.0)
    assert 5 < lock.sum() < 55
    assert np.array_equal(stream.time, TIME[lock])
    assert np.array_equal(stream.dropped, TIME[~lock])
    assert np.array_equal(stream.value, always.value[lock])
    assert len(stream.sigma) == len(stream.faults) == len(stream.fault_error) == len(stream)
    assert len(spec.build("dvl", 1).sense(TAP)) == len(TAP)


def test_dvl_range_counts_from_the_transducer():
    low = Dvl(sigma=0.01, lever_arm=(0, 0, 5.0), minimum_altitude=30.0).install(
        "dvl", 1, Surroundings({"bottom": FlatBottom(50.0)})
    )
    down = np.einsum("nij,j->ni", dcm_from_rpy(TAP.attitude), np.array([0, 0, 5.0]))[:, 2]
    assert np.array_equal(low.sense(TAP).time, TIME[50.0 + TAP.position[:, 2] - down >= 30.0])


def test_magnetic_compass_deviation_goes_once_around():
    t = np.zeros(360)
    tap = states(t)
    tap.attitude[:, 2] = heading = np.radians(np.arange(-180, 180))
    value = MagneticCompass(sigma=0.0, fixed_deviation=(0.03, -0.02)).build("c", 1).sense(tap).value[:, 0]
    error = np.angle(np.exp(1j * (value - heading)))
    assert error == pytest.approx(0.03 * np.sin(heading) - 0.02 * np.cos(heading), abs=1e-12)
    drawn = [MagneticCompass(sigma=0.0, deviation=0.05).build("c", s).deviation for s in range(500)]
    assert np.std(drawn) == pytest.approx(0.05, rel=0.08)


def test_gyrocompass_speed_error_is_the_mariners_rule():
    # V cos(C) / (5 pi cos(latitude)) degrees, V in knots: 10 kn due north at 60 degrees.
    one = np.zeros((1, 3))
    position = np.array([[np.radians(60), 0.0, 0.0]])
    velocity = np.array([[10 * 1852 / 3600, 0.0, 0.0]])
    tap = TapStates(np.zeros(1), position, velocity, one, one, one)
    value = Gyrocompass(sigma=0.0, speed_error=True).build("g", 1).sense(tap).value[0, 0]
    assert np.degrees(value) == pytest.approx(10 / (5 * np.pi * 0.5), rel=0.02)
    assert Gyrocompass(sigma=0.0).build("g", 1).sense(tap).value[0, 0] == 0.0


def test_the_errors_of_a_gyrocompass_at_60_degrees_are_twice_those_at_the_equator():
    """Its wander, which grows with the secant of the latitude, in each run; and the speed error, to the radii."""
    wander = {"kind": "gauss_markov", "sigma_deg": 0.5, "correlation_time_min": 15.0}
    table = {"sigma_deg": 0.0, "error": [wander | {"proportional_to": {"secant_latitude": 1.0}}]}

    def error(latitude: float, table: dict, north: float, seed: int) -> np.ndarray:
        n = 600
        place, velocity, zero = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
        place[:, 0], velocity[:, 0] = np.radians(latitude), north
        tap = TapStates(np.arange(float(n)), place, velocity, zero, zero, zero)
        made = Gyrocompass.from_toml(table).install("g", seed, Surroundings())
        return made.sense(tap).value[:, 0]

    for seed in range(3):
        equator, far = (error(latitude, table, 0.0, seed) for latitude in (0.0, 60.0))
        assert np.std(equator) > 0.0
        np.testing.assert_allclose(far, 2.0 * equator, rtol=1e-9)
    steaming = {"sigma_deg": 0.0, "speed_error": True}
    assert error(60.0, steaming, 5.0, 1) == pytest.approx(2.0 * error(0.0, steaming, 5.0, 1), rel=0.01)


def test_headings_stay_in_one_turn():
    tap = states(np.zeros(5000))
    tap.attitude[:, 2] = np.pi - 0.001
    value = Gyrocompass(sigma=0.05).build("g", 1).sense(tap).value
    assert value.min() >= -np.pi
    assert value.max() < np.pi
    assert (value < 0).mean() == pytest.approx(0.49, abs=0.03)


@pytest.mark.parametrize("name", FULL)
def test_white_noise_is_that_of_the_datasheet(name):
    spec = FULL[name].model_copy(update={"bias_instability": 0.0})
    tap = states(np.zeros(20_000))
    stream = spec.build(name, 4).sense(tap)
    error = spec.definition.difference(stream.value, np.broadcast_to(stream.value[0], stream.value.shape))
    assert np.std(error, axis=0) == pytest.approx(stream.sigma[0], rel=0.03)
    assert np.array_equal(stream.sigma, np.broadcast_to(stream.sigma[0], stream.sigma.shape))
    if name != "dvl":  # whose noise also grows with speed
        assert stream.sigma[0] == pytest.approx(spec.datasheet(name).sigma)


@pytest.mark.parametrize("name", FULL)
def test_turn_on_bias_over_many_runs_is_that_of_the_datasheet(name):
    spec = FULL[name]
    fixed = spec.figure("fixed_bias")
    bias = np.array([spec.build(name, s).bias for s in range(400)])
    assert np.std(bias, axis=0) == pytest.approx(spec.datasheet(name).bias, rel=0.15)
    assert np.mean(bias, axis=0) == pytest.approx(fixed, abs=0.2 * spec.datasheet(name).bias.max())


@pytest.mark.parametrize("name", ["gnss", "compass", "depth", "terrain"])
def test_slow_bias_is_stationary_from_the_first_measurement_and_correlated(name):
    spec = FULL[name].model_copy(update={"sigma": 0.0, "bias": 0.0, "scale": 0.0, "deviation": 0.0, "fixed_bias": 0.0})
    lag = spec.correlation_time
    tap = states(np.array([0.5, 0.5 + lag]))
    ideal = spec.model_copy(update={"bias_instability": 0.0}).build(name, 0).sense(tap).value
    errors = np.array([spec.definition.difference(spec.build(name, s).sense(tap).value, ideal) for s in range(500)])
    sigma = spec.datasheet(name).bias_instability
    assert np.std(errors, axis=0) == pytest.approx(np.stack([sigma, sigma]), rel=0.12)
    first, second = errors[:, 0].ravel(), errors[:, 1].ravel()
    assert np.corrcoef(first, second)[0, 1] == pytest.approx(np.exp(-1.0), abs=0.12)


@given(cuts=st.lists(st.integers(0, 60), max_size=5))
@settings(max_examples=20)
def test_blocks_of_any_length_give_the_same_bits(cuts):
    edges = [0, *sorted(cuts), 60]
    for name, spec in FULL.items():
        whole = spec.install(name, 9, Surroundings({"bottom": FlatBottom(81.0)})).sense(TAP)
        sensor = spec.install(name, 9, Surroundings({"bottom": FlatBottom(81.0)}))
        blocks = [sensor.sense(cut(TAP, a, b)) for a, b in itertools.pairwise(edges)]
        for field in ("time", "value", "sigma", "dropped", "faults", "fault_error"):
            joined = np.concatenate([getattr(b, field) for b in blocks])
            assert np.array_equal(joined, getattr(whole, field)), (name, field)


def test_an_instrument_of_others_is_told_where_its_lever_arm_is_and_how_it_moves():
    sensor = GnssVelocity(sigma=0.0, lever_arm=LEVER_ARM).build("v", 1)
    assert sensor.lever_displacement(TAP) == pytest.approx(dcm_from_rpy(TAP.attitude) @ LEVER_ARM, abs=1e-12)
    assert sensor.lever_velocity(TAP) == pytest.approx(np.cross(TAP.angular_rate, LEVER_ARM), abs=1e-12)
    assert np.abs(sensor.lever_velocity(TAP)).max(axis=0).min() > 0.01  # on every axis


@pytest.mark.parametrize("off", ["sigma", "bias", "bias_instability"])
def test_switching_one_process_off_leaves_the_others(off):
    spec = FULL["gnss_velocity"]
    only = spec.model_copy(update={p: 0.0 for p in ("sigma", "bias", "bias_instability") if p != off})
    less = spec.model_copy(update={off: 0.0})
    ideal = perfect(GnssVelocity(sigma=0.0, lever_arm=LEVER_ARM))
    full, rest, one = (s.build("v", 3).sense(TAP).value - ideal for s in (spec, less, only))
    assert full == pytest.approx(rest + one, abs=1e-12)


def test_instruments_of_other_names_and_seeds_are_independent():
    a, b, c = (GnssPosition(sigma=1.0).build(n, s).sense(TAP).value for n, s in (("a", 1), ("b", 1), ("a", 2)))
    assert not np.any(a == b)
    assert not np.any(a == c)


@pytest.mark.parametrize("name", FULL)
def test_streams_have_the_shapes_of_their_kind(name):
    spec = FULL[name]
    stream = spec.build(name, 1).sense(TAP)
    d = len(KINDS[spec.kind].values)
    assert stream.value.shape == (60, d)
    assert stream.sigma.shape == stream.fault_error.shape == (60, len(KINDS[spec.kind].errors))
    assert stream.faults.dtype == np.uint32
    assert not stream.faults.any()
    assert len(spec.build(name, 1).sense(cut(TAP, 0, 0))) == 0
    assert spec.datasheet(name).rate == 1.0


def test_mistakes_are_named():
    with pytest.raises(SpecError, match="sigma_m"):
        GnssPosition.from_toml({"sigma": 2})
    with pytest.raises(SpecError, match="correlation_time_s"):
        GnssPosition.from_toml({"sigma_m": 2, "bias_instability_m": 1})
    with pytest.raises(SpecError, match=r"sigma_m_s = -0\.1"):
        Dvl.from_toml({"sigma_m_s": -0.1})
    with pytest.raises(SpecError, match="rate_hz"):
        Depth.from_toml({"sigma_m": 0.1, "rate_hz": -1})
    with pytest.raises(SpecError, match="sigma_deg"):
        MagneticCompass.from_toml({})
