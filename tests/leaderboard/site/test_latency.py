"""The latency-accuracy curve: of a run, and on the page of a scenario."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.suitability import require_suitable, with_long_windows
from simnav.leaderboard.cli import app
from simnav.leaderboard.ranking.runs import Runs
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site.latency import latency_chart
from simnav.scenario import load
from tests.cases import POND

LATE = ("horizontal_rmse_lag_10", "horizontal_rmse_lag_0p5", "horizontal_rmse_lag_2")


def runs(name: str, late: bool) -> Runs:
    scores = [{"horizontal_rmse": 3.0 + k} | (dict.fromkeys(LATE, 2.0 + k) if late else {}) for k in range(3)]
    return Runs([Result("s-v1", k, name, {}, False, "ok", "", s) for k, s in enumerate(scores)])


def test_the_chart_has_the_rows_that_ran_with_lags_from_the_newest_state_on():
    both = {"a": runs("a", late=True), "b": runs("b", late=False)}
    chart = latency_chart(["a", "b"], both)
    assert chart is not None
    curves = chart.data["curves"]["rows"]
    assert list(curves) == ["a"]
    assert curves["a"]["value"] == [0.0, 0.5, 2.0, 10.0]
    assert curves["a"]["middle"] == [4.0, 3.0, 3.0, 3.0]
    assert "reaking" not in chart.caption
    assert latency_chart(["b"], both) is None


def test_a_run_draws_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pond.toml").write_text(POND)
    report = simnav.run("pond.toml", ["gnss-only"], lags="1/2")
    (line,) = report.plot_lags().axes[0].lines
    assert list(line.get_xdata()) == [0.0, 1.0, 2.0]
    with pytest.raises(simnav.RequestError, match="run with lags"):
        simnav.run("pond.toml", ["gnss-only"]).plot_lags()
    refused = CliRunner().invoke(app, ["run", "pond.toml", "-e", "gnss-only", "--plot-lags", "x.png"])
    assert refused.exit_code == 2
    assert "give delays" in refused.output


def test_rows_that_do_not_look_back_are_named_and_windows_are_long_enough(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pond.toml").write_text(POND)
    _, late = simnav.run("pond.toml", ["gnss-only"], lags="1/2").shown()
    assert late.caption is not None
    assert "is repeated: gnss-only(lags=1/2)" in late.caption
    turn, lags = load("ship-turn"), {"lags": "25"}
    window, plain = EstimatorRequest("ship-fgo", lags), EstimatorRequest("ship-ekf", lags)
    with pytest.raises(simnav.RequestError, match=r"ship-fgo\(lags=25\) on .*a lag of 25 s is longer than the window"):
        require_suitable(turn, [plain, window])
    longer, same = with_long_windows(turn, [window, plain])
    assert (longer.parameters, same) == ({"lags": "25", "window": 26}, plain)
    require_suitable(turn, [longer])
