"""Figures: what is drawn, in which colours, and how it is written."""

from __future__ import annotations

import itertools
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from simnav.leaderboard.figures import plots as figures
from simnav.leaderboard.figures.panels import Bar, bars
from simnav.leaderboard.figures.plots import Band, Curve, Dot, Track
from simnav.leaderboard.figures.ratio_map import ratio_map
from simnav.leaderboard.figures.style import PALETTE, WIDTH, Style, fitted, save, save_as

TIME = np.linspace(1.0, 1200.0, 240)
LABELS = ["ekf", "dead-reckoning", "oracle"]


def band(label: str, size: float, runs: int = 6) -> Band:
    rng = np.random.default_rng(len(label))
    return Band(label, TIME, size * rng.rayleigh(size=(runs, len(TIME))))


def texts(fig) -> str:
    """All texts of a figure, from the artists."""
    import matplotlib.text

    return "\n".join(t.get_text() for t in fig.findobj(matplotlib.text.Text))


def curves_of(ax, label: str):
    return next(line for line in ax.lines if line.get_label() == label)


@pytest.fixture
def style() -> Style:
    return Style(LABELS, ["oracle"])


@pytest.fixture
def truth() -> Track:
    return Track("truth", 10.0 * TIME, 3000.0 * np.sin(TIME / 400.0))


def test_a_colour_belongs_to_one_estimator_in_every_figure(style, truth):
    chart = figures.trajectory(truth, [Track("ekf", truth.east + 5.0, truth.north)], style)
    over_time = figures.error_over_time({"Horizontal error [m]": [band("ekf", 1.0)]}, style)
    cdf = figures.error_cdf([band("ekf", 1.0)], style, label="Horizontal error [m]")
    found = {curves_of(f.axes[0], "ekf").get_color() for f in (chart, over_time, cdf)}
    assert found == {style.colour("ekf")}


def test_styles_differ_for_two_dozen_estimators_and_references_are_grey():
    names = [f"e{i}" for i in range(24)]
    style = Style([*names, "oracle"], ["oracle"])
    looks = {(style.colour(n), str(style.line(n))) for n in names}
    assert len(looks) == 24
    assert style.colour("oracle") not in {light for light, _ in PALETTE}
    assert style.order("oracle") > style.order("e23")


def test_a_reference_takes_no_colour_from_the_others():
    assert Style(["oracle", "ekf"], ["oracle"]).colour("ekf") == Style(["ekf"]).colour("ekf")


# Machado, Oliveira and Fernandes (2009), severity 1.
_VISION = {
    "normal": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def _lab(colour: str, vision) -> np.ndarray:
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.asarray(vision) @ linear, 0.0, 1.0)
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ seen
    f = np.cbrt(np.maximum(xyz / [0.9505, 1.0, 1.089], 1e-9))
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", _VISION)
@pytest.mark.parametrize("dark", [False, True])
def test_palette_can_be_told_apart_with_any_colour_vision(vision, dark):
    seen = [_lab(pair[dark], _VISION[vision]) for pair in PALETTE]
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)) > 10.0


def test_trajectory_names_axes_and_keeps_the_frame_on_the_truth(style, truth):
    wild = Track("dead-reckoning", truth.east + 1e6, truth.north)
    fig = figures.trajectory(truth, [wild], style, fixes={"gnss fixes": truth}, title="Seed 3")
    ax = fig.axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("East [km]", "North [km]")
    assert ax.get_xlim()[1] < 20.0
    assert ax.get_aspect() == 1.0
    for text in ("truth", "dead-reckoning", "gnss fixes", "start", "end", "Seed 3"):
        assert text in texts(fig)


def test_short_trajectories_are_in_metres(style):
    fig = figures.trajectory(Track("truth", np.array([0.0, 0.0]), np.array([0.0, 50.0])), [], style)
    assert fig.axes[0].get_xlabel() == "East [m]"


def test_error_over_time_draws_median_band_and_outages(style):
    b = band("ekf", 2.0, runs=50)
    fig = figures.error_over_time({"Horizontal error [m]": [b]}, style, outages=[(120.0, 300.0, "no gnss")])
    ax = fig.axes[0]
    line = curves_of(ax, "ekf")
    np.testing.assert_allclose(line.get_xdata(), TIME / 60.0)
    np.testing.assert_allclose(line.get_ydata(), np.median(b.values, axis=0))
    edges = np.concatenate([p.vertices for c in ax.collections for p in c.get_paths()])
    low, high = np.percentile(b.values, [5.0, 95.0], axis=0)
    assert edges[:, 1].min() == pytest.approx(low.min())
    assert edges[:, 1].max() == pytest.approx(high.max())
    assert [(p.get_x(), p.get_x() + p.get_width()) for p in ax.patches] == [pytest.approx((2.0, 5.0))]
    assert "no gnss" in texts(fig)
    assert ax.get_yscale() == "log"
    assert "Time [min]" in texts(fig)
    assert "Horizontal error [m]" in texts(fig)


def test_a_median_needs_half_of_the_runs(style):
    values = np.ones((4, len(TIME)))
    values[:3, 100:] = np.nan  # three of four runs end early
    fig = figures.error_over_time({"Error [m]": [Band("ekf", TIME, values)]}, style)
    line = curves_of(fig.axes[0], "ekf").get_ydata()
    assert np.isfinite(line[:100]).all()
    assert np.isnan(line[100:]).all()


def test_cdf_rises_from_zero_to_all_epochs(style):
    values = np.arange(1.0, 101.0)[None, :]
    fig = figures.error_cdf([Band("ekf", values[0], values)], style, label="Horizontal error [m]")
    line = curves_of(fig.axes[0], "ekf")
    x, y = line.get_xdata(), line.get_ydata()
    np.testing.assert_allclose(y, x)  # of 1..100, x % are at most x
    assert fig.axes[0].get_xlabel() == "Horizontal error [m]"
    assert fig.axes[0].get_ylabel() == "Share of epochs [%]"


def test_dots_show_value_interval_and_failures(style):
    rows = [Dot("ekf", 2.0, 1.5, 2.5, note="(1 failed)"), Dot("oracle", 1.0, hollow=True)]
    fig = figures.dots(rows, style, label="Horizontal RMSE [m]")
    ax = fig.axes[0]
    assert [t.get_text() for t in ax.get_yticklabels()] == ["ekf  (1 failed)", "oracle"]
    assert any(list(line.get_xdata()) == [1.5, 2.5] for line in ax.lines)
    assert any(list(line.get_xdata()) == [2.0] for line in ax.lines)
    assert ax.get_xlabel() == "Horizontal RMSE [m]"


def test_what_is_far_off_stands_at_the_edge_as_a_number(style):
    """It would press all others together."""
    rows = [*(Dot(f"row-{i}", 1.0 + 0.1 * i) for i in range(5)), Dot("inertial", 2137.0, 2000.0, 2200.0)]
    ax = figures.dots(rows, style, label="Horizontal RMSE [m]").axes[0]
    assert ax.get_xlim()[1] < 100.0
    assert [t.get_text().split()[0] for t in ax.texts] == ["2137"]
    assert not any(2137.0 in line.get_xdata() for line in ax.lines)


def test_dots_of_those_that_all_failed_can_be_drawn(style, tmp_path):
    fig = figures.dots([Dot("ekf", np.nan)], style, label="Horizontal RMSE [m]")
    assert save(fig, tmp_path / "x.svg", formats=("svg",))[0].stat().st_size > 1000


def test_run_chart_shows_errors_bounds_and_diagnostics(style, truth):
    curve = Curve("ekf", TIME, np.sin(TIME), np.full(len(TIME), 3.0))
    diverged = Curve("dead-reckoning", TIME, 1e6 * TIME)
    fig = figures.run_chart(
        truth,
        [truth],
        {"North error [m]": [curve, diverged]},
        style,
        outages=[(60.0, 120.0, "no gnss")],
        diagnostics={"weight": [Curve("ekf", TIME, TIME)]},
        title="a run",
    )
    error = fig.axes[1]
    assert error.get_ylabel() == "North error [m]"
    assert any(np.allclose(line.get_ydata(), -3.0) for line in error.lines if len(line.get_ydata()) == len(TIME))
    assert error.get_ylim()[1] < 10.0  # the diverged one does not flatten the other
    assert fig.axes[2].get_ylabel() == "weight"


def test_a_map_has_a_cell_for_each_ratio():
    cells = {("ekf", "calm"): 1.0, ("ekf", "rough"): 1.0, ("iae", "calm"): 0.25, ("iae", "rough"): 8.0}
    axes = ratio_map(cells, "Error × ekf", "A track").axes[0]
    (drawn,) = axes.collections
    np.testing.assert_array_equal(drawn.get_array().reshape(2, 2), [[1.0, 1.0], [0.25, 8.0]])
    assert [t.get_text() for t in axes.get_yticklabels()] == ["ekf", "iae"]
    assert [t.get_text() for t in axes.get_xticklabels()] == ["calm", "rough"]


def test_saved_svg_is_valid_has_its_labels_and_follows_the_theme(style, tmp_path):
    fig = figures.error_cdf([band("ekf", 1.0)], style, label="Horizontal error [m]", title="Distribution")
    svg, png = save(fig, tmp_path / "figure")
    assert png.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    content = svg.read_text()
    ET.fromstring(content)
    for text in ("Horizontal error [m]", "Distribution", "ekf"):
        assert f">{text}</text>" in content  # letters stay letters
    assert "prefers-color-scheme:dark" in content
    assert re.search(r'style="[^"]*stroke: ' + style.colour("ekf"), content)
    assert not re.search(r'(href|src)="https?://', content)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["figure.png", "figure.svg"]


def test_the_same_figure_is_the_same_file(style, tmp_path):
    for name in ("a", "b"):
        save(figures.error_cdf([band("ekf", 1.0)], style, label="x"), tmp_path / name, formats=("svg",))
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_a_label_in_the_manner_of_tex_is_shown_as_it_is(tmp_path):
    fig = figures.error_cdf([band("$x_$", 1.0)], Style(["$x_$"]), label="Error [m]")
    assert save(fig, tmp_path / "x", formats=("svg", "pdf"))[1].read_bytes()[:4] == b"%PDF"


def _bar_figure():
    return bars({"Median time [ms]": [Bar("ekf", 1.0), Bar("sw-fgo", 3.0)]}, Style(["ekf", "sw-fgo"]), title="costs")


def test_a_figure_is_made_for_the_column_of_a_journal(tmp_path):
    before = _bar_figure()
    token = WIDTH.set(120.0)
    try:
        written = save_as(_bar_figure(), tmp_path / "narrow.svg")
    finally:
        WIDTH.reset(token)
    width = float(re.search(r'width="([\d.]+)pt"', written.read_text())[1])
    assert width / 72.0 * 25.4 == pytest.approx(120.0)
    assert before.get_size_inches()[0] * 25.4 > 130.0
    sizes = {float(x) for x in re.findall(r"font[^;:]*: (?:\w+ )?([\d.]+)px", written.read_text())}
    assert sizes
    assert max(sizes) < 9.5
    assert min(sizes) > 6.0


def test_a_figure_whose_panels_need_more_stays_wider():
    fig = _bar_figure()
    wide = fig.get_size_inches()[0]
    with pytest.warns(UserWarning, match="mm wide: its panels need that"):
        fitted(fig, 10.0)
    assert fig.get_size_inches()[0] == pytest.approx(0.44 * wide)
