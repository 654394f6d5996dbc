"""The registry of formats, and files that are whole."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from simnav.leaderboard.cli import app
from simnav.leaderboard.results import formats
from simnav.leaderboard.results.export import Document, table
from simnav.leaderboard.results.files import csv_text, write_whole
from simnav.leaderboard.results.result import Result
from simnav.plugins import PluginError
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record

ONE = Result("s-v1", 3, "mine", {"gain": 0.5}, False, "ok", "", {"horizontal_rmse": 2.5, "drift": float("nan")})


def test_every_format_of_results_is_written(tmp_path: Path):
    assert formats.formats("results") == ["json", "parquet"]
    for name in formats.formats("results"):
        (path,) = formats.write("results", name, Document([ONE]), tmp_path / f"results.{name}")
        assert path.stat().st_size > 100
    (row,) = pq.read_table(tmp_path / "results.parquet").to_pylist()
    assert (row["seed"], row["parameters"], row["horizontal_rmse"]) == (3, '{"gain": 0.5}', 2.5)
    assert row["drift"] is None
    assert [row] == table([ONE]).to_pylist()
    fields = pq.read_schema(tmp_path / "results.parquet")
    units = {name: (fields.field(name).metadata or {}).get(b"unit") for name in fields.names}
    assert (units["horizontal_rmse"], units["heading_rmse"], units["seconds"]) == (b"m", b"rad", b"s")
    assert units["reason"] is None


def test_a_text_that_a_spreadsheet_would_compute_is_quoted():
    """Texts of others stand in tables that people open; numbers stay numbers, also below zero."""
    texts = ["=1+1", "+1+cmd", "-1+1", "@SUM(A1)", "\t=1"]
    (read,) = csv.reader(io.StringIO(csv_text([texts])))
    assert read == [f"'{text}" for text in texts]
    assert csv_text([("=x", "-1.5", -1.5, "-", "a")]) == "'=x,-1.5,-1.5,-,a\n"


def test_every_format_of_a_recording_is_written(tmp_path: Path):
    recording = record(load("open-sea"), 0)
    assert {"csv", "npz"} <= set(formats.formats("recording"))
    (path,) = formats.write("recording", "npz", recording, tmp_path / "new" / "run.npz")
    assert len(Recording.load(path).data.truth) == len(recording.data.truth)
    written = formats.write("recording", "csv", recording, tmp_path / "tables")
    assert {p.stem for p in written} == {"truth", "imu", *recording.data.aids, "README", "start"}


@pytest.fixture
def forgotten():
    """Formats that a test registers are gone afterwards; in use a format is never forgotten."""
    before = {kind: registry.items() for kind, registry in formats.WRITERS.items()}
    yield
    for kind, registry in formats.WRITERS.items():
        registry._classes = before[kind]


def test_a_new_format_takes_one_function(tmp_path: Path, forgotten):
    @formats.writes("results", "txt")
    def write_txt(document: Document, path: Path) -> list[Path]:
        return [write_whole(path, str(len(document.results)))]

    assert "txt" in formats.formats("results")
    assert "txt" not in formats.formats("recording")
    formats.write("results", "txt", Document([ONE, ONE]), tmp_path / "n.txt")
    assert (tmp_path / "n.txt").read_text() == "2"


def test_an_unknown_format_is_named_with_the_nearest(tmp_path: Path):
    with pytest.raises(ValueError, match=r"no format .parque. of results.*parquet"):
        formats.write("results", "parque", Document([ONE]), tmp_path / "x")


def test_a_file_is_whole_or_the_old_one(tmp_path: Path):
    target = write_whole(tmp_path / "a.txt", "old")
    with pytest.raises(UnicodeEncodeError):
        write_whole(target, "\udc80")
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_the_file_of_a_third_party_adds_a_format_to_the_command(tmp_path: Path, plugins, forgotten):
    words = ["--plugin", str(plugins / "tracks.py"), "simulate", "open-sea", "-o", str(tmp_path / "run.geojson")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    points = json.loads((tmp_path / "run.geojson").read_text())["coordinates"]
    truth = record(load("open-sea"), 0).data.truth
    assert len(points) == len(truth)
    assert points[0][1] == pytest.approx(np.degrees(truth.position[0, 0]), abs=1e-12)
    done = CliRunner().invoke(app, ["simulate", "open-sea", "-o", str(tmp_path / "run.shp")])
    assert done.exit_code == 2
    assert "should end in .geojson or .gpx" in " ".join(done.output.split())


def test_a_format_of_simnav_is_not_replaced(forgotten):
    with pytest.raises(PluginError, match=r"the name is taken by write_npz"):
        formats.writes("recording", "npz")(lambda recording, path: [path])
