"""The table of costs: that it holds all rows, how it is read and written, and how boards show it."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import simnav
from simnav.estimator import find, lacking, make, names
from simnav.leaderboard.campaign.request import comes_with_simnav
from simnav.leaderboard.cli import app
from simnav.leaderboard.ranking import stored_costs
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.ranking_table import track_table
from simnav.leaderboard.ranking.stored_costs import FILE, CostMultiple, cost_of, read, save
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.result import Result
from simnav.scenario import load
from simnav.source import record
from tests.leaderboard.ranking.test_ranking import campaign

ROWS = (
    CostMultiple("ekf", "ekf", "open-sea-v1", 1.0, 0.98, 1.02, 15),
    CostMultiple("sw-fgo", "ekf", "open-sea-v1", 3.876, 3.71, 4.12, 15),
    CostMultiple("ship-fgo", "ekf", "open-sea-v1", 3.1, 3.0, 3.2, 15),
    CostMultiple("ship-fgo", "ship-ekf", "fishing-vessel-v1", 4.4, 4.3, 4.5, 15),
    CostMultiple("ekf-rts", "ekf-rts", "open-sea-v1", 1.0, 0.99, 1.01, 15),
)


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A table of costs in the place of the one that comes with simnav."""
    file = save(ROWS, tmp_path / "costs.json")
    _in_place(file, monkeypatch)
    return file


def _in_place(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored_costs, "stored", lambda: read(file))


def board(rows: dict[str, float]) -> list[Result]:
    return campaign({"one-v1": {"oracle": 1.0, "ekf": 2.0} | rows}, seeds=12)


def test_the_table_that_comes_with_simnav_has_all_its_rows():
    """If a row is new: simnav bench --all --output leaderboard/ranking/costs.json"""
    costs = read(FILE)
    mine = {name for name in names() if comes_with_simnav(find(name))}
    assert {r.estimator for r in costs.rows} == mine
    assert costs.measured.date
    assert costs.measured.cpu
    ship = record(load("fishing-vessel").model_copy(update={"duration": 20.0}), 0)
    for name in mine:
        with_imu, without = (costs.multiple_of(name, [plain]) for plain in ("ekf", "ship-ekf"))
        assert with_imu is not None
        assert (without is None) == bool(lacking(make(name).needs, ship.instruments)), name
    own = [costs.multiple_of(name, [name]) for name in ("ekf", "ship-ekf", "ekf-rts", "ship-ekf-rts")]
    assert all(c is not None and 0.9 < c.value < 1.1 for c in own)


def test_what_is_written_is_read(tmp_path: Path):
    found = read(save(ROWS, tmp_path / "costs.json"))
    assert found.rows[0] == ROWS[0]
    assert found.rows[1].value == pytest.approx(ROWS[1].value, rel=1e-3)
    assert found.measured.python.count(".") == 2
    assert found.measured.date


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t[: len(t) // 2], "costs.json is no table of costs: "),
        (lambda t: "[]", "format is [], and this version reads 1"),
        (lambda t: t.replace('"format": 1', '"format": 9'), "format is 9, and this version reads 1"),
        (lambda t: t.replace('"rows"', '"lines"'), "'rows' should be a list"),
        (lambda t: t.replace("3.876", "-3.0"), "rows[1].value is -3.0, and should be a finite number above 0"),
        (lambda t: t.replace("3.876", "NaN"), "rows[1].value is nan, and should be a finite number above 0"),
        (lambda t: t.replace("3.876", '"four"'), "rows[1].value is 'four'"),
        (lambda t: t.replace("3.876", "7.0"), "rows[1].value is 7.0, and should be between low and high"),
        (lambda t: t.replace('"sw-fgo"', "5"), "rows[1].estimator is 5, and should be a text"),
        (lambda t: t.replace('"sw-fgo"', '"ekf"'), "rows[1]: there are two multiples of ekf beside ekf"),
    ],
)
def test_a_damaged_table_is_one_sentence(tmp_path: Path, change, says: str, monkeypatch: pytest.MonkeyPatch):
    file = save(ROWS, tmp_path / "costs.json")
    file.write_text(change(file.read_text()))
    with pytest.raises(RequestError) as caught:
        read(file)
    assert says in str(caught.value)
    assert str(file) in str(caught.value)
    assert "simnav bench --all --output FILE" in str(caught.value)
    assert "\n" not in str(caught.value)
    _in_place(file, monkeypatch)
    with pytest.raises(RequestError, match=r"costs\.json is no table of costs"):
        rank(board({"sw-fgo": 1.5})).to_dict()


def test_a_table_that_is_missing_is_one_sentence(tmp_path: Path):
    with pytest.raises(RequestError, match=r"costs\.json is no table of costs: .*No such file"):
        read(tmp_path / "costs.json")


@pytest.mark.usefixtures("table")
def test_the_plain_row_of_the_board_decides():
    assert cost_of("ship-fgo", "ship-ekf", "horizontal_rmse").value == 4.4
    assert cost_of("ship-fgo", "ekf or ship-ekf", "horizontal_rmse").value == 3.1
    assert cost_of("ship-fgo", "", "horizontal_rmse").plain == "ekf"  # no plain row ran
    assert cost_of("ekf-rts", "", "smoothed_horizontal_rmse").plain == "ekf-rts"
    assert cost_of("ekf-rts", "ekf", "horizontal_rmse") is None
    assert cost_of("sw-fgo(window=10)", "ekf", "horizontal_rmse") is None  # other parameters, another cost


@pytest.mark.usefixtures("table")
def test_a_board_has_the_multiples_and_says_what_is_not_measured():
    from rich.console import Console

    ranking = rank(board({"sw-fgo": 1.5, "my-row": 1.2}))
    (track,) = ranking.tracks
    table = track_table(track)
    cost = table.columns.index("cost × ekf")
    cells = {row[table.columns.index("estimator")]: row[cost] for row in table.rows}
    assert (cells["sw-fgo"], cells["my-row"]) == ("3.88 [3.71, 4.12]", "not measured")
    console = Console(width=600, record=True, file=io.StringIO())
    console.print(table)
    text = " ".join(console.export_text().split())
    assert "Cost not measured: my-row, oracle; 'simnav bench NAME' measures it." in text
    assert "Wall clock: median time" in text
    rows = {r["estimator"]: r["cost"] for r in json.loads(json.dumps(ranking.to_dict()))["tracks"][0]["rows"]}
    assert rows["my-row"] is None
    assert (rows["sw-fgo"]["plain"], rows["sw-fgo"]["value"], rows["sw-fgo"]["high"]) == ("ekf", 3.876, 4.12)
    frame = ranking.to_frame()
    assert {"cost_plain", "cost", "cost_low", "cost_high"} <= set(getattr(frame, "column_names", frame.columns))


def test_costs_are_measured_on_a_scenario_that_suits(tmp_path: Path):
    file = tmp_path / "costs.json"
    found = simnav.costs("ship-ekf,ekf,ship-ekf-rts", epochs=30, rounds=5, output=file)
    pairs = {(r.estimator, r.plain): r for r in found.rows}
    assert pairs.keys() == {
        ("ship-ekf", "ekf"), ("ship-ekf", "ship-ekf"), ("ekf", "ekf"), ("ship-ekf-rts", "ekf"),
        ("ship-ekf-rts", "ekf-rts"), ("ship-ekf-rts", "ship-ekf"), ("ship-ekf-rts", "ship-ekf-rts"),
    }  # fmt: skip
    assert pairs["ekf", "ekf"].scenario == "open-sea-v1"
    assert pairs["ship-ekf", "ship-ekf"].scenario == "fishing-vessel-v1"
    assert 0.5 < pairs["ekf", "ekf"].value < 2.0
    assert 0.5 < pairs["ship-ekf-rts", "ship-ekf-rts"].value < 2.0
    assert [r.estimator for r in read(file).rows] == [r.estimator for r in found.rows]
    assert found.file == str(file)


NEEDY = """
from simnav import Estimate, Estimator

class Needy(Estimator):
    needs = ("terrain_fix", "dvl")

    def reset(self, start, instruments):
        self.position = start.position

    def update(self, measurements):
        return Estimate(measurements.time, self.position)
"""


@pytest.mark.usefixtures("clean_registry")
def test_a_row_for_an_auv_gets_an_auv(tmp_path: Path):
    path = tmp_path / "needy.py"
    path.write_text(NEEDY)
    done = CliRunner().invoke(
        app, ["bench", str(path), "--against", "ekf", "--epochs", "20", "--rounds", "2", "--json"]
    )
    assert done.exit_code == 0
    report = json.loads(done.stdout)
    assert [(m["estimator"], m["plain"], m["scenario"]) for m in report["multiples"]["rows"]] == [
        ("needy", "ekf", "auv-soft-mud-v1")
    ]
    assert report["scenario"] == "auv-soft-mud-v1"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["bench"], "no estimator was asked for"),
        (["bench", "--all", "ekf"], "--all measures the rows that come with simnav"),
        (["bench", "ekf", "--output", "x.json"], "--output goes with --all"),
        (["bench", "--all", "--output", "nowhere/x.json"], "there is no folder"),
    ],
)
def test_wrong_words(words: list[str], says: str):
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    assert says in " ".join(done.output.split())
