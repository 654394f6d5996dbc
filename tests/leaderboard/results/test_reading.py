"""What is read of a folder of results: the scores that are asked for, and series when they are looked at."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from simnav.leaderboard.results import store
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.stored_series import StoredSeries


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


def test_series_stay_on_disk_until_they_are_looked_at(folder: Path):
    found = store.load(folder)
    assert all(isinstance(r.series, StoredSeries) for r in found)
    for k, r in enumerate(found):
        assert set(r.series) == {"time", "grid"}
        np.testing.assert_array_equal(r.series["grid"], np.full((2, 3), k))
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(r.series))["time"], np.arange(4))
    assert dict(store.load(folder, series=False)[0].series) == {}
