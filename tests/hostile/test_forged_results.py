"""Results of others: nothing that they name is imported, and what was forged in them is found."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.comparison import too_quick
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.sampling import finds, sample_size
from simnav.leaderboard.campaign.verification import Verification, verify_results
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.standard.outdated_results import outdated
from simnav.scenario import load
from simnav.scenario.scenario import Scenario
from simnav.warmup import warmup
from tests.hostile.forging import evil_scenario, fields, forge, renamed

pytestmark = pytest.mark.skipif(os.name != "posix", reason="isolation without fork takes seconds a run")


@pytest.fixture(autouse=True)
def _unconfined(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is forged does not depend on confinement, whose process takes a second to start for each folder."""
    monkeypatch.setenv("SIMNAV_CONFINEMENT", "none")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load("harbour-multipath").model_copy(update={"duration": 20.0})


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory, scenario: Scenario) -> Path:
    """Two seeds of one row."""
    warmup(load=False)
    folder = tmp_path_factory.mktemp("honest") / "results"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SIMNAV_CONFINEMENT", "none")
        run_campaign([scenario], [EstimatorRequest("gnss-only")], range(2), folder, workers=1)
    store.compact(folder)
    return folder


@pytest.fixture
def folder(honest: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(honest, tmp_path / "results"))


def verified(folder: Path, scenario: Scenario) -> Verification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return verify_results(folder, scenarios=[scenario])


# -- code ------------------------------------------------------------------------------------------------------------


def uses(folder: Path) -> None:
    """Everything that opens a folder of results, whatever it says of it."""
    for words in (
        ["campaign", "verify", str(folder)],
        ["leaderboard", str(folder), "--output", str(folder.parent / "site")],
        ["campaign", "rescore", str(folder)],
        ["campaign", "cite", str(folder)],
        ["campaign", "merge", str(folder), "--output", str(folder.parent / "merged")],
    ):
        CliRunner().invoke(app, words)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outdated(folder)


def test_a_scenario_that_is_a_path_imports_nothing(folder: Path, tmp_path: Path) -> None:
    path, witness = evil_scenario(tmp_path / "others")
    before = set(sys.modules)
    with pytest.raises(ValueError, match=r"evil\.toml"):  # it has no instruments
        load(path)
    assert witness.exists()  # the trap works: whoever loads the file runs the code
    witness.unlink()
    for module in set(sys.modules) - before:
        del sys.modules[module]
    forge(folder, fields(scenario=str(path)))
    uses(folder)
    assert not witness.exists()
    with pytest.warns(store.SetAsideWarning, match="is no versioned id"):
        assert store.load(folder) == []


@pytest.mark.parametrize("label", ["{}", "{}:Mine", "{} x", "{}(gain=1)", "x({}", "ekf({}:Mine"])
def test_a_label_that_is_a_path_imports_nothing(folder: Path, tmp_path: Path, label: str) -> None:
    _, witness = evil_scenario(tmp_path / "others")
    forge(folder, renamed(label.format(tmp_path / "others" / "evil_plugin.py")))
    uses(folder)
    assert not witness.exists()


def test_a_parameter_that_names_a_file_is_not_opened(folder: Path, tmp_path: Path, scenario: Scenario) -> None:
    (tmp_path / "policy.npz").write_bytes(b"of somebody else")
    forge(folder, fields(parameters={"file": str(tmp_path / "policy.npz")}))
    said = verified(folder, scenario).not_here
    assert len(said) == 2
    assert "a parameter of the result names a file; give the estimator with --estimator" in said[0]


# -- forged numbers --------------------------------------------------------------------------------------------------


def test_what_is_honest_holds(folder: Path, scenario: Scenario) -> None:
    found = verified(folder, scenario)
    assert found.passed, found
    assert (found.repeated, found.same, found.finds) == (2, 2, "all 2 results were repeated")
    assert found.unconfirmed == ()


FORGERIES: dict[str, tuple[dict[str, Any], str]] = {
    "a better score": ({"score_horizontal_rmse": 0.1}, "horizontal_rmse 0.1 is stored"),
    "a consistency score": ({"score_coverage_95": 0.95}, "coverage_95 0.95 is stored"),
    "a score removed": ({"score_r95": None}, "r95 is missing"),
    "a score removed, of other code": ({"score_r95": None, "scoring": '{"x": "y"}'}, "r95 is missing"),
    "a note": ({"note": "recording 'dive 1'"}, "note \"recording 'dive 1'\" is stored"),
    "draws": ({"draws": {"duration_s": 1.0}}, "draws"),
    "a time": ({"seconds": 1e-9}, "seconds 1e-09 is stored"),
    "the times of epochs": ({"score_update_median": 1e-9}, "update_median 1e-09 s is stored"),
    "the times of a row": ({"score_update_median": 1e-9}, "of those that came out, in the median of 2"),
    "memory": ({"peak_memory": 1}, "peak_memory 1 is stored"),
    "no-recording": ({"status": "no-recording", "scores": {}}, "no-recording is stored, ok came out"),
    "unsuitable": ({"status": "unsuitable", "scores": {}}, "unsuitable is stored, ok came out"),
    "a timeout": ({"status": "timeout", "scores": {}}, "timeout is stored, ok came out"),
    "a timeout of a tiny limit": (
        {"status": "timeout", "time_limit": 1e-3, "scores": {}}, "timeout is stored, ok came out"),
    "no memory": ({"status": "out-of-memory", "scores": {}}, "out-of-memory is stored, ok came out"),
    "skipped": ({"status": "skipped", "scores": {}}, "status = 'skipped' is none of"),
    "no fault of a filter": ({"status": "diverged"}, "diverged is stored, ok came out"),
    "the version of a library": ({"made_numpy": "9.9.9"}, "numpy '9.9.9' is stored with 2 results"),
    "the version of simnav": ({"simnav": "9.9+0123456789ab"}, "simnav '9.9+0123456789ab' is stored"),
    "the commit": ({"made_commit": "0" * 40}, "commit '"),
    "a commit that is no hash": ({"made_commit": "main"}, "commit 'main' is no hash"),
    "a version that cannot be": ({"made_scipy": "0.1"}, "scipy '0.1' is excluded by the requirement scipy"),
    "the version of scipy": ({"made_scipy": "99.9"}, "scipy '99.9' is stored with 2 results"),
    "what is no version": ({"made_numpy": "newest"}, "numpy 'newest' is no version"),
    "a day to come": ({"made_date": "2999-01-01"}, "date '2999-01-01' is not between"),
    "no day": ({"made_date": "yesterday"}, "date 'yesterday' is no day"),
    "a confinement of another system": (
        {"made_system": "Windows AMD64", "made_processor": "", "made_confinement": "landlock"},
        "confinement 'landlock' does not exist on 'Windows AMD64'"),
    "a processor of another system": ({"made_processor": "aarch64 a72"}, "processor 'aarch64 a72' is none of"),
    "a processor of control characters": ({"made_cpu": "fast\x1b[2J"}, "numpy '' is stored with 2 results"),
    "a processor in other letters": ({"made_cpu": "\u0406ntel"}, "cpu '\\u0406ntel' is no printable ASCII text"),
    "the processor": ({"made_cpu": "a faster one"}, "cpu 'a faster one' is stored with 2 results"),
    "the confinement": ({"made_confinement": "bubblewrap"}, "confinement 'bubblewrap' is stored with 2 results"),
    "a confinement that does not exist": ({"made_confinement": "vault"}, "confinement 'vault' is stored"),
    "the digest of the scenario": ({"scenario_digest": "0" * 32}, "scenario_digest"),
    "the digest of the estimator": ({"estimator_digest": "0" * 24}, "estimator_digest"),
    "what was learned": ({"learned": {"learned_from": [[1, 2]]}}, "learned"),
    "a parameter": ({"parameters": {"gate": 3.0}}, "gate"),
    "the flag of a reference": ({"reference": True}, "says that it was told the truth"),
    "a negative error": ({"score_horizontal_rmse": -1.0}, "is below zero"),
}  # fmt: skip

#: What no repetition can show: it is named, and the results pass.
CLAIMS = {"the processor", "the confinement"}


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_forgery_is_found(folder: Path, scenario: Scenario, forgery: str) -> None:
    changes, said = FORGERIES[forgery]
    forge(folder, fields(**changes))
    found = verified(folder, scenario)
    words = " | ".join(
        (*found.different, *found.claims, *found.unconfirmed, *found.not_repeatable, *found.not_here, *found.set_aside)
    )
    assert said in words
    assert found.passed == (forgery in CLAIMS)
    if forgery in CLAIMS:
        (field,) = found.unconfirmed_fields
        assert found.to_dict()["unconfirmed_fields"] == (field,)
        assert found.summary.endswith(f", of which {field} differ from here")


def test_what_is_proven_and_what_is_claimed_is_said(
    folder: Path, scenario: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In one sentence, in the JSON, and by the exit code: 0, or 3 where something is left that only the results say."""
    found = verified(folder, scenario)
    assert found.unconfirmed_fields == ()
    assert {"commit", "cpu", "confinement"} <= set(found.claimed)  # also where they are as here
    assert found.summary.startswith("proven: status, note, parameters, draws and scores of the runs")
    assert "only claimed: commit, dirty, cpu, system, confinement" in found.summary
    monkeypatch.setattr("simnav.leaderboard.cli.verify.verify", SimpleNamespace(of=lambda _: found))
    assert CliRunner().invoke(app, ["campaign", "verify", str(folder)]).exit_code == 0
    for change, code in ((fields(made_cpu="a faster one"), 3), (fields(made_commit="main"), 1)):
        forge(folder, change)
        found = verified(folder, scenario)
        done = CliRunner().invoke(app, ["campaign", "verify", str(folder), "--json"])
        assert done.exit_code == code
        assert json.loads(done.stdout)["unconfirmed_fields"] == ["cpu"]


def test_the_sample_finds_five_per_cent_of_forged_runs() -> None:
    """By counting: draw samples of the chosen size from a folder in which 5 % are forged."""
    draw, total = random.Random(1), 400
    forged = set(range(20))
    count = sample_size(total)
    caught = sum(bool(forged & set(draw.sample(range(total), count))) for _ in range(4000)) / 4000
    assert caught == pytest.approx(finds(total, 20, count), abs=0.015)
    assert finds(total, 20, count) >= 0.95 > finds(total, 20, count - 1)
    assert sample_size(10**6) == 59


# -- names -----------------------------------------------------------------------------------------------------------


LOOKALIKES = [
    "\u0435kf", "ekf\u200b", "EKF", "eKf", "ekf\n", "ekf ", " ekf", "ekf_", "x" * 3000, "=HYPERLINK(1)", "ekf\u202e",
    "sw_fgo", "SW-FGO(window=10)", "huber\tkf", "",
]  # fmt: skip


@pytest.mark.parametrize("label", LOOKALIKES)
def test_a_lookalike_is_set_aside_and_not_merged(folder: Path, tmp_path: Path, label: str) -> None:
    forge(folder, renamed(label))
    with pytest.warns(store.SetAsideWarning, match="estimator = "):
        assert store.load(folder) == []
    warnings.simplefilter("ignore")
    with pytest.raises(RequestError):
        simnav.merge([folder], tmp_path / "merged")
    assert not (tmp_path / "merged").exists()


def test_a_name_that_is_nobodys_is_taken(folder: Path) -> None:
    forge(folder, renamed("student-l"))
    assert len(store.load(folder)) == 2


def test_two_rows_of_others_that_look_alike_are_not_merged(folder: Path, tmp_path: Path) -> None:
    rival = Path(shutil.copytree(folder, tmp_path / "rival"))
    forge(folder, renamed("my-filter"))
    forge(rival, lambda r: replace(r, estimator="My-Fi1ter", key=f"other-{r.seed}"))
    with pytest.raises(RequestError, match="can be taken for"):
        simnav.merge([folder, rival], tmp_path / "merged")


# -- merging ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (fields(score_horizontal_rmse=99.0), "horizontal_rmse is"),
        (fields(status="timeout", scores={}), "status is"),
        (fields(note="recording 'dive 1'"), "note is"),
        (fields(draws={"duration_s": 1.0}, note=""), ""),
        (fields(parameters={"gate": 9}), "parameters is"),
    ],
)
def test_results_that_contradict_each_other_are_not_merged(
    folder: Path, tmp_path: Path, change: Callable[[Result], Result], said: str
) -> None:
    other = Path(shutil.copytree(folder, tmp_path / "other"))
    forge(other, change)
    before = [(r.key, r.status, dict(r.scores)) for r in store.load(folder)]
    if said:
        with pytest.raises(RequestError, match=said):
            simnav.merge([folder, other], tmp_path / "merged")
        assert not (tmp_path / "merged").exists()
    merged = simnav.merge([folder], tmp_path / "alone")
    assert [r.key for r in merged] == [key for key, *_ in before]


def test_a_note_of_another_row_is_not_merged(folder: Path, tmp_path: Path) -> None:
    """A row of others that says that the run was another recording than the rows that are there say."""
    other = Path(shutil.copytree(folder, tmp_path / "other"))
    forge(other, lambda r: replace(r, estimator="theirs", key=f"theirs-{r.seed}", note="recording 'dive 1'"))
    with pytest.raises(RequestError, match="one of them is not of this run"):
        simnav.merge([folder, other], tmp_path / "merged")


@pytest.mark.parametrize(("part", "named"), [(0.03, True), (0.5, False)])
def test_times_a_little_too_short_are_found_over_the_runs_of_a_row(folder: Path, part: float, named: bool) -> None:
    """Times of this test's own: how long an epoch takes here is no matter of the rule."""
    again = [replace(result, scores={**result.scores, "update_median": 1e-3}) for result in store.load(folder)]
    stored = [replace(result, scores={**result.scores, "update_median": part * 1e-3}) for result in again]
    found = too_quick(zip(stored, again, strict=True))
    assert [line.split(",")[0] for line in found] == (
        [f"gnss-only: the times per epoch are {part:g} of those that came out"] if named else []
    )


def test_a_trial_of_others_does_not_stand_in_for_that_of_a_row(folder: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(folder, tmp_path / "other"))
    key = store.load(folder)[0].key
    (other / "trials").mkdir(exist_ok=True)
    (other / "trials" / f"{key}.parquet").write_bytes(b"a trial of somebody else")
    simnav.merge([folder, other], tmp_path / "merged")
    assert not list((tmp_path / "merged").glob("trials/*"))


def test_files_of_one_name_do_not_hide_each_other(honest: Path, tmp_path: Path) -> None:
    """Packed folders call the file of a row alike; both parts of it are there afterwards."""
    parts = []
    for seed in range(2):
        part = Path(shutil.copytree(honest, tmp_path / f"part-{seed}"))
        kept = [r for r in store.load(part) if r.seed == seed]
        forge(part, lambda r: r)
        store.drop(part, {r.key for r in store.load(part)} - {r.key for r in kept})
        parts.append(part)
    assert [r.seed for r in simnav.merge(parts, tmp_path / "merged")] == [0, 1]


@pytest.mark.parametrize("key", ["../../outside-0", "v-1", "/etc/x-0", "v\n-0", ""])
def test_a_key_is_no_path_and_belongs_to_its_seed(folder: Path, key: str) -> None:
    forge(folder, lambda r: replace(r, key=key) if r.seed == 0 else r, current=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert 0 not in {r.seed for r in store.load(folder)}


@pytest.mark.parametrize("value", [[1], {"a": 1}, 5, None, "x\ny", "x" * 1000])
def test_a_provenance_of_other_types_is_set_aside(folder: Path, value: Any) -> None:
    (file,) = (folder / "provenance").glob("*.json")
    file.write_text(json.dumps(json.loads(file.read_text()) | {"cpu": value, "later": 1}))
    with pytest.warns(store.StoreWarning, match="set aside"):
        assert len(store.load(folder)) == 2
    assert not any(r.provenance.cpu for r in store.load(folder))


@pytest.mark.parametrize("more", [{}, {"later": 1}])
def test_nobody_says_where_the_results_of_others_were_made(folder: Path, tmp_path: Path, more: dict[str, Any]) -> None:
    """A provenance under the id of another one, also with a field that hides it."""
    (file,) = (folder / "provenance").glob("*.json")
    kept = file.read_bytes()
    file.write_text(json.dumps(json.loads(kept) | {"cpu": "another"} | more))
    with pytest.warns(store.StoreWarning, match="the id should be"):
        store.load(folder)
    file.with_name("0123456789ab.json").write_bytes(kept)
    with pytest.warns(store.StoreWarning, match="it is called 0123456789ab"):
        store.load(folder)


def test_links_and_pipes_of_others_are_left_alone(folder: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret.json"
    secret.write_text('{"of": "mine"}')
    (folder / "provenance" / "0123456789ab.json").symlink_to(secret)
    (folder / "results").mkdir(exist_ok=True)
    os.mkfifo(folder / "results" / "v-9.parquet")
    os.mkfifo(folder / "provenance" / "pipe.json")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert len(simnav.merge([folder], tmp_path / "merged")) == 2
    assert [p.name for p in (tmp_path / "merged" / "provenance").iterdir()] == [
        r.provenance.id + ".json" for r in store.load(tmp_path / "merged")[:1]
    ]


@pytest.mark.parametrize(
    "current",
    [{"a-v1": 1}, {"a-v1": {"recording": "r", "estimators": [1]}}, {"a-v1": {"estimators": {"ekf": {}}}}, {"a-v1": []}],
)
def test_a_marker_of_other_types_is_set_aside(folder: Path, current: Any) -> None:
    marker = folder / "simnav-results.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"current": current}))
    with pytest.warns(store.StoreWarning, match="set aside"):
        assert store.load(folder) == []


def test_scores_that_are_no_numbers_stop_nothing(folder: Path) -> None:
    forge(folder, fields(score_horizontal_rmse=math.inf, score_r95=math.nan))
    ranking = simnav.rank(folder)
    assert ranking.tracks
