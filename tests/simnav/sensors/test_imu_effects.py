"""Errors of an IMU by specific force, vibration and temperature; bandwidth and delay; faults inside an IMU."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.scenario import parse
from simnav.sensors.imu import ImuSpec
from simnav.simulation.simulator import Simulator
from simnav.simulation.steps import SteppedRuns
from simnav.source import record
from simnav.spec import SpecError
from simnav.types import ImuSamples

G = 9.80665
DEG_H = np.radians(1.0) / 3600.0


def samples(n, rate=100.0, angular_rate=0.0, specific_force=0.0):
    shape = (n, 3)
    return ImuSamples(np.arange(1, n + 1) / rate, np.full(n, 1.0 / rate), np.zeros(shape) + angular_rate,
                      np.zeros(shape) + specific_force)  # fmt: skip


def sensed(effects, ideal, seed=1, rate=100.0, **triads):
    return ImuSpec.from_toml({"rate_hz": rate, "effects": effects, **triads}).build(seed).sense(ideal)


def test_effects_that_are_not_named_change_no_bit():
    table = {"rate_hz": 100, "model": "HG1700"}
    ideal = samples(500, specific_force=[0.1, 0.2, -G])
    plain, empty = (ImuSpec.from_toml(t).build(1) for t in (table, {**table, "effects": {}}))
    assert empty.effects is None
    np.testing.assert_array_equal(plain.sense(ideal).specific_force, empty.sense(ideal).specific_force)


def test_g_sensitivity_is_linear_in_the_specific_force_and_has_its_sigma():
    effects = {"gyroscope_g_sensitivity_deg_h_g": 5.0}
    one = sensed(effects, samples(3, specific_force=[0.0, 0.0, -G])).angular_rate
    two = sensed(effects, samples(3, specific_force=[0.0, 0.0, -2.0 * G])).angular_rate
    np.testing.assert_allclose(two, 2.0 * one, rtol=1e-12)
    drawn = [sensed(effects, samples(1, specific_force=[0.0, 0.0, -G]), seed=s).angular_rate[0] for s in range(150)]
    assert np.std(drawn) / DEG_H == pytest.approx(5.0, rel=0.12)


def test_a_vibration_is_rectified():
    """The mean of K (a sin)^2 is K a^2 / 2, along the axis that vibrates; the declared vibration counts on all."""
    t = np.arange(1, 8001) / 200.0
    shake = np.zeros((len(t), 3))
    shake[:, 0] = 3.0 * np.sin(2.0 * np.pi * 20.0 * t)
    effects = {"accelerometer_vibration_rectification_ug_g2": 100.0}
    ideal = samples(len(t), 200.0, specific_force=shake + np.array([0.0, 0.0, -G]))
    shaken = (sensed(effects, ideal, rate=200.0).specific_force - ideal.specific_force)[6000:].mean(axis=0)
    np.testing.assert_allclose(shaken[1:], 0.0, atol=1e-12)
    still = samples(10, 200.0, specific_force=[0.0, 0.0, -G])
    declared = sensed({**effects, "vibration_g": 2.0}, still, rate=200.0).specific_force - still.specific_force
    np.testing.assert_allclose(declared, declared[:1].repeat(10, axis=0), rtol=1e-6)
    assert shaken[0] / declared[0, 0] == pytest.approx(0.5 * 3.0**2 / (2.0 * G) ** 2, rel=0.01)
    drawn = [sensed({**effects, "vibration_g": 2.0}, still[:1], seed=s).specific_force[0] for s in range(200)]
    assert np.std(drawn - np.array([0.0, 0.0, -G])) / (1e-6 * G) == pytest.approx(400.0, rel=0.1)
    gyroscope = sensed({"gyroscope_vibration_rectification_deg_h_g2": 1.0, "vibration_g": 2.0}, samples(10))
    assert 0.0 < np.abs(gyroscope.angular_rate).max() / DEG_H < 4.0 * 4.0


def test_the_temperature_rises_and_stays():
    effects = {"accelerometer_temperature_ug_k": 50.0, "temperature_rise_k": 20.0, "temperature_time_min": 1.0}
    error = sensed(effects, samples(12_000)).specific_force
    np.testing.assert_allclose(error[2999], 0.5 * error[-1], rtol=1e-9)
    np.testing.assert_array_equal(error[6000:], error[-1:].repeat(6000, axis=0))
    ends = [sensed(effects, samples(6000)[-1:], seed=s).specific_force[-1] for s in range(200)]
    assert np.std(ends) / (1e-6 * G) == pytest.approx(1000.0, rel=0.15)


def test_the_bandwidth_is_3_db_down_and_passes_what_is_slow():
    t = np.arange(1, 20_001) / 200.0
    for frequency, gain in ((0.5, 1.0), (20.0, np.sqrt(0.5))):
        wave = np.sin(2.0 * np.pi * frequency * t)[:, None]
        shown = sensed({"gyroscope_bandwidth_hz": 20.0}, samples(len(t), 200.0, angular_rate=wave), rate=200.0)
        assert np.std(shown.angular_rate[2000:, 0]) / np.std(wave) == pytest.approx(gain, rel=0.01)
    fast = sensed({"gyroscope_bandwidth_hz": 100.0}, samples(50, 200.0, angular_rate=wave[:50]), rate=200.0)
    np.testing.assert_array_equal(fast.angular_rate, wave[:50].repeat(3, axis=1))


@pytest.mark.parametrize("delay", [0.005, 0.02, 0.0375])
def test_the_delay_shows_the_motion_later(delay):
    t = np.arange(1, 1001) / 100.0
    shown = sensed({"delay_s": delay}, samples(1000, angular_rate=t[:, None]))
    np.testing.assert_allclose(shown.angular_rate[20:, 0], t[20:] - delay, rtol=1e-12)
    np.testing.assert_array_equal(shown.angular_rate[0], 0.01)


EVERYTHING = {
    "gyroscope_g_sensitivity_deg_h_g": 5.0, "accelerometer_vibration_rectification_ug_g2": 100.0, "vibration_g": 0.2,
    "gyroscope_temperature_deg_h_k": 1.0, "temperature_rise_k": 20.0, "temperature_time_s": 4.0,
    "gyroscope_bandwidth_hz": 20.0, "accelerometer_bandwidth_hz": 30.0, "delay_s": 0.013,
}  # fmt: skip


def test_blocks_of_any_length_give_the_same_bits():
    rng = np.random.default_rng(1)
    ideal = samples(700, angular_rate=rng.normal(size=(700, 3)), specific_force=rng.normal(size=(700, 3)))
    whole = sensed(EVERYTHING, ideal)
    imu = ImuSpec.from_toml({"rate_hz": 100, "effects": EVERYTHING}).build(1)
    parts = [imu.sense(ideal[a:b]) for a, b in ((0, 1), (1, 3), (3, 3), (3, 350), (350, 351), (351, 700))]
    for name in ("angular_rate", "specific_force"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(whole, name))


SCENARIO = """
name = "shaken"
version = 1
title = "An IMU with effects and faults"
duration_s = 20.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
heading_deg = 30.0
speed_m_s = 5.0
[[manoeuvre]]
kind = "turn"
angle_deg = 90.0
rate_deg_s = 6.0
[instruments.imu]
rate_hz = 50.0
grade = "tactical"
[instruments.imu.effects]
accelerometer_vibration_rectification_ug_g2 = 50.0
vibration_g = 0.5
[instruments.gnss_position]
rate_hz = 1.0
sigma_m = 1.0
"""


def faulty(fault):
    return parse(SCENARIO + "\n[[fault]]\n" + fault)


def test_step_by_step_gives_the_same_as_in_one_block():
    """Runs in closed loop have no compiled passes for these effects and faults, and take the way of blocks."""
    scenario = faulty('kind = "imu_dropout"\nstart_s = 3.0\nend_s = 4.0')
    whole = record(scenario, 2).data.imu
    runs = SteppedRuns(1)
    runs.begin(0, Simulator(scenario, 2))
    for k in range(5):
        runs.advance(np.ones(1, np.bool_))
        np.testing.assert_array_equal(runs.packet(0).imu.specific_force, whole.specific_force[50 * k : 50 * (k + 1)])


def test_a_bias_steps():
    scenario = faulty('kind = "imu_bias_step"\nstart_s = 5.0\nangular_rate_deg_h = [10, 0, 0]\nspecific_force_mg = 2.0')
    clean, run = record(parse(SCENARIO), 1).data.imu, record(scenario, 1)
    after = run.data.imu.time >= 5.0 - 1e-9
    error = np.hstack([run.data.imu.angular_rate - clean.angular_rate,
                       run.data.imu.specific_force - clean.specific_force])  # fmt: skip
    np.testing.assert_allclose(error[after], np.tile([10 * DEG_H, 0, 0, *[2e-3 * G] * 3], (after.sum(), 1)), atol=1e-12)
    np.testing.assert_array_equal(error[~after], 0.0)
    np.testing.assert_array_equal(run.data.imu_labels.faults, after.astype(np.uint32))


def test_a_range_clips():
    scenario = faulty('kind = "imu_clipping"\nangular_rate_limit_deg_s = 2.0')
    clean, run = record(parse(SCENARIO), 1).data.imu, record(scenario, 1)
    limit = np.radians(2.0)
    np.testing.assert_array_equal(run.data.imu.angular_rate, np.clip(clean.angular_rate, -limit, limit))
    np.testing.assert_array_equal(run.data.imu.specific_force, clean.specific_force)
    clipped = (np.abs(clean.angular_rate) > limit).any(axis=1)
    assert 0 < clipped.sum() < len(clipped)
    np.testing.assert_array_equal(run.data.imu_labels.faults.astype(bool), clipped)


@pytest.mark.parametrize("output", ["last", "zero"])
def test_samples_drop_out(output):
    scenario = faulty(f'kind = "imu_dropout"\nintervals_s = [[3.0, 4.0], [6.0, 6.5]]\noutput = "{output}"')
    clean, run = record(parse(SCENARIO), 1).data.imu, record(scenario, 1)
    found, time = run.data.imu.specific_force, clean.time
    for a, b, bit in ((3.0, 4.0, 1), (6.0, 6.5, 2)):
        lost = (time >= a - 1e-9) & (time < b - 1e-9)
        before = clean.specific_force[np.argmax(lost) - 1] if output == "last" else np.zeros(3)
        np.testing.assert_array_equal(found[lost], np.tile(before, (lost.sum(), 1)))
        assert set(run.data.imu_labels.faults[lost]) == {bit}
    kept = run.data.imu_labels.faults == 0
    np.testing.assert_array_equal(found[kept], clean.specific_force[kept])
    parts = Simulator(scenario, 1)
    joined = np.concatenate([parts.advance(float(t)).imu.specific_force for t in range(1, 21)])
    np.testing.assert_array_equal(joined, found)


def test_samples_are_missing():
    """The others are as they were, also those that a fault of the list behind it disturbs."""
    noise = '\n[[fault]]\nkind = "imu_disturbance"\nangular_rate_noise_deg_s = 1.0'
    missing = 'kind = "imu_dropout"\noutput = "missing"\nstart_s = 3.0\nend_s = 4.5'
    whole, run = record(faulty(noise[10:]), 1).data, record(faulty(missing + noise), 1).data
    kept = (whole.imu.time < 3.0 - 1e-9) | (whole.imu.time >= 4.5 - 1e-9)
    assert np.sum(~kept) == 75
    for name in ("time", "interval", "angular_rate", "specific_force"):
        np.testing.assert_array_equal(getattr(run.imu, name), getattr(whole.imu, name)[kept])
    np.testing.assert_array_equal(run.imu_labels.fault_error, whole.imu_labels.fault_error[kept])
    parts = Simulator(faulty(missing + noise), 1)
    joined = np.concatenate([parts.advance(float(t)).imu.angular_rate for t in range(1, 21)])
    np.testing.assert_array_equal(joined, run.imu.angular_rate)
    runs = SteppedRuns(1)
    runs.begin(0, Simulator(faulty(missing + noise), 1))
    for _ in range(5):
        runs.advance(np.ones(1, np.bool_))
    assert runs.packet(0).imu.time[0] == 4.5  # the packet of the last second begins in mid-second


def test_an_axis_is_stuck():
    scenario = faulty('kind = "imu_stuck_axis"\naxes = ["gyroscope_z", "accelerometer_x"]\nstart_s = 8.0\nend_s = 12.0')
    clean, run = record(parse(SCENARIO), 1).data.imu, record(scenario, 1).data
    stuck = (clean.time >= 8.0 - 1e-9) & (clean.time < 12.0 - 1e-9)
    for name, axis in (("angular_rate", 2), ("specific_force", 0)):
        found, true = getattr(run.imu, name), getattr(clean, name)
        np.testing.assert_array_equal(found[stuck, axis], np.full(200, true[np.argmax(stuck) - 1, axis]))
        np.testing.assert_array_equal(np.delete(found, axis, 1), np.delete(true, axis, 1))
        np.testing.assert_array_equal(found[~stuck], true[~stuck])
    assert np.mean(run.imu_labels.faults[stuck] == 1) > 0.98
    assert not run.imu_labels.faults[~stuck].any()


def test_it_warms_up():
    scenario = faulty('kind = "imu_warm_up"\ntime_s = 4.0\nstart_s = 5.0\nangular_rate_deg_h = [0, 60, 0]')
    clean, run = record(parse(SCENARIO), 1).data.imu, record(scenario, 1).data
    risen = 60.0 * DEG_H * (1.0 - np.exp(-np.maximum(0.0, clean.time - 5.0) / 4.0))
    np.testing.assert_allclose(run.imu.angular_rate[:, 1] - clean.angular_rate[:, 1], risen, atol=1e-12)
    np.testing.assert_allclose(run.imu_labels.fault_error[:, 1], risen, atol=1e-12)
    np.testing.assert_array_equal(run.imu.specific_force, clean.specific_force)


def test_a_vibration_begins_and_is_rectified():
    """Each sample shows the mean of the sinusoid over its interval, so its size falls with the sinc of f T."""
    vibration = "vibration_g = 0.5\nfrequency_hz = 10.0\naccelerometer_ug_g2 = 4000.0\ngyroscope_deg_h_g2 = [40, 0, 0]"
    scenario = faulty('kind = "imu_vibration"\nstart_s = 4.0\n' + vibration)
    clean, run = record(parse(SCENARIO), 1).data.imu, record(scenario, 1).data
    after = clean.time >= 4.0 + 1e-9  # 16 s, or 160 periods
    force = (run.imu.specific_force - clean.specific_force)[after]
    np.testing.assert_allclose(force.mean(axis=0), 4000e-6 * 0.5**2 * G, rtol=1e-9)
    np.testing.assert_allclose(force.std(axis=0), 0.5 * G * np.sinc(10.0 / 50.0), rtol=1e-9)
    rate = (run.imu.angular_rate - clean.angular_rate)[after]
    np.testing.assert_allclose(rate, np.tile([40.0 * 0.25 * DEG_H, 0.0, 0.0], (len(rate), 1)), atol=1e-12)
    parts = Simulator(scenario, 1)
    joined = np.concatenate([parts.advance(float(t)).imu.specific_force for t in range(1, 21)])
    np.testing.assert_array_equal(joined, run.imu.specific_force)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ('kind = "imu_stuck_axis"\naxes = "gyroscope"', "an IMU has no axis 'gyroscope'.*gyroscope_x"),
        ('kind = "imu_stuck_axis"\naxes = []', "should name at least one of gyroscope_x"),
        ('kind = "imu_warm_up"\ntime_s = 4.0', "an imu_warm_up needs angular_rate_deg_h or specific_force_ug"),
        ('kind = "imu_warm_up"\nangular_rate_deg_h = 4.0', "time_s.*missing"),
        ('kind = "imu_bias_step"', "an imu_bias_step needs angular_rate_deg_h or specific_force_ug"),
        ('kind = "imu_clipping"', "an imu_clipping needs angular_rate_limit_deg_s or specific_force_limit_g"),
        ('kind = "imu_dropout"\ninstruments = "gnss_position"', "an imu_dropout is on 'imu' and nothing else"),
        ('kind = "imu_dropout"\noutput = "nan"', "output.*'last', 'zero' or 'missing'"),
        (
            'kind = "outage"\ninstruments = "imu"',
            "on the IMU there is 'imu_disturbance', 'imu_bias_step', 'imu_clipping'",
        ),
    ],
)
def test_mistakes_in_faults_are_one_sentence(fault, message):
    with pytest.raises(SpecError, match=message):
        faulty(fault)


@pytest.mark.parametrize(
    "fault",
    [
        'kind = "imu_bias_step"\nangular_rate_deg_h = { uniform = [-300, 300] }',
        'kind = "imu_warm_up"\ntime_s = 4.0\nspecific_force_ug = { uniform = [-300, 300] }',
        'kind = "imu_disturbance"\nangular_rate_deg_s = { uniform = [-3, 3] }',
        'kind = "imu_bias_step"\nangular_rate_deg_h = 0.0',
    ],
)
def test_a_fault_may_be_of_either_sign_and_of_no_size(fault):
    """The middle of the range, at which a scenario is checked, is no fault at all, like the clean end of a dial."""
    assert len(record(faulty(fault), 1).data.imu) > 0


def test_a_fault_of_the_imu_needs_one():
    text = SCENARIO.partition("[instruments.imu]")[0] + "[instruments.gnss_position]\nrate_hz = 1.0\nsigma_m = 1.0\n"
    with pytest.raises(SpecError, match="'imu_dropout': the scenario has no IMU"):
        parse(text + '[[fault]]\nkind = "imu_dropout"')
