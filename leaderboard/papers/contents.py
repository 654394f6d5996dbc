"""What a paper holds, table by table and figure by figure: where ours is, or why a simulation cannot show it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simnav.leaderboard.papers.paper import Paper

__all__ = ["Item", "contents"]


@dataclass(frozen=True)
class Item:
    """A table or figure of a paper.

    Attributes
    ----------
    number : str
        ``Table 3``, ``Figure 9``.
    what : str
    shown : tuple of str
        Titles of our tables and names of our figures' files; empty where there are none.
    why : str
        Why not, where there are none.
    """

    number: str
    what: str
    shown: tuple[str, ...] = ()
    why: str = ""


def contents(paper: Paper) -> list[Item]:
    """All tables and figures of a paper, in its order; what we draw beyond them is not in it.

    Examples
    --------
    >>> from simnav.leaderboard.papers.paper import load
    >>> [i.number for i in contents(load("001"))][:3]
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
