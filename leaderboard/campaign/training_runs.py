"""What an estimator learned from: no estimator is scored on such a run, and results say what it was.

`Estimator.learned_from` holds the seeds from which the random streams of the training runs started. A campaign compares
them with its own. Names of scenarios are not enough, because two scenarios with the same seed share streams.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from simnav.estimator import Estimator
from simnav.leaderboard.results.errors import RequestError

if TYPE_CHECKING:
    from simnav.scenario import Scenario

    from .entrant import Entrant

__all__ = ["declared_ranges", "ranges_of", "record_of", "require_unseen"]

_MOST_RANGES = 1000
_LONGEST = 8000  # of the record of a training, as JSON


def declared_ranges(estimator: Estimator) -> Any:
    """What an estimator tells of its training, as plain values; a text where it is wrong.

    The pairs of `simnav.estimator.Estimator.learned_from` as lists. Where the estimator or its policy also has
    ``trained_on``, a record of the training, a mapping of both.
    """
    try:
        ranges = [[int(n) for n in pair] for pair in estimator.learned_from]
        policy = getattr(estimator, "policy", None)
        record = getattr(estimator, "trained_on", None) or getattr(policy, "trained_on", None)
        if not isinstance(record, Mapping) or not record:
            return ranges
        return {"learned_from": ranges, "trained_on": json.loads(json.dumps(dict(record), default=str))}
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def record_of(given: Any) -> dict[str, Any]:
    """What a result says of the training of its estimator, from what `declared_ranges` gave.

    Returns
    -------
    dict
        ``learned_from`` and ``trained_on``, where the estimator tells them; empty for one that learned nothing.

    Raises
    ------
    ValueError
        If it is too long, or no table of plain values: one sentence.
    """
    ranges = [list(pair) for pair in ranges_of(given)]
    record = given.get("trained_on", {}) if isinstance(given, dict) else {}
    text = json.dumps(record, default=str)
    if not isinstance(record, dict) or len(text) > _LONGEST:
        raise ValueError(
            f"trained_on should be a table of at most {_LONGEST} characters as JSON, but is {text[:100]}..."
        )
    found = {"learned_from": ranges} if ranges else {}
    return {**found, "trained_on": record} if record else found


def ranges_of(given: Any) -> tuple[tuple[int, int], ...]:
    """What `declared_ranges` gave, perhaps in another process, checked.

    Raises
    ------
    ValueError
        If it is not pairs of integers: one sentence.
    """
    if isinstance(given, dict):
        given = given.get("learned_from")
    if not isinstance(given, list) or len(given) > _MOST_RANGES or not all(_is_pair(pair) for pair in given):
        text = repr(given)
        text = text if len(text) <= 100 else f"{text[:100]}..."
        raise ValueError(
            f"learned_from should hold at most {_MOST_RANGES} pairs of integers (first, last), but is {text}"
        )
    return tuple((int(first), int(last)) for first, last in given)


def _is_pair(pair: object) -> bool:
    return isinstance(pair, list) and len(pair) == 2 and all(type(n) is int for n in pair)


def require_unseen(entrants: Sequence[Entrant], scenarios: Sequence[Scenario], seeds: Sequence[int]) -> None:
    """Refuse runs whose random streams an estimator has learned from.

    Runs of two scenarios with the same number share random streams, so the numbers are compared
    (`simnav.scenario.Scenario.root`), whatever the scenarios are called.

    Parameters
    ----------
    entrants, scenarios, seeds
        Estimators, scenarios and seeds of a campaign that is not sealed.

    Raises
    ------
    RequestError
        Where there is one: estimator, scenario and the first such seed are named.
    """
    if not seeds or not any(entrant.learned_from for entrant in entrants):
        return
    dense = isinstance(seeds, range) and seeds.step == 1  # may be of any length
    least, most = (seeds[0], seeds[-1]) if dense else (min(seeds), max(seeds))
    for entrant in entrants:
        for first, last in entrant.learned_from:
            for scenario in scenarios:
                shift = scenario.root(0)
                low, high = max(first - shift, least), min(last - shift, most)
                if low > high:
                    continue
                seen = low if dense else next((s for s in seeds if low <= s <= high), None)
                if seen is not None:
                    raise RequestError(
                        f"estimator {entrant.label!r} has learned from the random streams of seed {seen} of "
                        f"{scenario.id}; score it on other seeds"
                    )
