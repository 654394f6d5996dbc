"""The standard result: run in parts, packed, published, and found to be out of date; with a small profile."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from simnav.estimator import find
from simnav.leaderboard import interface, publishing
from simnav.leaderboard.campaign import campaign, resolution
from simnav.leaderboard.campaign.fingerprint import estimator_source
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.trouble_profile import profiles_of
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.packing import write_packed
from simnav.leaderboard.site.content import SiteFacts
from simnav.leaderboard.standard import history, outdated_results, readme
from simnav.leaderboard.standard.auditing import share_found
from simnav.leaderboard.standard.editions import pages_of
from simnav.leaderboard.standard.outdated_results import outdated

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
    (folder / readme.PAGE).parent.mkdir()
    (folder / readme.PAGE).write_text(README)
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
    assert {(r.recording, r.simulator_version, r.estimator_version) for r in packed} == {("simulator-1", 1, 1)}
    for a, b in zip(packed, worked, strict=True):  # in single precision
        assert np.array_equal([*a.scores.values()], np.float32([*b.scores.values()]), equal_nan=True)
    assert {(r.seed, bool(r.draws)) for r in packed} == {(0, True), (0, False), (1, True), (1, False)}
    assert [r.provenance for r in packed] == [r.provenance for r in worked]
    assert all(r.series for r in worked)
    assert not any(r.series for r in packed)
    assert not publishing.check_standard(shipped)
    done = CliRunner().invoke(app, ["standard", "check", "--results", str(shipped)])
    assert (done.exit_code, done.stdout.strip()) == (0, "the standard result has the versions of today")


def test_the_readme_and_the_page_have_their_tables_and_the_rest_of_them_stays(home: Path) -> None:
    results = store.load(home / "shipped", series=False)
    made = {"README.md": readme.first_answer(None, results), readme.PAGE: readme.tables(rank(results), results)}
    for name, wanted in made.items():
        text = (home / name).read_text()
        assert text.startswith("# A board\n")
        assert text.endswith("The end.\n")
        assert readme.marked(home / name) == wanted
    assert "| `dead-reckoning` |" in text
    assert "(figures/board.png)" in text
    assert (home / readme.PICTURE).stat().st_size > 5000
    assert "| Generalisation | 1 | 2 | 2 | not enough data | " in text
    with pytest.raises(RequestError, match=r"lacks the marks of the standard result"):
        readme.replaced(home / "small.toml", "")


def test_an_edit_changes_nothing_and_a_raised_version_runs_that_row_only(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def edited(cls: type) -> str:
        return ("x" if cls.name == "gnss-only" else "") + estimator_source(cls)

    monkeypatch.setattr(resolution, "estimator_source", edited)
    monkeypatch.setattr(campaign, "simulator_version", lambda: "0.1+other")
    assert not publishing.check_standard(home / "shipped")
    same = run(home, tmp_path / "edited")
    assert (same.summary.skipped, same.summary.computed, same.summary.left) == (4, 0, 0)
    anew = run(home, tmp_path / "edited", force=["gnss-only, gnss-only"], minutes=0.0)  # names with a comma
    assert (anew.summary.skipped, anew.summary.left) == (2, 2)
    monkeypatch.setattr(find("gnss-only"), "version", 2)
    found = publishing.check_standard(home / "shipped")
    assert (found.rows, found.scenarios, found.gone) == (("gnss-only",), (), ())
    done = CliRunner().invoke(app, ["standard", "check", "--results", str(home / "shipped")])
    assert done.exit_code == 1
    assert "these rows have another version: run gnss-only on all scenarios" in done.stdout
    with pytest.raises(RequestError, match="out of date: these rows have another version: run gnss-only"):
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
    assert readme.marked(tmp_path / "README.md").startswith("**Preliminary: 2 of 4 results.**\n")
    done = run(home, tmp_path / "work")
    assert (done.summary.skipped, done.summary.computed, done.summary.left) == (2, 2, 0)
    made = publish(home, tmp_path / "work")
    assert made.edition == 2  # the version of a row is another one
    after = {p.name: p.read_bytes() for p in (home / "shipped" / "compacted").iterdir()}
    assert after["part-dead-reckoning.parquet"] == before["part-dead-reckoning.parquet"]
    assert after["part-gnss-only.parquet"] != before["part-gnss-only.parquet"]
    assert publish(home, tmp_path / "work").edition == 2  # nothing new
    lines = history.read(home / "history.csv")
    versions = [{line.row: line.version for line in lines if line.edition == n} for n in (1, 2)]
    assert versions == [{"gnss-only": "1", "dead-reckoning": "1"}, {"gnss-only": "2", "dead-reckoning": "1"}]
    assert {r.estimator: r.estimator_version for r in store.load(home / "shipped")} == {
        "gnss-only": 2, "dead-reckoning": 1,
    }  # fmt: skip
    monkeypatch.undo()  # as it was, for the tests that follow
    run(home, home / "work")
    publish(home, home / "work")


def test_the_site_of_what_is_published_has_the_results_by_kind_of_trouble(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    built: dict[str, object] = {}
    monkeypatch.setattr("simnav.leaderboard.site.site.build", lambda *_, **options: built.update(options))
    made = publish(home, home / "work", site=tmp_path / "site")
    assert built["tracks"] is made.tracks
    assert [p.track for p in profiles_of(made.tracks)] == ["generalisation"]


def test_the_audit_repeats_a_sample_and_finds_a_wrong_score(home: Path, tmp_path: Path) -> None:
    arguments = ["standard", "audit", "--results", str(home / "shipped"), "--sample", "2"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert "(4, of which 2 were repeated)" in done.stdout
    assert (
        "if 77.6% of the results or more were wrong, such a sample would find one with a probability of 95%"
        in " ".join(done.stdout.split())
    )
    assert share_found(59) == pytest.approx(0.05, abs=1e-3)  # 0.95^59 = 0.05
    shutil.copytree(home / "shipped", tmp_path / "shipped")
    results = store.load(tmp_path / "shipped", series=False)
    write_packed([replace(r, scores={**r.scores, "horizontal_rmse": 1.001 * r.scores["horizontal_rmse"]})
                  for r in results], tmp_path / "shipped")  # fmt: skip
    found = publishing.audit_standard(sample=1, results=tmp_path / "shipped")
    assert not found.passed
    assert "horizontal_rmse" in found.verification.different[0]
    with pytest.raises(RequestError, match="sample = 0"):
        publishing.audit_standard(sample=0, results=home / "shipped")


@pytest.fixture
def old(home: Path, tmp_path: Path) -> Path:
    """A folder of results as a campaign left it before versions were declared, stopped in the middle."""
    folder = tmp_path / "old"
    made = store.create(folder)
    results = store.load(home / "work")[:3]
    local = [replace(r, key=f"{k:024x}-{r.seed}", recording="ab" * 12) for k, r in zip((1, 1, 2), results, strict=True)]
    for result in local:
        store.write(made, result)
        if result is local[0]:
            store.compact(made)
    store.select(made, {local[0].scenario: ("ab" * 12, {r.estimator: r.variant for r in local})})
    for file in [*(made / "results").glob("*.parquet"), *(made / "compacted").glob("*.parquet")]:
        table = pq.read_table(file).drop_columns(["learned", "simulator_version", "estimator_version"])
        pq.write_table(table.replace_schema_metadata({"simnav_results": "4"}), file)
    marker = made / "simnav-results.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"format": 4}))
    return folder


def test_a_folder_from_before_versions_is_published_and_continued_without_running_it_again(
    home: Path, tmp_path: Path, old: Path
) -> None:
    shutil.copy(home / "small.toml", tmp_path)
    (tmp_path / "README.md").write_text(README)
    before = store.load(old)
    series = {(r.estimator, r.seed): set(r.series) for r in before}
    made = publish(tmp_path, old, preliminary=True)
    assert len(made.results) == 3
    wanted = {(r.scenario, r.estimator, r.seed): r.key for r in store.load(home / "shipped", series=False)}
    for folder in (tmp_path / "shipped", old):
        if folder == old:
            done = run(home, old)
            assert (done.summary.skipped, done.summary.computed) == (3, 1)
        found = store.load(folder)
        assert all(r.key == wanted[r.scenario, r.estimator, r.seed] for r in found)
        assert {(r.recording, r.simulator_version, r.estimator_version) for r in found} == {("simulator-1", 1, 1)}
    kept = {(r.estimator, r.seed): r for r in store.load(old)}
    for r in before:
        same = kept[r.estimator, r.seed]
        np.testing.assert_array_equal([*same.scores.values()], [*r.scores.values()])
        assert same.scores.keys() == r.scores.keys()
        assert set(same.series) == series[r.estimator, r.seed] != set()


def test_a_local_campaign_and_what_comes_with_simnav_do_not_take_each_others_results(
    home: Path, tmp_path: Path, old: Path
) -> None:
    shutil.copytree(home / "shipped", tmp_path / "mine")
    request = {"runs": 1, "workers": 1, "oracle": False}
    with pytest.raises(RequestError, match="holds results that came with simnav, of clean-voyages-v1"):
        interface.campaign("clean-voyages", "gnss-only", output=tmp_path / "mine", **request)
    interface.campaign("clean-voyages", "gnss-only", output=tmp_path / "local", **request)
    with pytest.raises(RequestError, match="holds results of a local campaign"):
        run(home, tmp_path / "local")


def test_what_the_profile_does_not_name_is_left_out_when_it_is_out_of_date(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "small.toml").write_text(PROFILE.replace('"gnss-only", ', ""))
    (tmp_path / "README.md").write_text(README)
    made = publish(tmp_path, home / "work")
    assert {r.estimator for r in made.results} == {"dead-reckoning", "gnss-only"}  # another row is welcome
    assert not any("left out" in text for text in made.remarks)

    monkeypatch.setattr(find("gnss-only"), "version", 2)
    made = publish(tmp_path, home / "work")
    assert {r.estimator for r in made.results} == {r.estimator for r in store.load(made.folder)} == {"dead-reckoning"}
    assert "gnss-only on clean-voyages-v1 is left out: it is out of date" in made.remarks[0]
    assert not publishing.check_standard(made.folder)


def test_results_of_an_older_version_of_a_row_are_published_if_asked_for_and_named(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(home / "small.toml", tmp_path)
    (tmp_path / "README.md").write_text(README)
    monkeypatch.setattr(find("gnss-only"), "version", 2)
    with pytest.raises(RequestError, match=r"run gnss-only on all scenarios.*--preliminary publishes what is there"):
        publish(tmp_path, home / "work")
    made = publish(tmp_path, home / "work", preliminary=True)
    assert made.edition == 1
    assert "some results are of an older version: `gnss-only`" in (tmp_path / "README.md").read_text()
    monkeypatch.setattr(outdated_results, "SIMULATOR_VERSION", 2)
    with pytest.raises(RequestError, match="the simulator now has version 2"):
        publish(tmp_path, home / "work", preliminary=True)


def test_a_change_of_simulator_scenario_or_benchmark_is_said(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = home / "shipped"
    with monkeypatch.context() as patch:
        patch.setattr(outdated_results, "SIMULATOR_VERSION", 2)
        assert outdated(folder).scenarios == ("clean-voyages-v1",)
        assert "the simulator now has version 2: run clean-voyages-v1 with all rows" in outdated(folder).sentences()
    with monkeypatch.context() as patch:
        patch.setattr(outdated_results, "headers", list)
        assert outdated(folder).gone == ("clean-voyages-v1",)
    with monkeypatch.context() as patch:
        patch.setattr(outdated_results, "BENCHMARK", "simnav-bench 9.9")
        assert outdated(folder).benchmark
    with pytest.raises(RequestError, match="'simnav standard run' makes one"):
        publishing.check_standard(tmp_path)


def test_an_edition_keeps_its_page_with_csv_and_latex(home: Path, tmp_path: Path) -> None:
    (tmp_path / "older").mkdir()
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
    replace(page, latest=False).install(tmp_path / "older", SiteFacts("0.1.0", "today", total=4))
    text = (tmp_path / "older" / "edition-1.html").read_text()
    links = re.findall(r'href="(edition-1/[^"]+)"', text)
    assert links
    assert all(name.endswith(".csv") and (tmp_path / "older" / name).stat().st_size > 100 for name in links)
    assert [p.number for p in pages_of(history.read(home / "history.csv"))][-1] == 1


def test_a_damaged_history_is_named(tmp_path: Path) -> None:
    (tmp_path / "history.csv").write_text("edition,row\n1,ekf\n")
    with pytest.raises(RequestError, match="the first line should be edition,date"):
        history.read(tmp_path / "history.csv")
    (tmp_path / "history.csv").write_text(",".join(f.name for f in fields(history.Line)) + "\none,two\n")
    with pytest.raises(RequestError, match="line 2: 2 values where 13 are wanted"):
        history.read(tmp_path / "history.csv")
