"""The chart: what is in it is where it belongs, and its memory is bounded."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from simnav.environment.rendering import Chart, Trace
from simnav.geometry.earth import displace

START = np.array([0.9, 0.1, 0.0])


def place(north, east):
    return displace(START, np.array([north, east, 0.0]))


def pixels(frame, colour, tolerance=12):
    """Rows and columns of the pixels of a colour (``#rrggbb``)."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
    return np.argwhere((np.abs(frame.astype(int) - rgb) <= tolerance).all(axis=2))


def lines(axes):
    """Points of the lines that have a name, (n, 2) each."""
    return {line.get_label(): line.get_xydata() for line in axes.lines if not line.get_label().startswith("_")}


def words(figure):
    return [text.get_text() for text in figure.texts]


@pytest.fixture
def colours(windows):
    """Of what the legend names (``#rrggbb``)."""
    Chart("legend", 60.0, human=True)
    return {line.get_label(): line.get_color() for line in windows.pop().axes[0].get_legend_handles_labels()[0]}


def test_a_trace_thins_evenly_and_keeps_the_ends():
    trace = Trace(1, capacity=8)
    for k in range(1000):
        trace.add(float(k))
        assert len(trace) <= 8
    kept = trace.points[:, 0]
    assert kept[0] == 0.0
    assert set(np.diff(kept)) == {128.0}
    trace.clear()
    assert len(trace) == 0


def test_a_trace_loses_no_peak():
    rng = np.random.default_rng(1)
    for peak in rng.integers(0, 3000, 20):
        trace = Trace(2, capacity=16, largest=1)
        for k in range(3000):
            trace.add(float(k), 7.0 if k == peak else rng.random())
        assert trace.points[:, 1].max() == 7.0
        t = trace.points[:, 0]
        at = trace.points[trace.points[:, 1].argmax(), 0]
        assert at <= peak < at + (t[1] - t[0])


def test_the_frame_shows_truth_estimate_and_fixes_where_they_are(colours):
    chart = Chart("here", 600.0)
    for k in range(200):  # truth goes north, the estimate 400 m east of it; a fix to the west now and then
        if k % 10 == 0:
            chart.add_fixes(place(5.0 * k, -300.0)[None, :2], np.array([k % 20 == 0]))
        chart.add(float(k), place(5.0 * k, 0.0), place(5.0 * k, 400.0))
    frame = chart.frame()
    assert frame.dtype == np.uint8
    assert frame.ndim == 3
    assert frame.shape[2] == 3
    upper = frame[60 : int(0.6 * len(frame)), 90:]  # the chart, without its legend and numbers
    truth = np.median(pixels(upper, colours["truth"])[:, 1])
    estimate = np.median(pixels(upper, colours["estimate"])[:, 1])
    fault = np.median(pixels(upper, colours["fix, faulty"])[:, 1])
    fix = np.median(np.argwhere(upper[..., 2].astype(int) - upper[..., 0] > 60)[:, 1])  # the only blue
    assert fix == pytest.approx(fault, abs=2.0)
    assert estimate - truth == pytest.approx((truth - fault) * 400.0 / 300.0, abs=3.0)
    assert estimate - truth > 80.0
    lower = pixels(frame[int(0.74 * len(frame)) :], colours["estimate"])
    assert np.median(np.abs(lower[:, 0] - np.median(lower[:, 0]))) < 3.0  # the error is constant


def test_a_frame_after_thousands_of_steps_and_after_a_new_run(windows):
    chart, shown = Chart("long", 6_000.0), Chart("long", 6_000.0, human=True)
    (figure,) = windows
    empty = chart.frame()
    for k in range(6_000):
        for each in (chart, shown) if k < 3_000 else (chart,):
            each.add_fixes(place(k, 0.0)[None, :2], np.array([False]))
            each.add(float(k), place(k, 0.0), place(k + 3.0, 4.0))
        if k % 2000 == 0:
            chart.frame()
    shown.show()
    longest = {len(line.get_xydata()) for axes in figure.axes for line in axes.lines}
    assert 1000 < max(longest) <= 2048
    assert "0:49:59    5 m" in words(figure)
    assert not np.array_equal(chart.frame(), empty)
    chart.clear()
    np.testing.assert_array_equal(chart.frame(), empty)


def test_the_close_up_is_centred_on_the_vessel_and_as_wide_as_the_error_asks(windows):
    chart = Chart("close", 600.0, human=True)
    for k in range(300):
        chart.add_fixes(place(5.0 * k, 2.0)[None, :2], np.array([False]))
        chart.add(float(k), place(5.0 * k, 0.0), place(5.0 * k + 12.0, -9.0))
    chart.show()
    (figure,) = windows
    drawn = lines(figure.axes[2])
    assert "close-up, 100 m" in words(figure)  # twice 50, the next after 1.5 times 15 m
    np.testing.assert_allclose(drawn["truth"][-1], [0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(drawn["estimate"][-1] * 50.0, [-9.0, 12.0], atol=1e-2)
    np.testing.assert_allclose(drawn["fix"][-2] * 50.0, [2.0, -5.0], atol=1e-2)
    np.testing.assert_allclose(np.diff(drawn["truth"], axis=0) * 50.0, [[0.0, 5.0]] * 199, atol=1e-2)  # 200 steps


def test_steps_without_a_reference_leave_nothing_behind():
    with_gap, without = Chart("gap", 600.0), Chart("gap", 600.0)
    for chart in (with_gap, without):
        chart.add(0.0, place(0.0, 0.0), place(1.0, 0.0))
    empty = Chart("gap", 600.0).frame()
    for k in range(1, 50):
        with_gap.add_fixes(place(5.0, 0.0)[None, :2], np.array([False]))
        with_gap.add(float(k), np.full(3, np.nan), place(1.0, 0.0))
    np.testing.assert_array_equal(with_gap.frame(), without.frame())
    for chart in (with_gap, without):
        chart.add(50.0, place(1.0, 0.0), place(2.0, 0.0))
    np.testing.assert_array_equal(with_gap.frame(), without.frame())
    assert not np.array_equal(with_gap.frame(), empty)


@pytest.mark.parametrize(
    ("error", "width"), [(0.0, "20 m"), (8.0, "40 m"), (1000.0 / 1.5, "2000 m"), (668.0, "4000 m"), (3000.0, "10000 m")]
)
def test_the_close_up_shows_half_as_much_again_as_the_error_rounded_up(windows, error, width):
    """To 1, 2, 5, 10, 20, ... m on each side; an error of less than 5 m counts as one."""
    chart = Chart("width", 60.0, human=True)
    chart.add(0.0, START, place(error, 0.0))
    chart.show()
    assert f"close-up, {width}" in words(windows[0])


def test_a_diverged_estimate_does_not_shrink_the_truth_to_a_dot(windows):
    chart = Chart("off", 600.0, human=True)
    for k in range(100):
        chart.add(float(k), place(10.0 * k, 0.0), place(10.0 * k, 1e5 * k))
    chart.show()
    axes = windows[0].axes[0]
    metres = 1000.0 if axes.get_ylabel().endswith("[km]") else 1.0
    (low, high) = axes.get_ylim()
    assert (high - low) * metres < 5000.0


def test_both_axes_of_the_chart_have_one_scale(windows):
    chart = Chart("scale", 600.0, human=True)
    for k in range(100):
        chart.add(float(k), place(2.0 * k, 30.0 * k), place(2.0 * k, 30.0 * k))
    chart.show()
    axes = windows[0].axes[0]
    x, y = np.ptp(axes.get_xlim()) / axes.bbox.width, np.ptp(axes.get_ylim()) / axes.bbox.height
    assert x == pytest.approx(y)


def test_without_a_display_there_is_one_sentence_and_no_error(monkeypatch, caplog):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with caplog.at_level(logging.WARNING, logger="simnav"):
        chart = Chart("blind", 60.0, human=True)
        for k in range(3):
            chart.add(float(k), START, START)
            chart.show()
        chart.close()
    assert [r.getMessage() for r in caplog.records] == [
        "there is no display here, so nothing is shown; use render_mode='rgb_array'"
    ]


def test_with_a_display_the_window_is_kept_up_to_date(windows, colours):
    chart = Chart("seen", 60.0, human=True)
    (window,) = windows
    assert window.shown
    canvas = window.canvas
    for k in range(30):
        chart.add(float(k), place(k, 0.0), place(k, 5.0))
        chart.show()
    assert canvas.asked == canvas.flushed == 30
    canvas.draw()
    assert len(pixels(np.asarray(canvas.buffer_rgba())[..., :3], colours["estimate"])) > 50
    chart.close()
    chart.show()
    assert canvas.asked == 30


def test_the_clock(windows):
    chart = Chart("clock", 7200.0, human=True)
    chart.add(3723.9, START, START)
    chart.show()
    assert any(text.startswith("1:02:03 ") for text in words(windows[0]))
