"""Tuning: what is varied, the search, the board out of bounds, and shipped files beside the rows."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import simnav
from simnav.estimator import describe, names
from simnav.leaderboard.campaign.fingerprint import has_recordings
from simnav.leaderboard.campaign.request import request
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.tuning.objective import CLEAN, LARGEST, PRICE, Voyages
from simnav.leaderboard.tuning.space import Range, read_range, space_of
from simnav.leaderboard.tuning.tuning import TUNED, Evaluation, ranges_of, read, search
from simnav.scenario import load
from simnav.scenario.catalogue import headers

FILES = sorted(TUNED.glob("*.json"))


def short(name: str = "training-voyages", duration: float = 40.0):
    """A training family, cut so that it is quick."""
    return load(name).model_copy(update={"duration": duration, "faults": ()})


# --- what is varied -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("k=1:4", Range("k", 1.0, 4.0)),
        (" dof = 2 : 50 : log ", Range("dof", 2.0, 50.0, "log")),
        ("window=5:60:integer", Range("window", 5.0, 60.0, "integer")),
        ("x=-1e-3:1e3", Range("x", -1e-3, 1e3)),
    ],
)
def test_a_range_is_read(text: str, expected: Range):
    assert read_range(text) == expected
    assert read_range(str(expected)) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("k", "name=low:high"),
        ("k=1", "name=low:high"),
        ("k=a:b", "name=low:high"),
        ("k=4:1", "first bound"),
        ("k=0:1:log", "above 0"),
        ("k=1.5:3:integer", "whole"),
        ("k=1:2:square", "no scale"),
        ("k=1:inf", "finite"),
    ],
)
def test_a_senseless_range_is_refused(text: str, message: str):
    with pytest.raises(RequestError, match=message):
        read_range(text)


@pytest.mark.parametrize("r", [Range("a", 1.0, 9.0), Range("b", 0.01, 100.0, "log"), Range("c", 2.0, 7.0, "integer")])
def test_values_stay_within_their_range_and_come_back(r: Range):
    low, high = r.bounds
    for x in np.linspace(low - 1.0, high + 1.0, 25):
        value = r.value(float(x))
        assert r.low <= value <= r.high
        assert r.value(r.position(value)) == value
    assert isinstance(Range("c", 2.0, 7.0, "integer").value(3.4), int)


@pytest.mark.parametrize(
    ("estimator", "vary", "message"),
    [
        ("huber-kf", ["gain=1:2"], "no parameter 'gain'; it has: k"),
        ("huber-kf", [], "no parameter is varied"),
        ("huber-kf:k=3", ["k=1:4"], "set or varied twice"),
        ("iae", ["newest=0:1"], "is no number"),
        ("huber-kf", ["k=3:4"], "present k = 2 is not within k=3:4"),
    ],
)
def test_a_parameter_that_cannot_be_varied_is_refused(estimator: str, vary: list[str], message: str):
    with pytest.raises(RequestError, match=message):
        space_of(request(estimator), vary)


# --- the search ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["differential-evolution", "nelder-mead"])
def test_it_finds_the_minimum_of_a_function(method):
    space = (Range("a", 0.01, 100.0, "log"), Range("b", -5.0, 5.0))

    def bowl(values):
        return math.log(values["a"] / 3.0) ** 2 + (values["b"] - 1.0) ** 2

    found = search(bowl, space, {"a": 50.0, "b": -4.0}, 120, method, seed=1)
    assert len(found) <= 120
    assert found[0] == Evaluation({"a": 50.0, "b": -4.0}, bowl({"a": 50.0, "b": -4.0}))
    best = min(found, key=lambda e: e.objective)
    assert best.objective < 0.1
    assert len({tuple(e.parameters.values()) for e in found}) == len(found)
    assert search(bowl, space, {"a": 50.0, "b": -4.0}, 120, method, seed=1) == found


def test_a_search_of_one_evaluation_is_none():
    with pytest.raises(RequestError, match="2 or more"):
        search(lambda v: 0.0, (Range("a", 0.0, 1.0),), {"a": 0.5}, 1)


# --- the objective ------------------------------------------------------------------------------------


def test_the_baseline_has_the_objective_zero():
    figures = Voyages([short()], range(2)).figures(request("ekf"), {})
    assert figures.objective == pytest.approx(0.0, abs=1e-12)
    assert figures.ratio == {"training-voyages-v1": pytest.approx(1.0)}
    assert (figures.lost, figures.failed) == (0.0, 0)


def test_a_clean_voyage_that_costs_is_dear_and_a_failure_is_the_worst():
    clean = Voyages([short("training-clean")], range(2))
    poor = clean.figures(request("huber-kf"), {"k": 0.1})
    (ratio,) = poor.ratio.values()
    assert ratio > CLEAN
    assert poor.objective == pytest.approx(math.log(ratio) + PRICE * (math.log(ratio) - math.log(CLEAN)))
    failed = clean.figures(request("huber-kf"), {"k": -1.0})
    assert failed.failed == 2
    assert list(failed.ratio.values()) == [pytest.approx(LARGEST)]
    assert failed.lost == 1.0


# --- former names of parameters -----------------------------------------------------------------------


def test_a_former_name_is_varied_under_the_present_one():
    space, present = space_of(request("student-t-rts"), ["smoothed_dof=2:50:log", "turns=1:9:integer"])
    assert ([r.name for r in space], dict(present)) == (["smoother__dof", "turns"], {"smoother__dof": 6.0, "turns": 5})
    with pytest.raises(RequestError, match="'smoother__dof' is set or varied twice"):
        space_of(request("student-t-rts"), ["smoothed_dof=2:50", "smoother__dof=2:50"])
    with pytest.raises(RequestError, match="'smoother__dof' is set or varied twice"):
        space_of(request("student-t-rts:smoothed_dof=3"), ["smoothed_dof=2:50"])


def test_a_stored_tuning_of_former_names_is_read(tmp_path: Path):
    document = json.loads(FILES[0].read_text())
    old = {"smoothed_dof": 4.0, "passes": 9}
    ranges = [{"name": name, "low": 1.0, "high": 20.0, "scale": "linear"} for name in old]
    document |= {"estimator": "student-t-rts", "chosen": old, "present": old, "ranges": ranges}
    path = tmp_path / "student-t-rts.json"
    path.write_text(json.dumps(document))
    found = read(path)
    assert found["chosen"] == found["present"] == {"smoother__dof": 4.0, "passes": 9}
    assert ranges_of(found) == (Range("smoother__dof", 1.0, 20.0), Range("passes", 1.0, 20.0))


# --- the board is out of bounds -----------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted({h.name for h in headers() if not h.training}))
def test_what_is_ranked_cannot_be_tuned_on(name: str):
    if not has_recordings(load(name)):
        pytest.skip("its recordings are not on this machine")
    with pytest.raises(RequestError, match="no training family"):
        simnav.tune("huber-kf", name, "k=1:4", runs=2, unseen=2)


def test_a_copy_of_a_board_scenario_cannot_either():
    with pytest.raises(RequestError, match="no training family"):
        Voyages([load("open-sea")], range(2))


# --- shipped files ------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_shipped_file_is_of_training_families_and_the_row_has_what_was_chosen(path: Path):
    document = read(path)
    assert document["estimator"] == path.stem in names()
    defaults = {p.name: p.default for p in describe(path.stem).parameters}
    # What does not hold on unseen voyages is not adopted.
    holds = document["unseen_after"]["objective"] < document["unseen_before"]["objective"]
    values = document["chosen" if holds else "present"]
    assert {name: defaults[name] for name in values} == values
    assert set(document["chosen"]) == {r.name for r in ranges_of(document)}
    for family in document["families"]:
        assert load(family.rpartition("-v")[0]).training
    first, last = document["seeds"]
    begin, end = document["unseen_seeds"]
    assert first <= last < begin <= end
    best = min(e[-1] for e in document["evaluations"])
    assert document["after"]["objective"] == pytest.approx(best, abs=1e-9)
    assert document["after"]["objective"] <= document["before"]["objective"]


def test_some_rows_are_tuned():
    assert FILES


def test_a_file_of_something_else_is_refused(tmp_path: Path):
    path = tmp_path / "other.json"
    for text in ("{}", "[", "[1]"):
        path.write_text(text)
        with pytest.raises(RequestError, match=r"other\.json"):
            read(path)


def test_a_row_without_a_file_asks_what_to_vary():
    with pytest.raises(RequestError, match=r"say what to vary .* --vary (\w+)=.*; its numbers are: .*\1"):
        simnav.tune("huber-kf", "training-clean")
    with pytest.raises(RequestError, match=r"huber-kf\(k=2\) has no number that could be varied"):
        simnav.tune(("huber-kf", {"k": 2}), "training-clean")


# --- the whole ----------------------------------------------------------------------------------------


def test_a_tuning_is_stored_with_what_it_was_chosen_on(tmp_path: Path, monkeypatch):
    from simnav.leaderboard import running

    monkeypatch.setattr(running, "scenarios_of", lambda families: [short()])
    found = simnav.tune("huber-kf", "training-voyages", "k=0.5:4", runs=2, unseen=2, evaluations=4, seed=7)
    document = read(found.write(tmp_path / "huber-kf.json"))
    assert document == json.loads(json.dumps(found.to_dict()))
    assert document["seeds"] == [7, 8]
    assert document["unseen_seeds"] == [9, 10]
    assert document["families"] == {"training-voyages-v1": short().content_hash()}
    assert len(document["evaluations"]) == 4
    assert document["after"]["objective"] <= document["before"]["objective"]
    assert found.to_frame().shape[0] == 4
    assert found.plot().axes[0].get_title(loc="left") == "huber-kf"
