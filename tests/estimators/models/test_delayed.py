"""Delays of time stamps as states: the derivatives, the datasheets that have them, and how well they are found."""

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.delayed import DELAY, is_delayed, with_delay
from simnav.estimators.models.lever_arms import has_measurement_function, observation_of, with_lever_arms
from simnav.estimators.models.readings import READINGS
from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy
from simnav.kinds import NavigationPoint
from simnav.scenario import parse
from simnav.simulation.simulator import Simulator, simulate
from simnav.timing import TimingSheet
from simnav.trial import run_trial
from simnav.types import KINDS, Datasheet, Instruments

TIMING = TimingSheet(offset=0.05)
PLACE, VELOCITY, RATE, ACCELERATION = (
    np.array(x) for x in ([0.9, 0.1, -5.0], [2.0, -1.0, 0.2], [0.02, -0.03, 0.2], [0.3, -0.2, 0.05])
)
ATTITUDE = dcm_from_rpy(np.array([0.05, -0.1, 0.7]))
SHEETS = [
    Datasheet("a", kind, 1.0, np.ones(len(KINDS[kind].errors)), lever_arm=np.array([1.0, 0.5, -2.0]), timing=TIMING)
    for kind in ("gnss_position", "gnss_velocity", "dvl", "depth", "terrain_fix", "gyrocompass")
]


def point(elapsed=0.0, **more):
    """A motion with constant acceleration and body rate, at a time."""
    return NavigationPoint(
        elapsed,
        displace(PLACE, VELOCITY * elapsed + 0.5 * ACCELERATION * elapsed**2),
        VELOCITY + ACCELERATION * elapsed,
        ATTITUDE @ dcm_from_rotation_vector(RATE * elapsed),
        RATE,
        acceleration=ACCELERATION,
        **more,
    )


@pytest.mark.parametrize("sheet", SHEETS, ids=lambda s: s.kind)
def test_a_reading_at_a_delay_is_that_of_the_earlier_time(sheet):
    (sheet,) = with_lever_arms(Instruments([sheet])).values()
    assert has_measurement_function(sheet)
    found = observation_of(sheet)(point(blocks={DELAY: np.array([0.08])}), sheet)
    reading = found if isinstance(found, np.ndarray) else found[0]
    error = KINDS[sheet.kind].difference(reading, READINGS[sheet.equation](point(-0.08), sheet))
    np.testing.assert_allclose(error, 0.0, atol=2e-4)  # the acceleration is that of the point, not of the time before


@pytest.mark.parametrize("sheet", SHEETS[:-1], ids=lambda s: s.kind)
def test_its_derivative_by_the_delay_is_minus_that_by_the_time(sheet):
    (sheet,) = with_lever_arms(Instruments([sheet])).values()
    _, blocks = observation_of(sheet)(point(blocks={DELAY: np.zeros(1)}), sheet)
    ahead, before = (READINGS[sheet.equation](point(t), sheet) for t in (1e-3, -1e-3))
    slope = KINDS[sheet.kind].difference(ahead, before) / 2e-3
    np.testing.assert_allclose(blocks[DELAY][:, 0], -slope, atol=1e-5)


def test_only_offsets_that_are_stated_are_states():
    plain = replace(SHEETS[0], timing=None)
    assert with_delay(plain) is plain
    assert with_delay(replace(plain, timing=TimingSheet(latency=1.0, jitter=0.1))).blocks == ()
    (block,) = with_delay(SHEETS[0]).blocks
    assert (block.name, block.size, block.sigma) == (DELAY, 1, (0.05,))
    (block,) = with_delay(replace(plain, timing=TimingSheet(offset=0.05, drift=1e-5))).blocks
    assert (block.process, block.sigma) == ("clock", (0.05, 1e-5))
    (block,) = with_delay(replace(plain, timing=TimingSheet(offset=0.05, drift=1e-5)), drifting=False).blocks
    assert (block.process, block.sigma) == ("constant", (0.05,))
    assert with_delay(replace(plain, timing=TimingSheet(drift=1e-5)), drifting=False).blocks == ()
    log = replace(SHEETS[0], kind="speed_log", sigma=np.ones(1), bias=np.zeros(1), bias_instability=np.zeros(1))
    assert not is_delayed(with_delay(log))


VOYAGE = """
name = "training-turns"
version = 1
title = "Turns in a seaway, with a DVL whose stamps are late"
duration_s = 200.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
speed_m_s = 2.0
depth_m = 5.0
[initial_error]
position_m = [1.0, 1.0, 1.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.1, 0.1, 0.5]
[vessel]
kind = "uuv"
turn_rate_deg_s = 6.0
[[manoeuvre]]
kind = "lawn_mower"
leg_m = 60.0
spacing_m = 20.0
legs = 8
[sea]
significant_height_m = 0.8
peak_period_s = 6.0
direction_deg = 30.0
[instruments.imu]
rate_hz = 25.0
grade = "tactical"
[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = 1.5
[instruments.dvl]
rate_hz = 4.0
sigma_m_s = 0.01
[instruments.dvl.timing]
offset_s = 0.05
"""


def late_by(delay, seed, duration=200.0):
    """A voyage whose DVL has stamps that are late by a delay [s]."""
    recording = simulate(parse(VOYAGE).model_copy(update={"duration": duration}), seed)
    stream = recording.data.aids["dvl"]
    aids = {**recording.data.aids, "dvl": replace(stream, stamp=stream.time + delay)}
    return replace(recording, data=replace(recording.data, aids=aids))


@pytest.mark.parametrize("seed", [7001, 7002, 7003])
def test_a_delay_of_50_ms_is_found_to_5_ms(seed):
    trial = run_trial(make("ekf"), late_by(0.05, seed))
    assert trial.diagnostics["state.dvl.delay"][-1, 0] == pytest.approx(0.05, abs=0.005)
    assert 0.0 < trial.diagnostics["sigma.dvl.delay"][-1, 0] < 0.003


def test_windows_sigma_points_and_the_23_states_find_the_same():
    recording = late_by(0.05, 7001, 40.0)
    found = []
    for estimator in (make("ekf"), make("ukf"), make("sw-fgo", window=3), make("ekf-23")):
        trial = run_trial(estimator, recording)
        assert trial.status == "ok", trial.reason
        states = trial.diagnostics.get("state.dvl.delay")
        found.append(estimator.solver.model.calibration[7] if states is None else states[-1, 0])
    assert 0.02 < found[0] < 0.08
    np.testing.assert_allclose(found, found[0], atol=1e-3)


def test_a_drift_is_found_with_the_delay():
    scenario = parse(VOYAGE + "drift_ppm = 200.0\n")
    clock = Simulator(scenario, 7004).clocks["dvl"]
    trial = run_trial(make("ekf"), simulate(scenario, 7004))
    value, sigma = (trial.diagnostics[f"{n}.dvl.delay"][-1] for n in ("state", "sigma"))
    assert abs(value[0] - (clock.offset + 200.0 * clock.drift)) < 4.0 * sigma[0]
    assert abs(value[1] - clock.drift) < 4.0 * sigma[1]
    assert sigma[1] < 100e-6
