"""Gain against the value of a dial, one panel a dial, with intervals, the judged values, and the claim as a line."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.style import GREY, INK, PALETTE, PAPER, SHADE, figure, styled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .points import DialAnswer, Point

__all__ = ["gain_figure"]

_WIDE = 66  # characters of all ticks of a panel, side by side
_FLOOR = -1.0  # a gain below -100 % is drawn at the edge


def gain_figure(sentence: str, claimed: float, limit: float, ours: Point, dials: Sequence[DialAnswer]) -> Figure:
    """Draw the answer to a claim.

    Parameters
    ----------
    sentence : str
        The claim.
    claimed : float
        Its gain, a fraction.
    limit : float
        Ratio of the scores up to which it holds.
    ours : Point
        The gain with our settings.
    dials : sequence of DialAnswer
        One panel each.
    """
    with styled():
        fig = figure(1.0 + 3.6 * max(len(dials), 1), 3.5)
        axes = fig.subplots(1, max(len(dials), 1), sharey=True, squeeze=False)[0]
        for ax, dial in zip(axes, dials, strict=False):
            _panel(ax, ours, dial)
        low, high = axes[0].get_ylim()
        low, high = min(low, -2.0), max(high, 110.0 * claimed)
        axes[0].set_ylim(low, high)  # the axis is shared
        for ax in axes:
            ax.axhline(100.0 * claimed, color=INK, lw=1.0)
            ax.axhspan(100.0 * (1.0 - limit), high, color=SHADE, zorder=0.1, lw=0)
            ax.axhline(0.0, color=GREY, lw=0.6)
        axes[0].set_ylabel("gain [%]")
        axes[0].annotate("claim", (0.01, 100.0 * claimed), xycoords=("axes fraction", "data"), xytext=(0, 2),
                         textcoords="offset points", fontsize=7.5, color=INK)  # fmt: skip
        fig.suptitle(f"{sentence[0].upper()}{sentence[1:]}", x=0.01, ha="left", fontsize=9.5,
                     fontweight="bold", wrap=True)  # fmt: skip
        _legend(fig)
    return fig


def _panel(ax: Axes, ours: Point, dial: DialAnswer) -> None:
    names = [p.value for p in dial.points]
    places = list(range(len(names)))
    colour = PALETTE[0][0]
    for x, point in zip(places, dial.points, strict=True):
        _bar(ax, x, point, colour, "o", 0.0)
    for point in dial.tried:
        _bar(ax, names.index(point.value), point, PALETTE[1][0], "s", 0.14)
    if dial.ours in names:
        _bar(ax, names.index(dial.ours), ours, PALETTE[1][0], "s", 0.14)
    texts = [v if isinstance(v, str) else f"{v:g}" for v in names]
    ax.set_xticks(places, [textwrap.fill(t, _WIDE // len(names)) for t in texts])
    ax.set_xlim(-0.5, len(names) - 0.5)
    title = f"{dial.title} [{dial.unit}]" if dial.unit else dial.title.rstrip(",")
    ax.set_xlabel(textwrap.fill(title, 44))


def _bar(ax: Axes, x: float, point: Point, colour: str, marker: str, shift: float) -> None:
    """A gain with its interval."""
    gain = point.gain
    if not math.isfinite(gain.value):
        return
    value = max(gain.value, _FLOOR)
    if math.isfinite(gain.low):
        ends = [100.0 * max(e, _FLOOR) for e in (gain.low, gain.high)]
        ax.plot([x + shift] * 2, ends, color=colour, lw=2.4, zorder=3)
    if gain.value < _FLOOR:
        marker = "v"
    ax.plot(x + shift, 100.0 * value, marker, color=colour, ms=5.5, mec=PAPER, mew=0.6, zorder=4)


def _legend(fig: Figure) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys: list[Line2D | Patch] = [
        Line2D([], [], color=PALETTE[0][0], marker="o", ms=5.5, lw=2.4, label="seeds of the search"),
        Line2D([], [], color=PALETTE[1][0], marker="s", ms=5.5, lw=2.4, label="seeds of the judgement"),
        Patch(facecolor=SHADE, label="the claim holds"),
    ]
    fig.legend(handles=keys, loc="outside lower center", ncols=len(keys))
