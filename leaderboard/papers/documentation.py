"""The tables of ``docs/papers``, written from the stored results.

``python -m simnav.leaderboard.papers.documentation [FOLDER]`` writes them; with a folder, the output of ``simnav paper
reproduce PAPER --until-decided``, it stores the results of that folder first. Each page has a marked block for each of
these: ``citation``, ``claims``, ``settings``, ``tables`` and ``contents``; the overview has ``overview``. The figures
are in ``docs/papers/figures``. The text between the marks is replaced, and everything else is written by hand.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from simnav.leaderboard.results.provenance import Provenance

from . import PAPERS, reading
from .claims.section import claim_count, claim_figures, claim_sheets
from .claims.stored import answers_of, computed_on
from .contents import contents
from .figures import Drawn, write_figures
from .paper import KINDS_OF_ROWS, Figure, Paper
from .report import Sheet, settings_sheet, sheets, single_run_sentence, verdicts
from .reproduction import Reproduction, find_method, load_results
from .sequential import LIMIT
from .stored import add, provenance, shipped_reproduction

__all__ = ["FOLDER", "blocks", "overview", "replaced", "update"]

#: Where the pages are, in a checkout of the repository.
FOLDER = Path(__file__).resolve().parents[2] / "docs" / "papers"


def update(folder: Path = FOLDER) -> None:
    """Write the marked blocks of all pages."""
    pages = {f"{key}.md": blocks(reading.paper_of(key)) for key in PAPERS} | {"index.md": {"overview": overview()}}
    for name, texts in pages.items():
        path = folder / name
        path.write_text(replaced(path.read_text(encoding="utf-8"), texts), encoding="utf-8")


def draw(folder: Path = FOLDER) -> None:
    """Draw the figures that need no run, and make the files small: they have few colours."""
    for key in PAPERS:
        place = folder / "figures" / key
        place.mkdir(parents=True, exist_ok=True)
        for old in place.glob("*.png"):
            old.unlink()
        for drawn in _figures(shipped_reproduction(reading.paper_of(key)), place):
            assert drawn.path is not None
            _shrink(drawn.path)
        for figure in claim_figures(answers_of(key), place):
            _shrink(figure.path)


def _shrink(path: Path) -> None:
    from PIL import Image

    Image.open(path).convert("RGB").quantize(64).save(path, optimize=True)


def _figures(found: Reproduction, place: Path) -> list[Drawn]:
    return [d for d in write_figures(found, place, scores_only=True) if d.path is not None]


def replaced(page: str, texts: dict[str, str]) -> str:
    """A page with new texts between its marks.

    >>> print(replaced("a\\n<!-- x: begin -->\\nold\\n<!-- x: end -->\\nb", {"x": "new"}))
    a
    <!-- x: begin -->
    <BLANKLINE>
    new
    <BLANKLINE>
    <!-- x: end -->
    b
    """
    for name, text in texts.items():
        begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
        before, _, rest = page.partition(begin)
        _, found, after = rest.partition(end)
        if found:
            page = f"{before}{begin}\n\n{text}\n\n{end}{after}"
    return page


def blocks(paper: Paper) -> dict[str, str]:
    """The marked blocks of a paper's page: name -> Markdown."""
    found = shipped_reproduction(paper)
    tables = [
        "\n".join(f"- {plural[0].upper()}{plural[1:]}: {text}." for kind, plural in KINDS_OF_ROWS.items()
                  if (text := verdicts(found, kind))),
        single_run_sentence(found),
        *(f"Computed on {p.date} with {_versions(p)}, on {p.cpu}." for p in provenance(paper)),
    ]  # fmt: skip
    for sheet in sheets(found):
        number = f"{sheet.number}: " if sheet.number else ""
        tables += [f"### {number}{sheet.title}", *_pictures(paper, sheet), *_markdown(sheet)]
    further = _images(paper, (f for f in paper.figures if f.draw in ("bars", "gains") and not f.number))
    tables += ["### Of all runs", *further] if further else []
    return {
        "citation": _citation(paper),
        "claims": _claims(paper),
        "settings": "\n\n".join(_markdown(settings_sheet(paper))),
        "tables": "\n\n".join(text for text in tables if text),
        "contents": _contents(paper),
    }


def _markdown(sheet: Sheet) -> tuple[str, str]:
    """A table, and its notes."""
    head = [c.title for c in sheet.columns]
    rule = ["--:" if c.numeric else "---" for c in sheet.columns]
    lines = [_line(cells) for cells in (head, rule, *(row.cells for row in sheet.rows))]
    return "\n".join(lines), "\n".join(f"- {note}" for note in sheet.notes)


def _claims(paper: Paper) -> str:
    """The claims of a paper with their conditions, the gains, and a figure for each."""
    answers = answers_of(paper.key)
    if not answers:
        return ""
    first, values = claim_sheets(answers)
    days = sorted({computed_on(a.claim) for a in answers})
    images = [f"![{a.sentence}](figures/{paper.key}/claim-{a.claim}.png)" for a in answers if a.dials]
    again = "`simnav paper claim NAME --holds-if CONDITION` computes an answer again, also with other values."
    computed = f"Computed on {', '.join(days)}. {again}"
    parts = [*_markdown(first), computed, *images, f"### {values.title}", *_markdown(values)]
    return "\n\n".join(parts)


def _pictures(paper: Paper, sheet: Sheet) -> list[str]:
    """The drawn figures of a table: those of its number, and its figures over the paper's."""
    numbered = [f for f in paper.figures if f.draw in ("bars", "gains") and f.number and f.number == sheet.number]
    return _images(paper, [*numbered, Figure("", sheet.title, "ratios", "", ())])


def _images(paper: Paper, entries: Iterable[Figure]) -> list[str]:
    images = {f"figures/{paper.key}/{f.name}.png": f.title for f in entries}
    return [f"![{title}]({image})" for image, title in images.items() if (FOLDER / image).exists()]


def _versions(p: Provenance) -> str:
    """Versions of what computed the results."""
    commit = f" (commit {p.commit[:9]})" if p.commit else ""
    return f"simnav {p.simnav}{commit}, Python {p.python}, NumPy {p.numpy}, Numba {p.numba} and GTSAM {p.gtsam}"


def overview() -> str:
    """A table of the papers with the verdicts on their claims and rows."""
    titles = ("paper", "comparison", "claims", *KINDS_OF_ROWS.values(), "a single run of ours")
    lines = [_line(titles), _line(("---",) * len(titles))]
    for key in PAPERS:
        paper = reading.paper_of(key)
        found = shipped_reproduction(paper)
        counts = (verdicts(found, kind) or "none" for kind in KINDS_OF_ROWS)
        inside, known = found.single_runs
        single = f"{inside} of {known} that do not agree" if known else "–"
        claims = claim_count(answers_of(key)) or "–"
        lines.append(_line((f"[{paper.short}]({key}.md)", paper.about, claims, *counts, single)))
    return "\n".join(lines)


def _citation(paper: Paper) -> str:
    doi = f" doi: [{paper.doi}](https://doi.org/{paper.doi})." if paper.doi else " No DOI is known."
    return f"{paper.authors}: *{paper.title}*. {paper.published}.{doi}"


def _contents(paper: Paper) -> str:
    lines = [_line(("paper", "subject", "ours")), _line(("---",) * 3)]
    for item in contents(paper):
        lines.append(_line((item.number, item.what, "; ".join(item.shown) or f"not shown: {item.why}")))
    return "\n".join(lines)


def _line(cells: Iterable[str]) -> str:
    texts = [c.replace("|", "\\|") for c in cells]
    return f"| {' | '.join(texts)} |"


def _store(folder: Path) -> None:
    """Add the results of all papers that a folder has to those that are stored."""
    for key in PAPERS:
        if not (folder / key / "results").is_dir():
            continue
        paper = reading.paper_of(key)
        stands_for = {m.name: find_method(m) for m in paper.methods}
        results = load_results(paper, stands_for, folder / key / "results", range(LIMIT))
        path = add(paper, results)
        print(f"{path}: {len(results)} runs, {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    import sys

    if len(sys.argv) > 2:
        sys.exit("usage: python -m simnav.leaderboard.papers.documentation [FOLDER]")
    for given in sys.argv[1:]:
        _store(Path(given))
    draw()
    update()
