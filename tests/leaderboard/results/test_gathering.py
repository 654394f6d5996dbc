"""Results of several folders in one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from simnav.leaderboard.results import store
from simnav.leaderboard.results.gathering import gather
from simnav.leaderboard.results.provenance import BENCHMARK, Provenance
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.store import StoreError

MADE = Provenance(benchmark=BENCHMARK, cpu="one", date="2026-11-22")


def part(path: Path, seeds: range, *, recording: str = "r", variant: str = "v", cpu: str = "one") -> Path:
    folder = store.create(path)
    store.select(folder, {"bay-v1": (recording, {"ekf": variant})})
    for seed in seeds:
        store.write(
            folder,
            Result(
                "bay-v1",
                seed,
                "ekf",
                {},
                False,
                "ok",
                "",
                {"horizontal_rmse": 1.0 + seed},
                key=f"{variant}-{seed}",
                recording=recording,
                provenance=replace(MADE, cpu=cpu),
            ),
        )
        if seed % 2:
            store.compact(folder)
    return folder


def table(folder: Path) -> list[tuple[int, float, str]]:
    return [(r.seed, r.scores["horizontal_rmse"], r.provenance.cpu) for r in store.load(folder)]


def test_parts_become_one_and_a_run_counts_once(tmp_path: Path):
    a, b = part(tmp_path / "a", range(4)), part(tmp_path / "b", range(3, 6), cpu="two")
    (a / "trials").mkdir()
    (a / "trials" / "v-0.parquet").write_bytes(b"a trial")
    before = table(a)
    out = gather(tmp_path / "out", [a, b])
    assert [row[0] for row in table(out)] == [0, 1, 2, 3, 4, 5]
    assert {row[2] for row in table(out)} == {"one", "two"}
    assert (out / "trials" / "v-0.parquet").read_bytes() == b"a trial"
    assert table(a) == before
    assert gather(out, [b]) == out  # again, into what is there
    assert len(table(out)) == 6


def test_what_differs_is_not_mixed(tmp_path: Path):
    a = part(tmp_path / "a", range(2))
    for name, changes, message in (
        ("b", {"recording": "other"}, r"bay-v1, or the simulator, differs between .*a and .*b"),
        ("c", {"variant": "w"}, r"ekf on bay-v1 differs between .*a and .*c"),
    ):
        other = part(tmp_path / name, range(2, 4), **changes)
        with pytest.raises(StoreError, match=message):
            gather(tmp_path / "out", [a, other])
    assert not (tmp_path / "out").exists()
    marker = a / "simnav-results.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"benchmark": "simnav-bench 0.9"}))
    with pytest.raises(StoreError, match=r"belong to simnav-bench 0\.9, not to simnav-bench 1\.0"):
        gather(tmp_path / "out", [a])
    with pytest.raises(StoreError, match="there are no results in"):
        gather(tmp_path / "out", [tmp_path / "nowhere"])


def test_what_came_with_simnav_goes_together_with_a_local_row_of_the_same_version_of_the_simulator(tmp_path: Path):
    shipped = part(tmp_path / "shipped", range(2), recording="simulator-1")
    local = store.create(tmp_path / "local")
    store.select(local, {"bay-v1": ("digest", {"mine": "m"})})
    (example, _) = store.load(shipped)
    store.write(local, replace(example, estimator="mine", key="m-0", recording="digest"))
    for k, folders in enumerate(([shipped, local], [local, shipped])):
        out = gather(tmp_path / f"out{k}", folders)
        assert sorted((r.estimator, r.seed) for r in store.load(out)) == [("ekf", 0), ("ekf", 1), ("mine", 0)]
        assert json.loads((out / "simnav-results.json").read_text())["current"]["bay-v1"]["recording"] == "simulator-1"
    own = part(tmp_path / "own", range(2), recording="digest", variant="w")  # the same row, of edited code perhaps
    with pytest.raises(StoreError, match=r"ekf on bay-v1 differs between"):
        gather(tmp_path / "out", [shipped, own])
    store.write(local, replace(example, estimator="mine", key="m-1", seed=1, recording="digest", simulator_version=2))
    with pytest.raises(StoreError, match="or the simulator, differs"):
        gather(tmp_path / "out", [shipped, local])
