"""A reproduction as a page: beside its figures, and in the site of the leaderboard."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.papers import PAPERS
from simnav.leaderboard.papers.comparison import RULES
from simnav.leaderboard.papers.report import NUMERIC, contents_rows, sheets, summary
from simnav.leaderboard.results.plain import plain
from simnav.leaderboard.site.pages import STATIC, TEMPLATES, environment

if TYPE_CHECKING:
    from simnav.leaderboard.papers.figures import Drawn
    from simnav.leaderboard.papers.reproduction import Reproduction

__all__ = ["PaperPage", "find", "write"]

_FORMAT = 1  # of the document


def write(found: Reproduction, drawn: Sequence[Drawn], folder: Path) -> Path:
    """Write ``paper-KEY.html`` and ``paper-KEY.json`` (what the page is made of) into the folder of the figures.

    Returns
    -------
    Path
        Of the page.
    """
    key = found.paper.key
    document = plain(_document(found, drawn))
    _replace(folder / f"paper-{key}.json", json.dumps(document, indent=1, ensure_ascii=False) + "\n")
    for name in STATIC:
        shutil.copyfile(TEMPLATES / name, folder / name)
    target = folder / f"paper-{key}.html"
    _replace(target, _render(document, "", {"papers": [], "scenarios": [], "total": 0}))
    return target


@dataclass(frozen=True)
class PaperPage:
    """A reproduction that was written to a folder, as a page of a site.

    Attributes
    ----------
    document : dict
        What the page is made of, as ``paper-KEY.json`` has it.
    folder : Path
        Where its figures are.
    """

    document: dict[str, Any]
    folder: Path

    @property
    def paper(self) -> str:
        """Key of the paper."""
        return str(self.document["paper"])

    @property
    def page(self) -> str:
        """Name of the file."""
        return f"paper-{self.paper}.html"

    @property
    def title(self) -> str:
        """Of the paper."""
        return str(self.document["title"])

    @property
    def summary(self) -> str:
        """How many rows agree."""
        return str(self.document["summary"])

    def install(self, site: Path, shared: dict[str, Any]) -> None:
        """Write the page into a site, and copy its figures; ``shared`` is what all pages are given."""
        place = f"figures/paper-{self.paper}/"
        (site / place).mkdir(parents=True, exist_ok=True)
        for figure in self.document["figures"]:
            name = Path(figure["file"]).name
            shutil.copyfile(self.folder / name, site / place / name)
        (site / self.page).write_text(_render(self.document, place, shared), encoding="utf-8")


def find(folder: Path) -> list[PaperPage]:
    """The reproductions below a folder, in order of their keys.

    One that cannot be read, is of another version, or whose figures are gone, is left out.
    """
    pages = []
    for key in PAPERS:
        place = folder / key
        try:
            document = json.loads((place / f"paper-{key}.json").read_text(encoding="utf-8"))
            files = [f["file"] for f in document["figures"]]
            known = (document["format"], document["paper"]) == (_FORMAT, key)
        except (OSError, ValueError, KeyError, TypeError):
            continue
        if known and all((place / Path(name).name).is_file() for name in files):
            pages.append(PaperPage(document, place))
    return pages


def _render(document: dict[str, Any], place: str, shared: dict[str, Any]) -> str:
    values = {"version": document["version"], "generated": document["generated"], **shared}
    values |= {"paper": document, "place": place, "page": f"paper-{document['paper']}.html"}
    return str(environment().get_template("paper.html").render(**values))


def _document(found: Reproduction, drawn: Sequence[Drawn]) -> dict[str, Any]:
    from datetime import UTC, datetime
    from importlib.metadata import version

    paper = found.paper
    return {
        "format": _FORMAT,
        "paper": paper.key,
        "title": paper.title,
        "citation": paper.citation,
        "version": version("simnav"),
        "generated": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "runs": len(found.seeds),
        "summary": summary(found),
        "rules": RULES,
        "command": f"simnav reproduce {paper.key} --runs {len(found.seeds)}",
        "full": f"simnav reproduce {paper.key} --runs {paper.full}",
        "notes": list(paper.notes),
        "tables": [
            {
                "title": s.title,
                "number": s.number,
                "columns": [{"title": c, "numeric": c in NUMERIC} for c in s.columns],
                "rows": [{"cells": cells, "verdict": v} for cells, v in zip(s.rows, s.verdicts, strict=True)],
                "notes": s.notes,
            }
            for s in sheets(found)
        ],
        "figures": [d.to_dict() for d in drawn if d.path is not None],
        "contents": contents_rows(found, drawn),
    }


def _replace(path: Path, text: str) -> None:
    partial = path.with_name(f".{path.name}.part")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, path)
