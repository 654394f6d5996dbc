"""What is written of a recording whose instruments have clocks: stamps and arrivals, and true times only if told."""

import json

import numpy as np

from simnav.leaderboard.results.hidden import without_truth
from simnav.leaderboard.results.recording_export import write_csv
from simnav.scenario import load
from simnav.simulation.simulator import simulate


def columns(path):
    head = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    return dict(zip(head, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))


def test_a_blind_export_has_stamps_and_arrivals_only(tmp_path):
    recording = simulate(load("unsynchronised-clocks").model_copy(update={"duration": 10.0}), 3)
    stream = recording.data.aids["dvl"]
    write_csv(recording, tmp_path / "told")
    blind = without_truth(recording)
    write_csv(blind, tmp_path / "blind")
    told, seen = columns(tmp_path / "told/dvl.csv"), columns(tmp_path / "blind/dvl.csv")
    np.testing.assert_array_equal(seen["time_s"], np.sort(stream.stamp))
    np.testing.assert_array_equal(np.sort(seen["arrival_s"]), np.sort(stream.arrival))
    np.testing.assert_array_equal(np.sort(told["time_of_validity_s"]), stream.time)
    assert "time_of_validity_s" not in seen
    assert "arrival_s" not in columns(tmp_path / "told/gyrocompass.csv")
    sheet = json.loads((tmp_path / "blind/start.json").read_text(encoding="utf-8"))["instruments"]["dvl"]
    assert sheet["timing"]["offset"] == recording.instruments["dvl"].timing.offset
    assert not np.array_equal(blind.data.aids["dvl"].time, stream.time)
    for a, b in zip(blind.steps(), recording.steps(), strict=True):
        assert [(m.instrument, m.time, *m.value) for m in a] == [(m.instrument, m.time, *m.value) for m in b]
