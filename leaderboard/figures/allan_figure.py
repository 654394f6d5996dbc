"""The figure of an Allan deviation, from plain arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .frames import decimal_log_ticks
from .plots import Array
from .style import GREY, Style, figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Panel", "allan_panels"]


@dataclass(frozen=True, eq=False)
class Panel:
    """One panel of the figure.

    Attributes
    ----------
    label : str
        Label of the vertical axis.
    lines : mapping of str to (n,) array
        The Allan deviation of each axis.
    datasheet : (n,) array or None
        That of the datasheet.
    """

    label: str
    lines: Mapping[str, Array]
    datasheet: Array | None


def allan_panels(time: Array, panels: Sequence[Panel], title: str) -> Figure:
    """Allan deviations over the averaging time, both logarithmic.

    Parameters
    ----------
    time : (n,) array
        Averaging times [s].
    panels : sequence of Panel
        One below the other.
    title : str
        Title of the figure.
    """
    style = Style(list(panels[0].lines))
    with styled():
        fig = figure(6.4, 3.0 * len(panels))
        axes = fig.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for ax, panel in zip(axes, panels, strict=True):
            for name, line in panel.lines.items():
                shown = line > 0.0
                ax.plot(time[shown], line[shown], style.line(name), color=style.colour(name), label=name)
            if panel.datasheet is not None and (panel.datasheet > 0.0).all():
                ax.plot(time, panel.datasheet, color=GREY, lw=1.0, ls=(0, (4, 2)), label="datasheet")
            ax.set_xscale("log")
            ax.set_yscale("log")
            decimal_log_ticks(ax.xaxis)
            decimal_log_ticks(ax.yaxis)
            ax.set_ylabel(panel.label)
            ax.legend(loc="best", ncols=2)
        axes[0].set_title(title)
        axes[-1].set_xlabel("averaging time [s]")
    return fig
