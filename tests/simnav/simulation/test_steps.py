"""Runs that go step by step, several at once, give the numbers of the block form, bit for bit."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from simnav.recording import packets
from simnav.scenario import Scenario, load, parse
from simnav.simulation.simulator import Simulator
from simnav.simulation.steps import SteppedRuns

#: Every kind of instrument and fault that comes with simnav.
TOML = """
name = "everything"
version = 1
title = "every kind of instrument and fault"
duration_s = 60.0
step_s = 0.5
water_depth_m = 60.0
[start]
latitude_deg = 50.0
longitude_deg = -5.0
depth_m = 5.0
speed_m_s = 2.0
[vessel]
kind = "uuv"
[current]
speed_m_s = 0.4
direction_deg = 70.0
variation_m_s = 0.1
[sea]
significant_height_m = 1.5
peak_period_s = 8.0
[instruments.imu]
rate_hz = 20.0
[instruments.imu.gyroscope]
bias_deg_h = 1.0
bias_instability_deg_h = 0.5
correlation_time_s = 300.0
random_walk_deg_sqrt_h = 0.05
rate_random_walk_deg_h_sqrt_h = 0.1
scale_ppm = 100.0
misalignment_deg = 0.01
quantization_arcsec = 0.1
[instruments.imu.accelerometer]
bias_ug = 200.0
random_walk_ug_sqrt_hz = 50.0
range_g = 1.01
[instruments.gnss_position]
rate_hz = 1.0
phase_s = 0.25
sigma_m = [1.5, 1.5, 3.0]
bias_instability_m = 0.5
correlation_time_s = 60.0
lever_arm_m = [1.0, 0.5, -3.0]
[instruments.gnss_velocity]
rate_hz = 2.0
sigma_m_s = [0.05, 0.05, 0.1]
lever_arm_m = [1.0, 0.5, -3.0]
[instruments.dvl]
rate_hz = 5.0
sigma_m_s = 0.02
speed_noise_percent = 1.0
scale_percent = 0.3
misalignment_deg = 0.2
lever_arm_m = [0.5, 0.0, 1.0]
minimum_altitude_m = 0.5
maximum_altitude_m = 53.99
[instruments.magnetic_compass]
rate_hz = 4.0
sigma_deg = 1.0
deviation_deg = 2.0
[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.3
speed_error = true
[instruments.speed_log]
rate_hz = 1.0
sigma_m_s = 0.1
scale_percent = 1.0
lever_arm_m = [1.0, 0.0, 0.0]
[instruments.depth]
rate_hz = 1.0
sigma_m = 0.1
scale_percent = 0.2
lever_arm_m = [1.0, 0.0, 0.5]
[instruments.terrain_fix]
rate_hz = 0.3
sigma_m = [10.0, 10.0]
lever_arm_m = [1.0, 0.0, 0.0]
[[fault]]
kind = "noise_step"
instruments = ["dvl", "magnetic_compass"]
factor = 3.0
start_s = 4.0
[[fault]]
kind = "noise_step"
instruments = "gnss_position"
sigma_m = [4.0, 4.0, 4.0]
intervals_s = [[1.0, 5.0], [7.0, 30.0]]
[[fault]]
kind = "gross_error"
instruments = ["gnss_position", "terrain_fix"]
probability = 0.3
size_m = [20.0, 50.0]
[[fault]]
kind = "multipath"
instruments = "gnss_velocity"
sigma_m_s = 0.3
correlation_time_s = 5.0
mean_active_s = 4.0
mean_gap_s = 3.0
[[fault]]
kind = "frozen"
instruments = ["depth", "dvl"]
intervals_s = [[3.0, 6.0], [6.0, 8.0], [12.0, 14.0]]
[[fault]]
kind = "ramp"
instruments = "depth"
slope_m_s = 0.1
start_s = 2.0
[[fault]]
kind = "outage"
instruments = "gnss_position"
start_s = 10.0
end_s = 14.0
[[fault]]
kind = "false_zero"
instruments = "dvl"
start_s = 15.0
end_s = 16.0
[[fault]]
kind = "bias_step"
instruments = "gyrocompass"
offset_deg = 200.0
start_s = 8.0
[[fault]]
kind = "imu_disturbance"
angular_rate_deg_s = 0.2
specific_force_noise_m_s2 = 0.1
start_s = 5.0
end_s = 9.0
"""


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return parse(TOML)


def steer(simulator, k):
    if k % 7 == 3:  # an error of the estimate, as in closed loop
        simulator.steer_by(5.0 * k, -3.0 * k, 0.01 * k)


def in_blocks(scenario, seed, steps):
    """The packets of a run, its truth and the labels of its measurements, from blocks of one step."""
    simulator, found = Simulator(scenario, seed), []
    for k in range(steps):
        steer(simulator, k)
        block = simulator.advance((k + 1) * simulator.step)
        (packet,) = packets(block, block.truth.time)
        labels = sorted((t, int(f), n) for n, s in block.aids.items() for t, f in zip(s.time, s.faults, strict=True))
        truth = np.concatenate([block.truth.position[0], block.truth.velocity[0], block.truth.attitude[0]])
        found.append((packet, labels, truth))
    return found


def assert_same(runs, b, expected):
    packet, labels, truth = expected
    own = runs.packet(b)
    assert (own.start, own.time) == (packet.start, packet.time)
    np.testing.assert_array_equal(runs.truth[b], truth)
    assert (own.imu is None) == (packet.imu is None)
    if own.imu is not None:
        for name in ("time", "interval", "angular_rate", "specific_force"):
            np.testing.assert_array_equal(getattr(own.imu, name), getattr(packet.imu, name), name)
    assert [(m.time, m.instrument, m.kind) for m in own.aids] == [(m.time, m.instrument, m.kind) for m in packet.aids]
    for mine, theirs in zip(own.aids, packet.aids, strict=True):
        np.testing.assert_array_equal(mine.value, theirs.value, mine.instrument)
    n = runs.count[b]
    mine = zip(runs.when[b, :n].tolist(), runs.faults[b, :n].tolist(), runs.who[b, :n].tolist(), strict=True)
    assert sorted((t, f, runs.names[b][i]) for t, f, i in mine) == labels


def check(scenarios, seeds, steps):
    expected = [in_blocks(s, seed, steps) for s, seed in zip(scenarios, seeds, strict=True)]
    runs, on = SteppedRuns(len(seeds)), np.ones(len(seeds), np.bool_)
    for b, (s, seed) in enumerate(zip(scenarios, seeds, strict=True)):
        runs.begin(b, Simulator(s, seed))
    for k in range(steps):
        for b in range(len(seeds)):
            steer(runs.simulators[b], k)
        runs.advance(on)
        for b in range(len(seeds)):
            assert_same(runs, b, expected[b][k])
    return expected


def test_every_instrument_and_fault(scenario):
    expected = check([scenario] * 2, [1, 2], 40)
    labels = [int(f) for run in expected for _, step, _ in run for _, f, _ in step]
    assert np.bitwise_or.reduce(labels) == 0b110111111111  # all but the outage's and the IMU's


def test_runs_of_unlike_scenarios_side_by_side(scenario):
    check([load("ship-turn"), scenario, load("gnss-outage"), load("auv-survey")], [3, 4, 5, 6], 12)


def test_a_run_is_taken_over_by_another_and_a_copy_goes_on_by_itself(scenario):
    runs, on = SteppedRuns(1), np.ones(1, np.bool_)
    runs.begin(0, Simulator(load("gnss-outage"), 1))
    runs.advance(on)
    runs.begin(0, Simulator(scenario, 2))
    expected = in_blocks(scenario, 2, 12)
    for k in range(12):
        steer(runs.simulators[0], k)
        runs.advance(on)
        assert_same(runs, 0, expected[k])
        if k == 5:
            for other in (copy.deepcopy(runs), pickle.loads(pickle.dumps(runs))):
                for j in range(k + 1, 12):
                    steer(other.simulators[0], j)
                    other.advance(on)
                    assert_same(other, 0, expected[j])


def test_what_only_makes_blocks_gives_the_same_numbers(scenario, monkeypatch):
    monkeypatch.setattr("simnav.simulation.steps.CompiledInstrument", int)  # as if the instruments were those of others
    runs, on = SteppedRuns(1), np.ones(1, np.bool_)
    runs.begin(0, Simulator(scenario, 1))
    for k, expected in enumerate(in_blocks(scenario, 1, 20)):
        steer(runs.simulators[0], k)
        runs.advance(on)
        assert_same(runs, 0, expected)
