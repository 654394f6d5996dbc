"""What a campaign has to do: the runs that are missing, made one by one, so that their number costs no memory."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from simnav.scenario import Scenario

from .entrant import Entrant
from .worker import Unit

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
    there : collection of str
        Keys of results of this part that need not be computed again.
    shard : pair of int
        Which of how many parts of the runs, from 1; each part has runs of every scenario.
    """

    scenarios: Sequence[Scenario]
    entrants: Sequence[Entrant]
    seeds: Sequence[int]
    variants: Mapping[str, Mapping[str, str]]
    there: Collection[str] = frozenset()
    shard: tuple[int, int] = (1, 1)

    @cached_property
    def _homes(self) -> dict[str, int]:
        """Key without the seed -> index of the scenario."""
        return {v: j for j, s in enumerate(self.scenarios) for v in self.variants[s.id].values()}

    @cached_property
    def _wanted(self) -> Collection[int]:
        """The seeds, so that it is quickly seen whether one is among them."""
        return self.seeds if isinstance(self.seeds, range) else frozenset(self.seeds)

    def scenario_of(self, key: str) -> Scenario:
        """The scenario of a result that is asked for."""
        return self.scenarios[self._homes[key.rpartition("-")[0]]]

    def asks(self, key: str) -> bool:
        """Whether a result is one of this part."""
        name, _, seed = key.rpartition("-")
        if name not in self._homes or not seed.isdecimal() or int(seed) not in self._wanted:
            return False
        return self.shard == (1, 1) or self._in_part(self.seeds.index(int(seed)), self._homes[name])

    def _in_part(self, seed: int, scenario: int) -> bool:
        """Whether the run with these indices of seed and scenario is in this part."""
        part, parts = self.shard
        return (seed + scenario) % parts == part - 1

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
        return whole - sum(self.scenario_of(key).duration for key in self.there)

    def units(self, make: Callable[[Scenario, int, tuple[tuple[Entrant, str], ...]], Unit]) -> Iterator[Unit]:
        """The runs that are missing: seed by seed, all scenarios in turn."""
        for i, seed in enumerate(self.seeds):
            for j, scenario in enumerate(self.scenarios):
                if not self._in_part(i, j):
                    continue
                variants = self.variants[scenario.id]
                keyed = ((e, f"{variants[e.label]}-{seed}") for e in self.entrants)
                missing = tuple((e, key) for e, key in keyed if key not in self.there)
                if missing:
                    yield make(scenario, seed, missing)
