"""A repeated comparison as an HTML page: beside its figures, and in the site of the leaderboard."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from zipfile import BadZipFile, ZipFile

from pydantic import TypeAdapter

from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.user_cache import keep, user_cache
from simnav.leaderboard.site.content import SiteFacts
from simnav.leaderboard.site.pages import STATIC, TEMPLATES, environment

from . import PAPERS
from .comparison import RULES
from .report import Sheet, Whereabouts, settings_sheet, sheets, summary, whereabouts

if TYPE_CHECKING:
    from .figures import Drawn
    from .reproduction import Reproduction

__all__ = ["PaperPage", "pages_in", "write"]

_FORMAT = 4  # of the document
_NAME, _MOST_KEPT = "document.json", 20  # of the pages that are kept in the user's cache


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
    short: str
    title: str
    about: str
    citation: str
    doi: str
    version: str
    generated: str
    runs: int
    summary: str
    rules: str
    command: str
    full: str
    notes: list[str]
    claims: list[Sheet]
    settings: list[Sheet]
    tables: list[Sheet]
    figures: list[_Figure]
    contents: list[Whereabouts]


@cache
def _json() -> TypeAdapter[_Document]:
    return TypeAdapter(_Document)


@dataclass(frozen=True)
class PaperPage:
    """A repeated comparison as a page of a site.

    Attributes
    ----------
    document : object
        The contents of the page.
    folder : Path
        Folder of its figures.
    stored : Reproduction or None
        The results that come with simnav, if the page is made of them: its figures are drawn when it is installed.
    """

    document: _Document
    folder: Path
    stored: Reproduction | None = None

    @property
    def paper(self) -> str:
        """Authors and year, for the menu."""
        return self.document.short

    @property
    def page(self) -> str:
        """Name of the file."""
        return f"paper-{self.document.paper}.html"

    @property
    def title(self) -> str:
        """Of the paper."""
        return self.document.title

    @property
    def summary(self) -> str:
        """How many rows agree, for each kind of rows."""
        return self.document.summary

    def install(self, folder: Path, site: SiteFacts) -> None:
        """Write the page into the folder of a site, and copy its figures."""
        place = f"figures/paper-{self.document.paper}/"
        (folder / place).mkdir(parents=True, exist_ok=True)
        document = self.document
        if self.stored is not None:
            document, figures = _drawn(self.document.paper)
            for name, content in figures.items():
                write_whole(folder / place / name, content)
        else:
            for figure in document.figures:
                shutil.copyfile(self.folder / figure.file, folder / place / figure.file)
        write_whole(folder / self.page, _render(document, place, site))


def write(found: Reproduction, drawn: Sequence[Drawn], folder: Path) -> Path:
    """Write ``paper-KEY.html`` and ``paper-KEY.json`` (what the page is made of) into the folder of the figures.

    Returns
    -------
    Path
        Path of the page.
    """
    document = _document(found, drawn, folder)
    write_whole(folder / f"paper-{document.paper}.json", _json().dump_json(document, indent=1) + b"\n")
    for name in STATIC:
        shutil.copyfile(TEMPLATES / name, folder / name)
    target = folder / f"paper-{document.paper}.html"
    write_whole(target, _render(document, "", SiteFacts(document.version, document.generated)))
    return target


def pages_in(folder: Path) -> list[PaperPage]:
    """The pages of the repeated comparisons, in the order of the papers.

    A comparison below the folder comes first. If there is none, or it is damaged or of another version, the page is
    made from the results that come with simnav, with the figures that need no run. If there are none either, the paper
    has no page.
    """
    pages = []
    for key in PAPERS:
        page = _written(folder / key, key) or _stored(folder, key)
        if page is not None:
            pages.append(page)
    return pages


def _written(place: Path, key: str) -> PaperPage | None:
    """The page that a folder holds; None if it cannot be used."""
    try:
        document = _json().validate_json((place / f"paper-{key}.json").read_bytes())
    except (OSError, ValueError):
        return None
    known = (document.format, document.paper) == (_FORMAT, key)
    complete = all(Path(f.file).name == f.file and (place / f.file).is_file() for f in document.figures)
    return PaperPage(document, place) if known and complete else None


def _stored(folder: Path, key: str) -> PaperPage | None:
    """The page from the stored results; None if there are none."""
    from . import reading, stored

    try:
        found = stored.shipped_reproduction(reading.paper_of(key))
        return PaperPage(_document(found, []), folder, found)
    except ValueError:
        return None


def _drawn(key: str) -> tuple[_Document, dict[str, bytes]]:
    """The page from the stored results with its figures, by name; kept in the user's cache, for to draw takes seconds.

    What is kept is known by all code of simnav, by all files of the papers and of the scenarios, and by the versions of
    the libraries.
    """
    kept = user_cache() / "papers" / f"{key}-{_state()}.zip"
    with suppress(OSError, ValueError, KeyError, BadZipFile), ZipFile(kept) as file:
        figures = {name: file.read(name) for name in file.namelist()}
        return _json().validate_json(figures.pop(_NAME)), figures
    document, figures = _draw(key)
    content = BytesIO()
    with ZipFile(content, "w") as file:
        for name, figure in {_NAME: _json().dump_json(document), **figures}.items():
            file.writestr(name, figure)
    keep(kept, content.getvalue())
    with suppress(OSError):
        for old in sorted(kept.parent.glob("*.zip"), key=lambda p: p.stat().st_mtime)[:-_MOST_KEPT]:
            old.unlink(missing_ok=True)
    return document, figures


@cache
def _state() -> str:
    """Digest of all that decides a page from stored results."""
    from importlib.metadata import version

    from simnav.leaderboard.campaign.sources import LIBRARY, digest, files_digest, folder_code

    here = Path(__file__).parent
    files = [p for place in (here, LIBRARY / "scenarios") for p in sorted(place.rglob("*")) if p.is_file()]
    data = files_digest((str(p), p) for p in files if p.suffix not in (".py", ".pyc"))
    versions = [version(name) for name in ("simnav", "matplotlib", "numpy")]
    return digest(folder_code(LIBRARY), data, sys.version, *versions)


def _draw(key: str) -> tuple[_Document, dict[str, bytes]]:
    """The page from the stored results with its figures, by name."""
    from . import reading, stored
    from .figures import write_figures

    found = stored.shipped_reproduction(reading.paper_of(key))
    with TemporaryDirectory() as folder:
        place = Path(folder)
        document = _document(found, write_figures(found, place, scores_only=True), place)
        return document, {path.name: path.read_bytes() for path in sorted(place.iterdir())}


def _render(document: _Document, place: str, site: SiteFacts) -> str:
    template = environment().get_template("paper.html")
    return str(template.render(paper=document, place=place, page=f"paper-{document.paper}.html", site=site))


def _document(found: Reproduction, drawn: Sequence[Drawn], folder: Path | None = None) -> _Document:
    """The contents of a page; figures of the claims are written into the folder, if one is given."""
    from importlib.metadata import version

    from .claims.section import claim_count, claim_figures, claim_sheets
    from .claims.stored import answers_of

    paper = found.paper
    answers = answers_of(paper.key) if found.answers is None else found.answers
    claims = claim_count(answers)
    of_claims = [] if folder is None else claim_figures(answers, folder)
    return _Document(
        format=_FORMAT,
        paper=paper.key,
        short=paper.short,
        title=paper.title,
        about=paper.about,
        citation=paper.citation,
        doi=paper.doi,
        version=version("simnav"),
        generated=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        runs=len(found.seeds),
        summary=f"claims: {claims}; {summary(found)}" if claims else summary(found),
        rules=RULES,
        command=f"simnav paper reproduce {paper.key}",
        full=f"simnav paper reproduce {paper.key} --until-decided",
        notes=list(paper.notes),
        claims=claim_sheets(answers),
        settings=[settings_sheet(paper)] if paper.settings else [],
        tables=list(sheets(found)),
        figures=[
            *(_Figure("", c.title, c.path.name, c.caption, c.width, c.height, []) for c in of_claims),
            *(
                _Figure(
                    d.figure.full_number, d.figure.title, d.path.name, d.caption, d.width, d.height, list(d.missing)
                )
                for d in drawn
                if d.path is not None
            ),
        ],
        contents=whereabouts(found, drawn),
    )
