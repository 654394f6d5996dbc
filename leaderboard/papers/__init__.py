"""The comparisons of papers, repeated: ``simnav paper reproduce PAPER`` puts ours beside the paper's, row by row.

A paper is one TOML file of this folder, or a file of one's own: ``simnav paper reproduce my_paper.toml``.

- `paper`: the description of a paper: citation, methods, tables of figures and claims, and its drawings.
- `paper_file`: the keys of the file of a paper; `reading`: from the file to the paper.
- `comparison`: the rule by which a row agrees, differs or is undecided.
- `measures`: the quantities that are compared: named scores and computing cost.
- `reproduction`: finds the methods among the registered estimators, runs them and fills the rows.
- `sequential`: more runs for undecided rows, in parts that can be interrupted.
- `stored`: the results that come with simnav, and how they are written.
- `report`: tables and CSV; `figures`: PNG; `contents`: the paper's tables and figures, and where ours are; `page`:
  HTML; `documentation`: the tables of ``docs/papers``.

If no registered estimator stands for a method, its row says so.
"""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

__all__ = ["ALIASES", "FOLDER", "PAPERS", "key_of"]

#: Where the files of the papers are.
FOLDER = Path(__file__).parent

#: Older names of papers on the command line.
ALIASES: dict[str, str] = {
    "000": "guo-2026",
    "001": "mao-2025",
    "002": "jiang-2026",
    "003": "zhan-2026",
    "004": "auv-smoothing-2022",
}

#: Key of each paper, which is the name of its file: those with an older name first.
PAPERS: tuple[str, ...] = tuple(dict.fromkeys([*ALIASES.values(), *sorted(f.stem for f in FOLDER.glob("*.toml"))]))


def key_of(name: str) -> str:
    """The key of a paper from its key or its alias; the path of a file, which ends in ``.toml``, stays.

    Raises
    ------
    ValueError
        If there is no such paper; one sentence.

    Examples
    --------
    >>> key_of("000"), key_of("zhan-2026")
    ('guo-2026', 'zhan-2026')
    """
    key = ALIASES.get(name, name)
    if key not in PAPERS and not key.endswith(".toml"):
        near = get_close_matches(name, PAPERS, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"there is no paper {name!r}; there are {', '.join(PAPERS)}.{hint}")
    return key
