"""Figures with a panel for each quantity, from plain arrays: curves over time, and values beside a paper's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .frames import decimal_log_ticks, legend_below, named_lines, time_panels
from .plots import Array, Curve
from .style import GREY, INK, PAPER, Style, figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Bar", "bars", "curves_over_time"]

_GAP = 5.0  # times the usual spacing: from here on a curve is broken
_DECADES = 30.0  # largest over smallest value, from where on they do not go into one linear frame


@dataclass(frozen=True, eq=False)
class Bar:
    """A figure with its interval, the values of the runs, and the paper's figure.

    Attributes
    ----------
    label : str
        Name of the method.
    value, low, high : float
        NaN where there is none.
    runs : sequence of float
        Values of the single runs.
    paper : pair of float
        Least and most; NaN where the paper has none.
    """

    label: str
    value: float
    low: float = math.nan
    high: float = math.nan
    runs: Sequence[float] = ()
    paper: tuple[float, float] = (math.nan, math.nan)


def curves_over_time(
    panels: Mapping[str, Sequence[Curve]],
    style: Style,
    *,
    outages: Sequence[tuple[float, float, str]] = (),
    title: str = "",
) -> Figure:
    """Series of one run, one panel each. A curve is interrupted where its series has no values.

    Parameters
    ----------
    panels : mapping of str to sequence of Curve
        Label of the vertical axis, with its unit -> curves.
    style : Style
        Colours and line styles of the methods.
    outages : sequence of (start, end, name)
        Shaded [s].
    title : str
        Title of the figure.
    """
    with styled():
        fig, axes, factor = time_panels(panels, 1.75, outages, title)
        for ax, curves in zip(axes, panels.values(), strict=True):
            order = sorted(curves, key=_layer)
            for k in range(len(order) - 1, -1, -1):  # what lies below is wider, so that equal curves are both seen
                c, (time, values) = order[k], broken(order[k].time, order[k].values)
                colour, line = style.colour(c.label), style.line(c.label)
                ax.plot(time * factor, values, color=colour, ls=line, lw=1.0 + 0.5 * k, label=c.label)
            _frame(ax, [v for c in curves if len(v := c.values[np.isfinite(c.values)])])
        fullest = max(zip(axes, panels.values(), strict=True), key=lambda panel: len(panel[1]))[0]
        legend_below(fig, fullest, style)
    return fig


def _layer(curve: Curve) -> tuple[bool, float]:
    """From the top: the truth, then the smallest."""
    known = curve.values[np.isfinite(curve.values)]
    return curve.label != "truth", float(np.mean(known**2)) if len(known) else 0.0


def broken(time: Array, values: Array) -> tuple[Array, Array]:
    """A series without its missing values, with one NaN in each long gap.

    >>> broken(np.array([0.0, 1.0, 2.0, 9.0]), np.array([5.0, 6.0, 7.0, 8.0]))[1].tolist()
    [5.0, 6.0, 7.0, nan, 8.0]
    >>> broken(np.array([0.0, 1.0, 2.0, 3.0]), np.array([5.0, np.nan, 7.0, np.nan]))[1].tolist()
    [5.0, 7.0]
    """
    known = np.isfinite(values)
    t, v = time[known], values[known]
    if len(t) < 3:
        return t, v
    steps = np.diff(t)
    after = np.flatnonzero(steps > _GAP * np.median(steps)) + 1
    return np.insert(t, after, t[after - 1]), np.insert(v, after, np.nan)


def _frame(ax: Axes, series: Sequence[Array]) -> None:
    """Limits around zero, or from zero on. Curves that are far beyond the better half leave the frame."""
    if not series:
        return
    spans = sorted(float(np.abs(v).max()) for v in series)
    usual = max(spans[(len(spans) - 1) // 2], 1e-12)
    limit = 1.06 * max((s for s in spans if s <= _DECADES * usual), default=1.0) or 1.0
    if any((v < 0.0).any() for v in series):
        ax.set_ylim(-limit, limit)
        ax.axhline(0.0, color=GREY, lw=0.6, zorder=0.5)
    else:
        ax.set_ylim(0.0, limit)


def bars(panels: Mapping[str, Sequence[Bar]], style: Style, *, title: str = "", zero: bool = False) -> Figure:
    """Figures of several methods side by side with the paper's, a panel each.

    Ours is a marker in front of its 95 % interval and of the runs (faint); the paper's is a hollow diamond, or a grey
    bar where it is a range.

    Parameters
    ----------
    panels : mapping of str to sequence of Bar
        Label of the horizontal axis, with its unit -> one bar a method, the same methods in all panels.
    style : Style
        Colours and line styles of the methods.
    title : str
        Title of the figure.
    zero : bool
        Mark zero, and never use a logarithmic axis: these are gains.
    """
    labels = list(dict.fromkeys(b.label for of in panels.values() for b in of))
    with styled():
        fig = figure(max(7.6, 2.1 + 2.5 * len(panels)), 1.3 + 0.36 * max(len(labels), 2))
        axes = np.atleast_1d(fig.subplots(1, len(panels), sharey=True))
        for ax, (label, of) in zip(axes, panels.items(), strict=True):
            for bar in of:
                _bar(ax, labels.index(bar.label), bar, style)
            values = [v for b in of for v in (b.value, *b.paper) if math.isfinite(v)]
            if zero:
                ax.axvline(0.0, color=GREY, lw=0.8, zorder=0.5)
            elif values and min(values) > 0.0 and max(values) > _DECADES * min(values):
                ax.set_xscale("log")
                decimal_log_ticks(ax.xaxis)
            elif values:
                ax.set_xlim(left=0.0)
            ax.set(xlabel=label)
            named_lines(ax, labels)
        fig.suptitle(title, x=0.01, ha="left", fontsize=9.5, fontweight="bold")
        _legend(fig, paper=any(math.isfinite(b.paper[0]) for of in panels.values() for b in of))
    return fig


def _bar(ax: Axes, y: int, bar: Bar, style: Style) -> None:
    colour = style.colour(bar.label)
    runs = np.asarray([r for r in bar.runs if math.isfinite(r)])
    offset = 0.16 * np.cos(np.arange(len(runs)) * 2.399963)  # spread without a random draw
    ax.plot(runs, y + offset, ".", ms=4, mew=0, color=colour, alpha=0.35, zorder=2)
    if math.isfinite(bar.low) and math.isfinite(bar.high):
        ax.plot([bar.low, bar.high], [y, y], color=colour, lw=2.4, zorder=3)
    if math.isfinite(bar.value):
        ax.plot(bar.value, y, style.marker(bar.label), ms=6.5, color=colour, zorder=4)
    least, most = bar.paper
    if least < most:
        ax.plot([least, most], [y, y], color=GREY, lw=7.0, alpha=0.35, solid_capstyle="butt", zorder=1)
    elif math.isfinite(least):
        ax.plot(least, y, "D", ms=6.0, mfc="none", mec=INK, mew=1.2, zorder=5)


def _legend(fig: Figure, *, paper: bool) -> None:
    from matplotlib.lines import Line2D

    keys = [
        Line2D([], [], color=GREY, marker="o", ms=6, lw=2.4, label="ours, 95 % interval"),
        Line2D([], [], color=GREY, marker=".", ms=5, lw=0, alpha=0.5, label="its runs"),
        Line2D([], [], color=INK, marker="D", ms=6, mfc=PAPER, lw=0, label="the paper's"),
    ]
    fig.legend(handles=keys if paper else keys[:2], loc="outside lower center", ncols=3)
