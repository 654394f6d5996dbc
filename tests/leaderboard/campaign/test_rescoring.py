"""A campaign, a new score afterwards, and no estimator runs again."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.campaign import own_scores, rescoring
from simnav.leaderboard.campaign.own_scores import scoring_differs
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.results import store, trials
from simnav.leaderboard.results.errors import RequestError
from simnav.plugins import load_plugin
from simnav.scoring import SCORES, ScoringInput, register_score
from tests.cases import POND

pytestmark = pytest.mark.skipif(os.name != "posix", reason="isolation without fork takes seconds a run")

BAD = """
from simnav import Estimator

class Bad(Estimator):
    def reset(self, start, instruments):
        raise RuntimeError("lost")
    def update(self, measurements): ...
"""
PLUGIN = Path(__file__).parents[2] / "simnav" / "plugins" / "excursion.py"
ESTIMATORS = ["gnss-only", "gnss-only:acceleration=2"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forget_scores: Callable[[], None]) -> Path:
    """A working directory with a short scenario; scores that a test registers are forgotten."""
    (tmp_path / "pond.toml").write_text(POND)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def campaign(**options: object) -> tuple[int, list[store.Result]]:
    report = simnav.campaign("pond.toml", ESTIMATORS, runs=2, output="out", workers=1, oracle=False, **options)
    return report.summary.computed, list(report.results)


def test_a_new_score_after_a_campaign(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    computed, before = campaign(keep_trials=True)
    assert computed == 4

    @register_score("north_spread", title="Spread of the north error", unit="m", better="lower")
    def north_spread(given: ScoringInput) -> float:
        return float(given.error[:, 0].std())

    assert campaign(keep_trials=True)[0] == 0  # a new score does not void the campaign
    monkeypatch.setattr("simnav.trial.run_trial", None)  # whoever ran an estimator would fail
    done = simnav.rescore("out", scenarios="pond.toml")
    assert (done.rescored, done.complete, done.without_trial, done.scores) == (4, 0, 0, ("north_spread",))
    again = simnav.rescore("out", scenarios="pond.toml")
    assert (again.rescored, again.complete, again.scores) == (0, 4, ())
    after = store.load(here / "out")
    for old, new in zip(before, after, strict=True):
        assert old.key == new.key
        kept = {name: repr(value) for name, value in new.scores.items() if name != "north_spread"}
        assert kept == {name: repr(value) for name, value in old.scores.items()}
        assert new.scores["north_spread"] > 0.0
    for name, says in (
        ("north_spred", "score = 'north_spred' is unknown; did you mean 'north_spread'"),
        ("coverage_95", "score = 'coverage_95' is not better when lower; a ranking is by errors"),
        (
            "smoothed_horizontal_rmse",
            "no result has the score 'smoothed_horizontal_rmse'; 'simnav campaign rescore'",
        ),
    ):
        with pytest.raises(RequestError, match=re.escape(says)):
            simnav.rank("out", score=name)
    ranking = simnav.rank("out", score="north_spread")
    assert ranking.tracks[0].score == "north_spread"
    medians = {row.estimator: row.median for row in ranking.scenarios[0].rows}
    for label, median in medians.items():
        values = [r.scores["north_spread"] for r in after if r.estimator == label]
        assert median == pytest.approx(sum(values) / 2)
    assert "north_spread" in simnav.campaign("pond.toml", ESTIMATORS, runs=2, output="out", oracle=False).to_frame()


def test_a_score_of_one_file_takes_part_in_a_campaign_of_several_workers(here: Path) -> None:
    load_plugin(shutil.copy(PLUGIN, here))  # a file of its own, so that it is imported anew
    report = simnav.campaign("pond.toml", "gnss-only", runs=2, output="out", workers=2, oracle=False)
    assert [r.scores["share_above_10_m"] for r in report.results] == [0.0, 0.0]


def test_an_edited_score_is_computed_again_from_the_trials(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign(keep_trials=True)
    spoilt = {r.key: {**r.scores, "cep50": -1.0} for r in store.load(here / "out")}
    code = json.loads(own_scores.scoring_code())
    old = json.dumps({**code, "simnav.scoring.accuracy": "older"})
    store.rescore(here / "out", spoilt, old)
    computed, results = campaign(keep_trials=True)
    assert computed == 0
    assert all(r.scores["cep50"] > 0.0 and r.scoring == json.dumps(code) for r in results)
    store.rescore(here / "out", spoilt, old)
    for key in spoilt:
        trials.discard(here / "out", key)
    computed, results = campaign()  # without trials there is no other way
    assert computed == 4
    assert all(r.scores["cep50"] > 0.0 for r in results)


def test_which_code_makes_scores_differ() -> None:
    now = own_scores.scoring_code()
    assert "simnav.scoring.accuracy" in json.loads(now)
    assert not scoring_differs(now, now)
    assert not scoring_differs(now, json.dumps({**json.loads(now), "simnav.scoring.new": "1"}))
    assert scoring_differs(json.dumps({**json.loads(now), "simnav.scoring.accuracy": "1"}), now)
    assert scoring_differs("", now)  # not known
    assert not scoring_differs("{}", now)  # a run without scores


def test_a_run_without_scores_is_not_void_by_an_edited_score(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (here / "bad.py").write_text(BAD)
    first = simnav.campaign("pond.toml", "bad.py", runs=1, output="out", workers=1, keep_trials=True, oracle=False)
    assert [r.status for r in first.results] == ["error"]
    monkeypatch.setattr("simnav.leaderboard.campaign.campaign.scoring_code", lambda: '{"simnav.scoring.accuracy": "1"}')
    again = simnav.campaign("pond.toml", "bad.py", runs=1, output="out", workers=1, keep_trials=True, oracle=False)
    assert again.summary.computed == 0


def test_thinned_covariances_leave_scores_that_use_them_as_they_are(here: Path) -> None:
    _, before = campaign(keep_trials=True, covariance_interval=10.0)
    simnav.rescore("out", list(SCORES), scenarios="pond.toml")
    for old, new in zip(before, store.load(here / "out"), strict=True):
        assert new.scores["nees_horizontal"] == old.scores["nees_horizontal"]
        assert new.scores == pytest.approx(old.scores, rel=1e-6, nan_ok=True)


def test_the_command_says_what_the_call_says(here: Path) -> None:
    campaign(keep_trials=True)
    words = ["campaign", "rescore", "out", "--score", "cep50,r95", "-s", "pond.toml", "--json"]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == 0, told.stderr
    called = simnav.rescore("out", "cep50,r95", scenarios="pond.toml").to_dict()
    said = json.loads(told.stdout)
    assert {k: said[k] for k in called if k != "seconds"} == {k: v for k, v in called.items() if k != "seconds"}
    assert called["scores"] == ["cep50", "r95"]


def test_what_cannot_be_rescored_is_one_sentence(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign()
    with pytest.raises(RequestError, match=r"no trials were kept in .*; 'simnav campaign --keep-trials' keeps them"):
        simnav.rescore("out")
    with pytest.raises(RequestError, match="there is no score 'cep05'; did you mean 'cep50'"):
        simnav.rescore("out", "cep05")
    simnav.campaign("pond.toml", "gnss-only", runs=1, seed=7, output="out", keep_trials=True, oracle=False)
    with pytest.raises(RequestError, match="scenario pond-v1 is not in the catalogue; give its file with --scenario"):
        simnav.rescore("out", "cep50")
    monkeypatch.setattr(rescoring, "simulator_version", lambda: "0.1.0+other")
    with pytest.raises(RequestError, match="the recordings of pond-v1 cannot be made again, for the scenario or the"):
        simnav.rescore("out", "cep50", scenarios="pond.toml")


def test_scores_of_a_plug_in_and_of_kept_trials_are_verified(here: Path, forget_scores: Callable[[], None]) -> None:
    campaign(keep_trials=True)

    @register_score("north_spread", title="Spread of the north error", unit="m", better="lower")
    def north_spread(given: ScoringInput) -> float:
        return float(given.error[:, 0].std())

    simnav.rescore("out", scenarios="pond.toml")
    wanted = {"sample": 4, "scenarios": "pond.toml", "estimators": ESTIMATORS}
    known = simnav.verify("out", **wanted)
    assert (known.passed, known.different, known.unknown) == (True, (), ())
    assert all("north_spread" in text for text in known.close)
    forget_scores()
    assert (simnav.verify("out", **wanted).passed, simnav.verify("out", **wanted).unknown) == (True, ("north_spread",))
    words = ["campaign", "verify", "out", "-s", "pond.toml", *(w for e in ESTIMATORS for w in ("-e", e))]
    said = CliRunner().invoke(app, words)
    assert said.exit_code == 0, said.output
    assert "not known here: north_spread ('simnav --plugin FILE campaign verify" in " ".join(said.stdout.split())
    simnav.rescore("out", "cep50,r95", scenarios="pond.toml")
    again = simnav.verify("out", **wanted)
    assert again.passed
    assert len(again.close) > 0
    (one, *_) = store.load(here / "out")
    store.rescore(here / "out", {one.key: {n: v for n, v in one.scores.items() if n != "cep50"}}, one.scoring)
    without = simnav.verify("out", **wanted)
    assert (without.passed, len(without.different)) == (False, 1)
    assert "cep50 is missing" in without.different[0]
