"""The figure of ``simnav run --plot``, and what the command says of its options."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

from simnav.estimator import make
from simnav.leaderboard.cli.application import app
from simnav.leaderboard.figures.run_figure import innovation_unit, run_figure
from simnav.scenario import load
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
