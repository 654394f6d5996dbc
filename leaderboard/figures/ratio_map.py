"""A map of ratios: rows against columns, a cell each, blue below one and orange above."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from .appearance import INKS, PALETTE
from .style import figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ENDS", "ratio_map"]

#: Ratio at which a colour is full, and its inverse.
ENDS = 4.0


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
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    rows, columns = (list(dict.fromkeys(key[k] for key in cells)) for k in (0, 1))
    values = np.array([[cells.get((row, column), np.nan) for column in columns] for row in rows])
    colours = [PALETTE[0][0], INKS["light"]["grid"], PALETTE[1][0]]
    with styled():
        fig = figure(2.6 + 0.42 * len(columns), 1.8 + 0.17 * len(rows))
        ax = fig.subplots()
        drawn = ax.pcolormesh(
            values,
            cmap=LinearSegmentedColormap.from_list("ratios", colours),
            norm=LogNorm(1.0 / ENDS, ENDS),
            edgecolors="white",
            linewidth=0.6,
        )
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
