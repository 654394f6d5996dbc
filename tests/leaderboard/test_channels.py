"""Channels after a run: packets and flags of a trial, scores, files and figures."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from typer.testing import CliRunner

from simnav.estimator import Estimator
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.figures.run_figure import outage_spans, run_figure
from simnav.leaderboard.results import trials
from simnav.leaderboard.results.formats import write
from simnav.plugins import load_plugin
from simnav.recording import Recording
from simnav.scoring import errors
from simnav.scoring.detection import detection
from simnav.scoring.outages import outages
from simnav.source import record
from simnav.testing.altered_recordings import altered
from simnav.testing.contract_check import check, contract_recording
from simnav.testing.contract_runs import digests
from simnav.trial import run_trial
from simnav.trial.wire import PacketDecoder, PacketEncoder
from simnav.types import Estimate
from tests.cases.fjord import CHANNEL_CASES, WITH_CHANNELS, fjord

FAULTS = """
[[fault]]
kind = "bias_step"
instruments = "beacons"
channels = ["B", "D"]
offset_m = 30.0
start_s = 10.0
end_s = 20.0
[[fault]]
kind = "outage"
instruments = "beacons"
channels = ["A", "C"]
start_s = 25.0
end_s = 30.0
"""


class Flags(Estimator):
    """Stays where it started, and flags what a function says."""

    def __init__(self, choose):
        self.choose, self.seen = choose, []

    def reset(self, start, instruments):
        self.start = start

    def update(self, measurements):
        s = self.start
        self.seen += measurements.aids
        estimate = Estimate(measurements.time, s.position, s.velocity, s.attitude)
        estimate.flagged = [flag for m in measurements.aids for flag in self.choose(m)]
        estimate.diagnostics = {f"nis.{m.source}": float(m.value[0]) for m in measurements.aids}
        return estimate


@pytest.fixture
def recording(plugins):
    return record(fjord(plugins, "beacons", duration=40.0, tables=FAULTS), 1)


@pytest.mark.parametrize("case", WITH_CHANNELS)
def test_packets_in_plain_form_are_the_same_measurements(plugins, case):
    recording = record(fjord(plugins, case, duration=10.0), 1)
    packets = PacketEncoder(recording.data, recording.data.truth.time)
    decode = PacketDecoder(packets.streams)
    for k, packet in enumerate(recording.steps()):
        buffer = bytearray(b"".join(packets[k]))
        assert PacketDecoder.size(buffer) == len(buffer)
        (own,) = decode(buffer)
        assert [(*m[:3], m.channel, m.source) for m in own.aids] == [(*m[:3], m.channel, m.source) for m in packet.aids]
        for mine, theirs in zip(own.aids, packet.aids, strict=True):
            assert np.array_equal(mine.value, theirs.value)
            assert np.array_equal(mine.side, theirs.side)


def test_a_flag_of_a_channel_is_counted_against_the_label_of_its_row(recording):
    stream = recording.data.aids["beacons"]
    assert {stream.channels[c] for c in stream.channel[stream.faults != 0]} == {"B", "D"}
    faulty = {("beacons:B", t) for t in np.arange(10.0, 20.0)} | {("beacons:D", t) for t in np.arange(10.0, 20.0)}

    def rates(choose):
        return tuple(detection(run_trial(Flags(choose), recording), recording).values())

    assert rates(lambda m: [(m.source, m.time)] if (m.source, m.time) in faulty else []) == (1.0, 0.0)
    found, false = rates(lambda m: [(m.source, m.time)] if m.source == "beacons:B" and m.time < 20.0 else [])
    assert found == pytest.approx(0.5)
    assert 0.0 < false < 0.1
    found, false = rates(lambda m: [("beacons:Z", m.time)] if m.channel else [])
    assert (found, false) == (0.0, 0.0)
    found, false = rates(lambda m: [("beacons", m.time)] if m.channel and 10.0 <= m.time < 20.0 else [])
    assert found == 1.0  # the whole instrument
    assert false > 0.1


def test_an_estimator_is_given_source_and_side_information(recording):
    estimator = Flags(lambda m: [])
    trial = run_trial(estimator, recording)
    assert trial.status == "ok", trial.reason
    stream = recording.data.aids["beacons"]
    mine = [m for m in estimator.seen if m.channel]
    assert [m.source for m in mine] == [f"beacons:{stream.channels[c]}" for c in stream.channel]
    assert np.array_equal([m.side for m in mine], stream.side)
    assert {"nis.depth", "nis.beacons:A", "nis.beacons:E"} <= trial.diagnostics.keys()


def test_one_channel_without_readings_is_no_outage_of_the_instrument(plugins, recording):
    trial = run_trial(Flags(lambda m: []), recording)
    assert outages(errors(trial, recording), recording) == []
    whole = FAULTS.replace('channels = ["A", "C"]\n', "")
    dark = record(fjord(plugins, "beacons", duration=40.0, tables=whole), 1)
    (found,) = outages(errors(run_trial(Flags(lambda m: []), dark), dark), dark)
    assert (found.start, found.end) == pytest.approx((25.0, 30.0), abs=1.01)


# --- files


def test_csv_has_channel_and_side_information(recording, tmp_path):
    write("recording", "csv", recording, tmp_path / "run")
    stream = recording.data.aids["beacons"]
    with open(tmp_path / "run" / "beacons.csv") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "time_s", "channel", "range_m", "latitude_deg", "longitude_deg", "height_m", "uncertainty_m", "faults",
    ]  # fmt: skip
    assert [row["channel"] for row in rows] == [stream.channels[c] for c in stream.channel]
    assert [float(row["range_m"]) for row in rows] == stream.value[:, 0].tolist()
    assert [float(row["latitude_deg"]) for row in rows] == pytest.approx(np.degrees(stream.side[:, 0]), abs=1e-12)
    assert [int(row["faults"]) for row in rows] == stream.faults.tolist()
    with open(tmp_path / "run" / "depth.csv") as file:
        assert file.readline().strip() == "time_s,depth_m,faults"


def test_a_kept_trial_has_the_flags_of_its_channels(recording, tmp_path):
    trial = run_trial(Flags(lambda m: [(m.source, m.time)] if m.channel in ("B", "E") else []), recording)
    trials.write(tmp_path, "k-1", trial, recording)
    again, _ = trials.read(tmp_path, "k-1", recording)
    assert {source for source, _ in again.flagged} == {"beacons:B", "beacons:E"}
    assert again.flagged == trial.flagged
    assert np.isfinite(again.diagnostics["nis.beacons:B"]).any()


def test_a_label_in_words(recording):
    assert [f.where for f in recording.faults] == ["beacons [B, D]", "beacons [A, C]"]


def test_the_contract_test_alters_readings_with_their_channels(recording):
    stream, changed = recording.data.aids["beacons"], altered(recording, 20.0).data.aids["beacons"]
    assert len(changed.channel) == len(changed.side) == len(changed) < len(stream)
    before = digests(recording)
    stream.side[0, 0] += 1.0
    assert [n for n, digest in digests(recording).items() if digest != before[n]] == ["the measurements of beacons"]


# --- figures


def panel(figure, label):
    (found,) = (ax for ax in figure.axes if ax.get_ylabel() == label)
    return found


def test_a_panel_has_a_line_for_each_channel(recording):
    trial = run_trial(Flags(lambda m: []), recording)
    ax = panel(run_figure(recording, [("flags", trial)]), "nis\nbeacons [-]")
    lines = {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}
    assert sorted(lines) == ["A", "B", "C", "D", "E"]
    assert len({line.get_color() for line in lines.values()}) == 5
    assert np.array_equal(lines["B"].get_ydata(), trial.diagnostics["nis.beacons:B"], equal_nan=True)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == list(lines)
    ax = panel(run_figure(recording, [("flags", trial), ("other", trial)]), "nis\nbeacons [-]")
    assert ax.get_legend() is None  # the estimators keep their colours


def test_a_legend_names_twelve_channels_at_most(recording):
    trial = run_trial(Flags(lambda m: []), recording)
    trial.diagnostics.update({f"nis.beacons:{k}": trial.diagnostics["nis.beacons:B"] + k for k in range(30)})
    ax = panel(run_figure(recording, [("flags", trial)]), "nis\nbeacons [-]")
    assert len([line for line in ax.lines if not line.get_label().startswith("_")]) == 35
    assert len(ax.get_legend().get_texts()) == 12


def test_the_mean_over_channels_is_named(recording):
    trial = run_trial(Flags(lambda m: []), recording)
    trial.diagnostics["nis.beacons"] = trial.diagnostics["nis.beacons:B"] + 1.0
    ax = panel(run_figure(recording, [("flags", trial)]), "nis\nbeacons [-]")
    assert sorted(text.get_text() for text in ax.get_legend().get_texts()) == ["A", "B", "C", "D", "E", "mean"]


def test_an_outage_of_channels_is_named(recording):
    spans = outage_spans(recording)
    assert {name for _, _, name in spans} <= {"no beacons:A", "no beacons:C", "no beacons:A, beacons:C"}
    assert (min(a for a, _, _ in spans), max(b for _, b, _ in spans)) == (25.0, 30.0)


# --- the contract test


def test_the_contract_test_has_them_among_its_instruments(plugins):
    load_plugin(plugins / "moving_beacons.py")
    load_plugin(plugins / "janus.py")
    recording = contract_recording(0)
    assert set(recording.data.aids["janus"].channels) == {"1", "2", "3", "4"}
    beacons = recording.data.aids["moving_beacons"]
    assert len(beacons) == 4 * len(beacons.channels)  # once in ten seconds
    assert check("dead-reckoning").passed


def test_the_command_says_how_many_channels_there_are(plugins, tmp_path):
    file, tables = CHANNEL_CASES["beacons"]
    text = (plugins / "fjord.toml").read_text().partition("[instruments.fix]")[0]
    text = text.replace("magnetometer.py", (plugins / file).as_posix()).replace("_s = 120.0", "_s = 10.0")
    fault = '[[fault]]\nkind = "frozen"\ninstruments = "beacons"\nchannels = ["B", "D"]\n'
    (tmp_path / "sound.toml").write_text(text + tables + fault)
    names = [str(tmp_path / name) for name in ("sound.toml", "run.npz", "csv")]
    arguments = ["simulate", names[0], "-o", names[1], "--csv", names[2]]
    shown = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    assert shown.exit_code == 0, shown.output
    assert "moving_beacons (5 channels)" in shown.output
    assert Recording.load(tmp_path / "run.npz").faults[0].channels == ("B", "D")
    assert (tmp_path / "csv" / "beacons.csv").read_text().startswith("time_s,channel,range_m")
