"""Which stored results are of rows that the scenario does not suit any more: they would not be run today.

A result says so by its status. This finds those that are older than the rule by which a row is unsuitable
(`simnav.estimator.suitability`).
"""

from __future__ import annotations

from collections.abc import Iterable

from simnav.estimator import EstimatorError, make, unsuitable
from simnav.leaderboard.ranking.superseded import version_of
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.leaderboard.results.result import Result
from simnav.source import open_source
from simnav.types import Instruments

__all__ = ["unsuited"]


def unsuited(results: Iterable[Result]) -> set[tuple[str, str]]:
    """Scenario and estimator of results that have another status than ``unsuitable``, where today's rows do not suit.

    Only rows that come with simnav are looked at, with the instruments of the first run that is there.

    Parameters
    ----------
    results : iterable of Result
        Of scenarios of the catalogue, in their present versions. Recorded ones whose logs are not here are left out.
    """
    tried: dict[tuple[str, str], Result] = {}
    for r in results:
        if r.tried and not r.reference and version_of(r.estimator.partition("(")[0]) is not None:
            tried.setdefault((r.scenario, r.estimator), r)
    instruments: dict[tuple[str, int], Instruments | None] = {}
    found = set()
    for pair, r in tried.items():
        run = r.scenario, r.seed
        if run not in instruments:
            instruments[run] = _instruments(*run)
        there = instruments[run]
        if there is not None and _does_not_suit(r, there):
            found.add(pair)
    return found


def _instruments(scenario: str, seed: int) -> Instruments | None:
    """The instruments of a run; None where it cannot be made here."""
    try:
        return open_source(catalogued_scenario(scenario), seed).instruments
    except (ValueError, OSError):
        return None


def _does_not_suit(result: Result, instruments: Instruments) -> bool:
    try:
        return bool(unsuitable(make(result.estimator.partition("(")[0], **result.parameters), instruments))
    except EstimatorError:  # it has other parameters today
        return False
