"""The cost of an epoch, beside other rows."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.cli import app
from simnav.leaderboard.ranking.costs import BESIDE

FAILING = """
from simnav import Estimate, Estimator

class Failing(Estimator):
    def reset(self, start, instruments):
        self.count, self.position = 0, start.position

    def update(self, measurements):
        self.count += 1
        if self.count > 5:
            raise KeyError("five")
        return Estimate(measurements.time, self.position)
"""


@pytest.fixture
def failing(tmp_path: Path) -> str:
    path = tmp_path / "failing.py"
    path.write_text(FAILING)
    return str(path)


@pytest.mark.usefixtures("clean_registry")
def test_an_estimator_that_fails_has_a_reason_and_the_others_go_on(failing: str):
    words = ["bench", failing, "-s", "ship-straight", "--against", "gnss-only,ekf", "--epochs", "20", "--rounds", "1"]
    done = CliRunner().invoke(app, [*words, "--json"])
    assert done.exit_code == 1
    report = json.loads(done.stdout)
    assert report["estimators"] == ["failing"]
    costs = {c["estimator"]: c for c in report["costs"]}
    assert (costs["failing"]["status"], costs["failing"]["reason"]) == ("error", "KeyError: 'five'")
    assert costs["failing"]["update_median"] is None
    assert costs["gnss-only"]["status"] == "ok"
    assert costs["ekf"]["status"] == "unsuitable"  # there is no IMU
    assert 0.0 < costs["gnss-only"]["update_median"] <= costs["gnss-only"]["update_p95"]
    table = CliRunner().invoke(app, words).stdout
    assert "failing: error: KeyError: 'five'" in table
    assert "unsuitable" in table


def test_the_default_rows_suit_the_default_scenario():
    report = simnav.bench("gnss-only", epochs=4, rounds=1)
    assert [c.estimator for c in report.costs] == ["gnss-only", *(name for name in BESIDE if name != "gnss-only")]
    assert {c.status for c in report.costs} == {"ok"}
    assert report.epochs == 4
