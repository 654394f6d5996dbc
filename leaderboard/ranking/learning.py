"""What a row learned from, in words for a board, and how many voyages it was."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["learned_by", "learned_words", "training_of", "voyages_of"]

_SHOWN = 3  # ranges of runs


def learned_by(results: Iterable[Result]) -> str:
    """What the estimator of some results learned from, in words; empty where nothing is said."""
    texts = {id(r.learned): r.learned for r in results if r.learned}
    return "; ".join(sorted({words for learned in texts.values() if (words := learned_words(learned))}))


def training_of(results: Iterable[Result]) -> Mapping[str, Any]:
    """The record of the training of the estimator of some results; empty where nothing is said."""
    records = (r.learned.get("trained_on") for r in results)
    return next((record for record in records if isinstance(record, Mapping)), {})


def voyages_of(results: Iterable[Result]) -> int:
    """The number of voyages that the estimator of some results learned from.

    It is beyond every budget where the estimator learned nothing, or does not say from how many voyages.
    """
    records = [r.learned.get("trained_on") for r in results]
    counts = [record.get("voyages") if isinstance(record, Mapping) else None for record in records]
    known = [n for n in counts if type(n) is int and n > 0]
    return max(known) if known and len(known) == len(counts) else sys.maxsize


def learned_words(learned: Mapping[str, Any]) -> str:
    """The record of a training in one line.

    Parameters
    ----------
    learned : mapping
        As of `simnav.leaderboard.results.result.Result`.

    Examples
    --------
    >>> learned_words({"learned_from": [[5, 8]], "trained_on": {"scenario": "training-gnss-faults", "voyages": 4}})
    'learned from 4 voyages of training-gnss-faults'
    >>> learned_words({"learned_from": [[5, 8], [20, 20]]}), learned_words({})
    ('learned from runs of streams 5 to 8, 20', '')
    >>> record = {"voyages": 9, "families": ["a", "b"], "parameters": 50, "seconds_per_epoch": 3.1}
    >>> learned_words({"trained_on": record})
    'learned from 9 voyages of 2 families; 50 parameters; 3.1 s for each pass over them'
    """
    record = learned.get("trained_on")
    record = record if isinstance(record, Mapping) else {}
    ranges = [p for p in _listed(learned.get("learned_from")) if isinstance(p, list) and len(p) == 2]
    streams = ", ".join(f"{a} to {b}" if a != b else f"{a}" for a, b in ranges[:_SHOWN])
    more = f" and {len(ranges) - _SHOWN} more" if len(ranges) > _SHOWN else ""
    families = _listed(record.get("families"))
    origin = f"{len(families)} families" if len(families) > 1 else next(iter(families), record.get("scenario") or "")
    scenario, voyages = str(origin)[:100], record.get("voyages")
    if scenario and isinstance(voyages, int):
        size, epoch = record.get("parameters"), record.get("seconds_per_epoch")
        words = f"learned from {voyages} voyages of {scenario}"
        words += f"; {size} parameters" if isinstance(size, int) else ""
        return words + (f"; {epoch:g} s for each pass over them" if isinstance(epoch, (int, float)) else "")
    if streams:
        return f"learned from runs of streams {streams}{more}"
    return f"learned from {', '.join(f'{k} {v}' for k, v in list(record.items())[:3])[:200]}" if record else ""


def _listed(value: object) -> list[Any]:
    return value if isinstance(value, list) else []
