"""The registry of formats, and files that are whole."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import pyarrow.parquet as pq
import pytest

from simnav.leaderboard.results import formats
from simnav.leaderboard.results.export import Document, table
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.result import Result
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record

ONE = Result("s-v1", 3, "mine", {"gain": 0.5}, False, "ok", "", {"horizontal_rmse": 2.5, "drift": float("nan")})


def test_every_format_of_results_is_written(tmp_path: Path):
    assert formats.formats("results") == ["csv", "json", "parquet"]
    for name in formats.formats("results"):
        (path,) = formats.write("results", name, Document([ONE]), tmp_path / f"results.{name}")
        assert path.stat().st_size > 100
    (row,) = pq.read_table(tmp_path / "results.parquet").to_pylist()
    assert (row["seed"], row["parameters"], row["horizontal_rmse"]) == (3, '{"gain": 0.5}', 2.5)
    assert row["drift"] is None
    assert [row] == table([ONE]).to_pylist()


def test_every_format_of_a_recording_is_written(tmp_path: Path):
    recording = record(load("open-sea"), 0)
    assert formats.formats("recording") == ["csv", "npz"]
    (path,) = formats.write("recording", "npz", recording, tmp_path / "new" / "run.npz")
    assert len(Recording.load(path).data.truth) == len(recording.data.truth)
    written = formats.write("recording", "csv", recording, tmp_path / "tables")
    assert {p.stem for p in written} == {"truth", "imu", *recording.data.aids}


@patch.dict("simnav.leaderboard.results.formats._writers", results={})  # a format is never forgotten in use
def test_a_new_format_takes_one_function(tmp_path: Path):
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
