"""The common style of all figures: colours, lines and axes, and how a figure is written to files.

Every estimator keeps one colour and line style in all figures (`Style`); the palette can be told
apart with any colour vision. SVG files follow the reader's light or dark setting in a browser and
are ordinary light figures everywhere else.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.files import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "GREY",
    "INK",
    "PALETTE",
    "SHADE",
    "Style",
    "figure",
    "legend_below",
    "plain_log_ticks",
    "save",
    "shade",
    "styled",
    "time_unit",
]

# Light and dark form of each colour: Okabe and Ito (2008) without yellow, and two of Tol's "muted" set.
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
_LINES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
_MARKERS = ("o", "s", "D", "^", "v", "P", "X", "*")
INK, GREY, GRID, SHADE, PAPER = "#1b2430", "#66707d", "#dfe3e8", "#eceff3", "#fefefe"
_DARK = {INK: "#e8ebef", GREY: "#9aa5b1", GRID: "#343c46", SHADE: "#262d36", PAPER: "#161b21"}
TRUTH = INK
_LEGEND = 15.0  # characters of a legend that fit into an inch

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
    "text.parse_math": False,  # names of estimators are not TeX
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "lines.solid_capstyle": "round",
    "figure.facecolor": "none",
    "svg.fonttype": "path",
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

    def colour(self, label: str, dark: bool = False) -> str:
        """Hex colour on a light (or dark) ground."""
        if label in self._references:
            return _DARK[GREY] if dark else GREY
        return PALETTE[self._of(label) % len(PALETTE)][dark]

    def line(self, label: str) -> Any:
        """Matplotlib line style: changes once the colours are used up."""
        if label in self._references:
            return _LINES[1 + self._references.index(label) % (len(_LINES) - 1)]
        return _LINES[self._of(label) // len(PALETTE) % len(_LINES)]

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
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_RC):
        return Figure(figsize=(width, height), layout="constrained")


def styled() -> Any:
    """The common style, inside a ``with`` block."""
    import matplotlib as mpl

    return mpl.rc_context(_RC)


def save(fig: Figure, path: Path, *, formats: Sequence[str] = ("svg", "png"), dpi: int = 160) -> list[Path]:
    """Write a figure, atomically, once for each format.

    Parameters
    ----------
    fig : matplotlib.figure.Figure
        The figure.
    path : Path
        Its suffix is replaced by the format's.
    formats : sequence of str
        Endings of the files, such as ``png``.
    dpi : int
        Resolution of the pixel formats [dots per inch].

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
                fig.set_dpi(dpi)
                FigureCanvasAgg(fig).print_png(buffer, pil_kwargs={"compress_level": 3})  # type: ignore[no-untyped-call]
            content = buffer.getvalue()
            if kind == "svg":
                content = _follow_theme(content.decode()).encode()
            target = path.with_suffix(f".{kind}")
            written.append(write_whole(target, content))
    return written


def _follow_theme(svg: str) -> str:
    """Add rules by which a browser shows the figure in dark colours where the reader prefers dark."""
    rules = []
    for light, dark in [*_DARK.items(), *PALETTE]:
        for name in ("fill", "stroke"):
            rules.append(f'[style*="{name}: {light}"]{{{name}:{dark}!important}}')
    css = "<style>@media (prefers-color-scheme:dark){" + "".join(rules) + "}</style>"
    head, tag, rest = svg.partition("<defs>")
    return head + css + tag + rest


def time_unit(longest: float) -> tuple[str, float]:
    """Unit that suits a time axis up to ``longest`` [s], and the factor to it."""
    if longest > 3.0 * 3600.0:
        return "h", 1.0 / 3600.0
    return ("min", 1.0 / 60.0) if longest > 600.0 else ("s", 1.0)


def shade(ax: Axes, outages: Sequence[tuple[float, float, str]], factor: float, *, named: bool) -> None:
    """Shade outages (start, end [s], name), and name them at the top."""
    last = -math.inf
    for start, end, name in sorted(outages):
        ax.axvspan(start * factor, end * factor, color=SHADE, lw=0, zorder=0)
        if named and name and start >= last:
            ax.annotate(name, (start * factor, 1.0), xycoords=("data", "axes fraction"), xytext=(2, -2),
                        textcoords="offset points", ha="left", va="top", fontsize=7.0, color=GREY)  # fmt: skip
            last = end


def plain_log_ticks(axis: Any) -> None:
    """Powers of ten as 0.1, 1, 10, 100, 1k; more ticks where the range is short."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    low, high = sorted(axis.get_view_interval())
    decades = math.log10(high / low) if low > 0.0 else 9.0

    def text(value: float, _: int) -> str:
        if value >= 1e6 or value < 1e-4:
            return f"1e{round(math.log10(value))}" if value > 0 else ""
        return f"{value / 1e3:g}k" if value >= 1e4 else f"{value:g}"

    subs = (1.0, 2.0, 5.0) if decades < 2.2 else (1.0, 3.0) if decades < 3.2 else (1.0,)
    axis.set_major_locator(LogLocator(base=10.0, subs=subs, numticks=12))
    axis.set_major_formatter(FuncFormatter(text))
    axis.set_minor_locator(NullLocator())


def legend_below(fig: Figure, ax: Axes, style: Style | None = None) -> None:
    """One legend for all panels, from one of them: in the order of the style, or without one the last drawn first."""
    handles, labels = ax.get_legend_handles_labels()
    if not handles:
        return
    columns = max(1, int(_LEGEND * fig.get_figwidth() / (max(map(len, labels)) + 7)))  # as many as fit side by side
    pairs = list(zip(labels, handles, strict=True))[::-1]
    if style is not None:
        pairs.sort(key=lambda pair: style.order(pair[0]))
    fig.legend(
        [handle for _, handle in pairs],
        [label for label, _ in pairs],
        loc="outside lower center",
        ncols=min(len(labels), columns, 5),
    )
