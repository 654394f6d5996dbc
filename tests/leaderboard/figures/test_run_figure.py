"""The figure of ``simnav run --plot``, and what the command says of its options."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

from simnav.estimator import make
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.figures.run_figure import fault_spans, fixes, innovation_unit, outage_spans, run_figure
from simnav.scenario import load
from simnav.sensors.faults import Outage
from simnav.source import record
from simnav.trial import run_trial


@pytest.fixture(scope="module")
def run():
    recording = record(load("ship-dead-reckoning").model_copy(update={"duration": 60.0, "faults": ()}), 0)
    trial = run_trial(make("ship-ekf"), recording)
    return trial, run_figure(recording, [("ship-ekf", trial)])


def test_panels_of_innovations_have_the_unit_of_their_instrument(run):
    trial, figure = run
    panels = {ax.get_ylabel(): ax for ax in figure.axes}
    assert {"innovation\ngnss [m]", "innovation\nspeed log [m/s]", "nis\ngyrocompass [-]"} <= set(panels)
    (line,) = (x for x in panels["innovation\ngyrocompass [deg]"].lines if x.get_label() == "ship-ekf")
    given = np.asarray(trial.diagnostics["innovation.gyrocompass"], dtype=float)
    assert np.allclose(line.get_ydata(), np.degrees(given), equal_nan=True)


def test_labels_of_panels_do_not_run_into_each_other(run):
    _, figure = run
    figure.draw_without_rendering()
    for column in {round(ax.get_position().x0, 3) for ax in figure.axes[1:]}:
        boxes = [ax.yaxis.label.get_window_extent() for ax in figure.axes if round(ax.get_position().x0, 3) == column]
        boxes.sort(key=lambda box: box.y0)
        assert all(lower.y1 < upper.y0 for lower, upper in pairwise(boxes))


def test_an_innovation_of_several_quantities_has_no_unit(plugins):
    kinds = {stream.kind for stream in record(load(plugins / "lagoon.toml"), 1).data.aids.values()}
    assert innovation_unit("beacon") is None
    assert "beacon" in kinds


def test_the_help_names_the_unit_of_the_alert_limit():
    shown = CliRunner().invoke(app, ["run", "--help"], env={"COLUMNS": "200"}).stdout
    assert "diagrams in metres;" in " ".join(shown.split())


def test_innovations_of_an_instrument_slower_than_the_estimates_are_drawn_as_points(plugins):
    """A line through single values with gaps between them would be invisible."""
    scenario = load(plugins / "lagoon.toml")
    slow = scenario.instruments["transponder"].model_copy(update={"rate": 0.5})
    instruments = {**scenario.instruments, "transponder": slow}
    scenario = scenario.model_copy(update={"duration": 20.0, "faults": (), "instruments": instruments})
    recording = record(scenario, 1)
    figure = run_figure(recording, [("ekf", run_trial(make("ekf"), recording))])
    (axes,) = (a for a in figure.axes if "nis\ntransponder" in a.get_ylabel())
    points = [line for line in axes.lines if line.get_marker() == "." and len(line.get_xdata())]
    assert [len(line.get_xdata()) for line in points] == [len(recording.data.aids["transponder"])]
    (axes,) = (a for a in figure.axes if "nis\ndepth" in a.get_ylabel())
    assert not any(line.get_marker() == "." and len(line.get_xdata()) for line in axes.lines)


def test_a_fix_that_is_no_latitude_and_longitude_is_not_drawn_as_one(plugins, tmp_path):
    for name in ("beacon.py", "echo.py", "lagoon.toml"):
        (tmp_path / name).write_text((plugins / name).read_text().replace('role="range"', 'role="fix"'))
    recording = record(load(tmp_path / "lagoon.toml").model_copy(update={"duration": 5.0, "faults": ()}), 1)
    assert fixes(recording) == {}


def test_faults_are_shaded_and_the_nis_has_its_bound():
    recording = record(load("harbour-multipath"), 1)
    spans = fault_spans(recording)
    assert [name for _, _, name in spans] == ["multipath gnss", "frozen gnss", "false zero dvl"]
    figure = run_figure(recording, [("ekf", run_trial(make("ekf"), recording))])
    first = next(a for a in figure.axes if a.get_ylabel().startswith("North error"))
    assert {t.get_text() for t in first.texts} == {name for _, _, name in spans}
    assert len(first.patches) == len(spans)
    (axes,) = (a for a in figure.axes if a.get_ylabel() == "nis\ngnss [-]")
    levels = [line.get_ydata()[0] for line in axes.lines if len(line.get_ydata()) == 2]
    assert levels == [pytest.approx(7.815, abs=1e-3)]  # of chi-square with three degrees of freedom


def test_an_outage_is_where_nothing_came(plugins):
    """A fault that takes single measurements away is no outage as long as it lasts."""
    scenario = load(plugins / "lagoon.toml")
    whole = Outage(instruments=("transponder",), start=30.0, end=60.0)
    spans = outage_spans(record(scenario.model_copy(update={"faults": (whole,)}), 1))
    assert spans == [(30.0, 60.0, "no transponder")]
    random = Outage(instruments=("transponder",), start=20.0, mean_active=5.0, mean_gap=40.0)
    recording = record(scenario.model_copy(update={"faults": (random,)}), 1)
    time, spans = recording.data.aids["transponder"].time, outage_spans(recording)
    assert 0 < sum(b - a for a, b, _ in spans) < 60.0
    for start, end, _ in spans:
        assert not np.any((time >= start) & (time < end))
    missing = set(np.arange(1.0, 121.0)) - set(time)
    assert missing == {t for t in np.arange(1.0, 121.0) for a, b, _ in spans if a <= t < b}


def test_what_says_that_an_instrument_is_wrong_has_a_panel_first(run):
    trial, _ = run
    recording = record(load("ship-dead-reckoning").model_copy(update={"duration": 60.0, "faults": ()}), 0)
    many = {f"nis.one{k}": np.arange(len(trial), dtype=float) for k in range(20)}
    told = replace(trial, diagnostics={**many, "doubt.gnss": np.linspace(0.0, 1.0, len(trial))})
    figure = run_figure(recording, [("mh-ekf", told)])
    assert "doubt\ngnss [-]" in {ax.get_ylabel() for ax in figure.axes}
