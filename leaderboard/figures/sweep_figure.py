"""Figures of a sweep: error against a dial, and maps over two, from plain arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .frames import decimal_log_ticks, grid_of_panels, legend_below
from .plots import Array
from .style import GREY, Style, figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Line", "Map", "error_against_dial", "error_maps"]

#: Highest over lowest value from where on an axis is logarithmic.
_DECADES = 20.0


@dataclass(frozen=True, eq=False)
class Line:
    """The error of an estimator against a dial.

    Attributes
    ----------
    label : str
        Name of the estimator.
    dial, value, low, high : (n,) array
        The error with its interval; infinite where half of the runs failed.
    """

    label: str
    dial: Array
    value: Array
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class Map:
    """The error of an estimator over two dials: an (m, n) array, a row a value of the second."""

    label: str
    value: Array


def error_against_dial(
    lines: Sequence[Line],
    across: str,
    up: str,
    title: str,
    limit: float | None = None,
    breaks: Mapping[str, float] | None = None,
) -> Figure:
    """Curves with shaded intervals.

    Parameters
    ----------
    lines : sequence of Line
        One for each estimator.
    across, up : str
        Labels of the axes.
    title : str
        Title of the figure.
    limit : float, optional
        Drawn as a horizontal line.
    breaks : mapping of str to float
        Where an estimator breaks: a vertical tick in its colour on the lower edge.
    """
    style = Style([line.label for line in lines])
    with styled():
        fig = figure(7.2, 4.4)
        ax = fig.add_subplot()
        for line in lines:
            shown = np.isfinite(line.value)
            colour = style.colour(line.label)
            ax.plot(line.dial[shown], line.value[shown], style.line(line.label), color=colour,
                    marker=style.marker(line.label), ms=4, label=line.label)  # fmt: skip
            band = shown & np.isfinite(line.low) & np.isfinite(line.high)
            ax.fill_between(line.dial[band], line.low[band], line.high[band], color=colour, alpha=0.15, lw=0)
            where = (breaks or {}).get(line.label, math.inf)
            if math.isfinite(where):
                ax.plot(
                    [where], [0.0], marker="^", ms=7, color=colour, clip_on=False, transform=ax.get_xaxis_transform()
                )
        if limit is not None:
            ax.axhline(limit, color=GREY, lw=1.0, ls=(0, (4, 2)))
            ax.annotate("limit", (1.0, limit), xycoords=("axes fraction", "data"), ha="right", va="bottom", color=GREY)
        values = np.concatenate([line.value for line in lines])
        values = values[np.isfinite(values) & (values > 0.0)]
        if len(values) and values.max() / values.min() > _DECADES:
            ax.set_yscale("log")
            decimal_log_ticks(ax.yaxis)
        else:
            ax.set_ylim(bottom=0.0)
        dial = lines[0].dial
        if dial[0] > 0.0 and dial[-1] / dial[0] >= _DECADES:
            ax.set_xscale("log")
            decimal_log_ticks(ax.xaxis)
        ax.set_xlabel(across)
        ax.set_ylabel(up)
        ax.set_title(title + (", triangles: twice the clean error" if breaks else ""))
        legend_below(fig, ax, style)
    return fig


def error_maps(
    maps: Sequence[Map], across: Sequence[float], up: Sequence[float], x: str, y: str, label: str, title: str
) -> Figure:
    """A coloured table for each map, at least one, on one scale; grey where half of the runs failed."""
    with styled():
        fig, axes = grid_of_panels(len(maps), (3.0, 2.7), (1.2, 0.9))
        finite = np.concatenate([m.value[np.isfinite(m.value)] for m in maps])
        low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
        for ax, m in zip(axes, maps, strict=True):
            ax.set_facecolor(GREY)
            shown = np.ma.masked_invalid(m.value)
            image = ax.imshow(shown, origin="lower", aspect="auto", cmap="viridis", vmin=low, vmax=high)
            for (i, j), value in np.ndenumerate(m.value):
                text = f"{value:.3g}" if math.isfinite(value) else "failed"
                light = math.isfinite(value) and value > 0.5 * (low + high)
                ax.text(j, i, text, ha="center", va="center", fontsize=7, color="black" if light else "white")
            ax.set_xticks(range(len(across)), [f"{v:g}" for v in across])
            ax.set_yticks(range(len(up)), [f"{v:g}" for v in up])
            ax.grid(False)
            ax.set_title(m.label)
            ax.set_xlabel(x)
            ax.set_ylabel(y)
        fig.colorbar(image, ax=fig.axes, label=label)
        fig.suptitle(title, fontsize=10)
    return fig
