"""A log as a run: against the trajectory that it was written from."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rpy
from simnav.log import LogError, LogSource, LogWarning
from simnav.recording import Block, Recording
from simnav.scoring.beyond_reference import rms_beyond
from simnav.source import record
from simnav.spec import SpecError
from simnav.strapdown import integrate
from tests.cases.tiny_log import CLOCK, RATE, write_csv

OUTAGE = """
[[fault]]
kind = "outage"
instruments = ["dvl"]
start_s = 10.0
end_s = 15.0

[[fault]]
kind = "bias_step"
instruments = ["dvl"]
start_s = 20.0
end_s = 25.0
offset_m_s = [0.5, 0.0, 0.0]

[[fault]]
kind = "imu_disturbance"
instruments = ["imu"]
start_s = 5.0
end_s = 6.0
angular_rate_noise_deg_s = 1.0
"""

DEPTH = """
[log.instruments.depth]
source = "reference"

[instruments.depth]
rate_hz = 2.0
sigma_m = 0.0
lever_arm_m = [1.0, 0.0, 0.5]

[log.instruments.gnss]
source = "reference"

[instruments.gnss]
kind = "gnss_velocity"
rate_hz = 4.0
phase_s = 0.1
sigma_m_s = 0.0
lever_arm_m = [2.0, 0.0, 0.0]
"""


def test_a_log_is_the_trajectory_that_it_was_written_from(tiny):
    source = LogSource(tiny.scenario(), 0)
    block, truth = source.advance(source.duration), tiny.truth
    assert (source.duration, source.step, source.recording) == (30.0, 1.0, "1")
    # Time 0 is the first second of the reference: the clock's 5000.
    np.testing.assert_allclose(block.imu.time, truth.samples.time[: len(block.imu)], atol=1e-8)
    np.testing.assert_allclose(block.imu.angular_rate, truth.samples.angular_rate[: len(block.imu)], atol=1e-9)
    np.testing.assert_allclose(block.imu.specific_force, truth.samples.specific_force[: len(block.imu)], atol=1e-6)
    np.testing.assert_array_equal(block.truth.time, np.arange(1.0, 31.0))
    k = np.round(block.truth.time * RATE).astype(int)
    assert np.abs(relative_position(block.truth.position, truth.position[k])).max() < 1e-6
    np.testing.assert_allclose(block.truth.velocity, truth.velocity[k], atol=1e-9)
    np.testing.assert_allclose(block.truth.attitude, truth.attitude[k], atol=1e-9)
    initial = source.initial_truth
    out = integrate(initial.position[0], initial.velocity[0], initial.attitude[0], block.imu)
    at_steps = out.position[round(RATE) - 1 :: round(RATE)]
    assert np.abs(relative_position(at_steps, block.truth.position)).max() < 1e-3
    dvl = block.aids["dvl"]
    np.testing.assert_allclose(dvl.time, 0.25 + np.arange(30), atol=1e-9)
    np.testing.assert_allclose(dvl.value, truth.dvl[:30], atol=1e-12)
    np.testing.assert_array_equal(dvl.sigma, 0.02)
    assert not dvl.faults.any()
    assert source.faults == ()


def test_blocks_add_up_to_the_whole(tiny):
    scenario = tiny.add(OUTAGE).add(DEPTH).scenario()
    whole = LogSource(scenario, 3).advance(30.0)
    source = LogSource(scenario, 3)
    joined = Block.concatenate([source.advance(t) for t in (1.0, 2.0, 12.0, 13.0, 30.0)])
    for name in ("time", "position", "velocity", "attitude"):
        np.testing.assert_array_equal(getattr(joined.truth, name), getattr(whole.truth, name))
    np.testing.assert_array_equal(joined.imu.angular_rate, whole.imu.angular_rate)
    np.testing.assert_array_equal(joined.imu_labels.faults, whole.imu_labels.faults)
    assert list(joined.aids) == list(whole.aids)
    for name, stream in whole.aids.items():
        for field in ("time", "value", "faults", "fault_error", "sigma", "dropped"):
            np.testing.assert_array_equal(getattr(joined.aids[name], field), getattr(stream, field))


def test_the_same_faults_lie_over_a_log(tiny):
    clean = LogSource(tiny.scenario(), 0).advance(30.0)
    source = LogSource(tiny.add(OUTAGE).scenario(), 0)
    block = source.advance(30.0)
    dvl, before = block.aids["dvl"], clean.aids["dvl"]
    assert [(f.kind, f.instruments, f.start, f.end) for f in source.faults] == [
        ("outage", ("dvl",), 10.0, 15.0),
        ("bias_step", ("dvl",), 20.0, 25.0),
        ("imu_disturbance", ("imu",), 5.0, 6.0),
    ]
    np.testing.assert_allclose(dvl.dropped, 10.25 + np.arange(5))
    kept = ~np.isin(before.time, dvl.dropped)
    stepped = (dvl.time > 20.0) & (dvl.time < 25.0)
    np.testing.assert_array_equal(dvl.faults, np.where(stepped, 2, 0))
    expected = before.value[kept] + np.where(stepped[:, None], [0.5, 0.0, 0.0], 0.0)
    np.testing.assert_allclose(dvl.value, expected, atol=1e-12)
    shaken = block.imu.angular_rate != clean.imu.angular_rate
    # The fault acts from 5 s on and before 6 s.
    assert shaken.all(axis=1).sum() == shaken.any(axis=1).sum() == RATE
    np.testing.assert_array_equal(block.imu_labels.faults > 0, shaken.any(axis=1))


def test_a_seed_chooses_the_recording_and_the_errors(tiny):
    tiny.add_recording("22")
    scenario = tiny.scenario()
    sources = [LogSource(scenario, seed) for seed in range(4)]
    assert [s.recording for s in sources] == ["1", "22", "1", "22"]
    assert sources[0].note.startswith("recording '1'")
    np.testing.assert_array_equal(sources[0].initial_truth.position, sources[2].initial_truth.position)
    assert not np.array_equal(sources[0].start.position, sources[2].start.position)
    np.testing.assert_array_equal(sources[0].start.position, LogSource(scenario, 0).start.position)
    # The errors are as large as they are said to be.
    starts = [LogSource(scenario, 2 * seed) for seed in range(200)]
    errors = relative_position(np.stack([s.start.position for s in starts]), sources[0].initial_truth.position)
    np.testing.assert_allclose(errors.std(axis=0), 3.0, rtol=0.2)
    np.testing.assert_allclose(np.diag(sources[0].start.covariance)[:3], 9.0)


def test_instruments_simulated_from_the_reference(tiny):
    source = LogSource(tiny.add(DEPTH).scenario(), 0)
    assert "simulated from the reference: depth, gnss" in source.note
    block, truth = source.advance(30.0), tiny.truth
    depth = block.aids["depth"]
    np.testing.assert_allclose(depth.time, np.arange(0.5, 30.25, 0.5))
    k = np.round(depth.time * RATE).astype(int)
    expected = -truth.position[k, 2] + (dcm_from_rpy(truth.attitude[k]) @ [1.0, 0.0, 0.5])[:, 2]
    # Between samples a second apart a cubic spline is good to 5/384 of the fourth derivative; less at the ends.
    np.testing.assert_allclose(depth.value[:, 0], expected, atol=2e-3)
    gnss = block.aids["gnss"]
    np.testing.assert_allclose(gnss.time, np.arange(0.1, 30.0, 0.25))
    k = np.round(gnss.time * RATE).astype(int)
    rate = np.gradient(truth.attitude, 1.0 / RATE, axis=0)[k]
    sideways = 2.0 * rate[:, 2]  # small roll and pitch: the antenna ahead swings with the yaw rate
    swing = np.stack([-np.sin(truth.attitude[k, 2]) * sideways, np.cos(truth.attitude[k, 2]) * sideways], axis=-1)
    np.testing.assert_allclose(gnss.value[:, :2], truth.velocity[k][:, :2] + swing, atol=5e-3)


def test_the_lever_arm_of_the_reference(tiny):
    """A reference that describes another point of the vessel is brought back to the IMU."""
    truth, lever = tiny.truth, np.array([1.8, -0.4, 0.3])
    every = slice(0, None, round(RATE))
    dcm = dcm_from_rpy(truth.attitude[every])
    # Angular rate relative to the Earth from the trajectory's own derivative: C' dC/dt = [w x].
    ahead, behind = dcm_from_rpy(truth.attitude[1:]), dcm_from_rpy(truth.attitude[:-1])
    s = np.einsum("nji,njk->nik", behind, ahead - behind) * RATE
    w = np.stack([s[:, 2, 1], s[:, 0, 2], s[:, 1, 0]], axis=-1)[np.r_[0 : len(s) : round(RATE), -1]]
    position = displace(truth.position[every], dcm @ lever)
    v = truth.velocity[every] + np.einsum("nij,nj->ni", dcm, np.cross(w, lever))
    a = np.degrees(truth.attitude[every])
    columns = [CLOCK + truth.time[every], *np.degrees(position[:, :2].T), position[:, 2], v[:, 0], v[:, 1], -v[:, 2]]
    write_csv(tiny.folder / "truth1.csv", "t,lat,lon,h,vn,ve,vu,roll,pitch,yaw", [*columns, *a.T])
    off = LogSource(tiny.scenario(), 0).advance(30.0).truth
    tiny.replace(
        "[log.reference.position]", "[log.reference]\nlever_arm_m = [1.8, -0.4, 0.3]\n\n[log.reference.position]"
    )
    on = LogSource(tiny.scenario(), 0).advance(30.0).truth
    k = np.round(on.time * RATE).astype(int)
    assert np.abs(relative_position(off.position, truth.position[k])).max() > 1.0
    assert np.abs(relative_position(on.position, truth.position[k])).max() < 1e-6
    assert np.abs(off.velocity - truth.velocity[k]).max() > 0.05
    # The rate is a mean over a twentieth of a second here and a forward difference above.
    np.testing.assert_allclose(on.velocity, truth.velocity[k], atol=1e-3)


def test_an_imu_off_the_grid_is_resampled_without_losing_an_increment(tiny):
    path = tiny.folder / "imu1.csv"
    header, *lines = path.read_text().splitlines()
    shifted = [",".join([repr(float(line.split(",")[0]) + 7.3), *line.split(",")[1:]]) for line in lines]
    path.write_text("\n".join([header, *shifted]) + "\n")
    source = LogSource(tiny.scenario(), 0)
    assert "resampled" in source.note
    block = source.advance(30.0)
    # Time 0 is now the reference's second sample, for the IMU begins 7.3 ms after the first.
    np.testing.assert_allclose(block.imu.time, np.arange(1, 1501) / RATE)
    np.testing.assert_allclose(block.imu.interval, 1.0 / RATE)
    time = tiny.truth.samples.time + 0.0073 - 1.0
    integral = np.concatenate([np.zeros((1, 3)), np.cumsum(tiny.truth.samples.angular_rate / RATE, axis=0)])
    edges = np.concatenate([[time[0] - 1.0 / RATE], time])
    total = [np.interp(30.0, edges, c) - np.interp(0.0, edges, c) for c in integral.T]
    np.testing.assert_allclose((block.imu.angular_rate / RATE).sum(axis=0), total, atol=1e-9)


def test_a_recording_shorter_than_the_scenario(tiny):
    scenario = tiny.replace("duration_s = 30.0", "duration_s = 100.0").scenario()
    with pytest.warns(
        LogWarning, match=r"recording '1': the run ends at 40 s, where the log does \(100 s are wanted\)"
    ):
        source = LogSource(scenario, 0)
    assert source.duration == 40.0
    assert len(source.advance(100.0).truth) == 40


def test_skip(tiny):
    source = LogSource(tiny.replace('folder = "tiny"', 'folder = "tiny"\nskip_s = 4.5').scenario(), 0)
    np.testing.assert_allclose(source.initial_truth.velocity[0], tiny.truth.velocity[round(5 * RATE)], atol=1e-9)


def test_a_hole_in_the_reference_is_not_interpolated(tiny):
    for _ in range(3):
        tiny.edit("truth1.csv", 12, None)  # 10, 11 and 12 s
    truth = LogSource(tiny.scenario(), 0).advance(30.0).truth
    lost = np.isnan(truth.position).any(axis=1)
    np.testing.assert_array_equal(truth.time[lost], [10.0, 11.0, 12.0])
    assert np.isfinite(truth.position[~lost]).all()


def test_a_log_without_a_reference_says_that_fixes_may_be_held_out(tiny):
    head, tail = tiny.text.split("[log.reference.position]")
    tiny.text = head + "[instruments.imu]" + tail.split("[instruments.imu]")[1]
    with pytest.raises(SpecError, match=r"\[log.reference.position\] is missing; .* hold_out = 10"):
        tiny.scenario()


def test_a_reference_of_positions_only(tiny):
    head, tail = tiny.text.split("[log.reference.velocity]")
    tiny.text = head + "[instruments.imu]" + tail.split("[instruments.imu]")[1]
    source = LogSource(tiny.scenario(), 0)
    assert np.isnan(source.initial_truth.velocity).all()
    assert np.isnan(source.advance(30.0).truth.attitude).all()
    assert "velocity (differentiated positions)" in source.note
    start, truth = source.start, tiny.truth
    # As good as the initial error and the levelling are: 0.1 m/s, and the trajectory pitches and heads as it likes.
    np.testing.assert_allclose(start.velocity, truth.velocity[0], atol=0.5)
    rolls = truth.attitude[: round(2 * RATE)]
    np.testing.assert_allclose(start.attitude[:2], rolls[:, :2].mean(axis=0), atol=0.01)
    assert start.attitude[2] == pytest.approx(np.arctan2(0.0, 2.0), abs=0.06)


def test_clocks_that_do_not_meet(tiny):
    tiny.replace('path = "truth{recording}.csv"', 'path = "truth{recording}.csv"\noffset_s = 500.0')
    with pytest.raises(
        LogError, match=r"have no epoch in common .* check time_unit, scale, offset_s, spacing_s and skip_s"
    ):
        LogSource(tiny.scenario(), 0)


def test_an_instrument_outside_the_run(tiny):
    tiny.replace("offset_s = 0.25", "offset_s = 500.0")
    with pytest.raises(LogError, match=r"none of the 39 measurements of 'dvl' lies within the run; .* offset_s"):
        LogSource(tiny.scenario(), 0)


def test_a_reference_knows_how_good_it_is(tiny):
    path = tiny.folder / "truth1.csv"
    lines = path.read_text().splitlines()
    solution = [5 if k in (8, 20) else 2 if k in (9, 10) else 1 for k in range(len(lines) - 1)]
    more = ["Q,sdn", *(f"{q},{0.3 if q == 1 else 'nan'}" for q in solution)]
    path.write_text("\n".join(f"{a},{b}" for a, b in zip(lines, more, strict=True)) + "\n")
    tiny.replace('units = ["deg", "deg", "m"]\n', 'units = ["deg", "deg", "m"]\nsigma = ["sdn"]\n')
    tiny.add('[log.reference]\nquality = "Q"\nfloating_sigma_m = [4.0, 4.0, 8.0]\n')
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        recording = record(tiny.scenario(), 0)
    assert "reference: 90.2% fixed, 4.9% float, 4.9% neither and not scored" in recording.note
    assert "its own horizontal sigma of 0.424 m is subtracted" in recording.note
    truth = recording.data.truth
    begin = round(LogSource(tiny.scenario(), 0)._begin - CLOCK)
    epoch = {k: k - begin - 1 for k in range(len(solution))}
    assert np.isnan(truth.position[epoch[20]]).all()  # neither
    assert truth.quality[[epoch[9], epoch[30]]].tolist() == [2.0, 1.0]
    np.testing.assert_allclose(truth.sigma[[epoch[10], epoch[30]]], [[4.0, 4.0, 8.0], [0.3, 0.3, 0.3]])
    # An estimate that is off by 2 m north, where the reference is known to 0.3 m in each direction.
    known = np.isfinite(truth.position).all(axis=1) & (truth.quality == 1.0)
    error = np.tile([2.0, 0.0], (int(known.sum()), 1))
    assert rms_beyond(error, truth.sigma[known][:, :2]) == pytest.approx(np.sqrt(4.0 - 2 * 0.09), rel=0.02)
    path = tiny.folder.parent / "kept.npz"
    recording.save(path)
    np.testing.assert_array_equal(Recording.load(path).data.truth.quality, truth.quality)
    tiny.replace('quality = "Q"', 'quality = "Q"\nfixed = [7]\nfloating = [8]')
    with pytest.raises(
        LogError, match=r"no row has a value of fixed = \[7.0\] or floating = \[8.0\] in the column 'Q'"
    ):
        LogSource(tiny.scenario(), 0)


HOLD_OUT = """
[log.instruments.gnss]
file = "truth"
columns = ["lat", "lon", "h"]
units = ["deg", "deg", "m"]
every = 5

[instruments.gnss]
kind = "gnss_position"
rate_hz = 0.2
sigma_m = [1.0, 1.0, 1.0]
"""


def test_the_seed_chooses_which_fixes_are_held_out(tiny):
    tiny.replace('folder = "tiny"', 'folder = "tiny"\nrows_by_seed = true')
    tiny.replace('units = ["deg", "deg", "m"]\n', 'units = ["deg", "deg", "m"]\nhold_out = 5\n')
    tiny.replace("[log.reference.velocity]", "[log.reference]\nmax_gap_s = 2.5\n\n[log.reference.velocity]").add(
        HOLD_OUT
    )
    firsts = set()
    for seed in range(8):
        source = LogSource(tiny.scenario(), seed)
        log = source.scenario.log
        gnss = source.advance(source.duration).aids["gnss"]
        # What an estimator gets is not in the reference that it is scored against.
        own = set(np.round(source._begin + gnss.time - CLOCK).astype(int))
        scored = set(np.round(source._reference.time - CLOCK).astype(int))
        assert own
        assert not own & scored
        firsts.add(min(own) % 5)
        assert log.rows_by_seed
    assert len(firsts) > 2
    again = [LogSource(tiny.scenario(), 3).advance(20.0).aids["gnss"].time for _ in range(2)]
    np.testing.assert_array_equal(*again)
