"""The world: dynamics, manoeuvres, waves and current as a vessel does them."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import dcm_from_rpy, rotation_vector_from_dcm
from simnav.strapdown import integrate
from simnav.world import (
    Accelerate,
    Current,
    Dive,
    Hold,
    LawnMower,
    Sea,
    Ship,
    Start,
    Surface,
    Turn,
    Uuv,
    Waypoints,
    World,
    ZigZag,
)
from simnav.world.sea import components

START = Start(latitude=np.radians(54.0), longitude=np.radians(8.0), heading=np.radians(40.0), speed=6.0)
SEA = Sea(significant_height=2.5, peak_period=8.0, direction=np.radians(200.0))


def run(duration, manoeuvres=(), *, start=START, vessel=None, sea=None, current=None, rate=20.0, every=1.0):
    world = World(start, vessel or Ship(), manoeuvres, sea, current, rate=rate, seed=1)
    first = world.state()
    block = world.advance(duration, {"all": np.arange(1, round(duration / every) + 1) * every})
    tap = block.taps["all"]
    return first, block, tap, relative_position(tap.position, first.position[0])


def test_hour_of_manoeuvring_in_a_seaway_returns_to_the_truth():
    """Perfect instruments, 100 Hz, one hour: 1 mm, 1e-5 m/s, 1e-7 rad."""
    manoeuvres = [
        Hold(duration=60), Turn(angle=1.5, rate=0.02), ZigZag(angle=0.2, duration=300), Accelerate(speed=8.0),
        Waypoints(points=((3000, 2000), (0, 0))), Turn(radius=500, duration=200), LawnMower(leg=500, spacing=200),
    ]  # fmt: skip
    first, block, tap, _ = run(
        3600.0, manoeuvres, vessel=Ship(heel=1.0), sea=SEA, current=Current(speed=0.5, direction=1.0), rate=100.0
    )
    states = integrate(first.position[0], first.velocity[0], first.attitude[0], block.imu)
    at = slice(99, None, 100)
    assert np.abs(relative_position(states.position[at], tap.position)).max() < 1e-3
    assert np.abs(states.velocity[at] - tap.velocity).max() < 1e-5
    turned = dcm_from_rpy(states.attitude[at]) @ np.swapaxes(dcm_from_rpy(tap.attitude), -1, -2)
    assert np.abs(rotation_vector_from_dcm(turned)).max() < 1e-7


#: Guidance that knows the position, or not; a variable current depends on it, too.
VOYAGES = [
    (Ship(), [ZigZag(angle=0.3, duration=30)], Current(speed=0.5)),
    (Ship(), [ZigZag(angle=0.3, duration=30)], Current(speed=0.5, variation=0.2)),
    (Uuv(), [Dive(depth=20.0), Waypoints(points=((40.0, 20.0), (0.0, 30.0)), acceptance_radius=5.0)], None),
]


@settings(max_examples=30)
@given(
    st.lists(st.integers(1, 400), min_size=1, max_size=12), st.integers(0, 2**40), st.sampled_from(VOYAGES)
)  # fmt: skip
def test_blocks_of_any_length_give_the_same_bits(lengths, seed, voyage):
    def world():
        vessel, manoeuvres, current = voyage
        return World(START, vessel, manoeuvres, SEA, current, rate=50.0, seed=seed)

    total = sum(lengths)
    taps = 0.013 + np.arange(total * 3 // 2 - 1) / 75.0
    whole = world().advance(total / 50.0, {"a": taps})
    stepped, parts, now = world(), [], 0
    for n in lengths:
        inside = taps[(taps > now / 50.0) & (taps <= (now + n) / 50.0)]
        parts.append(stepped.advance((now + n) / 50.0, {"a": inside}))
        now += n
    for name in ("time", "angular_rate", "specific_force"):
        np.testing.assert_array_equal(np.concatenate([getattr(p.imu, name) for p in parts]), getattr(whole.imu, name))
    for name in ("position", "velocity", "attitude", "angular_rate", "water_velocity"):
        joined = np.concatenate([getattr(p.taps["a"], name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole.taps["a"], name))


def test_a_voyage_is_the_same_up_to_waypoints_that_follow_it():
    """With waypoints guidance and motion alternate sample by sample; without them guidance is ahead by a block."""
    manoeuvres = [Turn(angle=1.0), ZigZag(angle=0.3, duration=60), Turn(radius=300, duration=40)]
    sea = Sea(significant_height=9.0, peak_period=9.0, direction=1.0, roll_gain=1.5, response="encounter")
    _, alone, tap, _ = run(130.0, manoeuvres, sea=sea, every=0.31)
    _, followed, other, _ = run(
        130.0, [*manoeuvres, Hold(duration=99), Waypoints(points=((0, 0),))], sea=sea, every=0.31
    )
    assert np.abs(tap.attitude[:, 0]).max() > 0.3  # beyond the series for small angles
    for name in ("angular_rate", "specific_force"):
        np.testing.assert_array_equal(getattr(followed.imu, name), getattr(alone.imu, name))
    for name in ("position", "velocity", "attitude", "angular_rate"):
        np.testing.assert_array_equal(getattr(other, name), getattr(tap, name))


def test_taps_between_samples_lie_on_the_motion():
    """The 20 Hz world tapped at 100 Hz is the motion that a fine sampling of the same sea shows."""
    world = World(START, Ship(), [], SEA, None, rate=20.0, seed=5)
    coarse = world.advance(60.0, {"a": np.arange(1, 6001) * 0.01}).taps["a"]
    world = World(START, Ship(), [], SEA, None, rate=100.0, seed=5)
    fine = world.advance(60.0, {"a": np.arange(1, 6001) * 0.01}).taps["a"]
    assert np.abs(relative_position(coarse.position, fine.position)).max() < 1e-3
    assert np.abs(coarse.velocity - fine.velocity).max() < 1e-3
    assert np.abs(coarse.attitude - fine.attitude).max() < 2e-4
    # Angular rate, extrapolated from means, against differences of the fine attitude
    dcm = dcm_from_rpy(fine.attitude)
    rate = rotation_vector_from_dcm(np.swapaxes(dcm[:-2], -1, -2) @ dcm[2:]) / 0.02
    assert np.abs(fine.angular_rate[1:-1] - rate).max() < 2e-5


def test_motion_is_smooth_through_all_changes_of_manoeuvre():
    _, block, _, _ = run(
        400.0,
        [Accelerate(speed=9.0), Turn(angle=2.0, rate=0.03), ZigZag(angle=0.3, duration=120), Accelerate(speed=3.0)],
        rate=100.0,
    )
    # Second differences see a jump of the rate as a spike: none is larger than the smooth motion's own.
    assert np.abs(np.diff(block.imu.specific_force, axis=0)).max() < 0.01
    assert np.abs(np.diff(block.imu.angular_rate, axis=0)).max() < 1e-3


def test_turn_by_an_angle_ends_on_its_heading_and_keeps_its_rate():
    _, _, tap, _ = run(300.0, [Turn(angle=np.radians(90.0), rate=np.radians(1.0))])
    assert np.degrees(tap.attitude[-1, 2]) == pytest.approx(130.0, abs=0.05)
    assert np.degrees(tap.angular_rate[:, 2].max()) == pytest.approx(1.0, abs=0.01)
    assert np.degrees(tap.attitude[:, 2].max()) < 130.01  # no overshoot


def test_turn_on_a_radius_sails_a_circle_of_it():
    _, _, _, xy = run(900.0, [Turn(radius=400.0, duration=880.0)])
    inner = xy[100:800]
    centre = inner[:419].mean(axis=0)  # one circle: 2 pi 400 / 6 s
    assert np.hypot(*(inner - centre)[:, :2].T) == pytest.approx(400.0, rel=0.02)


def test_accelerate_at_a_rate():
    _, _, tap, _ = run(250.0, [Accelerate(speed=8.0, acceleration=0.01), Hold(duration=10.0)])
    speed = np.hypot(tap.velocity[:, 0], tap.velocity[:, 1])
    assert (speed[150] - speed[100]) / 50.0 == pytest.approx(0.01, rel=1e-2)
    assert speed[-1] == pytest.approx(8.0, abs=0.2)


def test_zigzag_swings_by_its_angle():
    _, _, tap, _ = run(600.0, [ZigZag(angle=np.radians(20.0), rate=np.radians(0.8), duration=550.0)])
    swing = np.degrees(tap.attitude[:, 2]) - 40.0
    assert 20.0 < swing.max() < 27.0
    assert -27.0 < swing.min() < -20.0
    assert np.sum(np.diff(np.sign(swing)) != 0) >= 5


def test_waypoints_are_passed():
    points = ((1500.0, 500.0), (1500.0, 2500.0), (0.0, 2500.0))
    _, _, _, xy = run(1200.0, [Waypoints(points=points, acceptance_radius=60.0)])
    for point in points:
        assert np.hypot(xy[:, 0] - point[0], xy[:, 1] - point[1]).min() < 100.0


def test_a_waypoint_within_the_turning_circle_is_not_circled_for_ever():
    _, _, _, xy = run(1500.0, [Waypoints(points=((0.0, 300.0), (3000.0, 3000.0)), acceptance_radius=20.0)])
    assert np.hypot(xy[:, 0] - 3000.0, xy[:, 1] - 3000.0).min() < 100.0


def test_lawn_mower_covers_its_legs():
    vessel = Uuv(speed_time_constant=3.0, turn_time_constant=1.0, turn_rate=np.radians(6.0))
    start = Start(latitude=0.9, longitude=0.1, depth=20.0, heading=0.0, speed=2.0)
    _, _, _, xy = run(2600.0, [LawnMower(leg=800.0, spacing=60.0, legs=4)], start=start, vessel=vessel)
    for leg in range(4):
        on_leg = np.abs(xy[:, 1] - 60.0 * leg) < 12.0
        assert np.ptp(xy[on_leg, 0]) > 700.0


def test_dive_and_surface():
    vessel = Uuv(speed_time_constant=3.0, climb_time_constant=2.0)
    start = Start(latitude=0.9, longitude=0.1, speed=2.0)
    manoeuvres = [Dive(depth=40.0, angle=np.radians(20.0)), Hold(duration=120.0), Surface(angle=np.radians(20.0))]
    _, _, tap, xy = run(700.0, manoeuvres, start=start, vessel=vessel)
    depth = xy[:, 2]
    assert depth.max() == pytest.approx(40.0, abs=0.7)
    assert np.sum(np.abs(depth - 40.0) < 1.0) > 110
    assert abs(depth[-1]) < 0.5
    assert np.degrees(-tap.attitude[:, 1].min()) == pytest.approx(20.0, abs=0.5)
    # The path angle is the pitch: no side slip in calm water
    assert tap.velocity[30, 2] == pytest.approx(-2.0 * np.sin(tap.attitude[30, 1]), abs=1e-3)


def test_waves_die_off_with_depth():
    deep = Start(latitude=0.9, longitude=0.1, depth=40.0, speed=2.0)
    shallow = Start(latitude=0.9, longitude=0.1, depth=5.0, speed=2.0)
    heave = [run(300.0, start=s, vessel=Uuv(), sea=SEA)[2].velocity[:, 2].std() for s in (deep, shallow)]
    number = (2 * np.pi / SEA.peak_period) ** 2 / 9.81
    assert heave[0] / heave[1] == pytest.approx(np.exp(-number * 35.0), rel=0.05)


def test_current_carries_the_vessel_and_is_what_the_log_does_not_see():
    current = Current(speed=0.8, direction=np.radians(120.0), shear=0.01)
    _, _, tap, _ = run(60.0, current=current)
    through = tap.velocity - tap.water_velocity
    forward = np.array([np.cos(START.heading), np.sin(START.heading), 0.0])
    np.testing.assert_allclose(through, np.tile(6.0 * forward, (60, 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(tap.water_velocity, axis=1), 0.8)
    deep = Start(latitude=0.9, longitude=0.1, depth=30.0, speed=2.0)
    _, _, tap, _ = run(10.0, start=deep, vessel=Uuv(), current=current)
    np.testing.assert_allclose(np.linalg.norm(tap.water_velocity, axis=1), 0.5)


def test_roll_follows_the_seas_on_the_beam_and_pitch_those_ahead():
    def motion(course):
        start = Start(latitude=0.9, longitude=0.1, heading=course, speed=5.0)
        sea = Sea(significant_height=2.0, peak_period=8.0, direction=0.0, spreading=0.05)
        return run(1200.0, start=start, sea=sea)[2].attitude[:, :2].std(axis=0)

    head, beam = motion(0.0), motion(np.pi / 2)
    assert head[1] > 3.0 * head[0]
    assert beam[0] > 3.0 * beam[1]


@pytest.mark.parametrize("course", [0.0, 1.0, np.pi])
def test_encounter_frequency_is_the_dopplers(course):
    """Head seas are met faster, following seas slower: w_e = w - k . U (Fossen 2011, eq. 8.26)."""
    start = Start(latitude=0.9, longitude=0.1, heading=course, speed=6.0)
    sea = Sea(significant_height=1.0, peak_period=10.0, direction=0.0, spreading=0.3, components=5)
    _, _, tap, _ = run(4096.0, start=start, sea=sea)
    table = components(sea, 1)[1]
    lines = np.abs(table[0] - 6.0 * (table[1] * np.cos(course) + table[2] * np.sin(course)))
    heave = tap.velocity[:, 2]
    power = np.abs(np.fft.rfft(heave * np.hanning(len(heave)))) ** 2
    frequency = 2 * np.pi * np.fft.rfftfreq(len(heave), 1.0)
    near = np.min(np.abs(frequency[:, None] - lines), axis=1) < 0.006
    assert power[near].sum() / power.sum() > 0.99
    assert near.mean() < 0.05


def test_heel_is_outward_and_proportional_to_the_centripetal_acceleration():
    _, _, tap, _ = run(200.0, [Turn(duration=180.0, rate=np.radians(1.0))], vessel=Ship(heel=2.0))
    assert tap.attitude[150, 0] == pytest.approx(-2.0 * 6.0 * np.radians(1.0) / 9.81, rel=1e-3)


def test_closed_loop_steers_by_the_position_it_is_given():
    def end(offset):
        world = World(START, Ship(), [Waypoints(points=((5000.0, 4000.0),))], rate=20.0, seed=1)
        world.steer_by(*offset)
        tap = world.advance(900.0, {"a": np.array([900.0])}).taps["a"]
        return relative_position(tap.position, world.state().position)[0], tap

    _, plain = end((0.0, 0.0))
    _, shifted = end((-200.0, 0.0))
    # Believing to be 200 m too far south, it steers too far north.
    assert relative_position(shifted.position, plain.position)[0, 0] > 50.0


def test_memory_does_not_grow_with_the_run():
    world = World(START, Ship(), [ZigZag(angle=0.3, duration=1e6)], SEA, rate=100.0, seed=1)
    held = []
    tracemalloc.start()
    try:
        for second in range(1, 2001):
            world.advance(float(second), {"a": np.array([float(second)])})
            if second % 1000 == 0:
                held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert held[1] - held[0] < 2000  # one float a step would be 8000 bytes


def test_time_does_not_go_back():
    world = World(START, Ship(), [], SEA, rate=100.0, seed=1)
    world.advance(10.0, {})
    with pytest.raises(ValueError, match="does not go back"):
        world.advance(5.0, {})


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Turn(angle=1.0, duration=5.0), "angle_deg or duration_s, one of the two"),
        (lambda: Turn(rate=0.1, radius=10.0, angle=1.0), "rate_deg_s or radius_m, not both"),
        (lambda: Turn(rate=0.0, duration=10.0), "does not turn"),
        (lambda: Start(latitude=0.1, longitude=0.1, height=2.0, depth=3.0), "height_m or depth_m"),
    ],
)
def test_contradictions_are_named(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()


def test_a_current_changes_with_time_and_place():
    """Spread as stated over runs; smooth; the truth and the water agree."""
    still = Start(latitude=0.9, longitude=0.1, speed=0.0)
    current = Current(speed=0.4, direction=0.5, variation=0.15, length_scale=500.0, time_scale=900.0)
    drift = np.array([
        World(still, Ship(), current=current, rate=1.0, seed=k).state().velocity[0] for k in range(400)
    ])  # fmt: skip
    mean = 0.4 * np.array([np.cos(0.5), np.sin(0.5)])
    np.testing.assert_allclose(drift[:, :2].mean(axis=0), mean, atol=5 * 0.15 / 20.0)
    np.testing.assert_allclose(drift[:, :2].std(axis=0), 0.15, rtol=0.15)
    world = World(Start(latitude=0.9, longitude=0.1, speed=4.0), Ship(), current=current, rate=20.0, seed=1)
    tap = world.advance(600.0, {"a": np.arange(1.0, 601.0)}).taps["a"]
    through = tap.velocity - tap.water_velocity
    np.testing.assert_allclose(np.hypot(through[:, 0], through[:, 1]), 4.0, rtol=1e-6)
    assert np.ptp(tap.water_velocity[:, 0]) > 0.1
    assert np.abs(np.diff(tap.water_velocity[:, 0])).max() < 0.02
