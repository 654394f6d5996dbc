"""The figure of innovations before and after a fit, from plain arrays: are they white, and of the right size?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .plots import Array
from .style import GREY, PALETTE, figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["InnovationPanel", "innovation_figure"]

#: Lags of the autocorrelation, in readings.
_LAGS = 30


@dataclass(frozen=True, eq=False)
class InnovationPanel:
    """The innovations of an instrument.

    Attributes
    ----------
    name : str
        Its name.
    components : int
        Number d of components.
    before, after : (n, d) array
        Innovations, normalised by the filter's covariance: white with unit variance where that is true.
    """

    name: str
    components: int
    before: Array
    after: Array


def innovation_figure(panels: Sequence[InnovationPanel], title: str) -> Figure:
    """Autocorrelation (left) and distribution of the NIS (right), one row an instrument.

    Parameters
    ----------
    panels : sequence of InnovationPanel
        One below the other.
    title : str
        Title of the figure.
    """
    from scipy.stats import chi2

    with styled():
        fig = figure(7.2, 0.6 + 2.0 * len(panels))
        axes = fig.subplots(len(panels), 2, squeeze=False)
        for (left, right), panel in zip(axes, panels, strict=True):
            band = 1.96 / np.sqrt(max(len(panel.after) * panel.components, 1))
            left.axhspan(-band, band, color=GREY, alpha=0.25, lw=0.0)
            grid = chi2.ppf(np.linspace(0.001, 0.999, 200), panel.components)
            right.plot(grid, chi2.cdf(grid, panel.components), color=GREY, ls=(0, (4, 2)), label="expected")
            for k, (label, white) in enumerate((("before", panel.before), ("after", panel.after))):
                colour = PALETTE[k][0]
                left.plot(np.arange(1, _LAGS + 1), _autocorrelation(white), color=colour, label=label)
                nis = np.sort(np.sum(white**2, axis=1))
                right.plot(nis, (np.arange(len(nis)) + 0.5) / len(nis), color=colour, label=label)
            left.set_ylabel(panel.name)
            left.set_ylim(-0.5, 1.0)
            right.set_xlim(0.0, 2.0 * float(grid[-1]))
        axes[0, 0].legend()
        axes[0, 1].legend(loc="lower right")
        axes[-1, 0].set_xlabel("autocorrelation at lag [readings]")
        axes[-1, 1].set_xlabel("share of readings up to this NIS")
        fig.suptitle(title, x=0.01, ha="left", fontsize=9.5, fontweight="bold", wrap=True)
    return fig


def _autocorrelation(white: Array) -> Array:
    """(k,) autocorrelations at the lags from 1 on, means over the components; not a number beyond the data."""
    total = np.sum(white**2, axis=0)
    found = [
        float(np.mean(np.sum(white[lag:] * white[:-lag], axis=0) / total)) if lag < len(white) else np.nan
        for lag in range(1, _LAGS + 1)
    ]
    return np.array(found)
