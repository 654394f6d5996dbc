"""How simnav, and a set of results, is cited: BibTeX and a line of text."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime

from .errors import RequestError
from .provenance import BENCHMARK, Provenance, benchmark_of, distinct
from .web_addresses import home

__all__ = ["AUTHORS", "TITLE", "Citation", "citation"]

AUTHORS = "The simnav authors"
TITLE = "simnav: the open benchmark for marine integrated navigation"

_SHORT = 12  # characters of a commit


@dataclass(frozen=True)
class Citation:
    """A reference to simnav, or to results that were made with it.

    Attributes
    ----------
    key : str
        Key of the BibTeX entry.
    year, version : str
        Year and version of the software.
    author : str
        Who made the results; of simnav itself its authors.
    note : str
        Version of the benchmark; of results also the commit, the days of the runs and how many runs there are.
    repository : str
        Web address of the repository of simnav; empty where it is not known.
    """

    key: str
    year: str
    version: str
    note: str
    author: str = AUTHORS
    repository: str = ""

    @property
    def bibtex(self) -> str:
        """A ``@software`` entry; a group has braces of its own, persons are parted by "and"."""
        author = f"{{{AUTHORS}}}" if self.author == AUTHORS else self.author
        fields = {"author": author, "title": f"{{{TITLE}}}", "year": self.year,
                  "version": self.version, "url": self.repository, "note": self.note}  # fmt: skip
        lines = [f"  {name:<7} = {{{value}}}" for name, value in fields.items() if value]
        return f"@software{{{self.key},\n" + ",\n".join(lines) + "\n}"

    @property
    def text(self) -> str:
        """One line."""
        version = f", version {self.version}" if self.version else ""
        place = f" {self.repository}" if self.repository else ""
        return f"{self.author} ({self.year}). {TITLE}{version}. {self.note}.{place}"

    def to_dict(self) -> dict[str, str]:
        """What ``simnav campaign cite --json`` prints."""
        return {"key": self.key, "bibtex": self.bibtex, "text": self.text}


def citation(provenances: Iterable[Provenance] | None = None, author: str = "") -> Citation:
    """How to cite this version of simnav, or results.

    Parameters
    ----------
    provenances : iterable of Provenance, optional
        One for each result.
    author : str
        Who made the results. Default: the authors of simnav, whose software made them.

    Raises
    ------
    RequestError
        If the results belong to different versions of the benchmark.
    """
    if provenances is None:
        from importlib.metadata import version

        if author:
            raise RequestError("an author is named for results only; simnav itself has its own")
        return Citation("simnav", f"{datetime.now(UTC).year}", version("simnav"), BENCHMARK,
                        repository=home().repository)  # fmt: skip
    if fault := _author_fault(author):
        raise RequestError(f'author {author!r:.80}: {fault}; like "Ana Silva and Per Olsen"')
    every = list(provenances)
    known = distinct(every)
    benchmark = benchmark_of(every)
    commits = [c for c in dict.fromkeys(_commit(p) for p in known) if c]
    days = sorted({p.date for p in known if p.date})
    note = [benchmark or "a benchmark without a version", f"{len(every)} runs"]
    if commits:
        note.append(f"commit {' and '.join(commits)}" if len(commits) < 4 else f"{len(commits)} commits")
    if days:
        note.append(f"computed on {days[0]}" if len(days) == 1 else f"computed from {days[0]} to {days[-1]}")
    versions = ", ".join(sorted({p.simnav for p in known if p.simnav}))
    year = days[-1][:4] if days else f"{datetime.now(UTC).year}"
    return Citation(benchmark.replace(" ", "-") or "simnav", year, versions, "; ".join(note), author or AUTHORS,
                    home().repository)  # fmt: skip


def _author_fault(author: str) -> str:
    """Why a text cannot stand as an author in BibTeX; empty if it can."""
    if not author:
        return ""
    if not author.strip() or not author.isprintable():
        return "it is a line of printable characters"
    return "it has no braces, backslashes or quotes" if set(author) & set('{}\\"') else ""


def _commit(provenance: Provenance) -> str:
    changed = " with changes" if provenance.dirty else ""
    return provenance.commit[:_SHORT] + changed if provenance.commit else ""
