"""Faults on single channels: each kind of fault touches those that it names and no other reading."""

from __future__ import annotations

import re

import numpy as np
import pytest

from simnav.recording import AidStream, Recording
from simnav.sensors.faults import FaultLayer, fault_specs
from simnav.simulation.simulator import Simulator, ideal
from simnav.source import record
from simnav.spec import SpecError
from tests.cases.fjord import fjord

FAULTS = {
    "outage": "",
    "gross_error": "probability = 0.6\nsize_m = [50.0, 90.0]",
    "noise_step": "sigma_m = 20.0",
    "multipath": "sigma_m = 20.0\ncorrelation_time_s = 5.0",
    "ramp": "slope_m_s = 0.5",
    "bias_step": "offset_m = 30.0",
    "frozen": "",
    "false_zero": "",
}


def table(kind: str, channels: str = '["B", "D"]', times: str = "start_s = 10.0\nend_s = 30.0") -> str:
    named = f"channels = {channels}\n" if channels else ""
    return f'[[fault]]\nkind = "{kind}"\ninstruments = "beacons"\n{named}{times}\n{FAULTS[kind]}\n'


def beacons(plugins, faults: str = "", seed: int = 1) -> AidStream:
    return record(fjord(plugins, "beacons", duration=40.0, tables=faults), seed).data.aids["beacons"]


def readings(stream: AidStream) -> dict[tuple[float, str], tuple]:
    """Value, label, error and side information of each reading, by time and channel."""
    columns = zip(
        stream.time.tolist(), stream.channel.tolist(), stream.value[:, 0].tolist(), stream.faults.tolist(),
        stream.fault_error[:, 0].tolist(), stream.side.tolist(), strict=True,
    )  # fmt: skip
    return {(t, stream.channels[c]): (v, f, e, side) for t, c, v, f, e, side in columns}


def test_every_kind_of_fault_on_measurements_is_tried_here():
    on_the_imu = {cls.model_fields["kind"].default for cls in fault_specs() if cls.effect == "imu"}
    assert {cls.model_fields["kind"].default for cls in fault_specs()} - on_the_imu >= set(FAULTS)


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_touches_the_channels_that_it_names_only(plugins, kind):
    clean, faulty = readings(beacons(plugins)), readings(beacons(plugins, table(kind)))
    touched = {key for key in clean if faulty.get(key) != clean[key]}
    assert {channel for _, channel in touched} == {"B", "D"}
    assert all(10.0 <= t < 30.0 for t, _ in touched)
    for key in touched & faulty.keys():
        value, label, error, side = faulty[key]
        assert label == 1
        assert error == pytest.approx(value - clean[key][0])
        assert side == clean[key][3]
    assert (len(faulty) < len(clean)) == (kind == "outage")


@pytest.mark.parametrize("kind", FAULTS)
def test_without_channels_it_is_all_of_the_instrument(plugins, kind):
    clean, faulty = readings(beacons(plugins)), readings(beacons(plugins, table(kind, "")))
    touched = {key for key in clean if faulty.get(key) != clean[key]}
    assert {channel for _, channel in touched} == set("ABCDE")
    some = readings(beacons(plugins, table(kind)))
    assert all(faulty.get(key) == some.get(key) for key in clean if key[1] in "BD")  # a channel by itself


@pytest.mark.parametrize("kind", FAULTS)
def test_in_pieces_it_gives_the_same(plugins, kind):
    random = "mean_active_s = 4.0\nmean_gap_s = 3.0"
    scenario = fjord(plugins, "beacons", duration=40.0, tables=table(kind, times=random) + table("outage"))
    whole = readings(record(scenario, 5).data.aids["beacons"])
    simulator = Simulator(scenario, 5)
    parts = [simulator.advance(t).aids["beacons"] for t in (0.5, 7.0, 7.5, 21.0, 33.5, 40.0)]
    assert readings(AidStream.concatenate(parts)) == whole


def test_a_frozen_channel_repeats_its_own_value(plugins):
    stream = beacons(plugins, table("frozen"))
    values = {c: stream.value[(stream.channel == c) & (stream.faults != 0), 0] for c in (1, 3)}
    before = {c: stream.value[(stream.channel == c) & (stream.time < 10.0), 0][-1] for c in (1, 3)}
    for c in (1, 3):
        assert set(values[c]) == {before[c]}
    assert before[1] != before[3]


def test_channels_are_independent_of_each_other(plugins):
    stream = beacons(plugins, table("noise_step", ""))
    errors = {c: stream.fault_error[stream.channel == c, 0] for c in (0, 2)}
    active = [e[e != 0.0] for e in errors.values()]
    assert abs(np.corrcoef(*(e[:19] for e in active))[0, 1]) < 0.7
    assert not np.array_equal(active[0], active[1])


def test_an_outage_notes_its_channel(plugins):
    clean, stream = beacons(plugins), beacons(plugins, table("outage", '"B"'))
    lost = stream.dropped[stream.dropped_channel == 1]
    assert {10.0, 29.0} <= set(lost.tolist())
    assert np.array_equal(np.lexsort((stream.dropped_channel, stream.dropped)), np.arange(len(stream.dropped)))
    for c in (0, 2, 3, 4):
        assert np.array_equal(stream.dropped[stream.dropped_channel == c], clean.dropped[clean.dropped_channel == c])


def test_an_ideal_run_has_the_readings_of_the_real_one(plugins):
    scenario = fjord(plugins, "beacons", duration=40.0, tables=table("outage") + table("bias_step", '"A"'))
    real, clean = (f(scenario, 1).data.aids["beacons"] for f in (record, ideal))
    assert np.array_equal(real.time, clean.time)
    assert np.array_equal(real.channel, clean.channel)
    full = readings(ideal(fjord(plugins, "beacons", duration=40.0), 1).data.aids["beacons"])
    assert all(full[key][0] == entry[0] for key, entry in readings(clean).items())


def test_the_label_says_which_channels_and_a_file_keeps_it(plugins, tmp_path):
    recording = record(fjord(plugins, "beacons", duration=40.0, tables=table("ramp") + table("outage", "")), 1)
    assert [(f.kind, f.instruments, f.channels) for f in recording.faults] == [
        ("ramp", ("beacons",), ("B", "D")), ("outage", ("beacons",), ()),
    ]  # fmt: skip
    assert "channels" not in recording.faults[0].parameters
    recording.save(tmp_path / "run.npz")
    again = Recording.load(tmp_path / "run.npz")
    assert [f.channels for f in again.faults] == [("B", "D"), ()]


@pytest.mark.parametrize(
    ("instruments", "channels", "message"),
    [
        ("beacons", '["B", "G05"]', "fault[0] 'outage': 'beacons' has no channel 'G05'; it has: A, B, C, D, E"),
        ("depth", '"A"', "fault[0] 'outage': channels = ['A'] is of no use to 'depth', which has no channels"),
        ("beacons", "[2]", "fault[0].channels = [2]: should be the identifier of a channel, in quotes, or a list"),
        ("beacons", "[]", "fault[0].channels = []: should be the identifier of a channel"),
    ],
)
def test_a_wrong_channel_is_one_sentence(plugins, instruments, channels, message):
    text = f'[[fault]]\nkind = "outage"\ninstruments = "{instruments}"\nchannels = {channels}\n'
    with pytest.raises(SpecError, match=re.escape(message)):
        fjord(plugins, "beacons", tables=text)


def test_toml_keeps_the_channels(plugins):
    scenario = fjord(plugins, "beacons", tables=table("ramp") + table("outage", ""))
    written = scenario.to_toml()
    assert written["fault"][0]["channels"] == ["B", "D"]
    assert "channels" not in written["fault"][1]
    assert type(scenario).from_toml(written) == scenario
    other = scenario.model_copy(update={"faults": fjord(plugins, "beacons", tables=table("ramp", '"B"')).faults})
    assert other.content_hash() != scenario.content_hash()


def test_a_layer_of_a_third_party_sees_one_channel_after_the_other(plugins):
    seen = []

    class Watches(FaultLayer):
        def apply(self, stream):
            seen.append((stream.name, stream.channels, len(stream)))
            return stream

    scenario = fjord(plugins, "beacons", duration=10.0, tables=table("outage"))
    simulator = Simulator(scenario, 1)
    simulator.layers = (Watches(scenario.faults[0], 0, 1, "watches"),)
    simulator.advance(10.0)
    assert [name for name, _, _ in seen] == ["beacons:B", "beacons:D"]
    assert {channels for _, channels, _ in seen} == {()}
