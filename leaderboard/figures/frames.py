"""What figures have in common besides their style: panels over time, a grid of panels, axes, shading and legend."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .style import FAULT, GREY, SHADE, Style, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "decimal_log_ticks",
    "grid_of_panels",
    "legend_below",
    "longest_time",
    "named_lines",
    "shade",
    "time_panels",
    "time_unit",
]

_ACROSS = 3  # panels side by side
_LEGEND = 15.0  # characters of a legend that fit into an inch


class Timed(Protocol):
    """What is drawn over time."""

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,) array: times [s]."""


def time_panels(
    panels: Mapping[str, Sequence[Timed]], height: float, outages: Sequence[tuple[float, float, str]], title: str
) -> tuple[Figure, list[Axes], float]:
    """An empty figure with panels below each other that share the time.

    Parameters
    ----------
    panels : mapping of str to sequence
        Label of the vertical axis, with its unit -> what will be drawn.
    height : float
        Of a panel [inch].
    outages : sequence of (start, end, name)
        Shaded [s].
    title : str
        Title of the figure.

    Returns
    -------
    tuple
        The figure, its panels, and the factor from seconds to the unit of the time axis.
    """
    fig = figure(7.6, 1.0 + height * len(panels))
    axes: list[Axes] = fig.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0].tolist()
    longest = longest_time(panels)
    unit, factor = time_unit(longest)
    for ax, label in zip(axes, panels, strict=True):
        shade(ax, outages, factor, named=ax is axes[0])
        ax.set(ylabel=label, xlim=(0.0, longest * factor))
    axes[0].set_title(title)
    axes[-1].set_xlabel(f"Time [{unit}]")
    return fig, axes, factor


def longest_time(panels: Mapping[str, Sequence[Timed]]) -> float:
    """The last time of all that is drawn [s]; 1 without any."""
    return max((float(c.time[-1]) for curves in panels.values() for c in curves if len(c.time)), default=1.0)


def grid_of_panels(count: int, panel: tuple[float, float], margin: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """A figure with at most three panels a line; width and height of a panel and of what is around all [inch]."""
    columns = min(_ACROSS, count)
    rows = math.ceil(count / columns)
    fig = figure(margin[0] + panel[0] * columns, margin[1] + panel[1] * rows)
    axes: list[Axes] = fig.subplots(rows, columns, squeeze=False).ravel().tolist()
    for ax in axes[count:]:
        ax.set_visible(False)
    return fig, axes[:count]


def named_lines(ax: Axes, names: Sequence[str]) -> None:
    """Lines of a chart at 0, 1, ... from the top, each with a name in place of a tick."""
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)


def time_unit(longest: float) -> tuple[str, float]:
    """Unit that suits a time axis up to ``longest`` [s], and the factor to it."""
    if longest > 3.0 * 3600.0:
        return "h", 1.0 / 3600.0
    return ("min", 1.0 / 60.0) if longest > 600.0 else ("s", 1.0)


def shade(
    ax: Axes,
    outages: Sequence[tuple[float, float, str]],
    factor: float,
    *,
    named: bool,
    faults: Sequence[tuple[float, float, str]] = (),
) -> None:
    """Shade outages and other faults (start, end [s], name), and name them at the top beside each other."""
    ends: list[float] = []  # of the names on each line
    drawn = [(span, SHADE) for span in sorted(outages)] + [(span, FAULT) for span in sorted(faults)]
    for (start, end, name), colour in drawn:
        ax.axvspan(start * factor, end * factor, color=colour, lw=0, zorder=0, alpha=1.0 if colour == SHADE else 0.7)
        if not named or not name:
            continue
        line = next((k for k, last in enumerate(ends) if start >= last), len(ends))
        if line < _NAME_LINES:
            ends[line : line + 1] = [end]
            ax.annotate(name, (start * factor, 1.0), xycoords=("data", "axes fraction"), xytext=(2, -2 - 8 * line),
                        textcoords="offset points", ha="left", va="top", fontsize=7.0, color=GREY)  # fmt: skip


_NAME_LINES = 3  # of names above each other in a panel


def decimal_log_ticks(axis: Any) -> None:
    """Powers of ten as 0.1, 1, 10, 100, 1k; more ticks where the range is short."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    low, high = sorted(axis.get_view_interval())
    decades = math.log10(high / low) if low > 0.0 else 9.0

    def text(value: float, _: int) -> str:
        if value >= 1e6 or value < 1e-4:
            return f"1e{round(math.log10(value))}" if value > 0 else ""
        return f"{value / 1e3:g}k" if value >= 1e4 else f"{value:g}"

    subs = (1.0, 2.0, 5.0) if decades < 2.2 else (1.0, 3.0) if decades < 3.2 else (1.0,)
    axis.set_major_locator(LogLocator(base=10.0, subs=subs, numticks=12))
    axis.set_major_formatter(FuncFormatter(text))
    axis.set_minor_locator(NullLocator())


def legend_below(fig: Figure, ax: Axes, style: Style | None = None) -> None:
    """One legend for all panels, from one of them: in the order of the style, or without one the last drawn first."""
    handles, labels = ax.get_legend_handles_labels()
    if not handles:
        return
    columns = max(1, int(_LEGEND * fig.get_figwidth() / (max(map(len, labels)) + 7)))  # as many as fit side by side
    pairs = list(zip(labels, handles, strict=True))[::-1]
    if style is not None:
        pairs.sort(key=lambda pair: style.order(pair[0]))
    fig.legend(
        [handle for _, handle in pairs],
        [label for label, _ in pairs],
        loc="outside lower center",
        ncols=min(len(labels), columns, 5),
    )
