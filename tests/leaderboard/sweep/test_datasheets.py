"""Wrong datasheets: the truth stays as it is, the profile is that of the runs, and boards show it."""

from __future__ import annotations

import json
import math
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.ranking import stored_robustness
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.ranking_table import track_table
from simnav.leaderboard.ranking.stored_robustness import Profile, ProfilePoint, profile_of, read, save
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.site.datasheets import COLUMN, cells, profile_charts
from simnav.leaderboard.sweep import datasheets
from simnav.leaderboard.sweep.datasheets import bases, checked_factors, profiles, settings
from simnav.source import record
from tests.leaderboard.ranking.test_ranking import campaign

POINTS = tuple(
    ProfilePoint(name, factor, ratio, 0)
    for name, ratios in (("gnss", (1.1, 1.0, 1.4)), ("imu", (0.9, 1.0, 3.25)))
    for factor, ratio in zip((0.5, 1.0, 4.0), ratios, strict=True)
)
ROW = Profile("sw-fgo", 1, "ekf", 1, "datasheets-with-imu-v1", 4, POINTS)


def short_bases() -> list[dict]:
    """The scenarios of the sweep, cut."""
    tables = bases()
    for table in tables:
        table["duration_s"] = 12.0
        del table["fault"], table["draw"]
    return tables


@pytest.mark.parametrize("table", bases(), ids=lambda t: t["name"])
def test_the_datasheet_changes_and_the_truth_does_not(table):
    table = deepcopy(table) | {"duration_s": 5.0, "fault": []}
    true, *wrong = settings(table, (0.25, 10.0))
    assert (true.instrument, true.factor) == ("", 1.0)
    assert [(s.instrument, s.factor) for s in wrong] == [(i, f) for i in table["instruments"] for f in (0.25, 10.0)]
    before = record(true.scenario, 3)
    for setting in wrong:
        after = record(setting.scenario, 3)
        for name, stream in before.data.aids.items():
            assert after.data.aids[name].value == pytest.approx(stream.value, rel=1e-9, abs=1e-12)
            ratio = after.instruments[name].sigma / before.instruments[name].sigma
            assert ratio == pytest.approx(setting.factor if name == setting.instrument else 1.0)
        if before.data.imu is not None:
            assert after.data.imu.specific_force == pytest.approx(before.data.imu.specific_force, rel=1e-9, abs=1e-9)
            for triad in ("gyroscope", "accelerometer"):
                for figure in ("bias", "bias_instability", "random_walk"):
                    a, b = (getattr(getattr(r.instruments.imu, triad), figure) for r in (after, before))
                    assert a == pytest.approx(b * (setting.factor if setting.instrument == "imu" else 1.0))
    assert len({s.scenario.id for s in (true, *wrong)}) == 1 + len(wrong)


def test_a_figure_that_is_drawn_is_refused():
    table = bases()[0]
    table["instruments"]["dvl"]["sigma_m_s"] = {"uniform": [0.01, 0.1]}
    with pytest.raises(RequestError, match=r"sigma_m_s.*drawn"):
        settings(table, (3.0,))


@pytest.mark.parametrize("given", [(), (1.0,), (0.0,), (-3.0,), (math.nan,), (1e6,), ("3",)])
def test_factors_that_make_no_sense_are_refused(given):
    with pytest.raises(RequestError, match="factors"):
        checked_factors(given)


def test_profiles_are_ratios_on_the_same_seeds():
    found = settings(bases()[0], (3.0,))
    errors = {"ekf": 2.0, "sw-fgo": 3.0}
    results = []
    for setting in found:
        size = 4.0 if setting.instrument == "dvl" else 1.0
        made = campaign({setting.scenario.id: errors | {"sw-fgo": 3.0 * size}}, seeds=6)
        results += [replace(r, estimator_version=7) if r.estimator == "sw-fgo" else r for r in made]
    by_hand = {
        s.instrument: np.exp(np.mean([
            math.log(a.scores["horizontal_rmse"] / b.scores["horizontal_rmse"])
            for a in results for b in results
            if a.scenario == b.scenario == s.scenario.id and (a.estimator, b.estimator) == ("sw-fgo", "ekf")
            and a.seed == b.seed
        ]))
        for s in found
    }  # fmt: skip
    (row,) = profiles(found, results, ["sw-fgo"])
    assert (row.version, row.plain, row.runs) == (7, "ekf", 6)
    assert {p.instrument: p.ratio for p in row.points if p.factor == 3.0} == pytest.approx(
        {name: value for name, value in by_hand.items() if name}
    )
    assert all(p.ratio == pytest.approx(by_hand[""]) for p in row.points if p.factor == 1.0)
    assert row.worst.instrument == "dvl"
    broken = [replace(r, status="diverged", scores={}) if r.estimator == "sw-fgo" else r for r in results]
    (row,) = profiles(found, broken, ["sw-fgo"])
    assert all(p.ratio == pytest.approx(1000.0) and p.failed == 6 for p in row.points)
    assert profiles(found, results, ["ship-ekf"]) == []


def test_the_command_the_call_and_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(datasheets, "bases", short_bases)
    folder, file = tmp_path / "runs", tmp_path / "robustness.json"
    made = simnav.robustness("gnss-only", factors=(4.0,), runs=2, folder=folder, output=file, workers=1)
    assert {(row.plain, row.scenario) for row in made.rows} == {
        ("ekf", "datasheets-with-imu-v1"), ("ship-ekf", "datasheets-without-imu-v1"),
    }  # fmt: skip
    assert {p.instrument for p in made.rows[0].points} == {"imu", "gnss", "dvl", "gyrocompass"}
    assert len(made.to_frame()) == sum(len(row.points) for row in made.rows) == 2 * 4 + 2 * 3
    assert [replace(r, points=()) for r in read(file).rows] == [replace(r, points=()) for r in made.rows]
    assert [p.ratio for p in read(file).rows[1].points] == pytest.approx(
        [p.ratio for p in made.rows[1].points], rel=1e-3
    )
    words = ["robustness", "gnss-only", "--factors", "4", "-n", "2", "--results", str(folder), "--json"]
    ran = CliRunner().invoke(app, [*words, "--plot", str(tmp_path / "r.png")])
    assert ran.exit_code == 0, ran.output
    document = json.loads(ran.stdout)
    assert document["rows"] == json.loads(json.dumps(made.to_dict()["rows"]))
    assert document["rows"][0]["worst"]["factor"] == 4.0
    assert (tmp_path / "r.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 9}, "format is 9"),
        ({"rows": 3}, "'rows' should be a list"),
        ({"version": "1"}, "rows\\[0\\].version is '1'"),
        ({"points": [["imu", 3.0, -1.0, 0]]}, "points\\[0\\]: the ratio is -1.0"),
        ({"points": [["imu", 1.0, 1.0, 0]]}, "no wrong datasheet"),
        ({"points": [["imu", 3.0, 1.0]]}, "should be \\[instrument, factor, ratio, failed runs\\]"),
    ],
)
def test_a_file_that_is_none_is_named(tmp_path: Path, change, message):
    content = json.loads(save([ROW], tmp_path / "r.json").read_text())
    assert read(tmp_path / "r.json").rows == (ROW,)
    for key, value in change.items():
        (content if key in content else content["rows"][0])[key] = value
    (tmp_path / "r.json").write_text(json.dumps(content))
    with pytest.raises(RequestError, match=message):
        read(tmp_path / "r.json")


def test_boards_show_the_profile_of_the_same_version_only(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(stored_robustness, "stored", lambda: (ROW,))
    results = campaign({"one-v1": {"oracle": 1.0, "ekf": 2.0, "sw-fgo": 1.5}}, seeds=12)
    ranking = rank(results)
    (track, *_) = ranking.tracks
    assert {r.version for r in track.rows} == {1}
    assert cells(track).keys() == {"sw-fgo"}
    assert cells(track)["sw-fgo"]["value"] == 3.25
    assert "imu, datasheet 4 times the truth; 4 seeds" in cells(track)["sw-fgo"]["help"]
    exported = {r["estimator"]: r["wrong_datasheet"] for r in ranking.to_dict()["tracks"][0]["rows"]}
    assert exported["ekf"] is None
    assert (exported["sw-fgo"]["ratio"], exported["sw-fgo"]["instrument"], exported["sw-fgo"]["factor"]) == (
        3.25, "imu", 4.0
    )  # fmt: skip
    table = track_table(track)
    column = table.columns.index("wrong datasheet")
    assert {row[table.columns.index("estimator")]: row[column] for row in table.rows}["sw-fgo"] == "3.25"
    (chart,) = profile_charts("sw-fgo", 1)
    assert chart.data["points"]["ratio"] == [1.1, 1.0, 1.4, 0.9, 1.0, 3.25]
    assert COLUMN.key == "datasheet"
    newer = rank([replace(r, estimator_version=2) for r in results])
    assert cells(newer.tracks[0]) == {}
    assert all(r["wrong_datasheet"] is None for r in newer.to_dict()["tracks"][0]["rows"])
    mixed = rank([replace(r, estimator_version=1 + r.seed % 2) for r in results])
    assert {r.version for r in mixed.tracks[0].rows} == {None}
    assert profile_charts("sw-fgo", 2) == []
    assert profile_of("sw-fgo", 1, "ship-ekf", "horizontal_rmse") is None
    assert profile_of("sw-fgo", 1, "ekf or ship-ekf", "horizontal_rmse") == ROW


def test_without_a_file_there_is_no_profile(tmp_path: Path):
    assert stored_robustness.stored(tmp_path / "none.json") == ()
