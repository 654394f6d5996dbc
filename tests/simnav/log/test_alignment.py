"""Delays, lever arms, offsets and noise are found as they were put in; what the motion does not tell is said."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rpy, rpy_from_dcm
from simnav.log.alignment import align
from simnav.log.noise_figures import noise_figures
from tests.cases.tiny_log import CLOCK, write_csv

DELAY, ARM, SIGMA = 0.4, np.array([3.0, -1.0, -5.0]), 0.05


@pytest.fixture
def log(tiny):
    """Fixes of an antenna, and a compass: late, displaced, with an offset and noise, on the tiny log."""
    chance = np.random.default_rng(1)
    truth, pick = tiny.truth, np.arange(100, 1900, 10)
    dcm = dcm_from_rpy(truth.attitude[pick])
    place = displace(truth.position[pick], dcm @ ARM + SIGMA * chance.standard_normal((len(pick), 3)))
    stamp = CLOCK + truth.time[pick] + DELAY
    write_csv(tiny.folder / "fix1.csv", "t,la,lo,h", [stamp, *np.degrees(place[:, :2].T), place[:, 2]])
    heading = truth.attitude[pick, 2] + np.radians(3.0) + np.radians(0.2) * chance.standard_normal(len(pick))
    write_csv(tiny.folder / "hdg1.csv", "t,hdg", [stamp - DELAY, np.degrees(heading)])
    tiny.replace("columns = [2, -3, 4]", "columns = [2, -3, 4]\nevery = 1")
    return tiny.add("""
[log.files.fix]
path = "fix{recording}.csv"
time = "t"

[log.files.hdg]
path = "hdg{recording}.csv"
time = "t"

[log.instruments.gnss]
file = "fix"
columns = ["la", "lo", "h"]
units = ["deg", "deg", "m"]

[log.instruments.compass]
file = "hdg"
columns = ["hdg"]
units = "deg"

[instruments.gnss]
kind = "gnss_position"
rate_hz = 5.0
sigma_m = 1.0

[instruments.compass]
kind = "gyrocompass"
rate_hz = 5.0
sigma_deg = 1.0
""").scenario()


def test_what_was_put_in_is_found(log):
    found = {a.instrument: a for a in align(log)}
    gnss = found["gnss"]
    # In a steady turn a delay looks like a lever arm ahead, so both are found less well than the noise is small.
    assert gnss.delay == pytest.approx(DELAY, abs=0.15)
    arm = np.array([gnss.parameters[f"lever_arm_{axis}"][0] for axis in "xyz"])
    np.testing.assert_allclose(arm, ARM, atol=0.35)
    assert gnss.residual["north"] == pytest.approx(SIGMA, rel=0.4)
    offset, sigma = found["compass"].parameters["offset"]
    assert np.degrees(offset) == pytest.approx(3.0, abs=0.1)
    assert 0.0 < np.degrees(sigma) < 0.1
    # The vessel turns at a constant rate, so a delay of the compass would be an offset.
    assert np.isnan(found["compass"].delay) or found["compass"].delay_sigma > 0.05


def test_the_figures_for_datasheets(log):
    figures = {f.key: f for f in noise_figures(log, align(log))}
    assert figures["instruments.gnss.sigma_m"].value[0] == pytest.approx(SIGMA, rel=0.4)
    assert figures["instruments.gnss.sigma_m"].now == (1.0, 1.0, 1.0)
    assert figures["instruments.compass.sigma_deg"].value[0] == pytest.approx(0.2, rel=0.4)
    assert "instruments.imu.gyroscope.random_walk_deg_sqrt_h" in figures


def test_what_the_motion_does_not_tell_is_said(log):
    found = {a.instrument: a for a in align(log)}
    assert found["dvl"].rows == 30  # those with a reference at all delays
    assert found["dvl"].remark or found["dvl"].residual["forward"] > 0.01  # a ramp, whatever the motion is


def test_the_mounting_and_the_delay_of_an_imu(tiny):
    wrong = np.radians([2.0, -3.0, 5.0])
    tiny.replace('samples = "means"', 'samples = "means"\nmounting_deg = [2.0, -3.0, 5.0]')
    tiny.replace('time_unit = "ms"', 'time_unit = "ms"\noffset_s = 0.2')
    imu = {a.instrument: a for a in align(tiny.scenario())}["imu"]
    right = rpy_from_dcm(dcm_from_rpy(wrong).T)
    assert imu.delay == pytest.approx(0.2, abs=0.03)
    for name, value in zip(("roll", "pitch", "yaw"), right, strict=True):
        angle, sigma = imu.parameters[f"mounting_{name}"]
        assert np.degrees(angle - value) == pytest.approx(0.0, abs=0.5)
        assert 0.0 < sigma < np.radians(2.0)
    delays, costs = np.array(imu.curve).T
    assert costs.min() == 1.0
    assert delays[np.argmin(costs)] == pytest.approx(0.2, abs=0.03)
