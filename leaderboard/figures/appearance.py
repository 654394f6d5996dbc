"""What all charts share, whoever draws them: colours and lines of rows, inks, and the titles and units of axes.

Matplotlib draws figures of arrays, runs and papers (`simnav.leaderboard.figures`). Vega draws the charts of the site,
in the browser and for print (`simnav.leaderboard.site.charts`). Both read this file; the site hands it to the browser.
"""

from __future__ import annotations

from typing import Any

__all__ = ["DASHES", "EAST", "HORIZONTAL_ERROR", "INKS", "LINES", "NORTH", "PALETTE", "PROTECTION_LEVEL", "TIME",
           "for_browser", "titled"]  # fmt: skip

#: Light and dark form of the colour of each row: Okabe and Ito (2008) without yellow, and two of Tol's "muted" set.
PALETTE: tuple[tuple[str, str], ...] = (
    ("#0072b2", "#4aa8e0"),
    ("#d55e00", "#f08a45"),
    ("#009e73", "#2fc79c"),
    ("#cc79a7", "#e39fc4"),
    ("#56b4e9", "#8fd0f5"),
    ("#e69f00", "#f5bd45"),
    ("#882255", "#c9679b"),
    ("#999933", "#dddd92"),
)

#: The line of a row changes once the colours are used up: lengths of dashes and gaps, for Vega and for matplotlib.
DASHES: tuple[list[int], ...] = ([1, 0], [6, 2], [2, 2], [6, 2, 2, 2])
LINES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.5, 1.2, 1.5)))

#: Inks of charts in the browser, on a light and on a dark ground.
INKS: dict[str, dict[str, str]] = {
    "light": {"ink": "#1b2430", "grey": "#5b6673", "grid": "#dfe3e8", "shade": "#9aa5b1"},
    "dark": {"ink": "#e8ebef", "grey": "#9aa5b1", "grid": "#343c46", "shade": "#66707d"},
}


def titled(quantity: str, unit: str) -> str:
    """The title of an axis.

    >>> titled("Horizontal error", "m")
    'Horizontal error [m]'
    """
    return f"{quantity} [{unit}]"


TIME = titled("Time", "s")
EAST, NORTH = titled("East", "m"), titled("North", "m")
HORIZONTAL_ERROR = titled("Horizontal error", "m")
PROTECTION_LEVEL = titled("Protection level", "m")


def for_browser() -> dict[str, Any]:
    """Colours, lines and inks, for the scripts of the site."""
    palettes = {"light": [light for light, _ in PALETTE], "dark": [dark for _, dark in PALETTE]}
    return {"palettes": palettes, "inks": INKS, "dashes": DASHES}
