"""Environment: a one-second step, 100 IMU samples and every kind of instrument, simulation included.

``pytest tests/benchmarks/test_bench_environment.py --benchmark-enable``. Target: a step in open loop in under 80 us.
"""

from __future__ import annotations

import numpy as np
import pytest

from simnav.environment import NavigationEnv, NavigationVectorEnv
from simnav.scenario import Scenario, parse
from simnav.types import KINDS

TOML = """
name = "everything"
version = 1
title = "every kind of instrument"
duration_s = 1e6
water_depth_m = 80.0
[start]
latitude_deg = 50.0
longitude_deg = -5.0
speed_m_s = 5.0
[[manoeuvre]]
kind = "zigzag"
angle_deg = 20.0
rate_deg_s = 0.8
duration_s = 600.0
[sea]
significant_height_m = 1.5
peak_period_s = 8.0
[instruments.imu]
rate_hz = 100.0
[instruments.imu.gyroscope]
bias_deg_h = 1.0
random_walk_deg_sqrt_h = 0.05
rate_random_walk_deg_h_sqrt_h = 0.1
scale_ppm = 100.0
[instruments.imu.accelerometer]
bias_ug = 200.0
random_walk_ug_sqrt_hz = 50.0
rate_random_walk_ug_sqrt_s = 0.5
scale_ppm = 100.0
[instruments.gnss_position]
rate_hz = 1.0
sigma_m = [1.5, 1.5, 3.0]
[instruments.gnss_velocity]
rate_hz = 1.0
sigma_m_s = [0.05, 0.05, 0.1]
[instruments.dvl]
rate_hz = 5.0
sigma_m_s = 0.02
[instruments.magnetic_compass]
rate_hz = 10.0
sigma_deg = 1.0
[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.3
[instruments.speed_log]
rate_hz = 1.0
sigma_m_s = 0.1
[instruments.depth]
rate_hz = 1.0
sigma_m = 0.1
[instruments.terrain_fix]
rate_hz = 0.1
sigma_m = [10.0, 10.0]
[instruments.gnss_raw]
satellites = ["G12", "G29", "E27", "E30", "E34"]
sigma_pseudorange_m = 0.2
sigma_range_rate_m_s = 0.03
[instruments.gnss_receiver]
sigma_m = [1.0, 1.0, 2.0]
[instruments.gnss_receiver_velocity]
sigma_m_s = 0.05
"""


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return parse(TOML)


def begin(env):
    """Begin a run; the action is the initial state."""
    _, info = env.reset(seed=1)
    start = info["start"]
    return np.stack([start.position, start.velocity, start.attitude])


def test_the_scenario_has_every_kind_of_instrument(scenario):
    # Left out: so times compare with those of before.
    later = {
        "acoustic_range",
        "altimeter",
        "dvl_beams",
        "dvl_solution",
        "dvl_water_solution",
        "magnetic_field",
        "multibeam_profile",
        "terrain_match",
        "usbl_fix",
        "vessel_range",
    }
    assert {spec.kind for spec in scenario.aids.values()} == set(KINDS) - later


@pytest.mark.parametrize("options", [{}, {"closed_loop": True}], ids=["open loop", "closed loop"])
def test_step(benchmark, scenario, options):
    env = NavigationEnv(scenario, **options)
    action = begin(env)
    # Iterations are a multiple of the longest stretch that is simulated ahead.
    observation, *_ = benchmark.pedantic(env.step, (action,), rounds=10, iterations=512, warmup_rounds=1)
    assert observation["imu"]["valid"].sum() == 100


def test_step_of_eight_runs_side_by_side(benchmark, scenario):
    envs = NavigationVectorEnv(scenario, 8)
    _, infos = envs.reset(seed=1)
    actions = np.stack([np.stack([s.position, s.velocity, s.attitude]) for s in infos["start"]])
    observation, *_ = benchmark.pedantic(envs.step, (actions,), rounds=5, iterations=512, warmup_rounds=1)
    assert (observation["imu"]["valid"].sum(axis=1) == 100).all()


def test_reset(benchmark, scenario):
    env = NavigationEnv(scenario)
    observation, _ = benchmark.pedantic(env.reset, rounds=10, warmup_rounds=1)
    assert observation["interval"].tolist() == [0.0, 1.0]


def test_frame(benchmark, scenario):
    env = NavigationEnv(scenario, render_mode="rgb_array")
    action = begin(env)
    for _ in range(512):
        env.step(action)
    frame = benchmark.pedantic(env.render, rounds=10, warmup_rounds=1)
    assert frame.shape == (720, 720, 3)
