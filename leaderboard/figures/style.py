"""The common style of all figures of matplotlib, and how a figure is written to files.

Every estimator keeps one colour and line style in all figures (`Style`); the palette can be told
apart with any colour vision. SVG files follow the reader's light or dark setting in a browser and
are ordinary light figures everywhere else.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.files import write_whole

from .appearance import INKS, LINES, PALETTE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "FAULT",
    "GREY",
    "INK",
    "PALETTE",
    "SHADE",
    "WIDTH",
    "Style",
    "figure",
    "fitted",
    "save",
    "save_as",
    "styled",
]

_MARKERS = ("o", "s", "D", "^", "v", "P", "X", "*")
INK, GRID = INKS["light"]["ink"], INKS["light"]["grid"]
GREY, SHADE, FAULT, PAPER = "#66707d", "#eceff3", "#fbead9", "#fefefe"
_DARK = {
    INK: INKS["dark"]["ink"],
    GREY: INKS["dark"]["grey"],
    GRID: INKS["dark"]["grid"],
    SHADE: "#262d36",
    FAULT: "#3a2a1c",
    PAPER: "#161b21",
}
TRUTH = INK
_DPI = 160  # of PNG files
_SMALLEST = 7.0 / 9.0  # of the size of letters
_NARROWEST = 0.44  # of the width: labels and panels are still side by side

#: Width of the figures that `save_as` writes [mm]; None: as they were made.
WIDTH: ContextVar[float | None] = ContextVar("width", default=None)

_RC: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.facecolor": "none",
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "text.color": INK,
    "pdf.fonttype": 42,  # letters stay letters, as journals ask for it
    "text.parse_math": False,  # names of estimators are not TeX
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "lines.solid_capstyle": "round",
    "figure.facecolor": "none",
    "svg.fonttype": "none",
    "svg.hashsalt": "simnav",
    "path.simplify_threshold": 0.5,
}


class Style:
    """Colour, line style and marker of every estimator of a set of results.

    Parameters
    ----------
    labels : iterable of str
        All estimators, in the order in which they are shown.
    references : iterable of str
        Those that are told the truth: grey.
    """

    def __init__(self, labels: Iterable[str], references: Iterable[str] = ()):
        self._references = list(dict.fromkeys(references))
        shown = [label for label in dict.fromkeys(labels) if label not in self._references]
        self._index = {label: i for i, label in enumerate(shown)}

    def _of(self, label: str) -> int:
        return self._index.setdefault(label, len(self._index))

    def colour(self, label: str) -> str:
        """Hex colour on a light ground."""
        return GREY if label in self._references else PALETTE[self._of(label) % len(PALETTE)][0]

    def line(self, label: str) -> Any:
        """Matplotlib line style: changes once the colours are used up."""
        if label in self._references:
            return LINES[1 + self._references.index(label) % (len(LINES) - 1)]
        return LINES[self._of(label) // len(PALETTE) % len(LINES)]

    def marker(self, label: str) -> str:
        """Matplotlib marker."""
        if label in self._references:
            return "d"
        return _MARKERS[self._of(label) % len(_MARKERS)]

    def order(self, label: str) -> int:
        """Place in the order in which estimators are shown, references last."""
        return 10**6 if label in self._references else self._of(label)


def figure(width: float, height: float) -> Figure:
    """An empty figure in the common style; ``width`` and ``height`` in inches."""
    from .notebook_figure import NotebookFigure

    with styled():
        return NotebookFigure(figsize=(width, height), layout="constrained")


def styled() -> Any:
    """The common style, inside a ``with`` block."""
    import matplotlib as mpl

    return mpl.rc_context(_RC)


def save(fig: Figure, path: Path, *, formats: Sequence[str] = ("svg", "png")) -> list[Path]:
    """Write a figure, atomically, once for each format.

    Parameters
    ----------
    fig : matplotlib.figure.Figure
        The figure.
    path : Path
        Its suffix is replaced by the format's.
    formats : sequence of str
        Endings of the files, such as ``png``.

    Returns
    -------
    list of Path
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    written = []
    with styled():
        FigureCanvasAgg(fig)
        layout = fig.get_layout_engine()
        if layout is not None:
            layout.execute(fig)
            fig.set_layout_engine("none")  # laid out once: all formats look the same, and come quicker
        for kind in formats:
            # The canvases' own methods: Figure.savefig draws everything twice. No date, so that the same results
            # give the same file.
            buffer = io.BytesIO()
            fig.set_facecolor("none" if kind == "svg" else "white")
            if kind == "svg":
                FigureCanvasSVG(fig).print_svg(buffer, metadata={"Date": None})  # type: ignore[no-untyped-call]
            elif kind == "pdf":
                FigureCanvasPdf(fig).print_pdf(buffer, metadata={"CreationDate": None})  # type: ignore[no-untyped-call]
            else:
                fig.set_dpi(_DPI)
                FigureCanvasAgg(fig).print_png(buffer, pil_kwargs={"compress_level": 3})  # type: ignore[no-untyped-call]
            content = buffer.getvalue()
            if kind == "svg":
                content = _follow_theme(content.decode()).encode()
            target = path.with_suffix(f".{kind}")
            written.append(write_whole(target, content))
    return written


def fitted(fig: Figure, width: float) -> Figure:
    """A figure for the column of a journal, changed in place.

    Letters get smaller, down to seven ninths, so that 9 pt become 7 pt; the height is that which they need. A figure of
    several columns of panels stays wider than one column, with a warning.

    Parameters
    ----------
    fig : matplotlib.figure.Figure
        A figure that was not written before.
    width : float
        Width of the column [mm].
    """
    from matplotlib.text import Text

    before, height = fig.get_size_inches()
    wide = max(width / 25.4, _NARROWEST * before)
    if wide > width / 25.4:
        warnings.warn(f"the figure is {25.4 * wide:.0f} mm wide: its panels need that", UserWarning, stacklevel=2)
    letters = min(1.0, max(_SMALLEST, (wide / before) ** 0.5))
    for text in fig.findobj(Text):
        text.set_fontsize(text.get_fontsize() * letters)
    for axes in fig.axes:
        axes.tick_params(labelsize=_RC["xtick.labelsize"] * letters)
    fig.set_size_inches(wide, height * letters)
    return fig


def save_as(fig: Figure, path: Path) -> Path:
    """Write a figure in the format that its file's suffix names, such as ``.png``; returns the path.

    Its width is `WIDTH`, where that is set.
    """
    width = WIDTH.get()
    if width is not None:
        fitted(fig, width)
    return save(fig, path, formats=(path.suffix[1:].lower(),))[0]


def _follow_theme(svg: str) -> str:
    """Add rules by which a browser shows the figure in dark colours where the reader prefers dark."""
    rules = []
    for light, dark in [*_DARK.items(), *PALETTE]:
        for name in ("fill", "stroke"):
            rules.append(f'[style*="{name}: {light}"]{{{name}:{dark}!important}}')
    css = "<style>@media (prefers-color-scheme:dark){" + "".join(rules) + "}</style>"
    head, tag, rest = svg.partition("<defs>")
    return head + css + tag + rest
