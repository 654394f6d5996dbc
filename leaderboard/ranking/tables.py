"""Tables for people, from plain values (rich is imported when a table is drawn)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table

__all__ = ["Fitted", "Lines", "duration", "interval", "number", "parameters", "percent", "size", "table"]

MISSING = "–"


def number(value: Any, digits: int = 3) -> str:
    """A figure with ``digits`` significant digits, without exponents where they can be avoided.

    >>> number(1234.5), number(0.012345), number(0.9999), number(None)
    ('1230', '0.0123', '1.00', '–')
    """
    if value is None:
        return MISSING
    if isinstance(value, (int, str)):
        return str(value)
    x = float(value)
    if math.isnan(x):
        return MISSING
    if math.isinf(x):
        return "∞" if x > 0 else "-∞"
    if x == 0.0:
        return "0"
    x = float(f"{x:.{digits - 1}e}")
    exponent = math.floor(math.log10(abs(x)))
    if exponent >= 6 or exponent < -4:
        return f"{x:.{digits - 1}e}"
    decimals = digits - 1 - exponent
    return f"{x:.{max(decimals, 0)}f}"


def interval(value: Any, low: Any, high: Any) -> str:
    """A figure with its interval.

    >>> interval(2.0, 1.5, 2.5)
    '2.00 [1.50, 2.50]'
    """
    if low is None or high is None or not all(map(_finite, (value, low, high))):
        return number(value)
    return f"{number(value)} [{number(low)}, {number(high)}]"


def _finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


def percent(value: Any) -> str:
    """A fraction in percent.

    >>> percent(0.954)
    '95.4 %'
    """
    return MISSING if not _finite(value) else f"{100.0 * value:.1f} %"


def duration(seconds: Any) -> str:
    """A time with the unit that suits it.

    >>> duration(3.2e-5), duration(0.25), duration(90), duration(5400)
    ('32.0 µs', '250 ms', '90.0 s', '90.0 min')
    """
    if not _finite(seconds):
        return MISSING
    for factor, unit in ((1e-6, "µs"), (1e-3, "ms"), (1.0, "s")):
        if seconds < 999.5 * factor:
            return f"{number(seconds / factor)} {unit}"
    return f"{number(seconds / 60.0)} min" if seconds < 7200.0 else f"{number(seconds / 3600.0)} h"


def size(count: Any) -> str:
    """Bytes with the unit that suits them.

    >>> size(350 * 2**20)
    '350 MiB'
    """
    if not _finite(count):
        return MISSING
    for factor, unit in ((2**30, "GiB"), (2**20, "MiB"), (2**10, "KiB")):
        if count >= factor:
            return f"{number(count / factor)} {unit}"
    return f"{count:.0f} B"


def parameters(values: Mapping[str, Any]) -> str:
    """Parameters as they are typed on the command line.

    >>> parameters({"gate": 3.0})
    'gate=3.0'
    """
    return ", ".join(f"{k}={v}" for k, v in values.items())


def _fold(heading: str) -> str:
    """A long heading on two lines.

    >>> _fold("horizontal RMSE [m]").split(chr(10))
    ['horizontal', 'RMSE [m]']
    """
    spaces = [i for i, c in enumerate(heading) if c == " "]
    if len(heading) < 10 or not spaces:
        return heading
    middle = min(spaces, key=lambda i: (abs(i - len(heading) / 2), i))
    return heading[:middle] + "\n" + heading[middle + 1 :]


def table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[Any]],
    *,
    numeric: Iterable[str] = (),
    dim: Iterable[int] = (),
    strong: Iterable[int] = (),
    caption: str | None = None,
) -> Table:
    """A rich table; cells are shown as text, never as markup.

    Parameters
    ----------
    title : str
        Title above the table.
    columns : sequence of str
        Titles of the columns.
    rows : iterable of sequences
        Cells of each row.
    numeric : iterable of str
        Columns that are right-aligned.
    dim, strong : iterable of int
        Rows that step back (reference rows) and that stand out (the user's own).
    caption : str, optional
        Text below the table.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    right, faint, bold = set(numeric), set(dim), set(strong)
    result = Table(
        title=Text(title, style="bold"),
        caption=None if caption is None else Text(caption, style="dim"),
        title_justify="left",
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    for index, name in enumerate(columns):
        # Figures and names stay whole; headings are folded instead.
        result.add_column(
            Text(_fold(name) if name in right else name),
            justify="right" if name in right else "left",
            no_wrap=name in right or index == 0,
        )
    for index, row in enumerate(rows):
        style = "bold" if index in bold else "dim" if index in faint else ""
        result.add_row(*(Text(MISSING if c is None else str(c)) for c in row), style=style)
    return result


@dataclass(frozen=True)
class Lines:
    """A list with one line for each entry: the last column is cut where the terminal ends, all others stay whole.

    Parameters
    ----------
    title : str
        Title above the list.
    columns : sequence of str
        Titles of the columns.
    rows : sequence of sequences of str
        Cells of each entry.
    numeric, dim, caption
        As in `table`.
    spare : sequence of str
        Columns that are left out, one after the other, while they leave too little for the last one.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: Sequence[str] = ()
    dim: Sequence[int] = ()
    caption: str | None = None
    spare: Sequence[str] = ()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        heads = dict(zip(self.columns[:-1], list(zip(*self.rows, strict=True))[:-1], strict=False))
        spare = list(self.spare)
        while (room := self._room(heads, options.max_width)) < _ENOUGH and spare:
            heads.pop(spare.pop(0), None)
        last = [_cut(row[-1], max(room, _LEAST)) for row in self.rows]
        rows = [list(cells) for cells in zip(*heads.values(), last, strict=True)]
        columns = [*heads, self.columns[-1]]
        numeric = [name for name in self.numeric if name in columns]
        yield table(self.title, columns, rows, numeric=numeric, dim=self.dim, caption=self.caption)

    @staticmethod
    def _room(heads: Mapping[str, Sequence[str]], width: int) -> int:
        """What columns leave of a width for the last one [characters]."""
        widths = (max(map(len, (name, *cells))) for name, cells in heads.items())
        return width - _EDGES - sum(w + _BETWEEN for w in widths)


_LEAST = 12  # characters of the last column of `Lines`, be the terminal ever so narrow
_ENOUGH = 30  # characters of it that can be read


def _cut(text: str, width: int) -> str:
    """A text of at most so many characters.

    >>> _cut("Open sea on a clean day", 12)
    'Open sea on…'
    """
    return text if len(text) <= width else f"{text[: width - 1].rstrip()}…"


_BETWEEN, _EDGES = 3, 2  # characters between two columns, and at both ends of a line


@dataclass(frozen=True)
class Fitted:
    """A table that leaves out the columns of least value where the terminal is too narrow for all.

    Parameters
    ----------
    title : str
        Title above the table.
    columns : sequence of str
        Titles of the columns.
    rows : sequence of sequences
        Cells of each row.
    value : sequence of str
        Columns from the most valuable on. The first ones are never left out, be the terminal ever so narrow; columns
        that are not named go first.
    always : int
        How many are never left out.
    numeric, dim, strong, caption
        As in `table`.
    explained : mapping of str to str
        Sentences that are added to the caption where their column is shown.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    value: Sequence[str]
    always: int = 2
    numeric: Sequence[str] = ()
    dim: Sequence[int] = ()
    strong: Sequence[int] = ()
    caption: str | None = None
    explained: Mapping[str, str] = field(default_factory=dict)

    def shown(self, width: int) -> list[str]:
        """The columns that fit into a width [characters], in the order of the table."""
        filled = [c for i, c in enumerate(self.columns) if not self.rows or any(row[i] != "" for row in self.rows)]
        order = sorted(filled, key=lambda c: self.value.index(c) if c in self.value else len(self.value))
        kept: list[str] = []
        used = _EDGES - _BETWEEN
        for count, name in enumerate(order):
            wanted = used + self._width(name) + _BETWEEN
            if count < self.always or wanted <= width:
                kept.append(name)
                used = wanted
        return [name for name in self.columns if name in kept]

    def _width(self, name: str) -> int:
        index = self.columns.index(name)
        heading = max(map(len, _fold(name).split("\n"))) if name in self.numeric else len(name)
        return max([heading, *(len(MISSING if r[index] is None else str(r[index])) for r in self.rows)])

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        kept = self.shown(options.max_width)
        where = [self.columns.index(name) for name in kept]
        left = [c for i, c in enumerate(self.columns) if c not in kept and any(row[i] != "" for row in self.rows)]
        notes = [self.caption, *(text for name, text in self.explained.items() if name in kept)]
        if left:
            notes.append(f"Left out for want of width: {', '.join(left)}.")
        caption = " ".join(filter(None, notes)) or None
        yield table(
            self.title, kept, [[row[i] for i in where] for row in self.rows], numeric=self.numeric, dim=self.dim,
            strong=self.strong, caption=caption,
        )  # fmt: skip
