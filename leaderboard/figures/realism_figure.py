"""The figure of `simnav log realism`, from plain arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .plots import Array
from .style import GREY, Style, figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Panel", "realism_panels"]


@dataclass(frozen=True, eq=False)
class Panel:
    """One instrument: a row of the figure.

    Attributes
    ----------
    title : str
        Title of the row.
    rates : (float, float)
        Values of the lines a second, real and simulated [Hz].
    lines : mapping of str to ((m,), (m,) arrays)
        The autocorrelation of each component, real and simulated.
    telling : sequence of (str, float)
        Features, and the area under the ROC curve of each.
    """

    title: str
    rates: tuple[float, float]
    lines: Mapping[str, tuple[Array, Array]]
    telling: Sequence[tuple[str, float]]


def realism_panels(panels: Sequence[Panel], goal: float, title: str) -> Figure:
    """Autocorrelations beside the features that tell a simulation from a recording.

    Parameters
    ----------
    panels : sequence of Panel
        One for each instrument.
    goal : float
        Area under the ROC curve that passes.
    title : str
        Title of the figure.
    """
    style = Style([name for panel in panels for name in panel.lines] or ["feature"])
    with styled():
        fig = figure(9.0, 0.4 + 2.6 * len(panels))
        rows = fig.subplots(len(panels), 2, squeeze=False)
        for (left, right), panel in zip(rows, panels, strict=True):
            for name, (real, simulated) in panel.lines.items():
                time, times = (np.arange(len(x)) / r for x, r in zip((real, simulated), panel.rates, strict=True))
                left.plot(time, real, color=style.colour(name), label=name)
                left.plot(times, simulated, color=style.colour(name), ls=(0, (3, 2)))
            left.axhline(0.0, color=GREY, lw=0.8)
            left.set_ylabel("autocorrelation")
            left.set_title(f"{panel.title}\nsolid: real, dashed: simulated", loc="left")
            if panel.lines:
                left.legend(loc="upper right")
            names, areas = [name for name, _ in panel.telling], [value for _, value in panel.telling]
            right.barh(range(len(names)), areas, color=GREY)
            right.set_yticks(range(len(names)), names)
            right.invert_yaxis()
            right.set_xlim(0.5, 1.0)
            right.axvline(goal, color="black", lw=0.8, ls=(0, (4, 2)))
            right.set_title("AUC of each feature alone", loc="left")
        rows[-1][0].set_xlabel("lag [s]")
        rows[-1][1].set_xlabel("area under the ROC curve")
        fig.suptitle(title)
    return fig
