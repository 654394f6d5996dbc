"""The tables and figures of a paper: where ours are, or why a simulation cannot show them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .paper import Paper

__all__ = ["Item", "contents"]


@dataclass(frozen=True)
class Item:
    """A table or figure of a paper.

    Attributes
    ----------
    number : str
        Number in the paper, such as ``Table 3``.
    what : str
        Its subject.
    shown : tuple of str
        Titles of our tables and names of our figures' files; empty if there are none.
    why : str
        Reason why there are none.
    """

    number: str
    what: str
    shown: tuple[str, ...] = ()
    why: str = ""


def contents(paper: Paper) -> list[Item]:
    """All tables and figures of a paper, in its order; our additional figures are not among them.

    Examples
    --------
    >>> from simnav.leaderboard.papers.reading import paper_of
    >>> [i.number for i in contents(paper_of("mao-2025"))][:3]
    ['Table 1', 'Table 2', 'Table 3']
    """
    items: dict[str, Item] = {}
    for number, what, shown, why in _entries(paper):
        before = items.get(number)
        merged = shown if before is None else (*before.shown, *(s for s in shown if s not in before.shown))
        items[number] = Item(number, what if before is None else before.what, merged, why)
    return sorted(items.values(), key=_order)


def _entries(paper: Paper) -> Iterator[tuple[str, str, tuple[str, ...], str]]:
    for table in paper.tables:
        if table.number:
            yield table.number, table.title, (f"table '{table.title}'",), ""
    for figure in paper.figures:
        if figure.number:
            yield figure.number, figure.what, (f"{figure.name}.png",), ""
    for entry in paper.not_shown:
        yield entry.number, entry.what, (), entry.why


def _order(item: Item) -> tuple[bool, int]:
    found = re.fullmatch(r"(Table|Figure) (\d+)", item.number)
    assert found is not None, item.number
    return found[1] == "Figure", int(found[2])
