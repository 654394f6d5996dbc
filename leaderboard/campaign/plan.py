"""What a campaign has to do: the runs that are missing, made one by one, so that their number costs no memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.worker import Unit
from simnav.scenario import Scenario

__all__ = ["Plan"]


@dataclass(frozen=True, eq=False)
class Plan:
    """Scenarios x estimators x seeds, and what of it is there.

    Attributes
    ----------
    scenarios, entrants, seeds : sequence
        Seeds may be a range of any length.
    variants : mapping
        Versioned id of a scenario -> label of an estimator -> key without the seed.
    there : set of str
        Keys of results that need not be computed again.
    """

    scenarios: Sequence[Scenario]
    entrants: Sequence[Entrant]
    seeds: Sequence[int]
    variants: Mapping[str, Mapping[str, str]]
    there: set[str]

    @property
    def total(self) -> int:
        """Results that were asked for."""
        return len(self.seeds) * len(self.scenarios) * len(self.entrants)

    @property
    def weight(self) -> float:
        """About how much work is missing (as `Unit.weight`)."""
        whole = len(self.seeds) * len(self.entrants) * sum(s.duration for s in self.scenarios)
        durations = {v: s.duration for s in self.scenarios for v in self.variants[s.id].values()}
        return whole - sum(durations[key.rpartition("-")[0]] for key in self.there)

    def units(self, make: Callable[[Scenario, int, tuple[tuple[Entrant, str], ...]], Unit]) -> Iterator[Unit]:
        """The runs that are missing: seed by seed, all scenarios in turn."""
        for seed in self.seeds:
            for scenario in self.scenarios:
                variants = self.variants[scenario.id]
                keyed = ((e, f"{variants[e.label]}-{seed}") for e in self.entrants)
                missing = tuple((e, key) for e, key in keyed if key not in self.there)
                if missing:
                    yield make(scenario, seed, missing)
