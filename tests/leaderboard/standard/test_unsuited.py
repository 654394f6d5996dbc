"""Stored results of rows that do not suit their scenario any more."""

from __future__ import annotations

from simnav.leaderboard.results.result import Result
from simnav.leaderboard.standard.unsuited_results import unsuited

_CASES = {
    ("auv-and-ship-v2", "ship-ekf"): "ok",  # it uses no message of the other vessel, which alone gives a position
    ("auv-and-ship-v2", "ship-ukf"): "unsuitable",  # it says so already
    ("auv-and-ship-v2", "ekf-ci"): "ok",
    ("auv-and-ship-v2", "dead-reckoning"): "ok",  # by design
    ("auv-and-ship-v2", "of-somebody-else"): "ok",
    ("ship-turn-v1", "ship-ekf"): "ok",
    ("not-there-v1", "ekf"): "ok",
}


def test_only_those_of_a_rule_that_came_later_are_found() -> None:
    results = [
        Result(scenario=s, seed=k, estimator=e, parameters={}, reference=False, status=status, reason="", scores={})
        for (s, e), status in _CASES.items()
        for k in range(2)
    ]
    assert unsuited(results) == {("auv-and-ship-v2", "ship-ekf")}
