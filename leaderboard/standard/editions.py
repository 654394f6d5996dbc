"""Pages of the editions of the board: the tables of each stay when newer results take the place of its own.

The latest edition has its tables on the page, and as CSV and LaTeX. Those of older ones are CSV, for the site's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from simnav.leaderboard.ranking.tables import number
from simnav.leaderboard.ranking.tracks import title
from simnav.leaderboard.results.citation import TITLE, Citation
from simnav.leaderboard.results.files import csv_text, write_whole
from simnav.leaderboard.site.content import SiteFacts
from simnav.leaderboard.site.pages import environment

from .history import Line, editions

__all__ = ["EditionPage", "pages_of"]

_COLUMNS = ("rank", "estimator", "score", "95 % interval", "runs", "failed", "version")


@dataclass(frozen=True)
class EditionPage:
    """An edition as a page of a site.

    Attributes
    ----------
    number : int
        Number of the edition, from 1.
    lines : sequence of Line
        Lines of the edition.
    latest : bool
        Whether no edition is newer.
    """

    number: int
    lines: Sequence[Line]
    latest: bool

    @property
    def page(self) -> str:
        """Name of the file."""
        return f"edition-{self.number}.html"

    @property
    def paper(self) -> str:
        """For menus."""
        return f"Edition {self.number}"

    @property
    def benchmark(self) -> str:
        """Name and version of the benchmark."""
        return max((line.benchmark for line in self.lines), default="")

    @property
    def date(self) -> str:
        """Day of the latest run."""
        return max((line.date for line in self.lines), default="")

    @property
    def title(self) -> str:
        """Of the page."""
        return f"{self.benchmark}, edition {self.number}"

    @property
    def summary(self) -> str:
        """One line."""
        rows = {line.row for line in self.lines}
        return f"{self.date}: {len(rows)} rows, {sum(line.runs for line in self.lines)} runs in tables"

    @property
    def tables(self) -> list[tuple[str, str, list[tuple[str, ...]]]]:
        """Of each track its name, title and rows."""
        found: dict[str, list[Line]] = {}
        for line in self.lines:
            found.setdefault(line.track, []).append(line)
        return [(name, title(name), [_cells(line) for line in lines]) for name, lines in found.items()]

    @property
    def citation(self) -> Citation:
        """How the edition is cited."""
        commits = sorted({c for line in self.lines for c in line.commit.split()})
        note = [self.title, f"commit {' and '.join(commits)}" if 0 < len(commits) < 4 else f"{len(commits)} commits"]
        key = f"{self.benchmark.replace(' ', '-')}-edition-{self.number}"
        return Citation(key, self.date[:4], "", "; ".join(note))

    def install(self, folder: Path, site: SiteFacts) -> None:
        """Write the page and the tables into the folder of a site."""
        place = folder / f"edition-{self.number}"
        place.mkdir(exist_ok=True)
        for name, caption, rows in self.tables:
            write_whole(place / f"{name}.csv", csv_text([_COLUMNS, *rows]))
            if self.latest:
                write_whole(place / f"{name}.tex", _latex(f"{TITLE}. {self.title}. {caption}.", rows))
        page = environment().get_template("edition.html")
        write_whole(folder / self.page, page.render(edition=self, columns=_COLUMNS, page=self.page, site=site))


def pages_of(lines: Sequence[Line]) -> list[EditionPage]:
    """A page for each edition, the latest first."""
    found = editions(lines)
    return [EditionPage(number, mine, number == max(found)) for number, mine in found.items()]


def _cells(line: Line) -> tuple[str, ...]:
    interval = f"{number(line.low)} – {number(line.high)}" if line.low == line.low else ""
    return (line.ranks or "–", line.row, number(line.score), interval, str(line.runs), str(line.failed), line.version)


def _latex(caption: str, rows: Sequence[Sequence[str]]) -> str:
    r"""A table for the package ``booktabs``.

    >>> print(_latex("A_b.", [("1", "ekf_2", "1.5", "1 – 2", "30", "0", "abc")]).splitlines()[4])
    1 & ekf\_2 & 1.5 & 1 -- 2 & 30 & 0 & abc \\
    """
    lines = [f"% {caption}", r"\begin{tabular}{llrlrrl}", r"\toprule", _row(_COLUMNS) + r" \midrule"]
    return "\n".join([*lines, *map(_row, rows), r"\bottomrule", r"\end{tabular}", ""])


def _row(cells: Sequence[str]) -> str:
    return " & ".join(_escaped(cell) for cell in cells) + r" \\"


def _escaped(text: str) -> str:
    plain = {"\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{",
             "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--", "≥": r"$\geq$"}  # fmt: skip
    return "".join(plain.get(c, c) for c in text)
