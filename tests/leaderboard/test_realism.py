"""`simnav log realism`: what is like a recording passes, what is not fails, and the fit returns the processes."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import simnav
from simnav.kinds import KINDS
from simnav.leaderboard.cli import app
from simnav.leaderboard.realism.classifier import area, judge
from simnav.leaderboard.realism.errors import ErrorSeries, comparable
from simnav.leaderboard.realism.features import feature_names, windows_of
from simnav.leaderboard.realism.fit import fitted
from simnav.leaderboard.realism.report import GOAL, RealismReport, compared
from simnav.scenario import parse
from simnav.sensors.error_processes import ERROR_PROCESSES, TotalError
from simnav.spec import SpecError
from simnav.types import TapStates
from simnav.world import Surroundings

DATA = Path(os.environ.get("SIMNAV_DATA", "data"))
SWING = {"kind": "gauss_markov_2", "sigma_deg": 0.12, "period_s": 9.0, "damping": 0.25}
SLOW = {"kind": "gauss_markov", "sigma_deg": 0.2, "correlation_time_s": 30.0}
WHITE = {"kind": "white", "sigma_deg": 0.03}


def headings(tables: list[dict], seeds: range, duration: float = 600.0) -> list[ErrorSeries]:
    """Errors of a heading at 1 Hz that are the sum of processes."""
    specs = [ERROR_PROCESSES.items()[table["kind"]].from_toml(table) for table in tables]
    time = np.arange(1.0, duration + 1.0)
    zero = np.zeros((len(time), 3))
    tap = TapStates(time, zero, zero, zero, zero, zero)
    kind = KINDS["gyrocompass"]
    return [
        ErrorSeries(
            f"run {seed}", time, TotalError(specs, kind, seed, "g").at(tap, zero[:, :1], Surroundings()).error, 1.0,
            duration,
        )
        for seed in seeds
    ]  # fmt: skip


def test_the_area_is_that_of_mann_and_whitney():
    assert area(np.array([1.0, 2.0]), np.array([3.0, 4.0])) == 1.0
    assert area(np.array([1.0, 2.0]), np.array([1.0, 2.0])) == 0.5
    assert area(np.array([0.0, 3.0]), np.array([1.0])) == 0.5


def test_features_of_white_noise_are_known():
    windows = windows_of(headings([{"kind": "white", "sigma_deg": 0.2}], range(4)))
    median = dict(zip(feature_names(("heading",)), np.median(windows.values, axis=0), strict=True))
    assert np.degrees(np.exp(median["log sd of heading"])) == pytest.approx(0.2, rel=0.05)
    assert abs(median["autocorrelation at 1 s of heading"]) < 0.06
    assert abs(median["spectral slope of heading"]) < 0.15
    assert abs(median["kurtosis of heading"]) < 0.4
    assert median["missing readings"] == 0.0
    assert windows.values.shape == (4 * 19, 7)


def test_missing_readings_are_a_feature():
    (whole,) = headings([WHITE], range(1))
    keep = np.arange(len(whole.time)) % 4 != 0
    holes = ErrorSeries("holes", whole.time[keep], whole.error[keep], 1.0, whole.duration)
    assert windows_of([holes]).values[:, -1].mean() == pytest.approx(0.25, abs=0.02)


def test_a_white_heading_fails_at_once_and_a_coloured_one_passes():
    pytest.importorskip("sklearn")
    real = headings([SWING, SLOW, WHITE], range(100, 104))
    kind = KINDS["gyrocompass"]
    white = compared("gyrocompass", kind, real, headings([{"kind": "white", "sigma_deg": 0.235}], range(6)))
    assert white.verdict.auc > 0.95
    assert white.verdict.interval[0] > 0.9
    assert not white.rows()[0]["close"]
    assert "autocorrelation at 1 s" in white.telling(2)[0][0] or "slope" in white.telling(2)[0][0]
    same = compared("gyrocompass", kind, real, headings([SWING, SLOW, WHITE], range(6)))
    assert same.verdict.auc < 0.65
    row = same.rows()[0]
    assert row["sd"] == pytest.approx(row["sd_simulated"], rel=0.2)
    assert row["autocorrelation_1_s"] == pytest.approx(row["autocorrelation_1_s_simulated"], abs=0.15)


def test_the_fit_returns_the_processes():
    fit = fitted(headings([SWING, SLOW, WHITE], range(6), 1800.0))
    text = fit.to_toml("gyrocompass", KINDS["gyrocompass"])
    assert np.degrees(fit.white[0]) == pytest.approx(0.03, abs=0.02)
    parts = list(zip(fit.shapes, np.degrees(fit.sigma[:, 0]), strict=True))
    (swing,) = [(shape["period_s"], sigma) for shape, sigma in parts if shape["kind"] == "gauss_markov_2"]
    assert swing == (pytest.approx(9.0, abs=1.1), pytest.approx(0.12, abs=0.04))
    slow = [sigma for shape, sigma in parts if shape["kind"] == "gauss_markov"]
    assert np.hypot.reduce(slow) == pytest.approx(0.2, abs=0.05)
    head = 'name = "a"\nversion = 1\ntitle = "a"\nduration_s = 10.0\n[start]\nlatitude_deg = 1.0\nlongitude_deg = 1.0\n'
    assert len(parse(head + text).aids["gyrocompass"].processes) == len(fit.shapes) + (fit.freedom < 20.0)


def test_heavy_tails_are_found():
    fit = fitted(headings([{"kind": "heavy_tailed", "sigma_deg": 0.1, "degrees_of_freedom": 3.0}], range(4)))
    assert fit.freedom < 5.0
    assert np.isinf(fitted(headings([WHITE], range(4))).freedom)


def test_the_figure_shows_every_instrument():
    pytest.importorskip("sklearn")
    real = headings([SLOW], range(3))
    one = compared("gyrocompass", KINDS["gyrocompass"], real, headings([SLOW], range(3)))
    report = RealismReport("twin-v1", "log-v1", [one])
    figure = report.plot()
    assert len(figure.axes) == 2
    assert "AUC" in figure.axes[0].get_title(loc="left")
    assert report.to_dict()["instruments"][0]["fit"].startswith("[instruments.gyrocompass]")
    assert len(report.rows()) == 1


needs_nbp1406 = pytest.mark.skipif(not (DATA / "nbp1406").is_dir(), reason=f"no folder nbp1406 in {DATA} (SIMNAV_DATA)")


def test_bad_requests_are_answered_with_a_sentence():
    def said(*words: str) -> str:
        result = CliRunner().invoke(app, ["log", "realism", *words])
        assert result.exit_code == 2
        return " ".join(result.stderr.split())

    assert "open-sea-v1 has no [log]: it is no recording" in said("open-sea", "open-sea")
    assert "'sextant' is not measured in ship-nbp1406-v1" in said(
        "ship-nbp1406-twin", "ship-nbp1406", "--instrument", "sextant"
    )
    assert "simulates no instrument, by name and equation, that auv-akit-v1 measures" in said(
        "ship-nbp1406-twin", "auv-akit"
    )


def test_a_velocity_solved_from_beams_is_like_that_of_a_dvl():
    beams = simnav.load("lawnmower-beams")
    recorded = simnav.load("auv-akit")
    assert ("solution", "dvl") in comparable(beams, recorded)
    assert not any(here in ("beams", "imu") for here, _ in comparable(beams, recorded))
    result = CliRunner().invoke(app, ["log", "realism", "lawnmower-beams", "auv-akit", "--instrument", "beams=dvl"])
    assert result.exit_code == 2
    assert "did you mean 'solution=dvl'?" in " ".join(result.stderr.split()) or "solution=dvl" in result.stderr


def test_without_scikit_learn_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "sklearn.linear_model", None)
    windows = windows_of(headings([WHITE], range(3)))
    with pytest.raises(SpecError, match=r"needs scikit-learn: pip install 'simnav\[realism\]'"):
        judge(windows, windows)


def _is_like(twin: str, recorded: str, instrument: str) -> None:
    """The goal of a twin: no classifier knows it, and each component has the size and the colour of the real error."""
    pytest.importorskip("sklearn")
    report = simnav.realism(twin, recorded, runs=12, instrument=instrument)
    assert [one.name for one in report.instruments] == instrument.split(",")
    for one in report.instruments:
        assert one.verdict.auc <= GOAL
    for row in report.rows():
        assert row["close"], row


@needs_nbp1406
def test_the_twin_of_the_ship_has_the_errors_of_the_recording():
    _is_like("ship-nbp1406-twin", "ship-nbp1406", "gyrocompass,gnss")


@pytest.mark.skipif(not (DATA / "akit").is_dir(), reason=f"no folder akit in {DATA} (SIMNAV_DATA)")
def test_the_twin_of_the_auv_has_the_errors_of_the_recordings():
    _is_like("auv-akit-twin", "auv-akit", "dvl")
