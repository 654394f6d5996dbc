"""How many seeds the campaigns in a folder asked for, in the order in which they asked.

Who may look at results before he says how many runs there shall be can stop where he is lucky. So a campaign writes
what it asks before it runs, and a board says if it was stopped before that, or if the number was raised later.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from .files import write_whole

__all__ = ["FILE", "add", "copy", "read", "together"]

#: Name of the file in a folder of results.
FILE = "requested.json"


def read(folder: str | os.PathLike[str]) -> dict[str, tuple[int, ...]]:
    """The numbers of seeds that were asked, by versioned id of the scenario; empty where nothing is known."""
    try:
        content = json.loads((Path(folder) / FILE).read_text(encoding="utf-8"))
        return {str(name): tuple(int(n) for n in numbers) for name, numbers in content.items()}
    except (OSError, ValueError, TypeError, AttributeError, OverflowError, RecursionError):
        return {}


def add(folder: str | os.PathLike[str], scenarios: Iterable[str], seeds: int) -> None:
    """Write that so many seeds of some scenarios were asked."""
    before = read(folder)
    _write(folder, together([before, dict.fromkeys(scenarios, (seeds,))]))


def together(found: Iterable[Mapping[str, tuple[int, ...]]]) -> dict[str, tuple[int, ...]]:
    """Requests one after the other; a number that is not greater than those before it changes nothing.

    >>> together([{"a-v1": (10,)}, {"a-v1": (10, 30), "b-v1": (5,)}])
    {'a-v1': (10, 30), 'b-v1': (5,)}
    """
    every: dict[str, tuple[int, ...]] = {}
    for requests in found:
        for name, numbers in requests.items():
            for number in numbers:
                known = every.get(name, ())
                every[name] = (*known, number) if not known or number > known[-1] else known
    return every


def copy(folder: str | os.PathLike[str], sources: Iterable[str | os.PathLike[str]]) -> None:
    """Put the requests of several folders into one."""
    every = together([read(folder), *map(read, sources)])
    if every:
        _write(folder, every)


def _write(folder: str | os.PathLike[str], requests: Mapping[str, tuple[int, ...]]) -> None:
    write_whole(Path(folder) / FILE, json.dumps(dict(sorted(requests.items())), indent=1) + "\n")
