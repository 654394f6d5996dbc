"""The rows that an estimator is compared with where none are named."""

from __future__ import annotations

from simnav.estimator import names
from simnav.leaderboard.baselines import MOST, baselines, baselines_or
from simnav.scenario import load


def test_they_suit_the_scenario_and_are_few() -> None:
    assert baselines([load("open-sea")])[:1] == ["ekf"]
    under_water = baselines([load("auv-survey")])
    assert "gnss-only" not in under_water
    assert len(under_water) == MOST
    both = baselines([load("open-sea"), load("ship-straight")])
    assert both[0] == "ekf"
    assert "ship-ekf" in both
    assert len(set(both)) == len(both) <= 2 * MOST


def test_what_is_named_is_taken_and_all_are_all() -> None:
    scenario = load("ship-straight")
    assert [r.label for r in baselines_or("ekf,ukf", [scenario])] == ["ekf", "ukf"]
    assert [r.name for r in baselines_or("all", [scenario])] == names()
    assert [r.name for r in baselines_or(None, [scenario])] == baselines([scenario])
