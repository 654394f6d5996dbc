"""What is read of a folder of results: the scores that are asked for, and series when they are looked at."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from simnav.leaderboard.results import store
from simnav.leaderboard.results.gathering import gather
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.store import StoreError, StoreWarning
from simnav.leaderboard.results.stored_series import LostSeriesError, StoredSeries, read_ahead


@pytest.fixture(params=[False, True], ids=["loose", "compacted"])
def folder(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    path = store.create(tmp_path / "results")
    for seed in range(5):
        series = {"time": np.arange(4, dtype=np.float32), "grid": np.full((2, 3), seed, dtype=np.float32)}
        scores = {"a": float(seed), "b": float("nan"), "c": 3.0}
        store.write(
            path, Result("bay-v1", seed, "ekf", {"gain": seed % 2}, False, "ok", "", scores, series, key=f"k-{seed}")
        )
    store.select(path, {"bay-v1": ("r", {"ekf": "k"})})
    if request.param:
        store.compact(path)
    return path


def test_only_the_scores_that_are_wanted_are_read(folder: Path):
    found = store.load(folder, series=False, scores={"a", "c", "unknown"})
    assert [r.scores for r in found] == [{"a": float(k), "c": 3.0} for k in range(5)]
    assert [r.parameters for r in found] == [{"gain": k % 2} for k in range(5)]
    assert set(store.load(folder)[0].scores) == {"a", "b", "c"}
    assert store.load(folder, scores=())[0].scores == {}


@pytest.mark.parametrize("compacted", [False, True])
def test_former_names_of_parameters_are_shown_under_the_present_ones(tmp_path: Path, compacted: bool):
    """Files and marker as they were written when the parameters had these names; a row of others keeps its own."""
    path = store.create(tmp_path / "results")
    old = {
        "student-t-rts(dof=5,smoothed_dof=4)": {"dof": "5", "smoothed_dof": "4"},
        "rae(window=9)": {"window": "9"},
        "sw-fgo(window=9)": {"window": "9"},
        "theirs(window=9)": {"window": "9"},
        "rae": {},
    }
    for k, (label, parameters) in enumerate(old.items()):
        store.write(path, Result("bay-v1", 0, label, parameters, False, "ok", "", {"a": 1.0}, {}, key=f"k{k}-0"))
    entry = {"recording": "r", "estimators": {label: f"k{k}" for k, label in enumerate(old)}}
    marker = path / "simnav-results.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"current": {"bay-v1": entry}}))
    if compacted:
        store.compact(path)
    found = {r.estimator: (dict(r.parameters), r.key) for r in store.load(path)}
    assert found == {
        "student-t-rts(adaptation__dof=5,smoother__dof=4)": ({"adaptation__dof": "5", "smoother__dof": "4"}, "k0-0"),
        "rae(innovations=9)": ({"innovations": "9"}, "k1-0"),
        "sw-fgo(window=9)": ({"window": "9"}, "k2-0"),
        "theirs(window=9)": ({"window": "9"}, "k3-0"),
        "rae": ({}, "k4-0"),
    }
    store.write(path, Result("bay-v1", 0, "rae(innovations=9)", {"innovations": 9}, False, "ok", "", {}, key="new-0"))
    store.select(path, {"bay-v1": ("r", {"rae(innovations=9)": "new"})})  # a campaign of today in the same folder
    assert {r.key for r in store.load(path)} == {"k0-0", "new-0", "k2-0", "k3-0", "k4-0"}
    merged = gather(tmp_path / "merged", [path])
    assert {r.estimator for r in store.load(merged)} == set(found)


def test_series_stay_on_disk_until_they_are_looked_at(folder: Path):
    found = store.load(folder)
    assert all(isinstance(r.series, StoredSeries) for r in found)
    for k, r in enumerate(found):
        assert set(r.series) == {"time", "grid"}
        np.testing.assert_array_equal(r.series["grid"], np.full((2, 3), k))
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(r.series))["time"], np.arange(4))
    assert dict(store.load(folder, series=False)[0].series) == {}


def spoil_series(folder: Path) -> Path:
    """Flip two bytes in the last column of the series of the first file; scores and keys stay whole."""
    import pyarrow.parquet as pq

    path = next(p for p in sorted(folder.rglob("*.parquet")) if p.parent.name in ("compacted", "results"))
    group = pq.ParquetFile(path).metadata.row_group(0)
    columns = [group.column(k) for k in range(group.num_columns)]
    column = max((c for c in columns if c.path_in_schema.startswith("series.")), key=lambda c: c.data_page_offset)
    start = min(filter(None, (column.dictionary_page_offset, column.data_page_offset)))
    content = bytearray(path.read_bytes())
    for k in (1, 2):
        content[start + column.total_compressed_size - k] ^= 0xFF
    path.write_bytes(bytes(content))
    return path


def test_damaged_series_are_named_and_set_aside_and_the_others_are_read(folder: Path):
    path = spoil_series(folder)
    found = store.load(folder)
    assert [r.scores["a"] for r in found] == [0.0, 1.0, 2.0, 3.0, 4.0]  # they are whole
    with pytest.warns(StoreWarning) as caught:
        read = {id(series): held for series, held in read_ahead([r.series for r in found])}
    assert all(str(path) in str(w.message) for w in caught)
    assert "the charts lack its runs; 'simnav campaign' computes them again" in str(caught[-1].message)
    lost = [r.seed for r in found if not read[id(r.series)]]
    assert lost == ([0, 1, 2, 3, 4] if path.parent.name == "compacted" else [0])
    assert path.with_name(f"{path.name}.broken").exists()
    with pytest.raises(LostSeriesError, match="cannot be read any more"):
        found[0].series["time"]
    assert {f"k-{seed}" for seed in lost}.isdisjoint(store.keys(folder))  # a campaign computes them again


def test_series_that_are_looked_at_alone_name_their_damaged_file(folder: Path):
    path = spoil_series(folder)
    first = store.load(folder)[0]
    with (
        pytest.raises(LostSeriesError, match=f"{path.name} was damaged and is set aside"),
        pytest.warns(StoreWarning, match="set aside"),
    ):
        first.series["time"]


def test_a_lack_of_memory_sets_no_file_aside(folder: Path, monkeypatch: pytest.MonkeyPatch):
    first = store.load(folder)[0]

    def no_memory(*_: object, **__: object) -> None:
        raise pa.ArrowMemoryError("malloc of size 1 failed")

    for name in ("read_row_group", "read_row_groups"):
        monkeypatch.setattr(pq.ParquetFile, name, no_memory)
    for read in (lambda: store.load(folder), lambda: StoredSeries(first.series.path, 0, 0)["time"]):
        with pytest.raises(StoreError, match="cannot be read: there is not enough memory"):
            read()
    monkeypatch.undo()
    assert len(store.load(folder)) == 5
    assert not list(folder.rglob("*.broken"))


def test_what_is_damaged_is_not_merged(folder: Path, tmp_path: Path):
    path = spoil_series(folder)
    with pytest.warns(StoreWarning, match=f"{path.name} is not a whole file of results, set aside"):
        out = gather(tmp_path / "out", [folder])
    assert len(store.load(out)) == (0 if path.parent.name == "compacted" else 4)
    assert path.exists()
