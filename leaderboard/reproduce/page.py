"""A reproduction as a page: beside its figures, and in the site of the leaderboard."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.console import plain
from simnav.leaderboard.pages import STATIC, TEMPLATES, environment
from simnav.leaderboard.reproduce import PAPERS
from simnav.leaderboard.reproduce.comparison import RULES
from simnav.leaderboard.reproduce.report import NUMERIC, contents_rows, sheets, summary

if TYPE_CHECKING:
    from simnav.leaderboard.reproduce.figures import Drawn
    from simnav.leaderboard.reproduce.reproduction import Reproduction

__all__ = ["find", "install", "write"]

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


def find(folder: Path) -> list[dict[str, Any]]:
    """The reproductions below a folder, in order: documents of their pages, with their ``folder``.

    One that cannot be read, is of another version, or whose figures are gone, is left out.
    """
    documents = []
    for key in PAPERS:
        place = folder / key
        try:
            document = json.loads((place / f"paper-{key}.json").read_text(encoding="utf-8"))
            files = [f["file"] for f in document["figures"]]
            known = (document["format"], document["paper"]) == (_FORMAT, key)
        except (OSError, ValueError, KeyError, TypeError):
            continue
        if known and all((place / Path(name).name).is_file() for name in files):
            documents.append({**document, "folder": str(place), "page": f"paper-{key}.html"})
    return documents


def install(document: dict[str, Any], site: Path, shared: dict[str, Any]) -> None:
    """Write the page of a reproduction into the site, and copy its figures.

    Parameters
    ----------
    document : dict
        As from `find`.
    site : Path
    shared : dict
        What all pages of the site are given.
    """
    key, source = document["paper"], Path(document["folder"])
    place = f"figures/paper-{key}/"
    (site / place).mkdir(parents=True, exist_ok=True)
    for figure in document["figures"]:
        name = Path(figure["file"]).name
        shutil.copyfile(source / name, site / place / name)
    (site / document["page"]).write_text(_render(document, place, shared), encoding="utf-8")


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
