"""A figure of matplotlib that a notebook shows, also if nothing there has imported ``pyplot``."""

from __future__ import annotations

import io

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

__all__ = ["NotebookFigure"]


class NotebookFigure(Figure):
    """A figure with a picture of its own for notebooks."""

    def _repr_png_(self) -> bytes:
        """The picture, as IPython asks for it."""
        buffer = io.BytesIO()
        FigureCanvasAgg(self).print_png(buffer)  # type: ignore[no-untyped-call]
        return buffer.getvalue()
