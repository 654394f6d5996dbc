"""Sweeps: settings of dials, breaking points that are known, a whole sweep that is resumed."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.site.sweeps import sweeps_in
from simnav.leaderboard.sweep.breaking import breaking_point, crossing
from simnav.leaderboard.sweep.settings import chosen_dials, parse_dials, settings
from simnav.scenario import Scenario, load
from tests.cases import POND

BIASED = (
    POND
    + """
[draw]
bias = { uniform = [1, 5] }

[[fault]]
kind = "bias_step"
instruments = ["gnss_position"]
offset_m = [{ draw = "bias" }, 0.0, 0.0]

[[dial]]
name = "bias"
key = "draw.bias"
range = [0.0, 100.0]
unit = "m"
title = "bias to the north"
"""
)


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("sweep") / "biased.toml"
    file.write_text(BIASED)
    return file


@pytest.fixture(scope="module")
def scenario(path: Path) -> Scenario:
    return load(path)


@pytest.fixture(scope="module")
def sweep(scenario: Scenario, tmp_path_factory):
    folder = tmp_path_factory.mktemp("results") / "r"
    return simnav.sweep(scenario, {"bias": [5, 20]}, "gnss-only", runs=3, limit=10.0, output=folder, workers=1)


def test_crossing():
    dial = np.array([0.0, 1.0, 2.0, 4.0])
    assert crossing(dial, np.array([1.0, 1.2, 3.2, 9.0]), 2.2) == pytest.approx(1.5)
    assert crossing(dial, np.array([1.0, 1.2, np.inf, 9.0]), 2.0) == 2.0
    assert crossing(dial, np.array([3.0, 4.0, 5.0, 6.0]), 2.0) == 0.0
    assert math.isinf(crossing(dial, np.ones(4), 2.0))


def test_breaking_point_of_a_known_line():
    """Error 1 + x: twice the clean error at x = 1, the limit 4 at x = 3; the noise of the seeds makes the interval."""
    x = np.linspace(0.0, 5.0, 11)
    noise = np.random.default_rng(1).normal(1.0, 0.05, (40, 1))
    errors = noise * (1.0 + x)
    twice = breaking_point("a", x, errors, None)
    assert twice.value.value == pytest.approx(1.0, abs=0.02)
    limit = breaking_point("a", x, errors, 4.0)
    assert limit.value.value == pytest.approx(3.0, abs=0.15)
    assert limit.value.low < limit.value.value < limit.value.high
    assert limit.value.high - limit.value.low < 0.4
    # Up from the clean value only; not where the error stays small; where more than half of the runs fail.
    assert breaking_point("a", x, errors, None, clean=2).value.value == pytest.approx(3.0, abs=0.02)
    assert math.isinf(breaking_point("a", x, errors, 100.0).value.value)
    down = breaking_point("a", x, errors[:, ::-1], 4.0, clean=10)  # error 6 - x: the clean value is the highest
    assert down.value.value == pytest.approx(2.0, abs=0.15)
    assert down.value.low > down.value.value > down.value.high
    assert math.isinf(breaking_point("a", x, errors[:, ::-1], 100.0, clean=10).value.value)
    errors[:30, 6:] = np.inf
    assert breaking_point("a", x, errors, 100.0).value.value == x[6]


def test_settings_are_scenarios_of_their_own(scenario: Scenario):
    dials = chosen_dials(scenario, {"bias": [5.0, 0.5]})
    assert dials[0][1] == [0.0, 0.5, 5.0]  # ascending, with the clean value
    found = settings(scenario, dials)
    assert [s.scenario.name for s in found] == ["pond-at-bias-0", "pond-at-bias-0p5", "pond-at-bias-5"]
    assert len({s.scenario.content_hash() for s in found}) == 3
    assert [s.scenario.drawn(0).faults[0].offset_position[0] for s in found] == [0.0, 0.5, 5.0]
    # A key does as well, and two make a map.
    two = chosen_dials(scenario, {"bias": [1.0], "instruments.gnss_position.rate_hz": [1, 2]})
    assert len(settings(scenario, two)) == 4
    assert settings(scenario, two)[-1].scenario.instruments["gnss_position"].rate == 2.0
    assert len(chosen_dials(scenario, {"bias": []})[0][1]) == 7


@pytest.mark.parametrize(
    ("dials", "message"),
    [
        ("bais=1,2", "there is no dial 'bais' in pond-v1; did you mean 'bias'?"),
        ("bias=1,200", "dial 'bias' of pond-v1 = 200: it goes from 0 to 100 m; name its key to go beyond: draw.bias"),
        ("bias=1,x", "--dial bias=1,x: the values should be numbers, like --dial bias=1,2,4"),
        ("fault[0].offset_m[0]", "give it two values or more"),
        (["bias=1", "a.b=1,2", "c.d=1,2"], "3 dials were asked for; a sweep turns one, or two for a map"),
        ("fault[1].offset_m=1,2", "there is no key 'fault[1].offset_m'"),
        ("instruments.gnss_position.rate_hz=-1,1", "should be greater than 0"),
    ],
)
def test_a_mistake_gets_a_sentence(scenario: Scenario, dials, message: str):
    with pytest.raises(RequestError) as error:
        settings(scenario, chosen_dials(scenario, parse_dials(dials)))
    assert message in str(error.value)


def test_scores_that_cannot_be_swept(scenario: Scenario):
    with pytest.raises(RequestError, match="not better when lower"):
        simnav.sweep(scenario, "bias=1", "gnss-only", score="availability")
    with pytest.raises(RequestError, match="limit = -1 should be greater than 0"):
        simnav.sweep(scenario, "bias=1", "gnss-only", limit=-1.0)


def test_a_whole_sweep(sweep, scenario: Scenario):
    """The receiver weighs nothing but its fixes: the error is the bias, and some noise."""
    assert [p.values for p in sweep.points] == [(0.0,), (5.0,), (20.0,)]
    assert [p.runs for p in sweep.points] == [3, 3, 3]
    assert [p.error.value for p in sweep.points] == pytest.approx([0.8, 5.1, 20.0], abs=0.6)
    twice, limit = sweep.breaking_points
    assert (twice.criterion, limit.criterion) == ("twice-clean", "limit")
    assert limit.value.value == pytest.approx(10.0, abs=0.6)
    assert 0.0 < twice.value.value < 5.0
    table = sweep.to_frame()
    assert len(table) == 3
    assert json.loads(json.dumps(sweep.to_dict()))["scenario"] == scenario.id
    assert len(sweep.plot().axes) == 1
    (left,) = sweeps_in(sweep.summary.folder.parent)  # for the site
    assert left.scenario == scenario.id
    assert left.section(0)["breaking"][1]["value"] == pytest.approx(limit.value.value, rel=1e-3)


def test_a_sweep_is_resumed_and_extended(sweep, scenario: Scenario):
    more = simnav.sweep(
        scenario, {"bias": [5, 10, 20]}, "gnss-only", runs=3, output=sweep.summary.folder, workers=1
    )  # fmt: skip
    assert (more.summary.skipped, more.summary.computed) == (9, 3)
    assert len(more.points) == 4


def test_the_command_and_a_map(path: Path, tmp_path: Path):
    words = [
        "sweep",
        str(path),
        "--dial",
        "bias=1,5",
        "--dial",
        "instruments.gnss_position.rate_hz=1,2",
        "-e",
        "gnss-only",
    ]
    words += [
        "-n",
        "1",
        "--workers",
        "1",
        "-o",
        str(tmp_path / "r"),
        "--plot",
        str(tmp_path / "map.png"),
        "--limit",
        "3",
    ]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "Breaking points" in done.output
    lines = done.output.splitlines()
    assert any("bias to" in line for line in lines)  # a long heading is folded
    assert sum("gnss-only" in line for line in lines) == 6 + 2 * 2  # settings; twice the clean error and the limit
    assert (tmp_path / "map.png").stat().st_size > 5000
    bad = CliRunner().invoke(app, ["sweep", str(path), "--dial", "bias=1", "-e", "gnss-only", "--plot", "x.txt"])
    assert bad.exit_code == 2
