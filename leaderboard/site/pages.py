"""What all pages have in common: templates and the files beside them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup, escape

from simnav.leaderboard.ranking.tracks import title

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

__all__ = ["STATIC", "TEMPLATES", "environment"]

TEMPLATES = Path(__file__).parent / "templates"
#: Files that every page needs beside it, those of papers too.
STATIC = ("style.css",)


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
    found.filters["prose"] = _prose
    found.filters["ticked"] = _ticked
    found.filters["track_title"] = title
    return found


def _ticked(text: str) -> Markup:
    """A sentence with code in single backticks, as in Markdown."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def _prose(text: str) -> Markup:
    """A text of a docstring: ``*title*`` and code in two backticks become HTML, all else is escaped."""
    safe = re.sub(r"``(.+?)``", r"<code>\1</code>", str(escape(text)))
    # Nothing but the text that was escaped above.
    return Markup(re.sub(r"(?<!\*)\*([^*]+)\*(?!\*)", r"<em>\1</em>", safe))
