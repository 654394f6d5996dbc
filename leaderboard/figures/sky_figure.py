"""The sky over a run (a skyplot), and the place with the errors of ranges along the track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .appearance import EAST, NORTH
from .frames import decimal_log_ticks
from .sky_view import SkyView, State
from .style import GREY, INK, PALETTE, PAPER, SHADE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

__all__ = ["draw_place", "draw_sky"]

#: How a signal arrived: colour, size of its points, words.
_LOOK = {
    State.MISSING: ("#9aa5b1", 2.0, "not received"),
    State.RECEIVED: (PALETTE[0][0], 3.0, "received"),
    State.REFLECTED: (PALETTE[1][0], 4.0, "error by a reflection"),
    State.FAULTY: (PALETTE[6][0], 4.0, "fault"),
}
#: From here on the error of a range has a colour of its own [m].
_LEAST_ERROR = 0.1
#: What lies further from the track than this part of its length, and than so many metres, is left out of the map.
_MARGIN, _LEAST_MARGIN = 0.15, 120.0


def draw_sky(fig: Figure, place: SubplotSpec, view: SkyView) -> None:
    """A skyplot: north above, east to the right, the zenith in the middle, the horizon at the rim."""
    ax = fig.add_subplot(place, projection="polar")
    ax.set_theta_zero_location("N")  # type: ignore[attr-defined]
    ax.set_theta_direction(-1)  # type: ignore[attr-defined]
    away = 90.0 - np.degrees(view.elevation)
    for state, (colour, size, words) in _LOOK.items():
        chosen = (view.state == state) & np.isfinite(away)
        if chosen.any():
            ax.plot(view.azimuth[chosen], away[chosen], "o", ms=size, mew=0.0, color=colour, label=words)
    for c, name in enumerate(view.satellites):
        last = np.flatnonzero(np.isfinite(away[:, c]))[-1]
        ax.annotate(name, (view.azimuth[last, c], away[last, c]), xytext=(4, 3), textcoords="offset points",
                    fontsize=7.0, color=INK)  # fmt: skip
    ax.set_ylim(0.0, 90.0)
    ax.set_yticks([30.0, 60.0, 90.0], ["60°", "30°", ""])
    ax.set_xticks(np.radians(np.arange(0.0, 360.0, 45.0)), ["N", "NE", "E", "SE", "S", "SW", "W", "NW"])
    ax.set_title(f"Satellites of {view.instrument}")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=4, handletextpad=0.2, columnspacing=1.0)


def draw_place(fig: Figure, place: SubplotSpec, view: SkyView) -> None:
    """The obstacles and the track, coloured by the largest error of a range; without any, by what was received."""
    from matplotlib.colors import LogNorm

    ax = fig.add_subplot(place)
    _frame(ax, view)
    (west, east), (south, north) = ax.get_xlim(), ax.get_ylim()
    for o in view.outlines:
        ax.fill(o.east, o.north, fc=SHADE, ec=GREY, lw=0.8, zorder=1)
        middle = float(np.mean(o.east)), float(np.mean(o.north))
        if west < middle[0] < east and south < middle[1] < north:
            ax.annotate(f"{o.top:.0f} m", middle, ha="center", va="center", fontsize=6.5, color=INK)
    by_error = bool(view.error.any())
    values = view.error if by_error else (view.state != State.MISSING).sum(axis=1)
    scaling = LogNorm(_LEAST_ERROR, max(float(np.max(values)), 10.0 * _LEAST_ERROR), clip=True) if by_error else None
    drawn = ax.scatter(view.east, view.north, c=values, norm=scaling, s=14.0, cmap="cividis", lw=0, zorder=3)
    ax.plot(view.east[0], view.north[0], "o", ms=7, mfc=PAPER, mec=INK, zorder=4)
    scale = fig.colorbar(drawn, ax=ax, orientation="horizontal", shrink=0.6, pad=0.02)
    if by_error:
        decimal_log_ticks(scale.ax.xaxis)
    scale.set_label("Largest error of a range [m]" if by_error else "Satellites received")
    what = "Obstacles with heights, and track" if view.outlines else "Track"
    ax.set(xlabel=EAST, ylabel=NORTH, title=f"{what} (circle: start)")


def _frame(ax: Axes, view: SkyView) -> None:
    """Limits around the track, with what stands beside it."""
    sides = [(float(np.min(a)), float(np.max(a))) for a in (view.east, view.north)]
    margin = max(_MARGIN * max(high - low for low, high in sides), _LEAST_MARGIN)
    ax.set_xlim(sides[0][0] - margin, sides[0][1] + margin)
    ax.set_ylim(sides[1][0] - margin, sides[1][1] + margin)
    ax.set_aspect("equal", adjustable="box")
