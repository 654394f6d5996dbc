"""Reference figures: measured, stored, read again, and used by a ranking."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from simnav import load
from simnav.leaderboard.ranking import reference
from simnav.leaderboard.ranking.board import Reference
from simnav.leaderboard.ranking.plausibility import too_good
from simnav.leaderboard.ranking.reference_measurement import PLAIN, measure, save
from simnav.leaderboard.results.errors import RequestError

ROV = Path(__file__).parents[2] / "cases" / "rov.toml"


def test_figures_are_measured_stored_and_read_again(tmp_path: Path):
    scenario = load(ROV)
    found = measure([scenario], 2, tmp_path / "results", workers=1)
    figure = found[scenario.id]["horizontal_rmse"]
    assert (figure.estimator, figure.runs, figure.stored, figure.bounds) == ("oracle", 2, True, True)
    assert found[scenario.id]["smoothed_horizontal_rmse"].value < figure.value
    file = tmp_path / "figures.json"
    save({"old-v1": {"horizontal_rmse": Reference(2.0, "oracle", 9, 0.1, True)}}, file)
    save(found, file)
    again = reference.stored(file)
    assert set(again) == {"old-v1", scenario.id}
    assert again[scenario.id]["horizontal_rmse"].value == pytest.approx(figure.value, rel=1e-4)
    assert again["old-v1"]["horizontal_rmse"] == Reference(2.0, "oracle", 9, 0.1, True)


NEGATIVE = {"a-v1": {"x": {"estimator": "oracle", "value": -1, "spread": 0, "runs": 3}}}


@pytest.mark.parametrize(
    "content", ["no json", "{}", '{"format": 99, "figures": {}}', json.dumps({"format": 1, "figures": NEGATIVE})]
)
def test_a_file_that_is_none_is_refused(tmp_path: Path, content: str):
    file = tmp_path / "figures.json"
    file.write_text(content)
    with pytest.raises(RequestError, match="no file of reference figures"):
        reference.stored(file)


def test_the_figures_that_ship_are_of_known_oracles():
    for scores in reference.stored().values():
        assert set(scores) <= set(reference.ORACLES)
        for r in scores.values():
            assert r.stored
            assert r.estimator in (*reference.ORACLES.values(), *PLAIN)


def test_a_figure_is_a_geometric_mean_of_what_was_completed():
    assert reference.figure([1.0, 4.0, math.nan], "oracle").value == pytest.approx(2.0)
    assert reference.figure([math.nan, 0.0], "oracle") is None
    assert not Reference(1.0, "ekf", 200, 0.3).bounds


def test_nobody_is_implausible_by_chance_or_beside_what_is_no_bound():
    oracle = Reference(1.0, "oracle", 200, 0.3)
    assert too_good([-14.0], oracle)
    assert not too_good([-0.6], oracle)  # one lucky run
    assert too_good([-0.6] * 20, oracle)
    assert not too_good([-0.1] * 20, oracle)  # within the margin of the oracle
    assert not too_good([-14.0] * 5, Reference(1.0, "ekf", 200, 0.3))
    assert not too_good([-14.0] * 5, Reference())
    assert not too_good([], oracle)
