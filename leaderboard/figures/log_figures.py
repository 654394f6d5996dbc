"""Figures of logs: how residuals depend on the delay of an instrument, and where and when a log has data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .plots import Array
from .style import GREY, INK, Style, figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DelayCurve", "coverage_map", "delay_panels"]

#: A gap is drawn from so many times the usual spacing on.
_GAP = 5.0


@dataclass(frozen=True)
class DelayCurve:
    """What is left of one instrument, by delay.

    Attributes
    ----------
    name : str
        The instrument.
    curve : sequence of (float, float)
        Delays [s], and the mean square of the residuals over its smallest value.
    delay, sigma : float
        The delay that was found; NaN: none.
    """

    name: str
    curve: Sequence[tuple[float, float]]
    delay: float
    sigma: float


def delay_panels(curves: Sequence[DelayCurve], title: str) -> Figure:
    """A panel for each instrument: the rms of the residuals over the delay, relative to the smallest.

    Parameters
    ----------
    curves : sequence of DelayCurve
        At least one.
    title : str
        Title of the figure.
    """
    with styled():
        fig = figure(6.4, 1.0 + 1.6 * len(curves))
        axes = fig.subplots(len(curves), 1, sharex=True, squeeze=False)[:, 0]
        for ax, one in zip(axes, curves, strict=True):
            delay, square = np.array(sorted(one.curve)).reshape(-1, 2).T
            shown = np.isfinite(square)
            ax.plot(delay[shown], np.sqrt(square[shown]), color=INK, lw=1.2, marker="o", ms=2.0)
            if np.isfinite(one.delay):
                ax.axvline(one.delay, color=GREY, lw=1.0)
                ax.axvspan(one.delay - 2.0 * one.sigma, one.delay + 2.0 * one.sigma, color=GREY, alpha=0.25, lw=0.0)
            ax.set_ylabel(one.name)
        axes[0].set_title(title)
        axes[-1].set_xlabel("late by [s]; the line is what was found, the band two sigma")
    return fig


def coverage_map(tracks: Mapping[str, Array], times: Mapping[str, Array], title: str) -> Figure:
    """The tracks of a log on a map, and when each stream has data.

    Parameters
    ----------
    tracks : mapping of str to (n, 2) array
        East and north of the first position [m], by stream.
    times : mapping of str to (n,) array
        Times of the rows of each stream [s].
    title : str
        Title of the figure.
    """
    style = Style(list(times))
    first = min((float(t[0]) for t in times.values() if len(t)), default=0.0)
    with styled():
        fig = figure(6.4, 2.0 + 0.28 * len(times) + (4.0 if tracks else 0.0))
        parts = fig.subplots(
            1 + bool(tracks), 1, squeeze=False, height_ratios=[4.0, 1.0 + 0.28 * len(times)][-1 - bool(tracks) :]
        )[:, 0]
        parts[0].set_title(title)
        if tracks:
            for name, track in tracks.items():
                parts[0].plot(track[:, 0], track[:, 1], style.line(name), color=style.colour(name), lw=1.0, label=name)
            parts[0].set_aspect("equal", adjustable="datalim")
            parts[0].set_xlabel("east [m]")
            parts[0].set_ylabel("north [m]")
            parts[0].legend(loc="best")
        ax = parts[-1]
        for y, (name, time) in enumerate(times.items()):
            for begin, end in _parts_without_gaps(time):
                ax.plot(
                    [begin - first, max(end - first, begin - first + 1e-3)], [y, y], color=style.colour(name), lw=4.0
                )
        ax.set_yticks(range(len(times)), list(times))
        ax.invert_yaxis()
        ax.set_xlabel(f"time [s] from {first:.3f} s")
    return fig


def _parts_without_gaps(time: Array) -> list[tuple[float, float]]:
    """Begin and end of each part without a gap."""
    if not len(time):
        return []
    between = np.diff(time)
    usual = float(np.median(between)) if len(between) else 0.0
    cut = np.flatnonzero(between > _GAP * usual) if usual > 0.0 else np.empty(0, np.intp)
    begins = np.concatenate([[0], cut + 1])
    ends = np.concatenate([cut, [len(time) - 1]])
    return [(float(time[a]), float(time[b])) for a, b in zip(begins, ends, strict=True)]
