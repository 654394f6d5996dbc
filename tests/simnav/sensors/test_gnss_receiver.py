"""A receiver that solves the raw observations of another instrument: its errors, its gaps, its faults."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rpy
from simnav.simulation.simulator import ideal, simulate
from simnav.spec import SpecError
from tests.cases.raw_gnss import raw_gnss

ARM = np.array([-3.0, 0.0, -12.0])
RECEIVER = """
[instruments.fix]
kind = "gnss_receiver"
observations = "gnss"
sigma_m = [1.0, 1.0, 2.0]
lever_arm_m = [-3.0, 0.0, -12.0]
[instruments.doppler]
kind = "gnss_receiver_velocity"
observations = "gnss"
sigma_m_s = 0.05
lever_arm_m = [-3.0, 0.0, -12.0]
"""
LOST = ["G11", "G12", "G28", "E27", "E36"]
OUTAGE = f'[[fault]]\nkind = "outage"\ninstruments = "gnss"\nchannels = {LOST}\nstart_s = 10.0\nend_s = 20.0\n'
STEP = """
[[fault]]
kind = "bias_step"
instruments = "gnss"
channels = ["E30"]
start_s = 10.0
end_s = 20.0
offset_m = {0}
offset_m_s = 0.0
"""


def antenna(recording) -> np.ndarray:
    """True positions of the antenna at the ends of the steps."""
    truth = recording.data.truth
    return displace(truth.position, np.einsum("nij,j->ni", dcm_from_rpy(truth.attitude), ARM))


def test_fixes_have_the_error_that_the_receiver_states():
    normal = []
    for seed in range(25):
        recording = simulate(raw_gnss(2.0, RECEIVER), seed)
        fix = recording.data.aids["fix"]
        normal.append(relative_position(fix.value[-1], antenna(recording)[-1]) / fix.sigma[-1])
    assert np.sqrt(np.mean(np.square(normal))) == pytest.approx(1.0, abs=0.3)
    assert abs(np.mean(normal)) < 0.6


def test_an_ideal_velocity_is_that_of_the_vessel():
    at_the_imu = RECEIVER.replace("[-3.0, 0.0, -12.0]", "[0.0, 0.0, 0.0]")
    scenario = raw_gnss(10.0, at_the_imu)
    raw = scenario.aids["gnss"].model_copy(update={"lever_arm": (0.0, 0.0, 0.0)})
    recording = ideal(scenario.model_copy(update={"instruments": {**scenario.instruments, "gnss": raw}}), 1)
    np.testing.assert_allclose(recording.data.aids["doppler"].value, recording.data.truth.velocity, atol=1e-6)


def test_an_ideal_receiver_is_at_the_antenna():
    recording = ideal(raw_gnss(10.0, RECEIVER), 1)
    fix = recording.data.aids["fix"]
    assert len(fix) == 10
    np.testing.assert_allclose(relative_position(fix.value, antenna(recording)), 0.0, atol=1e-4)


def test_no_fix_with_three_satellites():
    recording = simulate(raw_gnss(30.0, RECEIVER + OUTAGE), 1)
    for name in ("fix", "doppler"):
        stream = recording.data.aids[name]
        assert stream.time.tolist() == [float(t) for t in range(1, 31) if not 10 <= t < 20]
        assert stream.dropped.tolist() == [float(t) for t in range(10, 20)]


@pytest.mark.parametrize(("offset", "false_alarm", "pulled"), [(60.0, 1e-5, False), (60.0, 0.0, True)])
def test_the_fault_of_a_satellite_is_excluded_or_labelled(offset, false_alarm, pulled):
    tables = RECEIVER.replace("sigma_m = [", f"false_alarm = {false_alarm}\nsigma_m = [")
    recording = simulate(raw_gnss(30.0, tables + STEP.format(offset)), 1)
    clean = simulate(raw_gnss(30.0, tables), 1).data.aids["fix"]
    fix = recording.data.aids["fix"]
    during = (fix.time >= 10.0) & (fix.time < 20.0)
    assert ((fix.faults != 0) == (during & pulled)).all()
    moved = relative_position(fix.value, clean.value)
    np.testing.assert_allclose(moved[~during], 0.0, atol=1e-9)
    assert (np.linalg.norm(moved[during], axis=1) > 5.0).all() == pulled
    if pulled:
        np.testing.assert_allclose(fix.fault_error, moved, atol=1e-3)


def test_the_division_into_blocks_changes_nothing():
    from simnav.simulation.simulator import Simulator

    whole = simulate(raw_gnss(20.0, RECEIVER), 5).data.aids["fix"]
    simulator = Simulator(raw_gnss(20.0, RECEIVER), 5)
    parts = [simulator.advance(t).aids["fix"].value for t in (3.0, 4.0, 15.0, 20.0)]
    np.testing.assert_array_equal(np.concatenate(parts), whole.value)


def test_the_observations_must_be_there():
    message = r"instruments.fix: it reads 'raw' of kind 'gnss_raw', which there is not; one of that kind is 'gnss'"
    with pytest.raises(SpecError, match=message):
        raw_gnss(20.0, RECEIVER.replace('observations = "gnss"', 'observations = "raw"'))
