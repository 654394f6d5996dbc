"""The latency-accuracy curve of a run: the error of each estimator against the delay of its output."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from .style import PALETTE, figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["lag_figure"]


def lag_figure(curves: Mapping[str, Sequence[tuple[float, float]]], title: str = "") -> Figure:
    """Draw errors against delays, one line an estimator, the newest state at the left.

    Parameters
    ----------
    curves : mapping of str to sequence of (float, float)
        Label -> delays [s] with horizontal RMSE [m], in ascending order of the delay.
    title : str
        Title of the figure.
    """
    with styled():
        fig = figure(6.4, 3.6)
        ax = fig.subplots()
        for k, (label, points) in enumerate(curves.items()):
            colour = PALETTE[k % len(PALETTE)][0]
            # A filter with a smoother and a window may lie on each other: the later line is thinner.
            ax.plot(*zip(*points, strict=True), "o-", color=colour, lw=max(3.4 - 0.9 * k, 1.2), ms=5.5, label=label)
        ax.set_xlabel("delay of the output [s]")
        ax.set_ylabel("horizontal RMSE [m]")
        ax.set_ylim(bottom=0.0)
        ax.legend()
        if title:
            fig.suptitle(title, x=0.01, ha="left", fontsize=9.5, fontweight="bold", wrap=True)
    return fig
