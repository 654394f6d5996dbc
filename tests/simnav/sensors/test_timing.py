"""Clocks of instruments: stamps, latency and order of arrival, their labels, and what the datasheet says."""

import numpy as np
import pytest

from simnav.environment.navigation import NavigationEnv
from simnav.recording import AidStream, Block, Recording
from simnav.scenario import parse
from simnav.simulation.simulator import Simulator, ideal, simulate
from simnav.simulation.steps import SteppedRuns
from simnav.spec import SpecError
from simnav.timing import TAIL, TimingSheet
from simnav.trial.wire import PacketDecoder, PacketEncoder

HEAD = """
name = "clocks"
version = 1
title = "clocks"
duration_s = 400.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
speed_m_s = 3.0
[initial_error]
position_m = [1.0, 1.0, 1.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.1, 0.1, 0.5]
[vessel]
kind = "ship"
[[manoeuvre]]
kind = "hold"
duration_s = 400.0
[instruments.gnss]
kind = "gnss_position"
rate_hz = 2.0
sigma_m = 1.0
[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.3
"""
CLOCK = "[instruments.gnss.timing]\n"


def run(clock="", more="", seed=1):
    """The recording of a voyage whose GNSS has a clock."""
    return simulate(parse(HEAD + (CLOCK + clock if clock else "") + more), seed)


def test_nothing_but_stamps_and_arrivals_changes():
    plain = run()
    late = run("latency_s = 0.2\nlatency_random_s = 0.3\njitter_s = 0.01\noffset_s = 0.5\n")
    for name, stream in plain.data.aids.items():
        np.testing.assert_array_equal(stream.value, late.data.aids[name].value)
        np.testing.assert_array_equal(stream.time, late.data.aids[name].time)
    assert late.data.aids["gnss"].has_clock
    assert not late.data.aids["gyrocompass"].has_clock


def test_without_the_table_the_digest_is_what_it_was():
    plain = parse(HEAD)
    assert "timing" not in plain.model_dump()["instruments"]["gnss"]
    assert parse(HEAD + CLOCK + "latency_s = 0.1\n").content_hash() != plain.content_hash()


def test_offset_drift_and_resolution_of_the_stamps():
    stream = run("fixed_offset_s = 0.25\nfixed_drift_ppm = 50.0\n").data.aids["gnss"]
    np.testing.assert_allclose(stream.stamp - stream.time, 0.25 + 50e-6 * stream.time, atol=1e-12)
    np.testing.assert_array_equal(stream.arrival, stream.time)
    rounded = run("fixed_offset_s = 0.26\nresolution_s = 0.1\n").data.aids["gnss"]
    np.testing.assert_allclose(rounded.stamp - rounded.time, 0.3, atol=1e-9)


def test_offset_and_drift_have_the_stated_spread_from_run_to_run():
    scenario = parse(HEAD + CLOCK + "offset_s = 0.2\ndrift_ppm = 30.0\n")
    clocks = [Simulator(scenario, seed).clocks["gnss"] for seed in range(60)]
    # 99.9 % of the standard deviations of 60 normal numbers are within 0.70 and 1.32 of the true one.
    assert 0.7 < np.std([c.offset for c in clocks]) / 0.2 < 1.32
    assert 0.7 < np.std([c.drift for c in clocks]) / 30e-6 < 1.32


def test_jitter_and_latency_have_the_stated_distribution():
    stream = run("latency_s = 0.1\nlatency_random_s = 0.2\njitter_s = 0.02\n").data.aids["gnss"]
    assert np.std(stream.stamp - stream.time) == pytest.approx(0.02, rel=0.1)
    late = stream.arrival - stream.time - 0.1
    # The cut exponential distribution has the mean 0.966 m and the median m ln 2, nearly.
    assert 0.0 <= late.min() < late.max() <= TAIL * 0.2
    assert late.mean() == pytest.approx(0.966 * 0.2, rel=0.15)
    assert np.median(late) == pytest.approx(0.2 * np.log(2.0), rel=0.15)
    sheet = TimingSheet("arrival", 0.1, 0.2)
    assert sheet.expected == pytest.approx(0.1 + late.mean(), rel=0.1)


def test_stamps_at_arrival():
    stream = run('stamped = "arrival"\nlatency_s = 0.1\nlatency_random_s = 0.2\n').data.aids["gnss"]
    np.testing.assert_array_equal(stream.stamp, stream.arrival)


def test_a_reading_comes_in_the_step_in_which_it_arrives():
    recording = run("latency_s = 0.4\nlatency_random_s = 0.6\njitter_s = 0.01\n")
    stream = recording.data.aids["gnss"]
    arrival = dict(zip(stream.stamp.tolist(), stream.arrival.tolist(), strict=True))
    overtaken = seen = 0
    newest = -np.inf
    for packet in recording.steps():
        own = [m.time for m in packet if m.instrument == "gnss"]
        assert [m.time for m in packet] == sorted(m.time for m in packet)
        for time in own:
            assert packet.start < arrival[time] <= packet.time + 1e-6
            overtaken += time < newest
            seen += 1
        newest = max([newest, *own])
    assert seen == np.sum(stream.arrival <= 400.0)
    assert overtaken > 20


def steps_of(recording):
    return [[(m.instrument, m.time, *m.value) for m in packet] for packet in recording.steps()]


LATE = "latency_s = 0.4\nlatency_random_s = 0.6\noffset_s = 0.1\njitter_s = 0.05\n"
STEP = '[[fault]]\nkind = "clock_step"\ninstruments = "gnss"\nstep_s = 0.7\nstart_s = 30.0\nend_s = 90.0\n'


def test_wire_steps_and_environment_deliver_the_same():
    scenario = parse(HEAD.replace("400.0", "120.0") + CLOCK + LATE + STEP)
    recording = simulate(scenario, 3)
    wanted = steps_of(recording)
    encoder = PacketEncoder(recording.data, recording.data.truth.time)
    decode = PacketDecoder(encoder.streams)
    decoded = [packet for k in range(len(encoder)) for packet in decode(bytearray(b"".join(encoder[k])))]
    assert [[(m.instrument, m.time, *m.value) for m in packet] for packet in decoded] == wanted
    runs = SteppedRuns(1)
    runs.begin(0, Simulator(scenario, 3))
    for packet in wanted:
        runs.advance(np.ones(1, bool))
        assert [(m.instrument, m.time, *m.value) for m in runs.packet(0)] == packet
    env = NavigationEnv(scenario)
    observation, _ = env.reset(seed=3)
    for packet in wanted:
        entry = observation["gnss"]
        there = entry["valid"] == 1
        rows = np.column_stack([entry["time"], entry["value"]])[there]
        assert rows.tolist() == [list(m[1:]) for m in packet if m[0] == "gnss"]
        observation, *_ = env.step(env.action_space.sample())
        if not observation["interval"].any():
            break


def test_blocks_give_the_numbers_of_one_block():
    scenario = parse(HEAD.replace("400.0", "60.0") + CLOCK + LATE + STEP)
    whole = Simulator(scenario, 5).advance(60.0).aids["gnss"]
    simulator = Simulator(scenario, 5)
    parts = Block.concatenate([simulator.advance(t) for t in (20.0, 35.0, 60.0)]).aids["gnss"]
    for name in ("time", "stamp", "arrival", "value", "faults"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name))


def test_a_step_of_the_clock_is_labelled_and_changes_no_value():
    plain, stepped = run(), run(more=STEP)
    a, b = plain.data.aids["gnss"], stepped.data.aids["gnss"]
    active = (b.time >= 30.0) & (b.time < 90.0)
    np.testing.assert_array_equal(a.value, b.value)
    np.testing.assert_allclose(b.stamps - b.time, np.where(active, 0.7, 0.0), atol=1e-12)
    np.testing.assert_array_equal(b.faults, active)
    assert not b.fault_error.any()
    assert stepped.faults[0].kind == "clock_step"


def test_an_outage_changes_no_stamp_of_another_reading():
    outage = '[[fault]]\nkind = "outage"\ninstruments = "gnss"\nstart_s = 50.0\nend_s = 100.0\n'
    a, b = (run(LATE, more).data.aids["gnss"] for more in ("", outage + STEP))
    kept = np.isin(a.time, b.time)
    assert 0 < kept.sum() < len(a)
    active = (b.time >= 30.0) & (b.time < 90.0)
    np.testing.assert_allclose(b.stamp, a.stamp[kept] + np.where(active, 0.7, 0.0), atol=1e-12)
    np.testing.assert_array_equal(b.arrival, a.arrival[kept])


def test_the_datasheet_says_what_is_known_and_only_that():
    text = "latency_s = 0.2\noffset_s = 0.1\njitter_s = 0.01\nfixed_offset_s = 0.3\nfixed_drift_ppm = 5.0\n"
    sheet = parse(HEAD + CLOCK + text).instruments_sheet()["gnss"]
    assert sheet.timing == TimingSheet("validity", 0.2, 0.0, 0.1, 0.0, 0.01)
    assert parse(HEAD + CLOCK + text + "stated = false\n").instruments_sheet()["gnss"].timing is None
    assert parse(HEAD).instruments_sheet()["gnss"].timing is None


def test_a_file_keeps_stamps_and_clock(tmp_path):
    recording = run(LATE)
    recording.save(tmp_path / "run.npz")
    back = Recording.load(tmp_path / "run.npz")
    assert back.instruments["gnss"].timing == recording.instruments["gnss"].timing
    assert steps_of(back) == steps_of(recording)


def test_ideal_values_have_the_stamps_of_the_run():
    scenario = parse(HEAD + CLOCK + LATE)
    a, b = (f(scenario, 2).data.aids["gnss"] for f in (simulate, ideal))
    np.testing.assert_array_equal(a.stamp, b.stamp)
    np.testing.assert_array_equal(a.arrival, b.arrival)


@pytest.mark.parametrize(
    ("clock", "said"),
    [
        ("latency_s = -0.1", r"timing.latency_s = -0.1: should be at least 0"),
        ("latency_random_s = -1.0", r"timing.latency_random_s = -1.0: should be at least 0"),
        ("jitter_s = 0.8", r"timing.jitter_s = 0.8: should be at most the interval between readings, 0.5 s"),
        ("resolution_s = 1.0", r"timing.resolution_s = 1: should be at most the interval between readings, 0.5 s"),
        ("drift_ppm = 1e5", r"timing.drift_ppm = 100000.0: should be at most 10000"),
        ('stamped = "never"', r"timing.stamped = 'never'.*'validity' or 'arrival'"),
        ("latency = 0.1", r"'instruments.gnss.timing.latency'.*'latency_s'"),
        ("offset_s = inf", r"timing: offset_s = inf: should be a finite time"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(clock, said):
    with pytest.raises(SpecError, match=said) as caught:
        parse(HEAD + CLOCK + clock)
    assert "\n" not in str(caught.value)


def test_a_step_of_zero_is_no_fault():
    with pytest.raises(SpecError, match=r"step_s = 0"):
        parse(HEAD + STEP.replace("step_s = 0.7", "step_s = 0.0"))


def test_rows_of_a_stream():
    stream = run(LATE).data.aids["gnss"]
    part = stream.rows(slice(3, 7))
    assert isinstance(part, AidStream)
    np.testing.assert_array_equal(part.arrival, stream.arrival[3:7])


def test_a_stream_as_delivered_shows_no_true_time():
    stream = run(LATE).data.aids["gnss"]
    seen = stream.as_delivered()
    assert np.all(np.diff(seen.time) >= 0.0)
    np.testing.assert_array_equal(np.sort(stream.stamp), seen.time)
    by_stamp = dict(zip(stream.stamp.tolist(), stream.arrival.tolist(), strict=True))
    assert [by_stamp[t] for t in seen.time.tolist()] == seen.arrival.tolist()
    assert not len(seen.stamp)
