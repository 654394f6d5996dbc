"""Runs that are lost against the plain EKF."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from simnav.leaderboard.ranking.board import ScenarioRanking
from simnav.leaderboard.ranking.lost_runs import lost_recordings
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.runs import group
from simnav.leaderboard.ranking.statistics import FAILURE
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site.entries import entries, run_names
from simnav.leaderboard.site.losses import faults_of, losses
from simnav.scenario import load

# Over the plain EKF; NaN stands for a run that failed. Exactly 1.5 times is not lost.
RATIOS = (1.0, 1.5, 1.6, 0.2, 3.0, math.nan)


@pytest.fixture
def mixed(results: list[Result], catalogued: str) -> list[Result]:
    found = []
    for r in results:
        if r.scenario == catalogued and r.seed < len(RATIOS) and r.estimator in ("ekf", "sw-fgo", "oracle"):
            ratio = RATIOS[r.seed] if r.estimator == "sw-fgo" else 1.0
            if math.isnan(ratio):
                found.append(replace(r, status="diverged", reason="far away", scores={}, series={}))
            else:
                error = ratio * (1.0 if r.estimator == "oracle" else 2.0)
                found.append(replace(r, scores={**r.scores, "horizontal_rmse": error}))
    return found


def test_lost_and_failed_runs_are_counted_and_the_worst_comes_first(mixed: list[Result], catalogued: str) -> None:
    ranking = rank(mixed)
    _, scenarios = entries(group(mixed), ranking)
    found = losses("sw-fgo", "ekf", ranking, scenarios)
    assert found is not None
    assert (found["lost"], found["failed"], found["runs"]) == (2, 1, 6)
    rows = found["table"]["rows"]
    assert [(row["run"], row["ratio"]) for row in rows] == [("4", 3.0), ("2", 1.6)]
    assert rows[0]["name"]["page"] == f"{scenarios[catalogued].page}#row=sw-fgo&seed=4"
    assert rows[0]["wrong"] == "gnss: noise step (160 to 240 s)"
    assert losses("sw-fgo", "no such row", ranking, scenarios) is None


def test_lost_recordings_are_those_of_recorded_scenarios_against_their_plain_row() -> None:
    def table(scenario: str, unit: str, plain: str, **rows: dict[str, float]) -> ScenarioRanking:
        made = [SimpleNamespace(estimator=name.replace("_", "-"), ratios=ratios) for name, ratios in rows.items()]
        return cast(ScenarioRanking, SimpleNamespace(scenario=scenario, unit=unit, plain=plain, rows=made))

    runs = ("a", "b", "c", "d")
    tables = [
        table("log-v1", "recording", "ship-ekf", ship_ekf=dict.fromkeys(runs, 2.0), ekf=dict.fromkeys(runs, 9.0),
              mine=dict(zip(runs, (3.0, 3.1, FAILURE, 0.5), strict=True))),
        table("car-v1", "recording", "ekf", ekf={"x": 1.0, "y": FAILURE}, mine={"x": 1.4, "y": FAILURE}),
        table("sea-v1", "seed", "ekf", ekf={"0": 1.0}, mine={"0": 5.0}),
    ]  # fmt: skip
    found = lost_recordings("mine", tables)
    assert (found.lost, found.runs, found.scenarios, found.words) == (2, 5, ("log-v1",), "2 of 5")
    assert lost_recordings("ship-ekf", tables).words == "0 of 4"
    assert lost_recordings("other", tables).words == ""


def test_faults_are_those_that_were_drawn_for_the_seed() -> None:
    scenario = load("random-voyages")
    words = {seed: faults_of(scenario.id, seed) for seed in range(12)}
    for seed, text in words.items():
        faults = scenario.drawn(seed).faults
        assert text.count(":") == len(faults)
        assert all(fault.kind.replace("_", " ") in text for fault in faults)
    assert "" in words.values()
    assert len(set(words.values())) > 6
    assert faults_of("made-up-one-v1", 1) == ""


def test_a_run_whose_name_is_a_sentence_has_a_short_one() -> None:
    def board(*runs: str) -> ScenarioRanking:
        row = SimpleNamespace(ratios=dict.fromkeys(runs, 1.0))
        return cast(ScenarioRanking, SimpleNamespace(rows=[row]))

    note = "samples were means, resampled; start velocity not from the reference"
    assert run_names(board("0", "17")) == {}
    assert run_names(board(note)) == {note: "recording"}
    assert run_names(board("leg 3", "b" + note, "a" + note)) == {"a" + note: "recording 1", "b" + note: "recording 2"}
