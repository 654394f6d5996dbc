"""A reproduction as a page: beside its figures, and in the site of the leaderboard."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter

from simnav.leaderboard.papers import PAPERS
from simnav.leaderboard.papers.comparison import RULES
from simnav.leaderboard.papers.report import Sheet, Whereabouts, sheets, summary, whereabouts
from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.site.content import SiteFacts
from simnav.leaderboard.site.pages import STATIC, TEMPLATES, environment

if TYPE_CHECKING:
    from simnav.leaderboard.papers.figures import Drawn
    from simnav.leaderboard.papers.reproduction import Reproduction

__all__ = ["PaperPage", "find", "write"]

_FORMAT = 1  # of the document


@dataclass(frozen=True)
class _Figure:
    number: str
    title: str
    file: str
    caption: str
    width: int
    height: int
    missing: list[str]


@dataclass(frozen=True)
class _Document:
    """What the page is made of, as ``paper-KEY.json`` has it."""

    format: int
    paper: str
    title: str
    citation: str
    version: str
    generated: str
    runs: int
    summary: str
    rules: str
    command: str
    full: str
    notes: list[str]
    tables: list[Sheet]
    figures: list[_Figure]
    contents: list[Whereabouts]


@cache
def _json() -> TypeAdapter[_Document]:
    return TypeAdapter(_Document)


@dataclass(frozen=True)
class PaperPage:
    """A reproduction that was written to a folder, as a page of a site.

    Attributes
    ----------
    document : object
        What is shown.
    folder : Path
        Where its figures are.
    """

    document: _Document
    folder: Path

    @property
    def paper(self) -> str:
        """Key of the paper."""
        return self.document.paper

    @property
    def page(self) -> str:
        """Name of the file."""
        return f"paper-{self.paper}.html"

    @property
    def title(self) -> str:
        """Of the paper."""
        return self.document.title

    @property
    def summary(self) -> str:
        """How many rows agree."""
        return self.document.summary

    def install(self, folder: Path, site: SiteFacts) -> None:
        """Write the page into the folder of a site, and copy its figures."""
        place = f"figures/paper-{self.paper}/"
        (folder / place).mkdir(parents=True, exist_ok=True)
        for figure in self.document.figures:
            shutil.copyfile(self.folder / figure.file, folder / place / figure.file)
        write_whole(folder / self.page, _render(self.document, place, site))


def write(found: Reproduction, drawn: Sequence[Drawn], folder: Path) -> Path:
    """Write ``paper-KEY.html`` and ``paper-KEY.json`` (what the page is made of) into the folder of the figures.

    Returns
    -------
    Path
        Of the page.
    """
    document = _document(found, drawn)
    write_whole(folder / f"paper-{document.paper}.json", _json().dump_json(document, indent=1) + b"\n")
    for name in STATIC:
        shutil.copyfile(TEMPLATES / name, folder / name)
    target = folder / f"paper-{document.paper}.html"
    write_whole(target, _render(document, "", SiteFacts(document.version, document.generated)))
    return target


def find(folder: Path) -> list[PaperPage]:
    """The reproductions below a folder, in order of their keys.

    One that cannot be read, is of another version, or whose figures are gone, is left out.
    """
    pages = []
    for key in PAPERS:
        place = folder / key
        try:
            document = _json().validate_json((place / f"paper-{key}.json").read_bytes())
        except (OSError, ValueError):
            continue
        known = (document.format, document.paper) == (_FORMAT, key)
        if known and all(Path(f.file).name == f.file and (place / f.file).is_file() for f in document.figures):
            pages.append(PaperPage(document, place))
    return pages


def _render(document: _Document, place: str, site: SiteFacts) -> str:
    template = environment().get_template("paper.html")
    return str(template.render(paper=document, place=place, page=f"paper-{document.paper}.html", site=site))


def _document(found: Reproduction, drawn: Sequence[Drawn]) -> _Document:
    from datetime import UTC, datetime
    from importlib.metadata import version

    paper = found.paper
    return _Document(
        format=_FORMAT,
        paper=paper.key,
        title=paper.title,
        citation=paper.citation,
        version=version("simnav"),
        generated=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        runs=len(found.seeds),
        summary=summary(found),
        rules=RULES,
        command=f"simnav reproduce {paper.key} --runs {len(found.seeds)}",
        full=f"simnav reproduce {paper.key} --runs {paper.full}",
        notes=list(paper.notes),
        tables=list(sheets(found)),
        figures=[
            _Figure(d.number, d.title, d.path.name, d.caption, d.width, d.height, list(d.missing))
            for d in drawn
            if d.path is not None
        ],
        contents=whereabouts(found, drawn),
    )
