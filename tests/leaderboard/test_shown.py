"""Reports at the prompt and in a notebook: short, and with the tables of the command."""

from __future__ import annotations

import numpy as np
import pytest

import simnav
from simnav.estimators.bound import Bound
from simnav.leaderboard.ranking.bounds import BoundReport
from simnav.testing.contract_check import Finding, Report


@pytest.fixture(scope="module")
def report() -> simnav.leaderboard.single_run.RunReport:
    return simnav.run("ship-straight", "gnss-only,ship-ekf", seed=2)


def test_nothing_prints_its_arrays(report) -> None:
    run = report.estimators[0]
    assert repr(report) == "<RunReport: ship-straight-v1, seed 2: gnss-only, ship-ekf>"
    assert repr(run).startswith("<EstimatorRun: gnss-only, ok, horizontal RMSE ")
    assert repr(run.trial).startswith("<Trial: gnss-only, ok, ")
    assert repr(report.recording).startswith("<Recording: ship-straight-v1, seed 2, ")


def test_a_notebook_shows_the_table_of_the_command(report) -> None:
    page = report._repr_html_()
    assert page.startswith("<pre")
    assert "horizontal" in page
    assert "gnss-only" in page
    assert len(page) < 10_000


def test_a_notebook_shows_a_figure_without_pyplot(report) -> None:
    assert report.plot()._repr_png_()[1:4] == b"PNG"


def test_an_evaluation_shows_its_verdict() -> None:
    made = simnav.evaluate("gnss-only", "ship-straight", runs=2, against="ship-ekf", workers=1)
    assert repr(made).startswith("<EvaluationReport: gnss-only may be 1 to 2 of 2 on ship-straight-v1")
    assert "may be 1 to 2 of 2" in made._repr_html_()
    assert repr(made.ranking).startswith("<Ranking: 1 scenarios in the tracks ")


def test_a_bound_shows_a_dozen_epochs() -> None:
    time = np.arange(1.0, 901.0)
    made = BoundReport("pond-v1", 3, False, (Bound("pond-v1", "clean", 3, time, np.tile(np.eye(9), (900, 1, 1))),))
    assert repr(made) == "<BoundReport: pond-v1: bound on the RMS horizontal error [m], 3 seeds>"
    assert made._repr_html_().count("1.41") == 13  # the last line is the whole run


def test_a_contract_test_shows_its_verdict() -> None:
    found = (Finding("units", False, "the first yaw is 69 degrees off"), Finding("reset", True, "it is as new"))
    assert repr(Report("mine", found, False)) == "<Report: mine fails: units>"
    assert repr(Report("mine", found[1:], True)) == "<Report: mine passes>"
