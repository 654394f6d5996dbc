"""Reports in a notebook and at the prompt: one line, and the tables that the command prints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import RenderableType

__all__ = ["Shown"]

_WIDTH = 140  # characters of a line in a notebook
_PAGE = '<pre style="white-space:pre;overflow-x:auto;line-height:normal;font-family:monospace">{code}</pre>'


class Shown(ABC):
    """What is shown of a report; its dataclass is declared with ``repr=False``."""

    @abstractmethod
    def headline(self) -> str:
        """What it is, in one line."""

    def shown(self) -> Iterable[RenderableType]:
        """The tables, as the command prints them."""
        return ()

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.headline()}>"

    def _repr_html_(self) -> str:
        """The tables for a notebook."""
        import io

        from rich.console import Console

        console = Console(record=True, file=io.StringIO(), width=_WIDTH, force_jupyter=False)
        for item in (self.headline(), *self.shown()):
            console.print(item, markup=False, highlight=False)
        return console.export_html(inline_styles=True, code_format=_PAGE)
