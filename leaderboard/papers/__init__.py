"""The comparisons of five papers, repeated: ``simnav reproduce PAPER`` puts our figures beside the paper's, row by row.

- `paper`: the description of a paper: citation, methods, tables of figures and claims, and its drawings.
- `guo_2026`, `mao_2025`, `jiang_2026`, `zhan_2026`, `auv_smoothing_2022`: the five papers.
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

__all__ = ["ALIASES", "PAPERS", "key_of"]

#: Key of each paper, which is also the name of its module.
PAPERS: tuple[str, ...] = ("guo-2026", "mao-2025", "jiang-2026", "zhan-2026", "auv-smoothing-2022")

#: Older names of the papers on the command line.
ALIASES: dict[str, str] = dict(zip(("000", "001", "002", "003", "004"), PAPERS, strict=True))


def key_of(name: str) -> str:
    """The key of a paper from its key or its alias.

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
    if key not in PAPERS:
        near = get_close_matches(name, PAPERS, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"there is no paper {name!r}; there are {', '.join(PAPERS)}.{hint}")
    return key
