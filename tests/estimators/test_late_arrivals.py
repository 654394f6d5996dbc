"""Late readings are used at their time of validity, by every row: as if they had come in the right order."""

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import EstimatorError, lacking, make
from simnav.scenario import load, parse
from simnav.scoring.detection import detection
from simnav.simulation.simulator import simulate
from simnav.source import record
from simnav.timing import TAIL, TimingSheet
from simnav.trial import run_trial
from simnav.types import Instruments


def delayed(recording, clock, names=None):
    """The recording, whose readings arrive late after a clock, with the datasheets of it."""
    rng = np.random.default_rng(5)
    aids, sheets = {}, []
    for name, stream in recording.data.aids.items():
        own = clock if names is None or name in names else None
        sheets.append(replace(recording.instruments[name], timing=own))
        if own is not None:
            _, tick = np.unique(stream.time, return_inverse=True)
            more = rng.exponential(own.latency_random, tick.max() + 1)
            late = own.latency + np.minimum(more, TAIL * own.latency_random)
            stream = replace(stream, arrival=stream.time + late[tick])
        aids[name] = stream
    instruments = Instruments(sheets, recording.instruments.imu, recording.instruments.step)
    return replace(recording, instruments=instruments, data=replace(recording.data, aids=aids))


def prompt(recording):
    """The same readings, all at once when they are valid; what arrives after the end is not there."""
    end = recording.data.end + 1e-6
    streams = {n: s.rows(s.arrivals <= end) for n, s in recording.data.aids.items()}
    aids = {n: replace(s, stamp=np.empty(0), arrival=np.empty(0)) for n, s in streams.items()}
    old = recording.instruments
    instruments = Instruments([replace(sheet, timing=None) for sheet in old.values()], old.imu, old.step)
    return replace(recording, instruments=instruments, data=replace(recording.data, aids=aids))


@pytest.fixture(scope="module")
def recordings():
    return [record(load(name).model_copy(update={"duration": 12.0}), 3) for name in ("auv-survey", "ship-field")]


@pytest.mark.parametrize(
    "name", ["ekf", "ukf", "ekf-rts", "huber-fgo", "imm", "kf-9", "oracle", "federated", "ship-ekf", "dead-reckoning"]
)
def test_the_last_estimate_is_that_of_the_right_order(name, recordings):
    """All readings that count have arrived at the end, so the row must be where it would be without latencies."""
    estimator = make(name)
    plain = next(r for r in recordings if not lacking(estimator.needs, r.instruments))
    late = delayed(plain, TimingSheet(latency=0.4, latency_random=0.5))
    there, here = run_trial(estimator, late), run_trial(make(name), prompt(late))
    assert there.status == here.status == "ok", (there.reason, here.reason)
    np.testing.assert_array_equal(there.position[-1], here.position[-1])
    np.testing.assert_array_equal(there.covariance[-1], here.covariance[-1])
    assert there.diagnostics["late"][-1] > 5
    assert not there.diagnostics["late_missed"].any()
    assert np.any(there.position[:-1] != here.position[:-1])  # which was not known then


def test_a_graph_of_gtsam_takes_them_when_they_arrive(recordings):
    late = delayed(recordings[0], TimingSheet(latency=0.4, latency_random=0.5))
    trial = run_trial(make("gtsam-fixed-lag"), late)
    assert trial.status == "ok", trial.reason
    assert trial.diagnostics["late"][-1] > 5


def test_without_clocks_nothing_is_copied(recordings, monkeypatch):
    monkeypatch.setattr("simnav.estimator.late_arrivals.LateArrivals.update", None)
    assert run_trial(make("ekf"), recordings[0]).status == "ok"


def test_where_no_datasheet_speaks_it_goes_back_from_the_first_late_reading_on(recordings):
    late = delayed(recordings[0], TimingSheet(latency=0.4, latency_random=0.5))
    silent = Instruments([replace(s, timing=None) for s in late.instruments.values()], late.instruments.imu, 1.0)
    trial = run_trial(make("ekf"), replace(late, instruments=silent))
    told = run_trial(make("ekf"), late)
    assert trial.status == "ok"
    counts = trial.diagnostics
    assert 0.8 * told.diagnostics["late"][-1] < counts["late"][-1] < told.diagnostics["late"][-1]
    assert 0 < counts["late_missed"][-1] == counts["late_missed"][4]  # it had no copy of itself yet


def test_memory_is_bounded_by_the_longest_latency(recordings):
    clock = TimingSheet(latency=0.5)
    estimator = make("ekf")
    run_trial(estimator, delayed(recordings[0], clock))
    assert estimator._late.reach == pytest.approx(1.5)
    assert len(estimator._late._history) <= 3


def test_a_reading_that_is_later_than_the_longest_latency_is_left_out(recordings):
    late = delayed(recordings[0], TimingSheet(latency=0.2), ["dvl"])
    stream = late.data.aids["dvl"]
    arrival = stream.arrival.copy()
    arrival[3] = stream.time[3] + 6.0
    aids = {**late.data.aids, "dvl": replace(stream, arrival=arrival)}
    trial = run_trial(make("ekf"), replace(late, data=replace(late.data, aids=aids)))
    assert trial.status == "ok"
    assert trial.diagnostics["late_missed"][-1] == 1.0


def test_stamps_at_arrival_are_put_back_by_the_mean_latency(recordings):
    """A constant latency is known, so nothing is lost."""
    late = delayed(recordings[0], TimingSheet("arrival", latency=0.25), ["dvl"])
    stream = late.data.aids["dvl"]
    aids = {**late.data.aids, "dvl": replace(stream, stamp=stream.arrival)}
    late = replace(late, data=replace(late.data, aids=aids))
    a, b = run_trial(make("ekf"), late), run_trial(make("ekf"), prompt(late))
    np.testing.assert_allclose(a.velocity[-1], b.velocity[-1], atol=1e-6)


def test_a_stamp_that_is_ahead_waits_for_its_time(recordings):
    """With stamps that are ahead by 2.5 s it is as if all that is stamped within the run had come at its stamp."""
    stream = recordings[0].data.aids["dvl"]
    ahead = replace(stream, stamp=stream.time + 2.5)
    kept = ahead.rows(ahead.stamp <= recordings[0].data.end + 1e-6)
    known = replace(kept, time=kept.stamp, stamp=np.empty(0))
    a, b = (
        run_trial(make("ekf"), replace(r, data=replace(r.data, aids={**r.data.aids, "dvl": s})))
        for r, s in ((recordings[0], ahead), (recordings[0], known))
    )
    assert a.status == b.status == "ok"
    np.testing.assert_array_equal(a.position[-1], b.position[-1])
    np.testing.assert_array_equal(a.position, b.position)


def test_a_stamp_from_a_far_future_counts_at_the_end_of_the_step(recordings):
    stream = recordings[0].data.aids["dvl"]
    aids = {**recordings[0].data.aids, "dvl": replace(stream, stamp=stream.time + 1e4)}
    estimator = make("ekf")
    trial = run_trial(estimator, replace(recordings[0], data=replace(recordings[0].data, aids=aids)))
    assert trial.status == "ok"
    assert not estimator._late._waiting
    assert np.isfinite(trial.diagnostics["nis.dvl"][1:]).all()


def test_readings_of_one_stamp_are_told_apart(recordings):
    """Stamps in whole steps of half a second of a DVL with two readings in each."""
    late = delayed(recordings[0], TimingSheet(resolution=1.0 / recordings[0].instruments["dvl"].rate), ["dvl"])
    stream = late.data.aids["dvl"]
    stamp = np.round(stream.time[::2].repeat(2)[: len(stream)], 6)
    aids = {**late.data.aids, "dvl": replace(stream, stamp=stamp)}
    trial = run_trial(make("ekf"), replace(late, data=replace(late.data, aids=aids)))
    assert trial.diagnostics["skipped"][-1] == 0.0


FLAGS = """
name = "late-flags"
version = 1
title = "late gross errors"
duration_s = 120.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
speed_m_s = 2.0
[initial_error]
position_m = [1.0, 1.0, 1.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.1, 0.1, 0.5]
[vessel]
kind = "ship"
[[manoeuvre]]
kind = "hold"
duration_s = 120.0
[instruments.imu]
rate_hz = 20.0
grade = "tactical"
[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = 1.0
[instruments.gnss.timing]
latency_s = 0.3
latency_random_s = 0.4
jitter_s = 0.01
[[fault]]
kind = "gross_error"
instruments = "gnss"
probability = 0.1
size_m = [50.0, 60.0]
"""


def test_what_is_flagged_is_found_by_its_stamp():
    recording = simulate(parse(FLAGS), 4)
    trial = run_trial(make("gated-ekf"), recording)
    stamps = set(recording.data.aids["gnss"].stamp.tolist())
    assert trial.flagged
    assert {time for _, time in trial.flagged} <= stamps
    found = detection(trial, recording)
    assert found["detection_rate"] > 0.9
    assert found["false_alarm_rate"] < 0.05


def test_manners():
    recording = simulate(parse(FLAGS), 4)
    replay, arrival, skip = (run_trial(make("ekf", late=m), recording) for m in ("replay", "arrival", "skip"))
    assert arrival.diagnostics["late"][-1] == replay.diagnostics["late"][-1] > 20
    assert skip.diagnostics["late_missed"][-1] == replay.diagnostics["late"][-1]
    with pytest.raises(EstimatorError, match=r"late = 'never' should be one of: replay, arrival, skip"):
        make("ekf", late="never")
    assert make("ekf", late="skip", lags=2).inner.late == "skip"
