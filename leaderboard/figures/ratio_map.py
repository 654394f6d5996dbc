"""A map of ratios: rows against columns, a cell each, blue below one and orange above."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .appearance import INKS, PALETTE
from .style import figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ENDS", "ratio_map", "written_map"]

#: Ratio at which a colour is full, and its inverse.
ENDS = 4.0
_APART = 0.15  # between the last line of a written map and the others, in lines
_PALE = ("#6aa9cf", "#e59a62")  # full colours on which a number is read


def ratio_map(cells: Mapping[tuple[str, str], float], label: str, title: str) -> Figure:
    """Draw a map.

    Parameters
    ----------
    cells : mapping of (str, str) to float
        Names of a row and a column -> their ratio; rows and columns stand in the order in which they first come.
    label : str
        What the ratio is of, for the scale.
    title : str
        Title of the figure.
    """
    rows, columns = (list(dict.fromkeys(key[k] for key in cells)) for k in (0, 1))
    values = np.array([[cells.get((row, column), np.nan) for column in columns] for row in rows])
    with styled():
        fig = figure(2.6 + 0.42 * len(columns), 1.8 + 0.17 * len(rows))
        ax = fig.subplots()
        drawn = ax.pcolormesh(values, edgecolors="white", linewidth=0.6, **_colours(PALETTE[0][0], PALETTE[1][0]))
        ax.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=45, ha="left", rotation_mode="anchor")
        ax.set_yticks(np.arange(len(rows)) + 0.5, rows)
        ax.invert_yaxis()
        ax.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0)
        ax.grid(visible=False)
        ax.set_title(title, pad=12)
        bar = fig.colorbar(drawn, ax=ax, shrink=0.5, aspect=16, label=label)
        ticks = [1.0 / ENDS, 0.5, 1.0, 2.0, ENDS]
        bar.set_ticks(ticks, labels=[f"{t:g}" for t in ticks])
        bar.ax.minorticks_off()
    return fig


def _colours(less: str, more: str) -> dict[str, Any]:
    """The scale of colours, on a logarithmic axis with 1 in its middle."""
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    colours = [less, INKS["light"]["grid"], more]
    return {"cmap": LinearSegmentedColormap.from_list("ratios", colours), "norm": LogNorm(1.0 / ENDS, ENDS)}


def written_map(
    cells: Mapping[tuple[str, str], float], strong: Container[tuple[str, str]], title: str, caption: str
) -> Figure:
    """Draw a small map with the numbers in its cells; the last line stands apart.

    Parameters
    ----------
    cells : mapping of (str, str) to float
        As for `ratio_map`.
    strong : container of (str, str)
        Cells whose numbers are bold.
    title, caption : str
        Above and below the map.
    """
    rows, columns = (list(dict.fromkeys(key[k] for key in cells)) for k in (0, 1))
    values = np.array([[cells.get((row, column), np.nan) for column in columns] for row in rows])
    tops = [float(k) for k in range(len(rows))]
    tops[-1] += _APART
    with styled():
        fig = figure(2.0 + 0.78 * len(columns), 1.2 + 0.3 * len(rows))
        ax = fig.subplots()
        for k, (row, top) in enumerate(zip(rows, tops, strict=True)):
            ax.pcolormesh(np.arange(len(columns) + 1), [top, top + 1.0], values[k : k + 1], edgecolors="white",
                          linewidth=1.5, **_colours(*_PALE))  # fmt: skip
            for j, column in enumerate(columns):
                weight = "bold" if (row, column) in strong else "normal"
                ax.text(j + 0.5, top + 0.5, f"{values[k, j]:.2f}", ha="center", va="center", weight=weight)
        ax.set_xticks(np.arange(len(columns)) + 0.5, columns)
        ax.set_yticks([top + 0.5 for top in tops], rows)
        ax.get_yticklabels()[-1].set_fontweight("bold")
        ax.invert_yaxis()
        ax.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0)
        ax.grid(visible=False)
        for side in ax.spines.values():
            side.set_visible(False)
        ax.set_title(title, pad=10)
        ax.set_xlabel(caption)
    return fig
