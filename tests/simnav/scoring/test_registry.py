"""Scores are open: a decorated function beside its title, unit and direction."""

from __future__ import annotations

import pickle
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simnav.plugins import PluginError, load_plugin
from simnav.recording import Recording
from simnav.scoring import SCORES, ScoreWarning, ScoringInput, register_score, score
from simnav.scoring.registry import Score

PLUGIN = Path(__file__).parents[1] / "plugins" / "excursion.py"


pytestmark = pytest.mark.usefixtures("forget_scores")


@pytest.fixture
def recording(make_recording: Any) -> Recording:
    return make_recording()


def test_a_function_becomes_a_score(recording: Recording, make_trial: Any) -> None:
    @register_score("north_median", title="Median north error", unit="m", better="lower")
    def north_median(given: ScoringInput) -> float:
        return float(np.nanmedian(given.error[:, 0]))

    trial = make_trial(recording, [2.0, 1.0, 0, 0, 0, 0, 0, 0, 0])
    found = score(trial, recording)
    assert list(found)[-1] == "north_median"
    assert found["north_median"] == pytest.approx(2.0, rel=1e-6)
    made = SCORES["north_median"]
    assert (made.title, made.unit, made.better) == ("Median north error", "m", "lower")
    assert north_median(ScoringInput(trial, recording)) == found["north_median"]
    assert score(trial, recording, ["north_median", "cep50"]) == {n: found[n] for n in ("north_median", "cep50")}


def test_one_file_of_a_third_party(recording: Recording, make_trial: Any, tmp_path: Path) -> None:
    assert "share_above_10_m" not in SCORES
    load_plugin(shutil.copy(PLUGIN, tmp_path))  # a file of its own, so that it is imported anew
    error = np.zeros((100, 9))
    error[:25, 1] = -11.0
    assert score(make_trial(recording, error), recording)["share_above_10_m"] == 0.25


def test_the_entry_points_of_packages_are_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    class Point:
        name, value, dist = "theirs", "theirs.scores", None

        def load(self) -> None:
            register_score("theirs", title="Theirs", unit="m")(lambda given: 1.0)

    def points(group: str) -> list[Point]:
        return [Point()] if group == "simnav.scores" else []

    monkeypatch.setattr("simnav.plugins.entry_points", points)
    assert SCORES["theirs"].better is None


def test_ours_have_the_last_word_on_their_names() -> None:
    with pytest.raises(PluginError, match=r"name 'cep50' .*: the name is taken by _cep50 \(.*accuracy.py, line"):
        register_score("cep50", title="Mine", unit="m")(lambda given: 1.0)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"name": "Not-Snake"}, "snake_case, like 'my_name'"),
        ({"better": "low"}, "better = 'low' should be one of lower, higher, one, nominal, or None"),
        ({"title": ""}, "title = '' should be a text"),
        ({"unit": None}, "unit = None should be a text"),
    ],
)
def test_what_cannot_be_a_score(change: dict[str, Any], says: str) -> None:
    values: dict[str, Any] = {"name": "mine", "title": "Mine", "unit": "m"} | change
    with pytest.raises(PluginError, match=re.escape(says)):
        register_score(values.pop("name"), **values)(lambda given: 1.0)


@pytest.mark.parametrize(("result", "says"), [("raise", "ZeroDivisionError"), (np.inf, "infinite")])
def test_a_score_that_fails_harms_no_other(recording: Recording, make_trial: Any, result: Any, says: str) -> None:
    @register_score("broken", title="Broken", unit="m")
    def broken(given: ScoringInput) -> float:
        return 1.0 / 0 if result == "raise" else result

    trial = make_trial(recording, np.ones(9))
    with pytest.warns(ScoreWarning, match=f"score 'broken' of given on tiny-v1 is left out: .*{says}"):
        found = score(trial, recording)
    assert np.isnan(found["broken"])
    assert found["horizontal_rmse"] == pytest.approx(np.sqrt(2.0), rel=1e-5)


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        (lambda given: given.error.fill(0.0), "read-only"),
        (lambda given: given.horizontal.fill(0.0), "read-only"),
        (lambda given: given.trial.position.fill(0.0), "read-only"),
        (lambda given: sys.exit("I give up"), "SystemExit: I give up"),
        (lambda given: "12 metres", "could not convert string to float"),
        (lambda given: given.horizontal, "TypeError"),
        (lambda given: None, "TypeError"),
    ],
)
def test_a_score_can_neither_change_what_others_are_given_nor_end_the_run(
    recording: Recording, make_trial: Any, harm: Any, says: str
) -> None:
    trial = make_trial(recording, np.ones(9))
    position, before = trial.position.copy(), score(trial, recording)
    register_score("harmful", title="Harmful", unit="m")(harm)
    with pytest.warns(ScoreWarning, match=f"score 'harmful' of given on tiny-v1 is left out: .*{says}"):
        found = score(trial, recording)
    assert np.isnan(found.pop("harmful"))
    np.testing.assert_array_equal(list(found.values()), list(before.values()))
    np.testing.assert_array_equal(trial.position, position)
    assert trial.position.flags.writeable


def test_what_several_scores_need_is_computed_once(recording: Recording, make_trial: Any) -> None:
    calls = []

    def shared(given: ScoringInput) -> float:
        calls.append(given)
        return 3.0

    for name in ("first", "second"):
        register_score(name, title=name, unit="m")(lambda given: given.shared(shared))
    found = score(make_trial(recording, np.zeros(9)), recording, ["first", "second"])
    assert found == {"first": 3.0, "second": 3.0}
    assert len(calls) == 1


def test_a_score_reaches_another_process() -> None:
    sent = pickle.loads(pickle.dumps(Score(np.mean, "mine", "Mine", "m", "lower", True)))
    assert (sent.name, sent.unit, sent.better, sent.uses_covariance, sent([1.0, 3.0])) == (
        "mine",
        "m",
        "lower",
        True,
        2.0,
    )


def test_the_file_of_the_documentation_is_the_one_that_is_tested() -> None:
    text = (Path(__file__).parents[3] / "docs" / "how-to" / "add-a-score.md").read_text(encoding="utf-8")
    code = PLUGIN.read_text(encoding="utf-8").split("import numpy", 1)[1]
    assert f"import numpy{code}" in text
