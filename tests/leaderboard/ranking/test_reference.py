"""Reference figures: measured, stored, read again, and used by a ranking."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from simnav import load
from simnav.leaderboard.ranking import reference
from simnav.leaderboard.ranking.board import Reference
from simnav.leaderboard.ranking.plausibility import beats, too_good
from simnav.leaderboard.ranking.reference_measurement import measure, save
from simnav.leaderboard.ranking.runs import Runs
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.result import Result

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


def test_a_measurement_goes_on_and_a_changed_scenario_begins_anew(tmp_path: Path):
    scenario = load(ROV).model_copy(update={"duration": 4.0})
    measure([scenario], 2, tmp_path, workers=1)
    file = tmp_path / f"{scenario.id}.jsonl"
    before = file.read_text()
    file.write_text(before + before.splitlines()[-1][:40])  # killed while it wrote
    done: list[tuple[int, int]] = []
    found = measure([scenario], 3, tmp_path, workers=1, progress=lambda k, n, _: done.append((k, n)))
    assert done == [(3, 3)]
    assert file.read_text().startswith(before)
    assert found[scenario.id]["horizontal_rmse"].runs == 3
    longer = scenario.model_copy(update={"duration": 5.0})
    again = measure([longer], 2, tmp_path, workers=1)
    assert again[scenario.id]["horizontal_rmse"].runs == 2
    assert again[scenario.id]["horizontal_rmse"].content != found[scenario.id]["horizontal_rmse"].content
    file.write_text(file.read_text().replace('"rms"', '"rsm"'))
    with pytest.raises(RequestError, match="line 2, is no run of the oracle"):
        measure([longer], 2, tmp_path, workers=1)


def test_the_figure_of_another_content_of_a_scenario_is_refused(monkeypatch: pytest.MonkeyPatch):
    figure = Reference(2.0, "oracle", 60, 0.1, True, "new")
    monkeypatch.setattr(reference, "stored", lambda: {"a-v1": {"horizontal_rmse": figure}})

    def cells(content: str) -> dict[str, Runs]:
        scores = {"horizontal_rmse": 3.0}
        both = (("oracle", True), ("ekf", False))
        return {
            n: Runs([Result("a-v1", 0, n, {}, known, "ok", "", scores, scenario_digest=content)]) for n, known in both
        }

    assert reference.reference_of("a-v1", "horizontal_rmse", cells("new")) == figure
    assert reference.reference_of("a-v1", "horizontal_rmse", cells("")) == figure  # not known of old results
    other = reference.reference_of("a-v1", "horizontal_rmse", cells("old"))
    assert (other.value, other.stored) == (pytest.approx(3.0), False)
    log = reference.reference_of("b-v1", "horizontal_rmse", cells("old"), recorded=True)
    assert (log.estimator, log.bounds) == ("ekf", False)
    assert "no oracle and no bound" in log.text


NEGATIVE = {"a-v1": {"x": {"estimator": "oracle", "value": -1, "spread": 0, "runs": 3, "content": ""}}}


@pytest.mark.parametrize(
    "content", ["no json", "{}", '{"format": 99, "figures": {}}', json.dumps({"format": 2, "figures": NEGATIVE})]
)
def test_a_file_that_is_none_is_refused(tmp_path: Path, content: str):
    file = tmp_path / "figures.json"
    file.write_text(content)
    with pytest.raises(RequestError, match="no file of reference figures"):
        reference.stored(file)


def test_the_figures_that_ship_are_of_known_oracles_and_of_scenarios_as_they_are():
    """After a change of a scenario: ``simnav standard reference -s NAME``."""
    for scenario, scores in reference.stored().items():
        assert {r.content for r in scores.values()} == {load(scenario.rpartition("-v")[0]).content_hash()}
        assert set(scores) <= set(reference.ORACLES)
        for r in scores.values():
            assert r.stored
            assert r.estimator in (*reference.ORACLES.values(), *reference.PLAIN)


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


def test_a_row_is_compared_with_the_oracle_run_by_run():
    """On a scenario whose runs differ by a factor of three the figure alone shows little."""
    hard = Reference(1.0, "oracle", 60, 1.1)
    assert not too_good([-0.7] * 10, hard)
    assert beats([-0.7] * 10)
    assert not beats([-0.7] * 4)  # too few
    assert not beats([-0.05, 0.1, -0.1, 0.0, -0.15, 0.05])
