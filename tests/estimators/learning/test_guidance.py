"""Guidance: who steers by the estimate keeps to the track, and the scores are of the truth."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from simnav.estimator import Estimator
from simnav.estimators.learning.guidance import GuidanceEnv, LineOfSight
from simnav.geometry.earth import displace
from simnav.scenario import load, parse
from simnav.types import Estimate
from simnav.world import World

TOML = """
name = "creek"
version = 1
title = "a launch in a creek"
duration_s = 120.0
[start]
latitude_deg = 50.0
longitude_deg = -5.0
speed_m_s = 4.0
[vessel]
speed_time_constant_s = 5.0
turn_time_constant_s = 2.0
turn_rate_deg_s = 6.0
[current]
speed_m_s = 0.3
direction_deg = 90.0
[[manoeuvre]]
kind = "hold"
duration_s = 40.0
[[manoeuvre]]
kind = "turn"
angle_deg = 70.0
[instruments.imu]
rate_hz = 20.0
gyroscope = { random_walk_deg_sqrt_h = 0.05 }
[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [1.0, 1.0, 2.0]
"""


@pytest.fixture(scope="module")
def scenario():
    return parse(TOML)


class Aside(Estimator):
    """Knows the way, but for a position that is 30 m too far east; set by the test."""

    offset = 0.0

    def reset(self, start, instruments):
        self.start = start

    def update(self, measurements):
        (fix,) = [m for m in measurements if m.instrument == "gnss"] or [None]
        position = self.start.position if fix is None else fix.value
        return Estimate(measurements.time, displace(position, np.array([0.0, self.offset, 0.0])))


def voyage(env, controller, seed=1):
    observation, info = env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(controller(observation))
        assert observation in env.observation_space
        total, over = total + reward, terminated or truncated
    return total, info["scores"], terminated


def test_steering_by_the_estimate_beats_the_planned_heading(scenario):
    env = GuidanceEnv(scenario)
    steered, scores, _ = voyage(env, LineOfSight())
    alone, drifted, _ = voyage(env, lambda _: np.zeros(2, np.float32))
    # There is no wind; what carries her off is the start's error of heading.
    assert scores.cross_track < 6.0
    assert steered > alone or scores.cross_track < drifted.cross_track
    assert scores.clearance == np.inf
    assert scores.fuel == pytest.approx(1.0, abs=0.05)


def test_an_error_of_the_estimate_becomes_one_of_the_track(scenario):
    navigator = Aside()
    env = GuidanceEnv(scenario, navigator=navigator, reveal_truth=True)
    asides = []
    for offset in (0.0, 30.0):
        navigator.offset = offset
        observation, _ = env.reset(seed=1)
        for _ in range(40):  # northward
            observation, _, _, _, info = env.step(LineOfSight()(observation))
        asides.append(info["aside"])
    assert asides[1] - asides[0] == pytest.approx(-30.0, abs=5.0)


def test_a_channel_ends_at_its_side_and_a_dock_wants_her_slow(scenario):
    env = GuidanceEnv(scenario, route="channel", half_width=20.0)
    total, scores, aground = voyage(env, lambda _: np.array([1.0, 0.0], np.float32))
    assert aground
    assert scores.aground
    assert scores.clearance < 0.0
    assert total < -90.0
    _, scores, aground = voyage(env, LineOfSight())
    assert not aground
    assert 0.0 < scores.clearance < 20.0
    dock = GuidanceEnv(scenario, route="dock")
    at_dock = voyage(dock, LineOfSight())[0]
    assert at_dock == pytest.approx(voyage(GuidanceEnv(scenario), LineOfSight())[0], abs=0.1)  # far too fast


def test_haste_burns_fuel(scenario):
    env = GuidanceEnv(scenario, steps=60)
    _, fast, _ = voyage(env, lambda o: np.array([LineOfSight()(o)[0], 1.0], np.float32))
    assert fast.fuel > 2.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"route": "canal"}, "route is one of track, channel, dock, not 'canal'"),
        ({"half_width": -1.0}, "half_width = -1.0 m should be positive"),
        ({"navigator": "oracle"}, "navigator 'oracle' is a reference that is told the truth"),
        ({"steps": 0}, "steps is a positive integer"),
        ({"render_mode": "ascii"}, "render_mode is"),
    ],
)
def test_bad_arguments(scenario, options, message):
    with pytest.raises(ValueError, match=message):
        GuidanceEnv(scenario, **options)


def test_bad_actions_and_logs_are_refused(scenario):
    env = GuidanceEnv(scenario)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(2))
    env.reset(seed=1)
    for action in (np.zeros(3), np.array([np.nan, 0.0])):
        with pytest.raises(ValueError, match="an action of Guidance is"):
            env.step(action)
    with pytest.raises(ValueError, match="is a recorded log: its vessel cannot be steered"):
        GuidanceEnv(load("car-kitti"))


DIVING = """
[vessel]
kind = "uuv"
[[manoeuvre]]
kind = "dive"
depth_m = 12.0
angle_deg = 20.0
[[manoeuvre]]
kind = "hold"
duration_s = 20.0
[[manoeuvre]]
kind = "surface"
"""


@pytest.mark.parametrize(("haste", "tolerance"), [(0.0, 1.0), (-0.8, 5.0)])
def test_the_vessel_dives_and_surfaces_where_it_is_planned(haste, tolerance):
    """Also where the agent is slow: the depth belongs to the place and not to the time, by which it is 12 m off."""
    text = TOML[: TOML.index("[vessel]")] + DIVING + TOML[TOML.index("[instruments.imu]") :]
    env = GuidanceEnv(parse(text.replace("duration_s = 120.0", "duration_s = 240.0", 1)), reveal_truth=True)
    env.reset(seed=4)
    track = World.plan(env.scenario.start, env.scenario.vessel, env.scenario.manoeuvres)
    track.reach(240.0)
    assert -track.position[:, 2].min() == pytest.approx(12.0, abs=0.5)
    depths, truncated = [], False
    while not truncated:
        _, _, _, truncated, info = env.step(np.array([0.0, haste], np.float32))
        position = info["truth"][0]
        nearest = int(np.argmin(np.abs(track.position[:, 0] - position[0])))
        planned = -track.position[nearest, 2]
        assert -position[2] == pytest.approx(planned, abs=tolerance)
        depths.append(-position[2])
    assert max(depths) == pytest.approx(12.0, abs=0.5)
    assert depths[-1] == pytest.approx(0.0, abs=0.5)


def test_the_glider_dives_in_its_task():
    env = GuidanceEnv("glider-dive", reveal_truth=True, steps=400)
    env.reset(seed=0)
    deepest = min(env.step(np.zeros(2, np.float32))[4]["truth"][0, 2] for _ in range(400))
    assert deepest < -25.0
