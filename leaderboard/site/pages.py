"""What all pages have in common: templates and the files beside them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking_table import between, ratio

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["STATIC", "TEMPLATES", "environment"]

TEMPLATES = Path(__file__).parent / "templates"
#: Files that every page needs beside it.
STATIC = ("style.css", "tables.js")


def environment() -> Environment:
    """The templates' environment: what comes from outside is escaped, and a name that is not there is a mistake."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    found = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters |= {
        "duration": tables.duration,
        "percent": tables.percent,
        "size": lambda count: tables.size(count or None),
        "ratio": ratio,
        "to_ratio": lambda low, high: between(low, high, ratio),
        "sortable": lambda value: "" if math.isnan(value) else repr(float(value)),
    }
    return found
