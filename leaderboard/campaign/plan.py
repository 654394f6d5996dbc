"""What a campaign has to do: the runs that are missing, made one by one, so that their number costs no memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.worker import Unit
from simnav.scenario import Scenario

__all__ = ["Plan", "in_part"]


def in_part(seed: int, scenario: int, shard: tuple[int, int]) -> bool:
    """Whether the run with these indices of seed and scenario is in a part."""
    part, parts = shard
    return (seed + scenario) % parts == part - 1


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
        Keys of results of this part that need not be computed again.
    shard : pair of int
        Which of how many parts of the runs, from 1; each part has runs of every scenario.
    """

    scenarios: Sequence[Scenario]
    entrants: Sequence[Entrant]
    seeds: Sequence[int]
    variants: Mapping[str, Mapping[str, str]]
    there: set[str]
    shard: tuple[int, int] = (1, 1)

    @property
    def total(self) -> int:
        """Results that were asked for."""
        return sum(self._seeds_of(j) for j in range(len(self.scenarios))) * len(self.entrants)

    def _seeds_of(self, scenario: int) -> int:
        """How many seeds of a scenario are in this part."""
        part, parts = self.shard
        return len(range((part - 1 - scenario) % parts, len(self.seeds), parts))

    @property
    def weight(self) -> float:
        """About how much work is missing (as `Unit.weight`)."""
        whole = len(self.entrants) * sum(s.duration * self._seeds_of(j) for j, s in enumerate(self.scenarios))
        durations = {v: s.duration for s in self.scenarios for v in self.variants[s.id].values()}
        return whole - sum(durations[key.rpartition("-")[0]] for key in self.there)

    def units(self, make: Callable[[Scenario, int, tuple[tuple[Entrant, str], ...]], Unit]) -> Iterator[Unit]:
        """The runs that are missing: seed by seed, all scenarios in turn."""
        for i, seed in enumerate(self.seeds):
            for j, scenario in enumerate(self.scenarios):
                if not in_part(i, j, self.shard):
                    continue
                variants = self.variants[scenario.id]
                keyed = ((e, f"{variants[e.label]}-{seed}") for e in self.entrants)
                missing = tuple((e, key) for e, key in keyed if key not in self.there)
                if missing:
                    yield make(scenario, seed, missing)
