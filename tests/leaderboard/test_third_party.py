"""An instrument and a fault of a third party on the command line, in CSV files and in figures."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from simnav.estimator import make
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.figures.run_figure import run_figure
from simnav.leaderboard.results.recording_export import write_csv
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial


@pytest.fixture
def recording(plugins):
    return record(load(plugins / "lagoon.toml"), 1)


def call(*words, code: int = 0):
    result = CliRunner().invoke(app, [str(w) for w in words])
    assert result.exit_code == code, (result.exit_code, result.stdout, result.stderr)
    return result


def test_csv_has_the_names_and_the_units_of_its_components(recording, tmp_path):
    assert tmp_path / "transponder.csv" in write_csv(recording, tmp_path)
    lines = (tmp_path / "transponder.csv").read_text().splitlines()
    assert lines[0] == "time_s,range_m,bearing_deg,faults"
    rows = np.genfromtxt(lines[1:], delimiter=",")
    stream = recording.data.aids["transponder"]
    assert np.array_equal(rows[:, 1], stream.value[:, 0])
    assert np.radians(rows[:, 2]) == pytest.approx(stream.value[:, 1], rel=1e-15)
    assert np.array_equal(rows[:, 3] != 0, stream.faults != 0)


def test_the_figure_of_a_run_shows_its_innovations(recording):
    figure = run_figure(recording, [("ekf", run_trial(make("ekf"), recording))])
    labels = {axes.get_title() or axes.get_ylabel() for axes in figure.axes}
    assert any("transponder" in label for label in labels), labels


def test_run_and_simulate(plugins, tmp_path):
    scenario = plugins / "lagoon.toml"
    done = call("run", scenario, "-e", "ekf,ukf", "--plot", tmp_path / "run.png", "--json")
    rows = json.loads(done.stdout)["estimators"]
    assert [row["status"] for row in rows] == ["ok", "ok"]
    assert (tmp_path / "run.png").stat().st_size > 10_000
    table = call("simulate", scenario, "-o", tmp_path / "lagoon.npz").stdout
    assert "beacon" in table


def test_a_plug_in_file_on_the_command_line(plugins):
    listed = json.loads(call("--plugin", plugins / "beacon.py", "list", "instruments", "--json").stdout)
    beacon = next(e for e in listed["instruments"] if e["kind"] == "beacon")
    assert beacon["summary"].startswith("Range and bearing")
    assert beacon["keys"]["sigma_range_m"]["required"]
    assert "passes" in call("--plugin", plugins / "beacon.py", "check", "ekf").stdout


def test_a_plug_in_file_that_is_not_there_is_a_mistake():
    assert "no plug-in file 'nowhere.py'" in call("--plugin", "nowhere.py", "list", code=2).stderr


def test_a_plug_in_that_is_refused_is_named(plugins, tmp_path):
    broken = tmp_path / "broken.py"
    broken.write_text((plugins / "beacon.py").read_text().replace('"sigma_range_m": 0.5', '"sigma_range_m": -0.5'))
    stderr = call("--plugin", plugins / "echo.py", "--plugin", broken, "list", code=2).stderr
    words = " ".join(stderr.replace("│", " ").split())
    assert "broken.py: the example of kind 'beacon': sigma_range_m = -0.5: should be at least 0" in words


def test_who_leaves_an_instrument_out_is_named(plugins, tmp_path):
    """GTSAM's factors are made from compiled equations: the beacon has none. Without a fix nothing is left to it."""
    text = (plugins / "lagoon.toml").read_text().partition("[[fault]]")[0].replace("120.0", "4.0")
    for name in ("beacon.py", "echo.py"):
        (tmp_path / name).write_text((plugins / name).read_text())
    (tmp_path / "alone.toml").write_text(text)
    (tmp_path / "short.toml").write_text(text + "[instruments.terrain_fix]\nrate_hz = 1.0\nsigma_m = 3.0\n")
    alone, words = (
        " ".join(call("run", tmp_path / name, "-e", "ekf,gtsam-fixed-lag").stderr.split())
        for name in ("alone.toml", "short.toml")
    )
    assert "gtsam-fixed-lag: unsuitable: it uses no instrument that gives a position" in alone
    assert "gtsam-fixed-lag shows no innovation of transponder (beacon): most likely it leaves it out" in words
    assert "ekf shows" not in words
