"""Stanford diagrams: the position error of every epoch beside the protection level that the estimator gave."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from .frames import grid_of_panels
from .style import GREY, INK, PALETTE, SHADE, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from simnav.scoring import Stanford

__all__ = ["stanford_diagrams"]

_STEPS = 60


def stanford_diagrams(diagrams: Mapping[str, Stanford], *, title: str = "") -> Figure:
    """A panel for each estimator: epochs by error and protection level, with the alert limit and the shares.

    Parameters
    ----------
    diagrams : mapping of str to Stanford
        Diagrams by label, at least one.
    title : str
        Title of the figure.

    Raises
    ------
    ValueError
        If there is no diagram.
    """
    if not diagrams:
        raise ValueError("a figure of Stanford diagrams needs at least one of them")
    with styled():
        made, axes = grid_of_panels(len(diagrams), (3.4, 3.3), (0.0, 0.3))
        for ax, (label, diagram) in zip(axes, diagrams.items(), strict=True):
            _panel(ax, label, diagram)
        if title:
            made.suptitle(title, color=INK)
    return made


def _panel(ax: Axes, label: str, diagram: Stanford) -> None:
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    limit, end = diagram.limit, 2.0 * diagram.limit
    edges = np.linspace(0.0, end, _STEPS + 1)
    counts = diagram.histogram(edges).astype(np.float64).T
    hazard, misleading = PALETTE[1][0], PALETTE[5][0]
    ax.fill_between([limit, end], 0.0, limit, color=hazard, alpha=0.15, lw=0)
    ax.fill_between([0.0, limit], 0.0, [0.0, limit], color=misleading, alpha=0.15, lw=0)
    ax.fill_between([0.0, end], limit, end, color=SHADE, lw=0, zorder=0)
    if counts.any():
        shades = LinearSegmentedColormap.from_list("counts", [PALETTE[4][0], PALETTE[0][0], INK])
        shown = np.ma.masked_equal(counts, 0.0)
        ax.pcolormesh(edges, edges, shown, cmap=shades, norm=LogNorm(1.0, max(counts.max(), 2.0)), rasterized=True)
    ax.plot([0.0, end], [0.0, end], color=GREY, lw=0.8)
    for line in (ax.axvline, ax.axhline):
        line(limit, color=GREY, lw=0.8, ls=(0, (4, 2)))
    shares = diagram.shares
    words = [("available", shares["normal"] + shares["misleading"] + shares["hazardously misleading"])]
    words += [("misleading", shares["misleading"]), ("hazardous", shares["hazardously misleading"])]
    text = "\n".join(f"{name} {100.0 * share:.3g} %" for name, share in words)
    ax.text(0.97, 0.05, text, transform=ax.transAxes, ha="right", va="bottom", fontsize=7.5, color=INK)
    ax.set(xlim=(0.0, end), ylim=(0.0, end), title=label)
    ax.set_xlabel("horizontal error [m]")
    ax.set_ylabel("protection level [m]")
    ax.set_aspect("equal")
