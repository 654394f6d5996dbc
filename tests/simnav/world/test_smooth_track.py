"""Trajectories of the user: through the poses, smooth, back by integration, and refused where they jump."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pyins.strapdown
import pytest

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.scenario import parse
from simnav.simulation.simulator import Simulator, ideal
from simnav.source import record
from simnav.spec import SpecError
from simnav.strapdown import integrate
from simnav.world.smooth_track import Limits, Poses, SmoothTrack
from simnav.world.surroundings import Surroundings
from simnav.world.trajectory import Voyage
from tests.cases.steered import ends_of

LIMITS = Limits(speed=40.0, acceleration=6.0, turn_rate=1.0)
SCENARIO = """
name = "own"
version = 1
title = "A trajectory of one's own"
duration_s = {duration}

[vessel]
{vessel}

[instruments.imu]
rate_hz = {rate}
"""
POINTS = """kind = "waypoint_track"
latitude_deg = [54.0, 54.01, 54.01, 54.0]
longitude_deg = [179.99, 179.99, -179.99, -179.98]
"""


def own(vessel, duration=600.0, rate=50.0):
    return parse(SCENARIO.format(vessel=vessel, duration=duration, rate=rate))


def seaway(t):
    """A ship that turns in waves: closed form, north-east-down [m] and roll, pitch, heading [rad]."""
    heading = 3.0 + 0.5 * np.sin(0.02 * t)
    place = [
        400.0 * np.cos(0.015 * t) + 0.4 * np.sin(0.7 * t),
        6.0 * t + 30.0 * np.sin(0.02 * t),
        1.2 * np.sin(0.63 * t) + 0.3 * np.sin(1.1 * t),
    ]
    return np.stack(place, axis=-1), np.stack([0.1 * np.sin(0.6 * t), 0.04 * np.cos(0.8 * t), heading], axis=-1)


def poses(t, attitude=True, latitude=54.0):
    place, angles = seaway(t)
    geodetic = np.radians([latitude, 179.999, 0.0]) + place * [1.0 / 6.37e6, 1.0 / 3.8e6, -1.0]
    geodetic[:, 1] = wrap_angle(geodetic[:, 1])
    return Poses("poses", t, geodetic, angles if attitude else None, [f"line {k}" for k in range(2, len(t) + 2)])


def voyage(duration, rate):
    scenario = own(POINTS + "speed_m_s = 5.0", duration, rate)
    return scenario.voyage(1, scenario.surround(1), rate)


def run(given, duration, rate, **kwargs):
    """Truth at the poses, the initial state, and the ideal samples."""
    track = SmoothTrack(given, voyage(duration, rate), LIMITS, **kwargs)
    start = track.state()
    at = given.time - given.time[0]
    return track.advance(duration, {"poses": at[(at > 0.0) & (at <= duration)]}), start


@pytest.mark.parametrize("rate", [20.0, 100.0])
def test_the_truth_goes_through_the_poses(rate):
    given = poses(np.arange(0.0, 300.1, 0.5))
    block, start = run(given, 300.0, rate)
    tap = block.taps["poses"]
    np.testing.assert_allclose(relative_position(tap.position, given.position[1:]), 0.0, atol=1e-3)
    np.testing.assert_allclose(wrap_angle(tap.attitude - given.attitude[1:]), 0.0, atol=1e-12)
    np.testing.assert_allclose(start.attitude[0], given.attitude[0], atol=1e-12)
    # What lies between two poses is the motion that they were taken from.
    speed = np.gradient(seaway(given.time)[0], given.time, axis=0)[1:]
    ratio = np.abs(np.linalg.norm(tap.velocity, axis=1) / np.linalg.norm(speed, axis=1) - 1.0)
    assert np.median(ratio) < 0.02


def test_poses_may_begin_at_any_time_and_the_run_later():
    given = poses(np.arange(0.0, 201.0, 0.5) + 1.7e6)
    block, _ = run(given, 100.0, 50.0, skip=0.0)
    later, start = run(given, 100.0, 50.0, skip=20.0)
    np.testing.assert_allclose(relative_position(start.position, given.position[[40]]), 0.0, atol=1e-6)
    same = block.imu.time > 20.01
    np.testing.assert_allclose(
        later.imu.specific_force[: same.sum()], block.imu.specific_force[same], atol=2e-4
    )  # coning and sculling of the first samples, and gravity 20 s later


def test_python_ins_returns_to_the_truth_after_an_hour_in_a_seaway():
    """An independent integration of our ideal samples; its vertical channel, which has no feedback, is held."""
    given = poses(np.arange(0.0, 3600.1, 0.5))
    block, start = run(given, 3600.0, 25.0)
    interval = block.imu.interval[:, None]
    raw = pd.DataFrame(
        np.hstack([block.imu.angular_rate * interval, block.imu.specific_force * interval]),
        index=block.imu.time,
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )
    raw = pyins.strapdown.compute_increments_from_imu(pd.concat([raw.iloc[:1].set_axis([0.0]), raw]), "increment")
    angles, place = np.degrees(start.attitude[0]), start.position[0]
    values = [*np.degrees(place[:2]), place[2], *start.velocity[0], *angles]
    names = ["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"]
    pva = pd.Series(values, index=names, name=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pandas, about python-ins
        end = pyins.strapdown.Integrator(pva, False).integrate(raw).iloc[-1]
    theirs = np.array([np.radians(end.lat), np.radians(end.lon), given.position[7200, 2]])
    np.testing.assert_allclose(relative_position(theirs, given.position[7200])[:2], 0.0, atol=0.05)
    ours = integrate(start.position[0], start.velocity[0], start.attitude[0], block.imu)
    np.testing.assert_allclose(relative_position(ours.position[-1], given.position[7200]), 0.0, atol=5e-3)


def test_specific_force_and_angular_rate_have_no_steps():
    """The acceleration of a cubic is continuous: two samples differ by the jerk times their spacing."""
    given = poses(np.arange(0.0, 61.0, 1.0))
    block, _ = run(given, 60.0, 200.0)
    assert np.abs(np.diff(block.imu.specific_force[5:], axis=0)).max() < 0.02
    assert np.abs(np.diff(block.imu.angular_rate[5:], axis=0)).max() < 1e-3


def test_without_a_heading_the_bow_points_along_the_course():
    given = poses(np.arange(0.0, 300.1, 1.0), attitude=False)
    tap = run(given, 300.0, 20.0)[0].taps["poses"]
    course = np.arctan2(tap.velocity[:, 1], tap.velocity[:, 0])
    np.testing.assert_allclose(wrap_angle(tap.attitude[:, 2] - course), 0.0, atol=2e-3)
    np.testing.assert_array_equal(tap.attitude[:, :2], 0.0)


def test_a_vessel_that_stops_keeps_a_smooth_heading():
    t = np.arange(0.0, 401.0, 2.0)
    way = 500.0 + 500.0 * np.tanh((t - 200.0) / 30.0)  # stops at both ends
    place = np.radians([54.0, 7.9, 0.0]) + np.outer(way, [1.0 / 6.37e6, 0.0, 0.0])
    given = Poses("poses", t, place, None, [f"line {k}" for k in range(len(t))])
    block, start = run(given, 400.0, 20.0)
    np.testing.assert_allclose([start.attitude[0, 2], *block.taps["poses"].attitude[:, 2]], 0.0, atol=1e-6)


def test_the_division_into_blocks_does_not_change_the_numbers():
    scenario = own(POINTS + "speed_m_s = 5.0", 120.0)
    whole = record(scenario, 1).data
    simulator = Simulator(scenario, 1)
    parts = [simulator.advance(until) for until in (1.0, 7.0, 60.0, 120.0)]
    for name in ("angular_rate", "specific_force"):
        joined = np.concatenate([getattr(p.imu, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole.imu, name), name)
    np.testing.assert_array_equal(np.concatenate([p.truth.position for p in parts]), whole.truth.position)


def test_waypoints_are_passed_at_their_times_across_the_antimeridian():
    scenario = own(POINTS + "time_s = [0.0, 200.0, 420.0, 600.0]\ndepth_m = [10.0, 20.0, 20.0, 5.0]")
    given, truth = scenario.vessel.poses(), ideal(scenario, 1).data.truth
    at = np.searchsorted(truth.time, given.time[1:] - 1e-6)
    np.testing.assert_allclose(relative_position(truth.position[at], given.position[1:]), 0.0, atol=1e-3)
    np.testing.assert_allclose(truth.position[at, 2], [-20.0, -20.0, -5.0], atol=1e-3)
    assert np.abs(truth.velocity).max() < 20.0


def test_waypoints_are_passed_at_their_speeds():
    scenario = own(POINTS + "speed_m_s = [4.0, 6.0, 6.0, 3.0]", 650.0)
    given = scenario.vessel.poses()
    track = SmoothTrack(given, scenario.voyage(1, scenario.surround(1), 50.0), scenario.vessel.limits())
    corners = given.time[[64, 128]]
    tap = track.advance(650.0, {"corner": corners}).taps["corner"]
    ends = np.radians([[54.01, 179.99, 0.0], [54.01, -179.99, 0.0]])
    np.testing.assert_allclose(relative_position(tap.position, ends), 0.0, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(tap.velocity, axis=1), 6.0, atol=1e-4)
    steady = own(POINTS + "speed_m_s = 5.0", 700.0)
    truth = ideal(steady, 1).data.truth
    np.testing.assert_allclose(np.linalg.norm(truth.velocity, axis=1), 5.0, atol=1e-4)


def shifted(given, k, metres):
    """The poses, of which those from k on are further north."""
    place = given.position.copy()
    place[k:, 0] += metres / 6.37e6
    return Poses(given.source, given.time, place, given.attitude, given.line)


@pytest.mark.parametrize(
    ("metres", "message"),
    [
        (120.0, "poses: the poses jump by .* m in 1 s from line 31 to line 32.*max_speed_m_s = 40"),
        (
            12.0,
            "poses: the poses jump between line 3. and line 3.: a smooth vessel accelerates.*max_acceleration_m_s2 = 6",
        ),
    ],
)
def test_a_jump_is_refused(metres, message):
    given = poses(np.arange(0.0, 61.0, 1.0))
    with pytest.raises(SpecError, match=message):
        SmoothTrack(shifted(given, 30, metres), voyage(60.0, 50.0), LIMITS)


def test_a_jump_of_the_heading_is_refused():
    given = poses(np.arange(0.0, 61.0, 1.0))
    given.attitude[30:, 2] += 2.0
    with pytest.raises(SpecError, match=r"a smooth vessel turns by .* deg/s there; max_turn_rate_deg_s = 57"):
        SmoothTrack(given, voyage(60.0, 50.0), LIMITS)


def test_what_is_no_trajectory_is_refused():
    given = poses(np.arange(0.0, 61.0, 1.0))
    with pytest.raises(SpecError, match="the poses reach 60 s from the start of the run, and duration_s = 100"):
        SmoothTrack(given, voyage(100.0, 50.0), LIMITS)
    with pytest.raises(SpecError, match="line 5: the time 2 s is not after 2 s of line 4"):
        Poses("poses", np.array([0.0, 1.0, 2.0, 2.0]), given.position[:4], None, given.line)
    with pytest.raises(SpecError, match="1 pose is no trajectory"):
        Poses("poses", given.time[:1], given.position[:1], None, given.line)
    still = Poses("poses", given.time, given.position[:1].repeat(61, axis=0), None, given.line)
    with pytest.raises(SpecError, match=r"never moves at course_speed_m_s = 0.2 or more.*give the attitude, too"):
        SmoothTrack(still, voyage(60.0, 50.0), LIMITS)
    quick = poses(np.arange(0.0, 61.0, 0.5))
    with pytest.raises(SpecError, match=r"at 1 samples a second the truth would miss the poses by .* Hz are"):
        SmoothTrack(quick, voyage(60.0, 1.0), LIMITS)


def test_a_departure_smooths_poses_with_errors():
    t = np.arange(0.0, 601.0, 5.0)
    clean = poses(t, attitude=False)
    noisy = Poses("ais", t, clean.position + np.random.default_rng(1).normal(size=(len(t), 3)) * [1e-6, 1e-6, 0.0],
                  None, clean.line)  # fmt: skip
    with pytest.raises(SpecError, match="because the acceleration changes by"):
        SmoothTrack(noisy, voyage(600.0, 4.0), LIMITS)
    tap = run(noisy, 600.0, 20.0, departure=6.0)[0].taps["poses"]
    error = relative_position(tap.position, clean.position[1:])[:, :2]
    assert np.sqrt(np.mean(error**2)) < 4.0  # the errors of the poses are 6.4 m


@pytest.mark.parametrize(
    ("vessel", "message"),
    [
        ("speed_m_s = 5.0\ntime_s = [0, 1, 2, 3]", "give the time_s of each waypoint or the speed_m_s there, not both"),
        ("", "give the time_s of each waypoint or the speed_m_s there"),
        ("speed_m_s = [5.0, 4.0]", "speed_m_s has 2 numbers, latitude_deg has 4; give one each, or one for all"),
        ("speed_m_s = 0.0", "should be greater than 0; give times for a vessel that stops"),
        ("speed_m_s = 5.0\nheight_m = 1\ndepth_m = 1", "give height_m or depth_m, not both"),
        ("speed = 5.0", "unknown key 'vessel.speed'.*'speed_m_s'"),
    ],
)
def test_mistakes_in_waypoints_are_one_sentence(vessel, message):
    with pytest.raises(SpecError, match=message):
        own(POINTS + vessel)


def test_waypoints_at_one_place_are_refused():
    scenario = own(
        POINTS.replace("54.01, 54.01", "54.0, 54.01").replace("179.99, -", "179.99, -", 1) + "speed_m_s = 5.0"
    )
    with pytest.raises(SpecError, match="waypoint 2 is where waypoint 1 is; give times"):
        record(scenario, 1)


def test_in_closed_loop_the_vessel_is_aside_by_the_error_of_its_estimate():
    """Believed to be 20 m too far north, it goes 20 m to the south, by a lag of at least 15 s, and without a step."""
    given = poses(np.arange(0.0, 400.0, 2.0))
    ends = []
    for error in (0.0, 20.0):
        track = SmoothTrack(given, Voyage(None, (), Surroundings(), 50.0, 300.0, 1), LIMITS)
        velocity = []
        for k in range(300):
            track.steer_by(error if k >= 50 else 0.0, -0.5 * error if k >= 50 else 0.0)
            block = track.advance(k + 1.0, {"all": np.arange(50 * k + 1, 50 * k + 51) / 50.0})
            velocity.append(block.taps["all"].velocity)
        ends.append((track.state().position[0], np.concatenate(velocity)))
    aside = relative_position(ends[1][0][None], ends[0][0])[0]
    np.testing.assert_allclose(aside, [-20.0, 10.0, 0.0], atol=1e-2)
    added = ends[1][1] - ends[0][1]
    assert np.abs(np.diff(added, axis=0)).max() < 0.02 * 20.0 / 15.0**2 * 2.0  # the acceleration of the lag
    assert not added[: 50 * 50].any()
    lag = 15.0
    t = np.arange(1, 101) / 50.0
    np.testing.assert_allclose(added[2500:2600, 0], -20.0 * t / lag**2 * np.exp(-t / lag), atol=2e-3)


def test_the_environment_steers_it():
    table = 'kind = "waypoint_track"\nlatitude_deg = [54.0, 54.01, 54.02]\nlongitude_deg = [7.9, 7.91, 7.9]\n'
    table += "speed_m_s = 5.0\n"
    gnss = '[instruments.gnss]\nkind = "gnss_position"\nrate_hz = 1.0\nsigma_m = 1.0\n'
    scenario = parse(SCENARIO.format(duration=60.0, rate=20.0, vessel=table) + gnss)
    ends = ends_of(scenario, (0.0, 30.0))
    assert relative_position(ends[1][None], ends[0])[0, 0] < -20.0
