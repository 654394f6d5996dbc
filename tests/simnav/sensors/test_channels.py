"""Instruments with channels: what they draw, what they check, and that a recording keeps them."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import dcm_from_rpy
from simnav.kinds import Component, Kind, NavigationPoint
from simnav.plugins import PluginError
from simnav.recording import AidStream, Recording
from simnav.scenario import parse
from simnav.sensors import AidSpec, ChannelInstrument, Instrument, register_instrument
from simnav.sensors.instrument import InstrumentError
from simnav.simulation.simulator import ideal
from simnav.source import open_source, record
from simnav.spec import NonNegative, SpecError, quantity
from simnav.types import KINDS, TapStates
from tests.cases.fjord import WITH_CHANNELS, fjord

ARRAYS = ("time", "value", "faults", "fault_error", "sigma", "dropped", "channel", "side", "dropped_channel")


@pytest.fixture(params=WITH_CHANNELS)
def case(request):
    return request.param


def of(stream: AidStream, channel: str) -> dict[str, np.ndarray]:
    """The readings of one channel."""
    c = stream.channels.index(channel)
    rows = {n: getattr(stream, n)[stream.channel == c] for n in ARRAYS if not n.startswith("dropped")}
    return rows | {"dropped": stream.dropped[stream.dropped_channel == c]}


def same(a: AidStream, b: AidStream) -> bool:
    return a.channels == b.channels and all(np.array_equal(getattr(a, n), getattr(b, n)) for n in ARRAYS)


# --- simulation


def test_readings_of_one_time_follow_each_other_and_vary_in_number(plugins):
    stream = record(fjord(plugins, "beacons"), 1).data.aids["beacons"]
    assert stream.channels == ("A", "B", "C", "D", "E")
    assert stream.value.shape == (len(stream), 1)
    assert stream.side.shape == (len(stream), 4)
    assert stream.channel.dtype == stream.dropped_channel.dtype == np.int16
    order = np.lexsort((stream.channel, stream.time))
    assert np.array_equal(order, np.arange(len(stream)))
    _, counts = np.unique(stream.time, return_counts=True)
    assert counts.min() < counts.max() == 5
    assert len(stream) + len(stream.dropped) == 5 * 60


def test_a_range_is_the_distance_to_where_its_beacon_says_it_is(plugins):
    scenario = fjord(plugins, "beacons", duration=40.0)
    recording = ideal(scenario, 1)
    stream, truth = recording.data.aids["beacons"], recording.data.truth
    position = truth.position[np.searchsorted(truth.time, stream.time - 1e-6)]
    distance = np.linalg.norm(relative_position(stream.side[:, :3], position), axis=1)
    assert stream.value[:, 0] == pytest.approx(distance, abs=1e-3)
    assert (distance <= 720.0 + 1e-3).all()
    moved = relative_position(of(stream, "A")["side"][:, :3], of(stream, "A")["side"][0, :3])
    assert moved[-1] == pytest.approx([0.0, 39.0, 0.0], abs=0.01)


def test_sigma_of_a_reading_follows_from_its_side_information(plugins):
    scenario = fjord(plugins, "beacons", duration=600.0)
    real, clean = (f(scenario, 3).data.aids["beacons"] for f in (record, ideal))
    for channel, uncertainty in (("A", 0.0), ("B", 0.3), ("C", 1.0)):
        sigma = of(real, channel)["sigma"]
        assert sigma == pytest.approx(np.hypot(0.5, uncertainty))
        errors = np.diff((of(real, channel)["value"] - of(clean, channel)["value"])[:, 0])
        clock = 0.1 + 0.02 + 0.05  # what drift and noise of the clock add within a second
        assert errors.std() == pytest.approx(np.sqrt(2.0) * sigma[0, 0], rel=0.2, abs=clock)


def test_every_channel_has_its_own_turn_on_bias_in_run_bias_and_noise(plugins):
    scenario = fjord(plugins, "beacons", duration=30.0)
    text = {"bias": 20.0, "bias_instability": 5.0, "correlation_time": 10.0, "clock": 0.0, "drift": 0.0}
    spec = scenario.aids["beacons"].model_copy(update=text)
    error, white = spec.build("beacons", 4).ahead(np.arange(30.0))
    assert error.shape == white.shape == (30, 5, 1)
    assert np.linalg.matrix_rank(error[..., 0]) == np.linalg.matrix_rank(white[..., 0]) == 5
    biases = np.array([spec.build("beacons", seed).bias[:, 0] for seed in range(300)])
    assert biases.std(axis=0) == pytest.approx([20.0] * 5, rel=0.15)
    assert np.abs(np.corrcoef(biases.T) - np.eye(5)).max() < 0.25


def test_a_further_channel_changes_no_other_one(plugins):
    scenario = fjord(plugins, "beacons", duration=30.0)
    spec = scenario.aids["beacons"]
    columns = ("beacons", "north", "east", "depth", "course", "speed", "uncertainty")
    fewer = spec.model_copy(update={name: getattr(spec, name)[1:4] for name in columns})
    changed = scenario.model_copy(update={"instruments": {**scenario.instruments, "beacons": fewer}})
    five, three = (record(s, 1).data.aids["beacons"] for s in (scenario, changed))
    assert three.channels == ("B", "C", "D")
    for channel in three.channels:
        a, b = of(five, channel), of(three, channel)
        assert all(np.array_equal(a[n], b[n]) for n in a if n != "channel")


def test_a_run_in_pieces_gives_the_same_readings(plugins, case):
    scenario = fjord(plugins, case, duration=20.0)
    whole = record(scenario, 2).data.aids[WITH_CHANNELS[case]]
    source = open_source(scenario, 2)
    parts = [source.advance(t).aids[WITH_CHANNELS[case]] for t in (0.4, 1.0, 1.2, 7.6, 20.0)]
    assert len(parts[0]) == 0
    assert same(AidStream.concatenate(parts), whole)


def test_a_beam_without_bottom_is_lost_by_itself(plugins):
    scenario = fjord(plugins, "janus").model_copy(update={"water_depth": 60.0})
    instrument = scenario.aids["beams"].install("beams", 1, scenario.surround(1))
    heel = np.radians([0.0, 10.0, -10.0, 60.0])
    zeros = np.zeros((4, 3))
    attitude = np.stack([heel, np.zeros(4), np.zeros(4)], axis=1)
    place = np.tile([np.radians(54.0), np.radians(7.9), -10.0], (4, 1))
    stream = instrument.sense(TapStates(np.arange(4.0), place, zeros, attitude, zeros, zeros))
    heard = [[stream.channels[c] for c in stream.channel[stream.time == t]] for t in range(4)]
    assert heard == [["1", "2", "3", "4"], ["1", "2"], ["3", "4"], []]  # down to starboard: beams to port meet nothing
    assert [len(of(stream, c)["dropped"]) for c in stream.channels] == [2, 2, 2, 2]


def test_a_beam_reads_the_velocity_along_its_direction(plugins):
    scenario = fjord(plugins, "janus", duration=20.0)
    recording = ideal(scenario, 1)
    stream, truth = recording.data.aids["beams"], recording.data.truth
    last = len(truth) - 1
    rows = np.flatnonzero(np.abs(stream.time - truth.time[last]) < 1e-6)
    assert rows.size == 4
    dcm = dcm_from_rpy(truth.attitude[last])
    for row in rows:
        point = NavigationPoint(
            20.0, truth.position[last], truth.velocity[last], dcm, np.zeros(3), {"sound_speed": np.zeros(1)},
            stream.channels[stream.channel[row]], stream.side[row],
        )  # fmt: skip
        predicted, jacobian = KINDS["janus"].observation(point, recording.instruments["beams"])
        assert predicted == pytest.approx(stream.value[row], abs=1e-9)
        assert set(jacobian) == {"navigation", "sound_speed"}


# --- recording


def test_a_saved_recording_is_the_same(plugins, case, tmp_path):
    recording = record(fjord(plugins, case, duration=10.0), 1)
    recording.save(tmp_path / "run.npz")
    again = Recording.load(tmp_path / "run.npz")
    name = WITH_CHANNELS[case]
    assert same(again.data.aids[name], recording.data.aids[name])
    assert again.instruments[name].channels == recording.instruments[name].channels
    assert again.data.aids["depth"].channels == ()


def test_packets_have_a_measurement_for_each_channel(plugins):
    recording = record(fjord(plugins, "beacons", duration=10.0), 1)
    stream = recording.data.aids["beacons"]
    found = [m for packet in recording.steps() for m in packet.aids if m.instrument == "beacons"]
    assert len(found) == len(stream) > 30
    for k, m in enumerate(found):
        assert m.source == f"beacons:{stream.channels[stream.channel[k]]}"
        assert np.array_equal(m.side, stream.side[k])
        assert np.array_equal(m.value, stream.value[k])
    depth = next(m for packet in recording.steps() for m in packet.aids if m.instrument == "depth")
    assert (depth.source, depth.channel, depth.side.size) == ("depth", "", 0)


def test_places_are_found_by_time_and_channel(plugins):
    stream = record(fjord(plugins, "beacons", duration=10.0), 1).data.aids["beacons"]
    rows = np.array([3, 11, 30])
    assert stream.places(stream.time[rows], stream.channel[rows]).tolist() == rows.tolist()
    plain = replace(stream, channels=(), time=np.arange(float(len(stream))))
    assert plain.places(plain.time[rows], plain.channel).tolist() == rows.tolist()


# --- mistakes


def probe(**methods):
    """A kind with two channels, some of whose methods are replaced, and a run with it."""

    @register_instrument(
        Kind("probe", role="other", components=(Component("depth", "m"),), side=(Component("angle", "deg"),)),
        example={"sigma_m": 1.0},
    )
    class Probe(AidSpec):
        kind: Literal["probe"] = "probe"
        sigma: NonNegative = quantity("m")

        def channels(self):
            return methods.get("channels", ("left", "right"))

        def build(self, name, seed):
            return methods.get("made", _Probe)(self, name, seed)

    class _Probe(ChannelInstrument):
        def observe(self, tap):
            return methods.get("observe", lambda tap: np.zeros((len(tap.time), 2, 1)))(tap)

        def side_information(self, tap):
            return methods.get("side", lambda tap: np.zeros((len(tap.time), 2, 1)))(tap)

        def available(self, tap):
            return methods.get("available", lambda tap: None)(tap)

    return Probe


def run_of(plugins):
    text = (plugins / "fjord.toml").read_text().partition("[instruments.fix]")[0].replace('"magnetometer.py"', "")
    return record(parse(text + '[instruments.probe]\nkind = "probe"\nsigma_m = 1.0\n'), 1)


def late(shape, value):
    """An array of zeros in which the right channel has another value at the last time."""

    def method(tap):
        array = np.zeros((len(tap.time), *shape))
        array[-1, 1] = value
        return array

    return method


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        ({"observe": lambda tap: np.zeros((len(tap.time), 2))}, r"observe\(\) returned an array of shape \(120, 2\), "
         r"where \(120, 2, 1\) is wanted: .* 2 channels, .*\(depth\)"),
        ({"side": lambda tap: np.zeros((len(tap.time), 2, 3))}, r"side_information\(\) .*\(120, 2, 1\).*\(angle\)"),
        ({"available": lambda tap: np.ones(len(tap.time), bool)}, r"available\(\) .*of shape \(120,\).*\(120, 2\)"),
        ({"observe": late((2, 1), np.nan)}, r"observe\(\) returned \[nan\] for channel 'right' at 120 s; .*finite"),
        ({"side": late((2, 1), np.inf)}, r"side_information\(\) returned \[inf\] for channel 'right' at 120 s"),
        ({"side": lambda tap: 1 / 0}, r"instrument 'probe' of kind 'probe' \(.*_channels.py\): .*division by zero"),
        ({"made": lambda spec, name, seed: Plain(spec, name, seed)}, "is a simnav.sensors.ChannelInstrument"),
    ],
)  # fmt: skip
def test_a_mistake_of_an_instrument_is_named(plugins, methods, message):
    probe(**methods)
    with pytest.raises(InstrumentError, match=message):
        run_of(plugins)


class Plain(Instrument):
    def observe(self, tap):
        return np.zeros((len(tap.time), 1))


def test_what_is_not_delivered_may_be_no_number(plugins):
    mask = lambda tap: np.tile([True, False], (len(tap.time), 1))  # noqa: E731
    probe(observe=late((2, 1), np.nan), side=late((2, 1), np.nan), available=mask)
    stream = run_of(plugins).data.aids["probe"]
    assert set(stream.channel) == {0}
    assert set(stream.dropped_channel) == {1}


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        (("a", "a"), "channel 'a' is there more than once"),
        (("a b",), "letters, digits and the signs"),
        (("x:y",), "letters, digits and the signs"),
        (["a"], "should be a tuple of identifiers"),
        (tuple(map(str, range(1001))), "1001 channels are too many"),
        ((), "has no channels, but its kind has side information"),
    ],
)
def test_wrong_channels_are_refused(plugins, channels, message):
    with pytest.raises((PluginError, SpecError), match=message):
        probe(channels=channels)


def test_a_missing_method_is_named(plugins):
    Probe = probe()
    text = (plugins / "fjord.toml").read_text()
    assert text

    class Bare(ChannelInstrument):
        def observe(self, tap):
            return np.zeros((len(tap.time), 2, 1))

    probe(made=Bare)
    with pytest.raises(InstrumentError, match=r"Bare has no side_information\(\).*angle"):
        run_of(plugins)
    assert Probe.definition.side_names == ("angle",)
