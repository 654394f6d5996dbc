"""One figure for a table of a paper: each of our figures over the paper's, with its interval and the single runs.

The axis is logarithmic and reaches from a quarter of the paper's figure to four times it. A figure beyond is drawn at
the edge with its number, so that a method that is 600 times worse does not flatten the rest. Of a gain, the ratio of
the two errors is compared, so that "larger" always means a larger error than the paper's.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.style import GREY, INK, PALETTE, PAPER, SHADE, figure, styled
from simnav.leaderboard.ranking import tables

from .comparison import GAIN, TOLERANCE
from .measures import measure
from .paper import Gain, kind_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .findings import Finding

__all__ = ["EDGE", "Ratio", "ratio_figure", "ratios"]

#: The axis ends at this multiple of the paper's figure, and at its inverse.
EDGE = 4.0
_WIDEST = 56  # characters of a label in a line

_COLOUR = {"agrees": PALETTE[2][0], "differs": PALETTE[1][0], "undecided": PALETTE[5][0]}
_MARKER = {"agrees": "o", "differs": "s", "undecided": "D"}


@dataclass(frozen=True)
class Ratio:
    """A row of a paper's table: our figure over the paper's.

    Attributes
    ----------
    label : str
        Method and measure.
    value, low, high : float
        Our mean over the paper's figure (of a range: over its nearer end; 1 within it), with its 95 % interval.
    single_low, single_high : float
        The range of our single runs over the paper's figure; NaN where there is none.
    band : (float, float)
        Ratios that agree.
    verdict : str
        ``agrees``, ``differs`` or ``undecided``.
    """

    label: str
    value: float
    low: float
    high: float
    single_low: float
    single_high: float
    band: tuple[float, float]
    verdict: str


def ratios(findings: Sequence[Finding]) -> list[Ratio]:
    """The rows of a table that can be drawn: figures and gains that both the paper and we have, above zero.

    Parameters
    ----------
    findings : sequence of Finding
        The rows of one table.
    """
    several = len({f.row.scenario for f in findings}) > 1
    made = []
    for f in findings:
        row, paper = f.row, f.row.paper
        if paper is None or f.ours is None or f.verdict not in _COLOUR or kind_of(row) != "figure":
            continue
        what = measure(row.score).title
        label = f"{row.method}: {what[0].lower()}{what[1:]}"
        band = (1.0 / (1.0 + TOLERANCE), 1.0 + TOLERANCE)
        if isinstance(row, Gain):
            divisor = 1.0 - row.paper if row.paper is not None else math.nan
            label = f"{row.method} against {row.than}: {what[0].lower()}{what[1:]}"
            low, high = sorted((divisor ** (1.0 / GAIN), divisor**GAIN)) if divisor > 0.0 else (math.nan, math.nan)
            band = (low / divisor, high / divisor)
        elif isinstance(paper, tuple):
            divisor = min(max(f.ours.value, paper[0]), paper[1])
        else:
            divisor = paper
        if not divisor > 0.0 or not f.ours.value > 0.0:
            continue
        single = (math.nan, math.nan) if f.single is None else (f.single.low / divisor, f.single.high / divisor)
        label = f"{label} ({row.scenario})" if several else label
        made.append(Ratio(label, f.ours.value / divisor, f.ours.low / divisor, f.ours.high / divisor, *single, band,
                          f.verdict))  # fmt: skip
    return made


def ratio_figure(rows: Sequence[Ratio], title: str) -> Figure:
    """Draw the rows of a table, one below the other.

    Parameters
    ----------
    rows : sequence of Ratio
        From `ratios`; at least one.
    title : str
        Title of the figure.
    """
    from matplotlib.ticker import NullFormatter, NullLocator

    labels = [textwrap.fill(r.label, _WIDEST, break_on_hyphens=False) for r in rows]
    lines = max(label.count("\n") for label in labels) + 1
    with styled():
        fig = figure(8.4, 1.35 + (0.13 + 0.1 * lines) * max(len(rows), 2))
        ax = fig.subplots()
        ax.set_xscale("log")
        ax.set_xlim(1.0 / EDGE / 1.25, EDGE * 1.25)
        ax.set_ylim(len(rows) - 0.4, -0.6)
        for y, row in enumerate(rows):
            _row(ax, y, row)
        ax.axvline(1.0, color=INK, lw=0.9, zorder=0.8)
        ax.set_yticks(range(len(rows)), labels)
        ticks = (0.25, 0.33, 0.5, 0.67, 0.8, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0)
        ax.set_xticks(ticks, [f"{x:g}" for x in ticks])
        ax.xaxis.set_minor_locator(NullLocator())
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("our figure, as a multiple of the paper's")
        fig.suptitle(textwrap.fill(title, 100), x=0.01, ha="left", fontsize=9.5, fontweight="bold")
        _legend(fig, {r.verdict for r in rows})
    return fig


def _row(ax: Axes, y: int, row: Ratio) -> None:
    """The band of agreement, the range of single runs, the interval of the mean, and the mean."""
    colour = _COLOUR[row.verdict]
    if math.isfinite(row.band[0]):
        ax.plot(row.band, (y, y), color=SHADE, lw=11.0, solid_capstyle="butt", zorder=0.5)
    for low, high, width, order in ((row.single_low, row.single_high, 1.0, 2.0), (row.low, row.high, 3.2, 3.0)):
        if math.isfinite(low) and math.isfinite(high):
            ends = [min(max(x, 1.0 / EDGE), EDGE) for x in (max(low, 1e-12), high)]
            ax.plot(ends, (y, y), color=colour, lw=width, zorder=order)
    if 1.0 / EDGE <= row.value <= EDGE:
        ax.plot(row.value, y, _MARKER[row.verdict], ms=5.5, color=colour, mec=PAPER, mew=0.6, zorder=4)
        return
    beyond = row.value > EDGE
    edge = EDGE if beyond else 1.0 / EDGE
    ax.plot(edge, y, ">" if beyond else "<", ms=6.5, color=colour, zorder=4, clip_on=False)
    ax.annotate(
        f"{tables.number(row.value)} times", (edge, y), xytext=(-8 if beyond else 8, 0), textcoords="offset points",
        ha="right" if beyond else "left", va="center", fontsize=7.5, color=INK, zorder=5,
        bbox={"facecolor": PAPER, "edgecolor": "none", "pad": 1.0},
    )  # fmt: skip


def _legend(fig: Figure, verdicts: set[str]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys: list[Line2D | Patch] = [
        Line2D([], [], color=_COLOUR[v], marker=_MARKER[v], ms=5.5, lw=3.2, label=f"{v} (mean, 95 %)")
        for v in _COLOUR
        if v in verdicts
    ]
    keys.append(Line2D([], [], color=GREY, lw=1.0, label="95 % of single runs"))
    keys.append(Patch(facecolor=SHADE, label="agrees"))
    fig.legend(handles=keys, loc="outside lower center", ncols=len(keys))
