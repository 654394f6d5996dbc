"""Runs of one estimator on one scenario."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from simnav.leaderboard.ranking.runs import Runs, group
from simnav.leaderboard.results.result import Result


def ended(seed: int, status: str = "ok", **fields: Any) -> Result:
    scores = {"horizontal_rmse": 1.0 + seed} if status == "ok" else {}
    return Result("s-v1", seed, "e", {}, False, status, "why", scores, **fields)


def test_runs_of_different_length_share_a_time_axis():
    def run(seed: int, end: float) -> Result:
        time = np.linspace(0.0, end, 11, dtype=np.float32)
        return Result("s-v1", seed, "e", {}, False, "ok", "", {}, {"time": time, "horizontal": 2.0 * time})

    band = Runs([run(0, 50.0), run(1, 100.0)]).band("horizontal")
    np.testing.assert_allclose(band.time, np.linspace(0.0, 100.0, 11))
    np.testing.assert_allclose(band.values[1], 2.0 * band.time)
    np.testing.assert_allclose(band.values[0, :6], 2.0 * band.time[:6])
    assert np.isnan(band.values[0, 6:]).all()


def test_failures_do_not_count_as_runs_that_do_not_suit():
    runs = group([ended(2, "timeout"), ended(0), ended(1), ended(3, "no-recording"), ended(4, "unsuitable")])["s-v1"][
        "e"
    ]
    assert [r.seed for r in runs.results] == [0, 1, 2, 3, 4]
    assert (len(runs.tried), len(runs.good), runs.failed) == (3, 2, 1)
    assert runs.statuses == {"ok": 2, "timeout": 1}
    assert runs.scores("horizontal_rmse").tolist() == [1.0, 2.0]
    assert runs.unsuitable() == "why"
    assert Runs([ended(0, "unsuitable")]).tried == []
    assert Runs([ended(0, "no-recording")]).unsuitable() == ""


def test_a_run_counts_once():
    with pytest.raises(ValueError, match="two results of 'e' on s-v1"):
        Runs([ended(0), ended(1), ended(0)])
    with pytest.raises(ValueError, match="two results of 'e' on s-v1"):
        Runs([ended(0, note="morning"), ended(0, note="evening")])  # a note makes no other run of it
