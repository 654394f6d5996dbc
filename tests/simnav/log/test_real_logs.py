"""The real recordings: what was found in them holds. Those of the data folder are skipped where it is absent."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import dcm_from_rpy, rotation_vector_from_dcm
from simnav.log import LogSource, LogWarning
from simnav.log.channel import read_channel
from simnav.log.imu_series import read_imu
from simnav.log.nmea import read_nmea
from simnav.log.reference import Reference
from simnav.scenario import load
from simnav.strapdown import integrate

DATA = Path(os.environ.get("SIMNAV_DATA") or Path(__file__).parents[4] / "shared" / "data")
needs_akit = pytest.mark.skipif(not (DATA / "akit").is_dir(), reason=f"no folder akit in {DATA} (SIMNAV_DATA)")
needs_nbp1406 = pytest.mark.skipif(not (DATA / "nbp1406").is_dir(), reason=f"no folder nbp1406 in {DATA} (SIMNAV_DATA)")


@pytest.fixture(autouse=True)
def data(monkeypatch):
    monkeypatch.setenv("SIMNAV_DATA", str(DATA))


def reference_of(source):
    """The reference of a run, read anew from the log, and its time at the start of the run [s]."""
    log = source.scenario.log
    imu = None if log.imu is None else read_imu(log, log.imu, source.recording)
    channels = {name: getattr(log.reference, name) for name in ("position", "velocity", "attitude")}
    series = {n: None if c is None else read_channel(log, c, n, source.recording) for n, c in channels.items()}
    reference = Reference(**series, max_gap=log.reference.max_gap, lever_arm=log.reference.lever_arm, imu=imu)
    first = source.initial_truth.position
    (begin,) = reference.time[(reference.states(reference.time).position == first).all(axis=1)]
    return reference, begin


@needs_akit
@pytest.mark.parametrize("seed", range(6))
def test_free_inertial_navigation_of_the_auv(seed):
    """Issue: roll and pitch to 0.04 deg and heading to 0.05 deg for 300 s, position to 11-71 m."""
    source = LogSource(load("auv-akit"), seed)
    block, start = source.advance(300.0), source.initial_truth
    out = integrate(start.position[0], start.velocity[0], start.attitude[0], block.imu)
    k = np.searchsorted(block.imu.time, block.truth.time - 1e-6)
    turn = dcm_from_rpy(out.attitude[k]) @ np.swapaxes(dcm_from_rpy(block.truth.attitude), 1, 2)
    error = np.degrees(np.abs(rotation_vector_from_dcm(turn)).max(axis=0))
    assert (error[:2] < 0.04).all()
    assert error[2] < 0.05
    drift = np.hypot(*relative_position(out.position[k], block.truth.position)[-1, :2])
    assert drift < 71.0


@needs_akit
@pytest.mark.parametrize("seed", range(6))
def test_the_dvl_agrees_with_the_reference(seed):
    """With its time offset and the lever arms what is left is the DVL's own noise and scale."""
    scenario = load("auv-akit")
    source = LogSource(scenario, seed)
    dvl = source.advance(source.duration).aids["dvl"]
    assert len(dvl) >= 397
    reference, begin = reference_of(source)
    tap = reference.taps(begin + dvl.time)
    body = np.einsum("nji,nj->ni", dcm_from_rpy(tap.attitude), tap.velocity)
    error = dvl.value - body - np.cross(tap.angular_rate, scenario.aids["dvl"].lever_arm)
    assert (np.abs(np.median(error, axis=0)) < 0.012).all()
    spread = 1.4826 * np.median(np.abs(error - np.median(error, axis=0)), axis=0)
    assert (spread < [0.02, 0.02, 0.012]).all()


@needs_akit
def test_what_is_simulated_is_said():
    source = LogSource(load("auv-akit"), 5)
    assert source.recording == "7"
    assert "simulated from the reference: depth, gyrocompass" in source.note
    depth = source.advance(398.0).aids["depth"]
    reference, begin = reference_of(source)
    assert np.std(depth.value[:, 0] + reference.states(begin + depth.time).position[:, 2]) == pytest.approx(
        0.1, rel=0.15
    )


@needs_nbp1406
def test_the_ship():
    with pytest.warns(LogWarning, match="2 of 5000 rows at the time of the one before"):
        source = LogSource(load("ship-nbp1406"), 0)
    block = source.advance(source.duration)
    assert block.imu is None
    assert len(block.truth) == 620
    gnss = block.aids["gnss"]
    assert len(gnss) + len(gnss.dropped) == 620
    reference, begin = reference_of(source)
    tap = reference.taps(begin + gnss.time)
    offset = relative_position(gnss.value, tap.position)
    lever = dcm_from_rpy(tap.attitude) @ [0.0, 0.0, -28.84]
    # The antenna is that high above the Seapath's point: the scatter falls by a factor, in the heave direction too.
    assert offset[:, 2].mean() == pytest.approx(-28.84, abs=0.3)
    assert np.hypot(*(offset - lever)[:, :2].std(axis=0)) < 0.5 * np.hypot(*offset[:, :2].std(axis=0))
    assert (np.abs((offset - lever)[:, :2].mean(axis=0)) < 1.0).all()
    heading = block.aids["gyrocompass"]
    turn = np.angle(np.exp(1j * (heading.value[:, 0] - reference.states(begin + heading.time).attitude[:, 2])))
    assert np.degrees(abs(turn.mean())) < 0.05
    assert np.degrees(turn.std()) < 0.2
    log = block.aids["speed_log"]
    state = reference.states(begin + log.time)
    ahead = np.cos(state.attitude[:, 2]) * state.velocity[:, 0] + np.sin(state.attitude[:, 2]) * state.velocity[:, 1]
    inside = np.isfinite(ahead)
    assert (log.value[inside, 0] - ahead[inside]).mean() == pytest.approx(-0.59, abs=0.05)


@needs_nbp1406
def test_the_receiver_whose_week_rolled_over():
    file = read_nmea(DATA / "nbp1406" / "NBP1406_PCOD-2014-08-01")
    table = file.table("GGA")
    # Its own date is 1994-12-16; by the logger's it is 2014-08-01, and the fix is a second old when it is logged.
    delay = table.columns["logger"] - table.columns["sentence"]
    assert delay.min() > 0.8
    assert delay.max() < 1.2


def test_the_car():
    source = LogSource(load("car-kitti"), 0)
    block = source.advance(source.duration)
    gnss = block.aids["gnss"]
    np.testing.assert_allclose(np.diff(gnss.time), 10.0, atol=0.01)
    # No fix is told and asked: there is no truth within half a second of one.
    near = np.abs(block.truth.time[:, None] - gnss.time).min(axis=1) < 0.5
    assert near.sum() == 46
    assert np.isnan(block.truth.position[near]).all()
    assert np.isfinite(block.truth.position[~near]).all()
    assert np.isnan(block.truth.velocity).all()
    assert np.isnan(block.truth.attitude).all()
    step = relative_position(block.truth.position[1:], block.truth.position[:-1])
    speed = np.hypot(step[:, 0], step[:, 1])
    assert 12.0 < np.nanmax(speed) < 14.0
    # The gyroscope turns as the track does.
    course = np.unwrap(np.arctan2(step[:4, 1], step[:4, 0]))
    turned = block.imu.angular_rate[100:400, 2].sum() / 100.0
    assert course[3] - course[0] == pytest.approx(turned, abs=0.05)
    assert np.linalg.norm(source.start.velocity) == pytest.approx(speed[0], abs=1.5)
