"""How simnav, and a set of results, is cited: BibTeX and a line of text."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime

from .provenance import BENCHMARK, Provenance, benchmark_of, distinct

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
    note : str
        Version of the benchmark; of results also the commit, the days of the runs and how many runs there are.
    """

    key: str
    year: str
    version: str
    note: str

    @property
    def bibtex(self) -> str:
        """A ``@software`` entry."""
        fields = {"author": f"{{{AUTHORS}}}", "title": f"{{{TITLE}}}", "year": self.year,
                  "version": self.version, "note": self.note}  # fmt: skip
        lines = [f"  {name:<7} = {{{value}}}" for name, value in fields.items() if value]
        return f"@software{{{self.key},\n" + ",\n".join(lines) + "\n}"

    @property
    def text(self) -> str:
        """One line."""
        version = f", version {self.version}" if self.version else ""
        return f"{AUTHORS} ({self.year}). {TITLE}{version}. {self.note}."

    def to_dict(self) -> dict[str, str]:
        """What ``simnav cite --json`` prints."""
        return {"key": self.key, "bibtex": self.bibtex, "text": self.text}


def citation(provenances: Iterable[Provenance] | None = None) -> Citation:
    """How to cite this version of simnav, or results.

    Parameters
    ----------
    provenances : iterable of Provenance, optional
        One for each result.

    Raises
    ------
    RequestError
        If the results belong to different versions of the benchmark.
    """
    if provenances is None:
        from importlib.metadata import version

        return Citation("simnav", f"{datetime.now(UTC).year}", version("simnav"), BENCHMARK)
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
    return Citation(benchmark.replace(" ", "-") or "simnav", year, versions, "; ".join(note))


def _commit(provenance: Provenance) -> str:
    changed = " with changes" if provenance.dirty else ""
    return provenance.commit[:_SHORT] + changed if provenance.commit else ""
