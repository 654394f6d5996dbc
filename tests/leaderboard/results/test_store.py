"""The result store: nothing is lost, nothing counts twice, whatever happens to the disk or the process."""

from __future__ import annotations

import dataclasses
import errno
import io
import json
import os
import shutil
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simnav.leaderboard.results import folder as store_folder
from simnav.leaderboard.results import store
from simnav.leaderboard.results.store import Result, StoreError, StoreWarning


def result(seed: int, label: str = "ekf", scenario: str = "bay-v1", recording: str = "r1", **changes: Any) -> Result:
    made = Result(
        scenario=scenario,
        seed=seed,
        estimator=label,
        parameters={"gate": 3.0, "name": "x"},
        reference=False,
        status="ok",
        reason="",
        scores={"horizontal_rmse": 1.0 + seed, "nees_position": float("nan"), "drift": float("inf")},
        series={"time": np.arange(5.0 + seed % 7), "track": np.arange(6.0).reshape(3, 2), "none": np.zeros(0)},
        note="run A",
        seconds=0.25,
        peak_memory=12345,
        key=f"{label}{recording}-{seed}",
        recording=recording,
        simnav="0.1.0",
        time_limit=60.0,
        memory_limit=1 << 30,
        scoring="{}",
    )
    return dataclasses.replace(made, **changes)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder in which the estimators ekf and dr are current on bay-v1."""
    path = store.create(tmp_path / "results")
    store.select(path, {"bay-v1": ("r1", {"ekf": "ekfr1", "dr": "drr1"})})
    return path


def table(folder: Path) -> list[tuple[str, str, int, float]]:
    return [(r.scenario, r.estimator, r.seed, r.scores["horizontal_rmse"]) for r in store.load(folder)]


def loose(folder: Path) -> list[Path]:
    return sorted((folder / "results").glob("*.parquet"))


def same(a: Result, b: Result) -> None:
    for item in dataclasses.fields(Result):
        x, y = getattr(a, item.name), getattr(b, item.name)
        if item.name == "series":
            assert list(x) == list(y)
            for name in x:
                assert x[name].shape == y[name].shape
                np.testing.assert_array_equal(np.asarray(x[name], dtype=np.float32), y[name])
        elif item.name == "scores":
            np.testing.assert_equal(dict(x), dict(y))
        else:
            assert x == y, item.name


def test_what_is_written_is_read(folder: Path) -> None:
    written = [result(s, label) for label in ("dr", "ekf") for s in (0, 1, 2**62)]
    for r in reversed(written):
        store.write(folder, r)
    for _ in range(2):  # loose, then compacted
        loaded = store.load(folder)
        assert len(loaded) == len(written)
        for a, b in zip(written, loaded, strict=True):
            same(a, b)
        assert store.keys(folder) == {r.key: ("ok", 60.0, 1 << 30, "{}", "") for r in written}
        store.compact(folder)
        assert not loose(folder)
    assert all(not r.series and r.scores for r in store.load(folder, series=False))


def test_more_results_than_are_held_in_memory(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "BATCH", 16)
    written = [result(s) for s in range(store.BATCH + 10)]
    for r in written:
        store.write(folder, r)
    store.compact(folder)
    for a, b in zip(written, store.load(folder), strict=True):
        same(a, b)


def test_compaction_in_rounds_merges_parts(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MOST_PARTS", 3)
    for seed in range(6):
        store.write(folder, result(seed))
        store.write(folder, result(0))  # again what is compacted already
        store.compact(folder)
        assert [r.seed for r in store.load(folder)] == list(range(seed + 1))
        assert len(list((folder / "compacted").iterdir())) <= 3
    store.compact(folder)
    assert [r.seed for r in store.load(folder)] == list(range(6))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_compaction_killed_at_every_step(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed for good (no clean-up runs) before its n-th touch of the disk, for every n."""
    monkeypatch.setattr(store, "MOST_PARTS", 2)
    for part in range(2):
        for seed in range(3):
            store.write(folder, result(3 * part + seed))
        store.compact(folder)
    for seed in range(6, 9):
        store.write(folder, result(seed))
    wanted = table(folder)

    def killed_at(step: int, copy: Path) -> bool:
        child = os.fork()
        if child == 0:
            left = [step]

            def counted(function: Callable[..., Any]) -> Callable[..., Any]:
                def call(*args: Any, **kwargs: Any) -> Any:
                    left[0] -= 1
                    if left[0] < 0:
                        os._exit(9)
                    return function(*args, **kwargs)

                return call

            os.fsync, os.replace = counted(os.fsync), counted(os.replace)
            Path.unlink = counted(Path.unlink)  # type: ignore[method-assign]
            store.compact(copy)
            os._exit(0)
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9

    step = 0
    while True:
        copy = tmp_path / f"copy{step}"
        shutil.copytree(folder, copy)
        killed = killed_at(step, copy)
        assert table(copy) == wanted
        store.compact(copy)  # and again, to its end
        assert table(copy) == wanted
        assert not loose(copy)
        if not killed:
            break
        step += 1
    assert step >= 8  # two syncs and a rename, then a file each


def test_a_reader_beside_a_compaction_sees_each_result_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The compaction falls between the listing of the folder and the reading of its files."""
    for seed in range(3):
        store.write(folder, result(seed))
    original, calls = store_folder.files_of, []

    def files(path: Path) -> list[Path]:
        found = original(path)
        if not calls:
            calls.append(1)
            store.compact(path)
        return found

    monkeypatch.setattr(store_folder, "files_of", files)
    assert [r.seed for r in store.load(folder)] == [0, 1, 2]


@pytest.mark.parametrize("damage", ["truncated", "empty", "flipped", "foreign", "other-parquet"])
@pytest.mark.parametrize("compacted", [False, True])
def test_damaged_files_are_set_aside(folder: Path, damage: str, compacted: bool) -> None:
    for seed in range(3):
        store.write(folder, result(seed))
        if compacted:
            store.compact(folder)
    files = sorted((folder / "compacted").glob("*")) if compacted else loose(folder)
    victim, data = files[1], files[1].read_bytes()
    if damage == "truncated":
        victim.write_bytes(data[: len(data) // 2])
    elif damage == "empty":
        victim.write_bytes(b"")
    elif damage == "flipped":
        where = data.index(b"bay-v1")
        victim.write_bytes(data[:where] + b"bax-v1" + data[where + 6 :])
    elif damage == "foreign":
        victim.write_text("shopping list")
    else:
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.table({"key": ["a"]}), victim)
    noticed = store.load if compacted and damage == "flipped" else store.keys  # which reads the keys of parts only
    with pytest.warns(StoreWarning, match=victim.name):
        noticed(folder)
    there = store.keys(folder)
    assert len(there) == 2
    aside = victim.with_name(victim.name + ".broken")
    assert aside.exists()
    assert not victim.exists()
    assert len(store.load(folder)) == 2  # without another warning
    for seed in range(3):  # computed again
        if result(seed).key not in there:
            store.write(folder, result(seed))
    store.compact(folder)
    assert [r.seed for r in store.load(folder)] == [0, 1, 2]


def test_an_interrupted_write_leaves_nothing_that_counts(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store.write(folder, result(0))

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupt)
        with pytest.raises(KeyboardInterrupt):
            store.write(folder, result(1))
    assert [p.name for p in (folder / "results").iterdir()] == [loose(folder)[0].name]
    left = folder / "results" / ".x.parquet.1.tmp"  # of a process that was killed
    left.write_text("half")
    assert [r.seed for r in store.load(folder)] == [0]
    os.utime(left, (time.time() - 7200.0,) * 2)
    store.keys(folder)
    assert not left.exists()


class Full(io.FileIO):
    """A file on a full disk."""

    def write(self, data: Any) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("where", ["write", "fsync", "replace"])
@pytest.mark.parametrize("what", ["write", "compact", "create", "select"])
def test_a_full_disk_is_one_sentence_and_loses_nothing(
    folder: Path, tmp_path: Path, where: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.write(folder, result(0))
    store.write(folder, result(1))
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    action: Callable[[], Any] = {
        "write": lambda: store.write(folder, result(2)),
        "compact": lambda: store.compact(folder),
        "create": lambda: store.create(tmp_path / "new"),
        "select": lambda: store.select(folder, {"bay-v2": ("r2", {})}),
    }[what]
    with monkeypatch.context() as patch:
        if where == "write":

            def opened(file: Any, mode: str = "r") -> Any:
                return Full(file, mode) if "w" in mode else open(file, mode)

            patch.setattr(store_folder, "open", opened, raising=False)
        else:
            patch.setattr(os, where, full)
        with pytest.raises(StoreError, match="the disk is full") as caught:
            action()
    assert "\n" not in str(caught.value)
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before
    action()
    store.create(tmp_path / "new")


def test_a_folder_of_another_format_is_left_alone(folder: Path) -> None:
    store.write(folder, result(0))
    marker = folder / "simnav-results.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"format": 99, "simnav": "9.0"}))
    before = {p: (p.stat().st_mtime_ns, p.read_bytes()) for p in folder.rglob("*") if p.is_file()}
    for action in (store.create, store.load, store.compact, store.keys, lambda f: store.select(f, {})):
        with pytest.raises(StoreError, match=r"format 99 \(simnav 9.0\), this version reads format 5"):
            action(folder)
    assert {p: (p.stat().st_mtime_ns, p.read_bytes()) for p in folder.rglob("*") if p.is_file()} == before


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "photo.jpg").write_text("")
    for action in (store.create, store.load, store.compact):
        with pytest.raises(StoreError, match="no results of simnav"):
            action(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["photo.jpg"]
    with pytest.raises(StoreError, match="is a file"):
        store.create(tmp_path / "photo.jpg")
    with pytest.raises(StoreError, match="there are no results"):
        store.load(tmp_path / "nowhere")


def test_a_damaged_marker_costs_no_result(folder: Path) -> None:
    store.write(folder, result(0))
    (folder / "simnav-results.json").write_text('{"form')
    with pytest.warns(StoreWarning, match=r"simnav-results.json"):
        store.create(folder)
    assert list(store.keys(folder)) == ["ekfr1-0"]
    store.select(folder, {"bay-v1": ("r1", {"ekf": "ekfr1"})})
    assert len(store.load(folder)) == 1


def test_only_current_results_are_loaded(folder: Path) -> None:
    """After an edit of an estimator its old results step back, and return with the old version."""
    old = [result(s) for s in range(3)]
    new = [result(s, key=f"edited-{s}", scores={"horizontal_rmse": 9.0}) for s in range(2)]
    for r in [*old, *new, result(0, "dr")]:
        store.write(folder, r)
    assert [r.key for r in store.load(folder) if r.estimator == "ekf"] == [r.key for r in old]
    store.select(folder, {"bay-v1": ("r1", {"ekf": "edited"})})
    for _ in range(2):
        assert [r.key for r in store.load(folder) if r.estimator == "ekf"] == [r.key for r in new]
        assert len([r for r in store.load(folder) if r.estimator == "dr"]) == 1
        store.compact(folder)
    store.select(folder, {"bay-v1": ("r1", {"ekf": "ekfr1"})})
    assert [r.key for r in store.load(folder) if r.estimator == "ekf"] == [r.key for r in old]


def test_other_recordings_are_not_compared(folder: Path) -> None:
    """The scenario or the simulator changed: who was not run again is left out, and named."""
    for r in (result(0), result(0, "dr"), result(0, recording="r2")):
        store.write(folder, r)
    store.select(folder, {"bay-v1": ("r2", {"ekf": "ekfr2"})})
    with pytest.warns(StoreWarning, match="dr on bay-v1 are left out"):
        loaded = store.load(folder)
    assert [(r.estimator, r.recording) for r in loaded] == [("ekf", "r2")]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        store.select(folder, {"bay-v1": ("r1", {"ekf": "ekfr1", "dr": "drr1"})})
        assert {r.recording for r in store.load(folder)} == {"r1"}


def test_results_are_dropped_wherever_they_are(folder: Path) -> None:
    for seed in range(6):
        store.write(folder, result(seed))
        if seed == 3:
            store.compact(folder)
    store.drop(folder, {"ekfr1-1", "ekfr1-5", "unknown"})
    assert [r.seed for r in store.load(folder)] == [0, 2, 3, 4]
    store.write(folder, result(1, scores={"horizontal_rmse": 9.0}))
    store.compact(folder)
    assert [r.scores["horizontal_rmse"] for r in store.load(folder)] == [1.0, 9.0, 3.0, 4.0, 5.0]


@pytest.mark.parametrize(
    ("version", "missing", "ending"),
    [
        (1, ["time_limit", "memory_limit", "scoring"], ("ok", 0.0, 0, "", "")),
        (2, [], ("ok", 60.0, 1 << 30, "{}", "")),
    ],
)
def test_results_of_older_formats_are_read(
    folder: Path, version: int, missing: list[str], ending: tuple[Any, ...]
) -> None:
    """What they do not have is not known."""
    import pyarrow.parquet as pq

    store.write(folder, result(0))
    (path,) = loose(folder)
    since_3, since_4 = ["scenario_digest", "estimator_digest", "provenance"], ["draws"]
    since_5 = ["learned", "simulator_version", "estimator_version"]
    old = pq.read_table(path).drop_columns(missing + since_3 + since_4 + since_5)
    pq.write_table(old.replace_schema_metadata({"simnav_results": str(version)}), path)
    marker = folder / "simnav-results.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"format": version}))
    assert store.keys(folder) == {"ekfr1-0": ending}
    store.write(folder, result(1))
    store.compact(folder)
    assert [(r.seed, r.time_limit) for r in store.load(folder)] == [(0, ending[1]), (1, 60.0)]
    assert [r.provenance.id for r in store.load(folder)] == ["", ""]
    assert [r.draws for r in store.load(folder)] == [{}, {}]
    assert [(r.simulator_version, r.estimator_version) for r in store.load(folder)] == [(1, 1), (1, 1)]


def test_scores_are_replaced_wherever_they_are(folder: Path) -> None:
    for seed in range(4):
        store.write(folder, result(seed))
        if seed == 1:
            store.compact(folder)
    before = store.load(folder)
    store.rescore(folder, {"ekfr1-1": {"new": 5.0}, "ekfr1-3": {"new": 6.0}}, "code")
    after = store.load(folder)
    assert [r.scores.get("new") for r in after] == [None, 5.0, None, 6.0]
    assert [r.scoring for r in after] == ["{}", "code", "{}", "code"]
    for old, new in zip(before, after, strict=True):
        same(dataclasses.replace(old, scores={}, scoring=""), dataclasses.replace(new, scores={}, scoring=""))
