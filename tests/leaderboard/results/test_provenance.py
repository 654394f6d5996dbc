"""Provenance: what it says, where it is kept, and that versions of the benchmark are never mixed."""

from __future__ import annotations

import itertools
import json
import subprocess
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from simnav.leaderboard.results import folder as store_folder
from simnav.leaderboard.results import formats, provenance, store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.export import Document
from simnav.leaderboard.results.provenance import BENCHMARK, Provenance, benchmark_of, distinct, here
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.results.store import StoreError, StoreWarning

MADE = Provenance(BENCHMARK, "c0ffee", False, "0.1.0", "3.11.7", "2.0", "0.60", "4.3", "Linux", "A processor", 2,
                  "namespaces", "2026-11-22")  # fmt: skip


def result(seed: int, made: Provenance = MADE) -> Result:
    return Result("bay-v1", seed, "ekf", {}, False, "ok", "", {"horizontal_rmse": 1.0}, key=f"v-{seed}", recording="r",
                  scenario_digest="5ce", estimator_digest="e5", provenance=made)  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = store.create(tmp_path / "results")
    store.select(path, {"bay-v1": ("r", {"ekf": "v"})})
    return path


def test_this_process_is_described():
    made = here("a wall")
    assert (made.benchmark, made.confinement) == (BENCHMARK, "a wall")
    assert all((made.simnav, made.python, made.numpy, made.numba, made.gtsam, made.system, made.date))
    assert made.cores >= 1
    assert here("a wall").id == made.id != here("").id


def test_a_checkout_is_named_by_its_commit_and_whether_it_was_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A checkout in a folder of its own, as if this process ran its code."""
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "leaderboard" / "results" / "provenance.py"))
    walls = (f"wall {k}" for k in itertools.count())  # what is known of one is not looked up again

    def checkout() -> tuple[str, bool | None]:
        made = here(next(walls))
        return made.commit, made.dirty

    def git(*words: str) -> str:
        command = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@example.org", *words]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    assert checkout() == ("", None)
    git("init", "-q")
    published = ("docs/page.md", "README.md", "leaderboard/standard/history.csv", "leaderboard/standard/results/a.json")
    code = ("simnav/world/world.py", "estimators/rows/ekf.py", "leaderboard/campaign/runs.py", "pyproject.toml")
    for name in (*published, *code):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("a = 1\n")
    git("add", ".")
    git("commit", "-qm", "first")
    assert checkout() == (git("rev-parse", "HEAD"), False)
    (tmp_path / "notes.txt").write_text("no part of it")
    for name in published:
        (tmp_path / name).write_text("a = 2\n")
    assert checkout()[1] is False  # what decides no result
    for name in code:
        (tmp_path / name).write_text("a = 2\n")
        assert checkout()[1] is True
        git("checkout", "-q", name)


def test_a_folder_keeps_each_provenance_once(folder: Path):
    other = replace(MADE, cpu="Another processor")
    for seed, made in enumerate((MADE, MADE, other)):
        store.write(folder, result(seed, made))
    store.compact(folder)
    assert sorted(p.stem for p in (folder / "provenance").iterdir()) == sorted([MADE.id, other.id])
    assert [r.provenance for r in store.load(folder)] == [MADE, MADE, other]
    store.rescore(folder, {"v-2": {"horizontal_rmse": 2.0}}, "{}")
    assert [r.provenance for r in store.load(folder)] == [MADE, MADE, other]


def test_a_damaged_provenance_is_set_aside_and_its_id_stays(folder: Path):
    store.write(folder, result(0))
    file = folder / "provenance" / f"{MADE.id}.json"
    file.write_text(file.read_text().replace("A processor", "A better one"))
    with pytest.warns(StoreWarning, match="the id should be"):
        (found,) = store.load(folder)
    assert (found.provenance.id, found.provenance.cpu) == (MADE.id, "")
    assert not file.exists()


def test_every_export_says_where_a_row_comes_from(tmp_path: Path):
    document = Document([result(0), result(1, replace(MADE, dirty=True))])
    for name in ("json", "parquet"):
        formats.write("results", name, document, tmp_path / f"r.{name}")
    rows = pq.read_table(tmp_path / "r.parquet").to_pylist()
    assert [r["dirty"] for r in rows] == [False, True]
    assert [(r["commit"], r["cores"], r["scenario_digest"], r["estimator_digest"]) for r in rows] == 2 * [
        ("c0ffee", 2, "5ce", "e5")
    ]
    assert (rows[0]["benchmark"], rows[0]["cpu"], rows[0]["provenance"]) == (BENCHMARK, "A processor", MADE.id)
    read = json.loads((tmp_path / "r.json").read_text())
    assert read["benchmark"] == BENCHMARK
    assert {p["id"] for p in read["provenance"]} == {r["provenance"] for r in read["results"]}


def test_versions_of_the_benchmark_are_not_mixed(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    older = replace(MADE, benchmark="simnav-bench 0.9")
    with pytest.raises(RequestError, match=r"simnav-bench 0\.9 and simnav-bench 1\.0.*folder of its own"):
        benchmark_of([MADE, older])
    assert benchmark_of([MADE, Provenance(identity="lost")]) == BENCHMARK
    with pytest.raises(RequestError, match="must not be mixed"):
        formats.write("results", "json", Document([result(0), result(1, older)]), tmp_path / "r.json")
    monkeypatch.setattr(store_folder, "BENCHMARK", "simnav-bench 2.0")
    with pytest.raises(StoreError, match=r"belong to simnav-bench 1\.0.*runs simnav-bench 2\.0"):
        store.create(folder)
    assert store.load(folder) == []  # reading stays allowed


def test_results_of_no_known_origin():
    assert Provenance().id == ""
    assert distinct([Provenance(), MADE, MADE]) == [MADE]
