"""The middle of three solutions: of each component, with the covariance of the mixture; a wrong one moves it little."""

from __future__ import annotations

import tomllib
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.solvers.mid_value import middle
from simnav.estimators.solvers.state_difference import difference
from simnav.scenario import Scenario
from simnav.scoring.navigation_error import errors
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Estimate
from tests.cases.displaced import displaced

SHORT = tomllib.loads((Path(__file__).parents[2] / "cases" / "short.toml").read_text(encoding="utf-8"))
START = Estimate(1.0, np.array([0.8, 0.1, 5.0]), np.array([3.0, 1.0, 0.0]), np.array([0.01, -0.02, 2.0]))
ROWS = ("ekf", "vb-akf", "gnc-fgo")


def three(offsets) -> list[Estimate]:
    """Estimates that are off by these amounts in every component, with unit covariances."""
    return [displaced(START, np.full(9, float(x)), np.eye(9)) for x in offsets]


def test_the_middle_of_each_component_and_the_mixture_about_it():
    """1/3 sum(P + d d') with d = -0.001, 0 and 0.003: P + 1e-5 / 3 in every element."""
    found, apart = middle(three([0.002, 0.001, 0.005]))
    assert difference(found, START) == pytest.approx(np.full(9, 0.002), rel=5e-3)
    assert apart == pytest.approx(np.outer([0.0, -0.001, 0.003], np.ones(9)), rel=2e-2, abs=1e-6)
    assert found.covariance - np.eye(9) == pytest.approx(np.full((9, 9), 1e-5 / 3.0), rel=2e-2)


def test_longitudes_and_headings_go_round_the_circle():
    west, east = (
        Estimate(1.0, np.array([0.0, x, 0.0]), np.zeros(3), np.array([0.0, 0.0, x]), np.eye(9)) for x in (3.14, -3.14)
    )
    found, apart = middle([west, east, east])
    assert np.remainder(found.position[1], 2.0 * np.pi) == pytest.approx(np.remainder(-3.14, 2.0 * np.pi))
    assert np.remainder(found.attitude[2], 2.0 * np.pi) == pytest.approx(np.remainder(-3.14, 2.0 * np.pi))
    assert np.abs(apart[:, 8]).max() < 0.01


def test_each_component_has_a_middle_of_its_own():
    north, east, down = (displaced(START, np.eye(9)[k], np.eye(9)) for k in range(3))
    assert difference(middle([north, east, down])[0], START) == pytest.approx(np.zeros(9), abs=1e-6)


def test_one_solution_that_is_lost_moves_the_estimate_no_further_than_to_its_neighbour():
    far, _ = middle(three([0.0, 0.1, 1e3]))
    assert difference(far, START)[:3] == pytest.approx(np.full(3, 0.1), abs=1e-6)
    assert far.covariance[0, 0] > 1e5


def recorded(fault=None):
    table = deepcopy(SHORT)
    table["duration_s"] = 40.0
    if fault is not None:
        table["fault"] = [fault]
    return record(Scenario.from_toml(table, source="short"), 3)


@pytest.fixture(scope="module")
def jumping():
    """A run whose fixes are off by 60 m for ten seconds, and the trials of the row and its three solutions."""
    recording = recorded({
        "kind": "bias_step", "instruments": ["gnss"], "start_s": 20.0, "end_s": 30.0, "offset_m": [60.0, 0.0, 0.0],
    })  # fmt: skip
    return recording, {row: run_trial(make(row), recording) for row in (*ROWS, "mid-value")}


def test_the_row_is_the_middle_of_the_three_rows(jumping):
    recording, trials = jumping
    assert all(t.status == "ok" for t in trials.values())
    error = {row: errors(trial, recording)[:, :6] for row, trial in trials.items()}
    assert error["mid-value"] == pytest.approx(np.median([error[row] for row in ROWS], axis=0), abs=1e-4)


def test_the_covariance_grows_where_they_disagree(jumping):
    _, trials = jumping
    sigma = {row: np.sqrt(trial.covariance[:, 0, 0]) for row, trial in trials.items()}
    before, during = trials["ekf"].time < 19.0, (trials["ekf"].time > 22.0) & (trials["ekf"].time < 30.0)
    assert np.all(sigma["mid-value"][before] < 1.3 * sigma["ekf"][before])
    assert np.max(sigma["mid-value"][during] / sigma["ekf"][during]) > 3.0
    apart = trials["mid-value"].diagnostics["apart"]
    assert np.max(apart[during]) > 10.0 * np.max(apart[before])


def test_a_solution_of_no_numbers_is_left_out(monkeypatch):
    recording = recorded()
    row = make("mid-value")
    lost = row.solver._solutions["window"]
    plain = lost.update
    monkeypatch.setattr(
        lost,
        "update",
        lambda m: displaced(e := plain(m), np.full(9, np.nan), e.covariance) if m.time > 20.0 else plain(m),
    )
    trial = run_trial(row, recording)
    assert trial.status == "ok", trial.reason
    assert np.isfinite(errors(trial, recording)[:, :2]).all()
