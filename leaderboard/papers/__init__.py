"""The papers' comparisons, run again: ``simnav reproduce PAPER`` puts our figures beside theirs, row by row.

- `paper`: what a paper is: methods, tables of figures and claims with their reasons where ours differ, what it draws.
- `paper_000` ... `paper_004`: the papers.
- `comparison`: means with intervals, and the rule by which a row agrees or differs.
- `measures`: what can be compared: the named scores, and cost.
- `reproduction`: finds the methods among the registered estimators, runs them, fills the rows.
- `report`: tables, CSV; `figures`: PNG; `contents`: what the paper has, and where ours is; `page`: HTML.

A method that nobody has registered yet gets a row that says so, and figures as soon as it is there.
"""

from __future__ import annotations

__all__ = ["PAPERS"]

#: Key of each paper, which is also the end of its module's name.
PAPERS: tuple[str, ...] = ("000", "001", "002", "003", "004")
