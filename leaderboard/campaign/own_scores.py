"""Scores of others in a campaign: how workers come to know them, and which code a result was scored with."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from simnav.plugins import is_file_module, load_plugin, place_of
from simnav.scoring import SCORES, registry

from . import sources
from .session_class import is_session, pickle_class, receive
from .sources import folder_code

__all__ = ["OwnScores", "changed_code", "own_scores", "same_code", "scoring_code", "scoring_differs"]


@dataclass(frozen=True)
class OwnScores:
    """Scores that another process does not find by itself.

    Attributes
    ----------
    files : tuple of str
        Python files that register them.
    code : tuple of bytes
        Scores of a session, packed.
    """

    files: tuple[str, ...] = ()
    code: tuple[bytes, ...] = ()

    def register(self) -> None:
        """Make them known in this process."""
        for file in self.files:
            load_plugin(file)
        for packed in self.code:
            score = receive(packed)
            if score.name not in SCORES:
                registry.add(score)


def own_scores() -> OwnScores:
    """The scores of single files and of the session.

    Raises
    ------
    RequestError
        If a score of the session uses something that cannot be sent.
    """
    files, code = [], []
    for score in SCORES.values():
        if score.__module__.startswith("simnav."):
            continue
        if is_file_module(score.__module__):
            files.append(str(Path(place_of(score)[0]).resolve()))
        elif is_session(score.__module__):
            code.append(pickle_class(score))
    return OwnScores(tuple(dict.fromkeys(files)), tuple(code))


def scoring_code() -> str:
    """JSON: the modules of simnav that hold scores, each with the digest of the code of all of them."""
    code = folder_code(sources.LIBRARY / "scoring")
    homes = {score.__module__ for score in SCORES.values() if score.__module__.startswith("simnav.")}
    return json.dumps(dict.fromkeys(sorted(homes), code))


def scoring_differs(before: str, now: str) -> bool:
    """Whether scores that a result has would be computed differently now; new ones do not matter.

    >>> scoring_differs('{"a": "1"}', '{"a": "1", "b": "1"}'), scoring_differs('{"a": "1"}', '{"a": "2"}')
    (False, True)
    """
    return before != now and bool(changed_code(before, now))


def changed_code(before: str, now: str) -> frozenset[str]:
    """The modules whose scores a result has, and that have changed since; ``all`` where it is not known.

    >>> sorted(changed_code('{"a": "1", "b": "1"}', '{"b": "2", "c": "1"}')), sorted(changed_code("", "{}"))
    (['a', 'b'], ['all'])
    """
    if not before:
        return frozenset({"all"})
    new = json.loads(now)
    return frozenset(home for home, code in json.loads(before).items() if new.get(home) != code)


def same_code(before: str, now: str) -> frozenset[str]:
    """The modules of simnav whose scores a result has as they would be computed now.

    >>> sorted(same_code('{"a": "1", "b": "1"}', '{"a": "1", "b": "2", "c": "1"}'))
    ['a']
    """
    old, new = json.loads(before or "{}"), json.loads(now)
    return frozenset(home for home, code in new.items() if old.get(home) == code)
