"""Figures of runs, rankings and papers: from plain arrays to matplotlib figures.

Nothing here knows results, campaigns or scenarios. The style is that of `simnav.leaderboard.figures.style`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .appearance import titled
from .frames import (
    decimal_log_ticks,
    legend_below,
    longest_time,
    named_lines,
    shade,
    time_panels,
    time_unit,
)
from .sky_figure import draw_place, draw_sky
from .style import GREY, INK, PALETTE, PAPER, TRUTH, Style, figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .sky_view import SkyView

__all__ = ["Band", "Curve", "Dot", "Track", "dots", "error_cdf", "error_over_time", "run_chart", "trajectory"]

Array = NDArray[np.float64]

#: Points of a curve over time; more cannot be seen.
_POINTS = 300
#: Height of the sky and the map of obstacles, in rows of diagnostics.
_SKY_ROWS = 3
#: What an axis of all estimators shows ends at this multiple of their median.
FAR_OFF = 20.0


@dataclass(frozen=True, eq=False)
class Band:
    """An error over time of many runs.

    Attributes
    ----------
    label : str
        Estimator.
    time : (n,) array
        Times of the columns of ``values`` [s].
    values : (runs, n) array
        NaN where a run has none.
    """

    label: str
    time: Array
    values: Array


#: Most channels of an instrument that a legend names.
_MOST_CHANNELS = 12


@dataclass(frozen=True, eq=False)
class Curve:
    """One error over time, with the estimator's own three-sigma bound.

    Attributes
    ----------
    label : str
        Name of the estimator.
    time, values : (n,) array
        Times [s] and values.
    bound : (n,) array or None
        The estimator's own three-sigma bound, if it has one.
    channel : str
        The channel of the instrument of which it is a diagnostic, if that has channels.
    """

    label: str
    time: Array
    values: Array
    bound: Array | None = None
    channel: str = ""


@dataclass(frozen=True, eq=False)
class Track:
    """A horizontal track: east and north [m], relative to a common origin."""

    label: str
    east: Array
    north: Array


@dataclass(frozen=True, eq=False)
class Dot:
    """A figure with its interval.

    Attributes
    ----------
    label : str
        Name of the estimator.
    value, low, high : float
        The value and its interval.
    hollow : bool
        Reference rows.
    note : str
        Beside the label, e.g. how many runs failed.
    """

    label: str
    value: float
    low: float = math.nan
    high: float = math.nan
    hollow: bool = False
    note: str = ""


# ------------------------------------------------------------------------------------------------
# Figures over one run or many


def trajectory(
    truth: Track,
    tracks: Sequence[Track],
    style: Style,
    *,
    fixes: Mapping[str, Track] | None = None,
    title: str = "",
) -> Figure:
    """Chart of one run: truth, fixes and estimates. The frame is that of the truth; estimates that diverge leave it."""
    with styled():
        width, height = _frame(truth)
        fig = figure(7.2, min(max(5.4 * height / width, 3.0), 7.5))
        _chart(fig.add_subplot(), truth, tracks, style, fixes or {}, title)
    return fig


def _frame(truth: Track) -> tuple[float, float]:
    """Width and height [m] of a chart around the truth, with a margin, never thinner than 1 : 2.5."""
    sides = [1.16 * float(np.ptp(a)) for a in (truth.east, truth.north)]
    least = max(0.4 * max(sides), 1.0)
    return max(sides[0], least), max(sides[1], least)


def _chart(
    ax: Axes, truth: Track, tracks: Sequence[Track], style: Style, fixes: Mapping[str, Track], title: str
) -> None:
    span = max(np.ptp(truth.east), np.ptp(truth.north), 1.0)
    unit, factor = ("km", 1e-3) if span > 3000.0 else ("m", 1.0)
    for (name, fix), marker in zip(fixes.items(), ".+x1234", strict=False):
        ax.plot(
            fix.east * factor, fix.north * factor, marker, ms=2.5, mew=0.6, color=GREY, alpha=0.6, label=name, zorder=1
        )
    ax.plot(truth.east * factor, truth.north * factor, color=TRUTH, lw=2.6, alpha=0.9, label="truth", zorder=2)
    for t in tracks:
        ax.plot(
            t.east * factor,
            t.north * factor,
            color=style.colour(t.label),
            ls=style.line(t.label),
            lw=1.3,
            label=t.label,
            zorder=3,
        )
    ax.plot(truth.east[0] * factor, truth.north[0] * factor, "o", ms=6, mfc=PAPER, mec=INK, zorder=4, label="start")
    ax.plot(truth.east[-1] * factor, truth.north[-1] * factor, "s", ms=6, mfc=INK, mec=INK, zorder=4, label="end")
    centre = [0.5 * (np.min(a) + np.max(a)) * factor for a in (truth.east, truth.north)]
    half = [0.5 * side * factor for side in _frame(truth)]
    ax.set_xlim(centre[0] - half[0], centre[0] + half[0])
    ax.set_ylim(centre[1] - half[1], centre[1] + half[1])
    ax.set_aspect("equal", adjustable="box")
    ax.set(xlabel=titled("East", unit), ylabel=titled("North", unit), title=title)
    ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)


def error_over_time(
    panels: Mapping[str, Sequence[Band]],
    style: Style,
    *,
    outages: Sequence[tuple[float, float, str]] = (),
    title: str = "",
) -> Figure:
    """Median error over the runs, and the band between their 5th and 95th percentile.

    Parameters
    ----------
    panels : mapping of str to sequence of Band
        Label of the vertical axis, with its unit -> one band for each estimator.
    style : Style
        Colours and line styles of the estimators.
    outages : sequence of (start, end, name)
        Shaded [s].
    title : str
        Title of the figure.
    """
    with styled():
        fig, axes, factor = time_panels(panels, 2.15, outages, title)
        for ax, bands in zip(axes, panels.values(), strict=True):
            floor = math.inf
            for band in sorted(bands, key=lambda b: style.order(b.label), reverse=True):
                every = max(1, -(-len(band.time) // _POINTS))
                low, middle, high = _percentiles(band.values[:, ::every], (5.0, 50.0, 95.0))
                colour, t = style.colour(band.label), band.time[::every] * factor
                if len(band.values) > 1:
                    ax.fill_between(t, low, high, color=colour, alpha=0.13, lw=0)
                ax.plot(t, middle, color=colour, ls=style.line(band.label), label=band.label)
                shown = middle[np.isfinite(middle) & (middle > 0.0)]
                if len(shown):
                    floor = min(floor, float(np.percentile(shown, 2.0)))
            _log_scale(ax, floor)
        legend_below(fig, axes[0], style)
    return fig


def error_cdf(bands: Sequence[Band], style: Style, *, label: str, title: str = "") -> Figure:
    """Share of all epochs of all runs whose error is below x; ``label`` names x, with its unit."""
    with styled():
        fig = figure(7.0, 3.8)
        ax = fig.add_subplot()
        low, high = math.inf, 0.0
        for band in bands:
            x = np.sort(band.values[np.isfinite(band.values)])
            if not len(x):
                continue
            share = (np.arange(len(x)) + 1.0) / len(x)
            pick = np.unique(np.linspace(0, len(x) - 1, min(len(x), 400)).astype(int))
            ax.plot(
                np.maximum(x[pick], 1e-9),
                100.0 * share[pick],
                color=style.colour(band.label),
                ls=style.line(band.label),
                label=band.label,
            )
            low, high = min(low, float(np.percentile(x, 2.0))), max(high, float(x[-1]))
        for level in (50, 95):
            ax.axhline(level, color=GREY, lw=0.7, ls=(0, (2, 2)), zorder=0.5)
            ax.annotate(
                f"{level} %",
                (0.01, level),
                xycoords=("axes fraction", "data"),
                ha="left",
                va="bottom",
                fontsize=7.5,
                color=GREY,
            )
        ax.set_xscale("log")
        if high > 0.0 and math.isfinite(low):
            ax.set_xlim(max(low, 1e-6 * high) * 0.8, high * 1.15)
        decimal_log_ticks(ax.xaxis)
        ax.set(xlabel=label, ylabel="Share of epochs [%]", ylim=(0.0, 101.0), title=title)
        ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    return fig


def dots(rows: Sequence[Dot], style: Style, *, label: str, title: str = "") -> Figure:
    """One line for each estimator: the figure with its interval.

    What is more than `FAR_OFF` times the median estimator stands at the edge, as a number.
    """
    values = [r.value for r in rows if math.isfinite(r.value) and r.value > 0.0]
    limit = FAR_OFF * float(np.median(values)) if values else math.inf
    with styled():
        fig = figure(7.6, 0.9 + 0.25 * max(len(rows), 1))
        ax = fig.add_subplot()
        for y, row in enumerate(rows):
            colour = style.colour(row.label)
            if not math.isfinite(row.value):
                continue
            if row.value > limit:
                number = f"{row.value:.{0 if row.value >= 100.0 else 1}f} \N{RIGHTWARDS ARROW}"
                ax.annotate(
                    number, (1.0, y), xycoords=ax.get_yaxis_transform(), color=colour, fontsize="small", ha="right",
                    va="center",
                )  # fmt: skip
                continue
            if math.isfinite(row.low) and math.isfinite(row.high):
                ax.plot([row.low, row.high], [y, y], color=colour, lw=1.6, marker="|", ms=6.0, zorder=3)
            ax.plot(row.value, y, style.marker(row.label), ms=4.5, mew=1.0, mec=colour,
                    mfc=PAPER if row.hollow else colour, zorder=4)  # fmt: skip
        if values:
            ax.set_xscale("log")
            decimal_log_ticks(ax.xaxis)
        ax.set_xlim(right=min(ax.get_xlim()[1], limit))
        named_lines(ax, [f"{r.label}  {r.note}".rstrip() for r in rows])
        ax.set(xlabel=label, title=title)
    return fig


# ------------------------------------------------------------------------------------------------
# Figure of one run


def run_chart(
    truth: Track,
    tracks: Sequence[Track],
    errors: Mapping[str, Sequence[Curve]],
    style: Style,
    *,
    fixes: Mapping[str, Track] | None = None,
    outages: Sequence[tuple[float, float, str]] = (),
    faults: Sequence[tuple[float, float, str]] = (),
    diagnostics: Mapping[str, Sequence[Curve]] | None = None,
    bounds: Mapping[str, float] | None = None,
    sky: SkyView | None = None,
    title: str = "",
) -> Figure:
    """Chart beside the errors over time with their claimed three-sigma bounds; below both, diagnostics in two columns.

    With satellites, the sky and the map of the obstacles come last.

    Parameters
    ----------
    truth : Track
        The true track.
    tracks : sequence of Track
        The estimated tracks.
    errors : mapping of str to sequence of Curve
        Label of the vertical axis, with its unit -> one curve for each estimator.
    style : Style
        Colours and line styles of the estimators.
    fixes : mapping of str to Track, optional
        Instrument -> its position fixes.
    outages, faults : sequence of (start, end, name)
        Shaded [s].
    diagnostics : mapping of str to sequence of Curve, optional
        Label of the vertical axis -> curves.
    bounds : mapping of str to float, optional
        Label of a diagnostic's axis -> a line, below which it should be 95 % of the time.
    sky : SkyView, optional
        Satellites and obstacles of the run.
    title : str
        Title of the figure.
    """
    below = diagnostics or {}
    top, rows = max(len(errors), 1), -(-len(below) // 2)
    with styled():
        last = 0 if sky is None else _SKY_ROWS
        fig = figure(13.0, max(5.0, 1.0 + 1.45 * (top + rows + last)))
        grid = fig.add_gridspec(top + rows + last, 2, width_ratios=(1.0, 1.15))
        _chart(fig.add_subplot(grid[:top, 0]), truth, tracks, style, fixes or {}, title)
        chart = fig.axes[0]
        chart.set_anchor("N")
        # Below the label of the axis, however high the chart is.
        chart.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=4, borderaxespad=3.6)
        longest = longest_time(errors)
        unit, factor = time_unit(longest)
        first: Axes | None = None
        places = [(row, 1) for row in range(len(errors))] + [(top + k // 2, k % 2) for k in range(len(below))]
        lowest = {column: row for row, column in places}
        for (row, column), (label, curves) in zip(places, [*errors.items(), *below.items()]):
            ax = fig.add_subplot(grid[row, column], sharex=first)
            first = first or ax
            shade(ax, outages, factor, named=row == 0, faults=faults)
            by_channel = _channel_styles(curves)
            for c in curves:
                colour, line = by_channel.get(c.channel) or (style.colour(c.label), style.line(c.label))
                ax.plot(
                    c.time * factor, c.values, color=colour, ls=line, lw=0.8 if c.channel else 1.1,
                    label=(c.channel or "mean") if by_channel else c.label,
                )  # fmt: skip
                single = _alone(c.values)
                ax.plot(c.time[single] * factor, c.values[single], ".", ms=4.5, mew=0.0, color=colour)
                if c.bound is not None:
                    for sign in (1.0, -1.0):
                        ax.plot(c.time * factor, sign * c.bound, color=colour, lw=0.8, ls=(0, (3, 2)), alpha=0.75)
            if by_channel:
                named, _ = ax.get_legend_handles_labels()
                ax.legend(handles=named[:_MOST_CHANNELS], ncols=6, loc="upper right", fontsize="x-small")
            if label in errors:
                _frame_errors(ax, curves)
                ax.axhline(0.0, color=GREY, lw=0.6, zorder=0.5)
            if label in (bounds or {}):
                ax.axhline((bounds or {})[label], color=GREY, lw=0.8, ls=(0, (4, 2)), zorder=0.5)
            ax.set(ylabel=label, xlim=(0.0, longest * factor))
            ax.tick_params(labelbottom=row == lowest[column])
            if row == lowest[column]:
                ax.set_xlabel(titled("Time", unit))
        if first is not None:
            claimed = any(c.bound is not None for curves in errors.values() for c in curves)
            first.set_title("Error; dashed: claimed ±3σ" if claimed else "Error")
        if sky is not None:
            draw_sky(fig, grid[top + rows :, 0], sky)
            draw_place(fig, grid[top + rows :, 1], sky)
    return fig


def _channel_styles(curves: Sequence[Curve]) -> dict[str, tuple[str, str]]:
    """Colour and line of each channel, where a panel has the channels of one estimator; several keep their colours."""
    channels = list(dict.fromkeys(c.channel for c in curves if c.channel))
    if len({c.label for c in curves}) > 1:
        return {}
    lines = ("-", "--", ":")
    return {
        channel: (PALETTE[i % len(PALETTE)][0], lines[i // len(PALETTE) % len(lines)])
        for i, channel in enumerate(channels)
    }


def _alone(values: Array) -> NDArray[np.bool_]:
    """Which values have none beside them, so that no line shows them: of an instrument slower than the estimates."""
    there = np.isfinite(values)
    beside = np.zeros(len(there), np.bool_)
    beside[1:] |= there[:-1]
    beside[:-1] |= there[1:]
    return there & ~beside


def _frame_errors(ax: Axes, curves: Sequence[Curve]) -> None:
    """One estimator that diverges must not flatten the others: beyond 30 x the best, it leaves the frame."""
    spans = [float(np.nanmax(np.abs(c.values))) for c in curves if np.isfinite(c.values).any()]
    bounds = [
        float(np.nanpercentile(c.bound, 95)) for c in curves if c.bound is not None and np.isfinite(c.bound).any()
    ]
    if not spans:
        return
    limit = max(s for s in spans if s <= 30.0 * max(min(spans), 1e-12))
    limit = max([limit, *(b for b in bounds if b <= 3.0 * limit)])
    if limit > 0.0:
        ax.set_ylim(-1.08 * limit, 1.08 * limit)


# ------------------------------------------------------------------------------------------------


def _percentiles(values: Array, levels: Sequence[float]) -> Array:
    """Over the runs, (levels, n); NaN where fewer than half of the runs have a value."""
    finite = np.isfinite(values)
    if finite.all():
        return np.asarray(np.percentile(values, levels, axis=0))
    present = finite.sum(axis=0)
    result = np.full((len(levels), values.shape[1]), np.nan)
    enough = present >= max(1.0, 0.5 * len(values))
    if enough.any():
        result[:, enough] = np.nanpercentile(np.where(finite, values, np.nan)[:, enough], levels, axis=0)
    return result


def _log_scale(ax: Axes, floor: float) -> None:
    ax.set_yscale("log")
    if math.isfinite(floor) and floor > 0.0:
        ax.set_ylim(bottom=0.5 * floor)
    decimal_log_ticks(ax.yaxis)
