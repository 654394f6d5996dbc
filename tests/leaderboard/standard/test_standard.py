"""The standard result: run in parts, packed, published, and found to be out of date; with a small profile."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from simnav.leaderboard import publishing
from simnav.leaderboard.campaign import resolution
from simnav.leaderboard.campaign.fingerprint import estimator_source
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.packing import write_packed
from simnav.leaderboard.results.provenance import Provenance
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site.content import SiteFacts
from simnav.leaderboard.standard import carrying, currency, history, readme
from simnav.leaderboard.standard.currency import outdated
from simnav.leaderboard.standard.editions import pages_of

PROFILE = """
title = "small"
[[part]]
scenarios = ["clean-voyages"]
estimators = ["gnss-only", "dead-reckoning"]
runs = 2
"""

README = f"# A board\n\n{readme.BEGIN}\nold\n{readme.END}\n\nThe end.\n"


@pytest.fixture(scope="module", autouse=True)
def _unconfined() -> Iterator[None]:
    """The rows are simnav's own; a process that confines them takes a second to start for each folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SIMNAV_CONFINEMENT", "none")
        yield


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A standard result of a small profile, published once."""
    folder = tmp_path_factory.mktemp("standard")
    (folder / "small.toml").write_text(PROFILE)
    (folder / "README.md").write_text(README)
    done = run(folder, folder / "work")
    assert (done.summary.computed, done.summary.left) == (4, 0)
    publish(folder, folder / "work")
    return folder


def run(home: Path, work: Path, **options: object):
    return publishing.run_standard(profile=home / "small.toml", results=work, shipped=home / "shipped", workers=1,
                                   **options)  # fmt: skip


def publish(home: Path, work: Path, **options: object):
    return publishing.publish_standard(profile=home / "small.toml", results=work, shipped=home / "shipped",
                                       history=home / "history.csv", readme=home / "README.md", **options)  # fmt: skip


def test_what_is_published_is_small_complete_and_current(home: Path) -> None:
    shipped = home / "shipped"
    parts = sorted(p.name for p in (shipped / "compacted").iterdir())
    assert parts == ["part-dead-reckoning.parquet", "part-gnss-only.parquet"]
    packed, worked = store.load(shipped), store.load(home / "work")
    assert [(r.key, r.scores.keys()) for r in packed] == [(r.key, r.scores.keys()) for r in worked]
    for a, b in zip(packed, worked, strict=True):  # in single precision
        assert np.array_equal([*a.scores.values()], np.float32([*b.scores.values()]), equal_nan=True)
    assert {(r.seed, bool(r.draws)) for r in packed} == {(0, True), (0, False), (1, True), (1, False)}
    assert [r.provenance for r in packed] == [r.provenance for r in worked]
    assert all(r.series for r in worked)
    assert not any(r.series for r in packed)
    assert not publishing.check_standard(shipped)
    done = CliRunner().invoke(app, ["standard", "check", "--results", str(shipped)])
    assert (done.exit_code, done.stdout.strip()) == (0, "the standard result is what the code of today gives")


def test_the_readme_has_its_tables_and_the_rest_of_it_stays(home: Path) -> None:
    results = store.load(home / "shipped", series=False)
    text = (home / "README.md").read_text()
    assert text.startswith("# A board\n")
    assert text.endswith("The end.\n")
    assert readme.marked(home / "README.md") == readme.tables(rank(results), results)
    assert f"({readme.PICTURE})" in text
    assert (home / readme.PICTURE).stat().st_size > 5000
    assert "| Generalisation | 1 | 2 | 2 | not enough data | " in text
    assert "| `dead-reckoning` |" in text
    with pytest.raises(RequestError, match=r"lacks the marks of the standard result"):
        readme.replaced(home / "small.toml", "")


def test_a_change_of_one_row_runs_that_row_only(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def edited(cls: type) -> str:
        return ("x" if cls.name == "gnss-only" else "") + estimator_source(cls)

    for module in (currency, resolution):
        monkeypatch.setattr(module, "estimator_source", edited)
    found = publishing.check_standard(home / "shipped")
    assert (found.rows, found.scenarios, found.scores, found.gone) == (("gnss-only",), (), (), ())
    done = CliRunner().invoke(app, ["standard", "check", "--results", str(home / "shipped")])
    assert done.exit_code == 1
    assert "these rows have changed: run gnss-only on all scenarios" in done.stdout
    with pytest.raises(RequestError, match="out of date: these rows have changed: run gnss-only"):
        publish(home, home / "shipped")
    before = {p.name: p.read_bytes() for p in (home / "shipped" / "compacted").iterdir()}
    stopped = run(home, tmp_path / "work", minutes=0.0)
    assert (stopped.summary.skipped, stopped.summary.computed, stopped.summary.left) == (2, 0, 2)
    with pytest.raises(RequestError, match=r"2 runs of the profile small are missing, such as of gnss-only on"):
        publish(home, tmp_path / "work")
    for name in ("small.toml", "README.md"):
        (tmp_path / name).write_text((home / name).read_text())
    early = publish(tmp_path, tmp_path / "work", preliminary=True)
    assert early.edition == 0
    assert not (tmp_path / "history.csv").exists()
    assert readme.marked(tmp_path / "README.md").startswith("**Preliminary: 2 of 4 results.** 2 runs of")
    done = run(home, tmp_path / "work")
    assert (done.summary.skipped, done.summary.computed, done.summary.left) == (2, 2, 0)
    made = publish(home, tmp_path / "work")
    assert made.edition == 2  # the version of a row is another one
    after = {p.name: p.read_bytes() for p in (home / "shipped" / "compacted").iterdir()}
    assert after["part-dead-reckoning.parquet"] == before["part-dead-reckoning.parquet"]
    assert after["part-gnss-only.parquet"] != before["part-gnss-only.parquet"]
    assert publish(home, tmp_path / "work").edition == 2  # nothing new
    lines = history.read(home / "history.csv")
    codes = [{line.row: line.code for line in lines if line.edition == n} for n in (1, 2)]
    assert codes[0]["gnss-only"] != codes[1]["gnss-only"]
    assert codes[0]["dead-reckoning"] == codes[1]["dead-reckoning"]


@pytest.fixture
def copied(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the standard result, after an edit of one row."""

    def edited(cls: type) -> str:
        return ("tidied" if cls.name == "gnss-only" else "") + estimator_source(cls)

    for module in (currency, resolution):
        monkeypatch.setattr(module, "estimator_source", edited)
    monkeypatch.setattr(carrying, "here", lambda: Provenance(commit="0123456789abcdef", dirty=False))
    shutil.copytree(home / "shipped", tmp_path / "shipped")
    for name in ("small.toml", "README.md", "history.csv"):
        shutil.copy(home / name, tmp_path / name)
    return tmp_path


def test_results_are_carried_over_to_code_that_gives_the_same_numbers(home: Path, copied: Path) -> None:
    before = store.load(home / "shipped", series=False)
    arguments = ["standard", "carry", "--shipped", str(copied / "shipped"), "--record", str(copied / "carried.csv")]
    done = CliRunner().invoke(app, [*arguments, "--workers", "1"])
    assert done.exit_code == 0, done.output
    assert "(2 carried over, 1 runs were repeated)" in done.stdout
    assert not publishing.check_standard(copied / "shipped")
    after = store.load(copied / "shipped", series=False)
    assert {r.key for r in after} & {r.key for r in before} == {r.key for r in before if r.estimator != "gnss-only"}
    kept = [f.name for f in fields(Result) if f.name not in ("key", "scores", "series")]
    assert [[getattr(r, n) for n in kept] for r in after] == [[getattr(r, n) for n in kept] for r in before]
    for a, b in zip(after, before, strict=True):
        np.testing.assert_array_equal([*a.scores.values()], [*b.scores.values()])
    last = max(line.edition for line in history.read(copied / "history.csv"))
    assert publish(copied, copied / "shipped").edition == last  # nothing new
    header, *lines = (copied / "carried.csv").read_text().splitlines()
    assert header == "date,commit,rows,results,repeated"
    assert [line.partition(",")[2] for line in lines] == ["0123456789ab,1,2,1"]
    again = publishing.carry_standard(shipped=copied / "shipped", record=copied / "carried.csv", workers=1)
    assert (again.rows, again.repeated) == (0, 0)


def test_results_that_come_out_differently_are_not_carried_over(
    home: Path, copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = store.load(copied / "shipped", series=False)
    wrong = next(r for r in results if r.estimator == "gnss-only" and r.seed == 1)
    others = {k: v * (1.0 + 1e-6) if k == "horizontal_rmse" else v for k, v in wrong.scores.items()}
    write_packed([replace(r, scores=others) if r is wrong else r for r in results], copied / "shipped")
    found = publishing.carry_standard(runs=5, shipped=copied / "shipped", record=copied / "carried.csv", workers=1)
    assert (found.rows, found.results, found.repeated) == (0, 0, 2)
    (text,) = found.different
    assert text.startswith(f"gnss-only on {wrong.scenario}, run 1: horizontal_rmse ")
    assert publishing.check_standard(copied / "shipped").rows == ("gnss-only",)
    assert not (copied / "carried.csv").exists()
    write_packed([replace(r, scenario_digest="another") for r in results], copied / "shipped")
    found = publishing.carry_standard(shipped=copied / "shipped", record=copied / "carried.csv", workers=1)
    assert found.left == (f"gnss-only on {wrong.scenario}: the scenario itself has changed",)
    assert found.repeated == 0
    monkeypatch.setattr(carrying, "here", lambda: Provenance(commit="0123", dirty=True))
    with pytest.raises(RequestError, match="the code differs from its commit"):
        publishing.carry_standard(shipped=copied / "shipped", record=copied / "carried.csv")
    with pytest.raises(RequestError, match="runs = 0"):
        publishing.carry_standard(runs=0, shipped=copied / "shipped", record=copied / "carried.csv")


def test_what_the_profile_does_not_name_is_left_out_when_it_is_out_of_date(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "small.toml").write_text(PROFILE.replace('"gnss-only", ', ""))
    (tmp_path / "README.md").write_text(README)
    made = publish(tmp_path, home / "work")
    assert {r.estimator for r in made.results} == {"dead-reckoning", "gnss-only"}  # another row is welcome
    assert not any("left out" in text for text in made.remarks)

    def edited(cls: type) -> str:
        return ("x" if cls.name == "gnss-only" else "") + estimator_source(cls)

    monkeypatch.setattr(currency, "estimator_source", edited)
    made = publish(tmp_path, home / "work")
    assert {r.estimator for r in made.results} == {r.estimator for r in store.load(made.folder)} == {"dead-reckoning"}
    assert "gnss-only on clean-voyages-v1 is left out: it is out of date" in made.remarks[0]
    assert not publishing.check_standard(made.folder)


def test_a_change_of_simulator_scores_or_benchmark_is_said(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = home / "shipped"
    with monkeypatch.context() as patch:
        patch.setattr(currency, "simulator_version", lambda: "0.1+other")
        assert outdated(folder).scenarios == ("clean-voyages-v1",)
    with monkeypatch.context() as patch:
        (module, *_) = json.loads(currency.scoring_code())
        patch.setattr(currency, "scoring_code", lambda: json.dumps({module: "other"}))
        assert module in outdated(folder).scores
        assert "run everything again" in outdated(folder).sentences()[0]
    with monkeypatch.context() as patch:
        patch.setattr(currency, "BENCHMARK", "simnav-bench 9.9")
        assert outdated(folder).benchmark
    with monkeypatch.context() as patch:  # of logs that are not on this machine nothing can be said
        patch.setattr(currency, "simulator_version", lambda: "0.1+other")
        patch.setattr(currency, "has_recordings", lambda scenario: False)
        assert not outdated(folder)
    with pytest.raises(RequestError, match="'simnav standard run' makes one"):
        publishing.check_standard(tmp_path)


def test_an_edition_keeps_its_page_with_csv_and_latex(home: Path, tmp_path: Path) -> None:
    lines = [line for line in history.read(home / "history.csv") if line.edition == 1]
    (page,) = pages_of(lines)
    page.install(tmp_path, SiteFacts("0.1.0", "today", total=4))
    text = (tmp_path / "edition-1.html").read_text()
    assert "simnav-bench 1.0, edition 1" in text
    assert "@software{simnav-bench-1.0-edition-1" in text
    assert "gnss-only" in text
    for name in re.findall(r'href="(edition-1/[^"]+)"', text):
        assert (tmp_path / name).stat().st_size > 100
    (table,) = (tmp_path / "edition-1").glob("*.tex")
    assert table.read_text().count(r"\\") == 1 + len(lines)
    assert [p.number for p in pages_of(history.read(home / "history.csv"))][-1] == 1


def test_a_damaged_history_is_named(tmp_path: Path) -> None:
    (tmp_path / "history.csv").write_text("edition,row\n1,ekf\n")
    with pytest.raises(RequestError, match="the first line should be edition,date"):
        history.read(tmp_path / "history.csv")
    (tmp_path / "history.csv").write_text(",".join(f.name for f in fields(history.Line)) + "\none,two\n")
    with pytest.raises(RequestError, match="line 2: 2 values where 13 are wanted"):
        history.read(tmp_path / "history.csv")
