"""What is said of a track beside its sentence: cost, and where the best rows are worse."""

from __future__ import annotations

from simnav.leaderboard.ranking.board import TrackRanking
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.stored_costs import cost_of
from simnav.leaderboard.ranking.summary import best_rows, limits
from simnav.leaderboard.results.result import Result

#: Errors of rows on two scenarios: `iae` is best over both, and worse than the plain row on the second.
ERRORS = {
    "ekf": (1.0, 1.0),
    "iae": (0.2, 1.5),
    "ukf": (3.0, 3.0),
    "ckf": (4.0, 4.0),
    "iekf": (5.0, 5.0),
    "mckf": (6.0, 6.0),
}


def track() -> TrackRanking:
    results = [
        Result(
            f"{scenario}-v1", seed, label, {}, False, "ok", "", {"horizontal_rmse": error * (1.0 + 0.01 * (seed % 5))}
        )
        for label, errors in ERRORS.items()
        for scenario, error in zip(("calm", "rough"), errors, strict=True)
        for seed in range(30)
    ]
    (found,) = rank(results).tracks
    return found


def test_cost_and_the_worst_scenario_are_said() -> None:
    found = track()
    assert "iae" in {r.estimator for r in best_rows(found)}
    cost = cost_of("iae", "ekf", "horizontal_rmse")
    assert cost is not None
    said = limits(found)
    assert [r.estimator for r in best_rows(found)] == ["iae"]
    assert said.startswith(f"It takes {cost.value:.2g} times the processor time of `ekf`")
    assert said.endswith("its worst scenario is rough-v1, with 50 % more.")


def test_without_another_row_than_the_plain_one_nothing_is_said() -> None:
    found = rank([Result("calm-v1", s, "ekf", {}, False, "ok", "", {"horizontal_rmse": 1.0}) for s in range(12)])
    assert limits(found.tracks[0]) == ""
