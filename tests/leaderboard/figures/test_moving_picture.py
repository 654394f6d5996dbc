"""The moving picture of ``simnav run --animate``."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from simnav.estimator import make
from simnav.leaderboard.figures import moving_picture as drawing
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial


def test_frames_are_over_the_whole_run_and_show_the_fault(tmp_path, monkeypatch):
    scenario = load("ship-dead-reckoning")
    recording = record(scenario.model_copy(update={"duration": 60.0, "faults": ()}), 0)
    trial = run_trial(make("ship-ekf"), recording)
    stream = recording.data.aids["gnss"]
    stream.faults[stream.time > 30.0] = 1
    titles = []
    monkeypatch.setattr("matplotlib.axes.Axes.set_title", lambda self, text, **_: titles.append(text))
    file = drawing.moving_picture(recording, [("ship-ekf", trial)], tmp_path / "run.gif", frames=3)
    assert [float(title.rpartition(", ")[2][:-2]) for title in titles[::2]] == pytest.approx([0, 30, 60], abs=1)
    assert titles[1::2] == ["close-up"] * 3
    with Image.open(file) as image:
        assert (image.n_frames, image.info["loop"]) == (3, 0)
        faulty = np.array([int(drawing._FAULTY[i : i + 2], 16) for i in (1, 3, 5)])
        found = []
        for k in range(3):
            image.seek(k)
            pixels = np.asarray(image.convert("RGB"))[:300].astype(int)  # above the legend
            found.append(int((np.abs(pixels - faulty).max(axis=2) < 25).sum()))
    assert found[0] == 0
    assert found[2] > 20


def test_the_ellipse_holds_95_percent_and_lies_as_the_covariance_does():
    path = drawing._Path(np.array([0.0, 1.0]), np.zeros((2, 2)))
    estimates = drawing._Estimates("ekf", path, np.array([np.full((2, 2), np.nan), np.diag([4.0, 1.0])]))
    assert len(estimates.ellipse(0.5)) == 0  # no covariance then
    outline = estimates.ellipse(1.0)
    assert outline.max(axis=0) == pytest.approx(np.sqrt(5.991) * np.array([2.0, 1.0]), rel=1e-3)


def test_the_bow_points_along_the_heading():
    axes = Figure().subplots()
    drawing._draw_vessel(axes, np.array([10.0, 20.0]), np.pi / 2.0, 2.0)
    (outline,) = axes.patches
    assert outline.get_xy()[0] == pytest.approx([12.0, 20.0])
