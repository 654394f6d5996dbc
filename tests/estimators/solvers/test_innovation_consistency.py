"""A filter that cannot explain its measurements says so; one that can is quiet."""

from __future__ import annotations

import numpy as np
import pytest

import simnav
from simnav.estimator import make
from simnav.estimators.solvers.innovation_consistency import (
    EPOCHS,
    LONG,
    TEST,
    add_square,
    begun_test,
    end_epoch,
    is_inconsistent,
)
from simnav.leaderboard.ranking.runs import Runs
from simnav.leaderboard.results.result import Result
from tests.agreement.voyages import turned


def reports(scale: float, epochs: int, seed: int = 0, each: int = 3) -> list[bool]:
    """What the test says of innovations whose variance is ``scale`` times the one that was claimed."""
    rng, test, found = np.random.default_rng(seed), begun_test(), []
    for _ in range(epochs):
        for _ in range(each):
            add_square(test, scale * rng.chisquare(3), 3)
        end_epoch(test)
        found.append(is_inconsistent(test))
    return found


def test_right_innovations_are_consistent():
    assert np.mean(reports(1.0, 20_000)) < 1e-3


def test_wrong_innovations_are_not():
    assert np.mean(reports(2.0, 500)) > 0.95
    assert np.mean(reports(0.3, 500)) == 0.0  # too cautious is no contradiction


def test_an_epoch_without_measurements_says_nothing():
    test = begun_test()
    end_epoch(test)
    assert np.isnan(test.view(TEST)[0].variance_factor)
    assert not is_inconsistent(test)
    for _ in range(EPOCHS):
        add_square(test, 60.0, 3)
        end_epoch(test)
    assert is_inconsistent(test)
    assert test.view(TEST)[0].variance_factor == 20.0
    end_epoch(test)
    assert is_inconsistent(test)


def after(square: float, epochs: int, seed: int = 0) -> list[bool]:
    """What the test says after some epochs with a square of 4 components, and right ones from then on."""
    rng, test, found = np.random.default_rng(seed), begun_test(), []
    for k in range(400):
        add_square(test, rng.chisquare(4) if not 100 <= k < 100 + epochs else square, 4)
        end_epoch(test)
        found.append(is_inconsistent(test))
    return found[100:]


def test_a_contradiction_that_lasted_is_remembered_and_a_short_one_is_not():
    lasted, short = after(1000.0, 60), after(1000.0, 15)
    assert all(lasted[5 : 60 + EPOCHS + 30])
    assert not any(lasted[60 + LONG :])
    assert not any(short[15 + EPOCHS :])


@pytest.fixture(scope="module")
def voyage():
    scenario = simnav.load("clean-voyages").with_values({"draw.heading": 1.0})
    return simnav.record(scenario.drawn(1).model_copy(update={"duration": 60.0}), 1)


@pytest.mark.parametrize("row", ["ekf", "ukf", "heading-bank"])
def test_a_clean_voyage_is_consistent(voyage, row: str):
    trial = simnav.run_trial(make(row), voyage)
    assert trial.status == "ok"
    assert simnav.score(trial, voyage, ["inconsistent"]) == {"inconsistent": 0.0}


def test_a_start_beyond_recovery_is_reported(voyage):
    """A heading that is off by 170 degrees, at one degree of sigma: the filter does not recover, and it says so."""
    recording = turned(voyage, 170.0)
    trial = simnav.run_trial(make("ekf"), recording)
    scores = simnav.score(trial, recording)
    assert trial.status == "ok"
    assert scores["heading_rmse"] > 0.5
    assert scores["inconsistent"] > 0.8
    assert scores["inconsistent_end"] == 1.0
    result = Result(voyage.scenario, 1, "ekf", {}, False, trial.status, "", scores)
    assert result.ending == "lost"  # whatever it says of itself
    assert Runs([result]).statuses == {"lost": 1}
    assert Runs([result]).failed == 0  # it has its own error in the ranking


def test_a_run_that_a_late_fault_leaves_wrong_ends_as_inconsistent():
    scores = {"inconsistent": 0.3, "inconsistent_end": 1.0}
    assert Result("voyage-v1", 1, "ekf", {}, False, "ok", "", scores).ending == "inconsistent"
    assert Result("voyage-v1", 1, "ekf", {}, False, "ok", "", scores | {"inconsistent_end": 0.0}).ending == "ok"


def test_a_filter_follows_the_current_through_a_turn():
    """With the current along the keel as a bias the velocity's NEES was 26 on this voyage."""
    recording = simnav.record(simnav.load("auv-water-track").drawn(1).model_copy(update={"duration": 500.0}), 1)
    scores = simnav.score(simnav.run_trial(make("ekf"), recording), recording, ["nees_velocity", "inconsistent"])
    assert scores["nees_velocity"] < 2.0
    assert scores["inconsistent"] == 0.0
