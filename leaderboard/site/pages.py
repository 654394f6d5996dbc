"""What all pages have in common: templates and the files beside them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["STATIC", "TEMPLATES", "ExtraPage", "environment"]

TEMPLATES = Path(__file__).parent / "templates"
#: Files that every page needs beside it.
STATIC = ("style.css", "tables.js")


class ExtraPage(Protocol):
    """A page that something other than a campaign's results brings to the site: a reproduction of a paper."""

    @property
    def page(self) -> str:
        """Name of its file."""

    @property
    def paper(self) -> str:
        """Key of the paper, for the menu."""

    @property
    def title(self) -> str:
        """Of the paper."""

    @property
    def summary(self) -> str:
        """One line for the index."""

    def install(self, site: Path, shared: dict[str, Any]) -> None:
        """Write the page and its figures into a folder; ``shared`` is what all pages of the site are given."""


def environment() -> Environment:
    """The templates' environment: what comes from outside is escaped, and a name that is not there is a mistake."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
