"""The voyages that a recipe learns from, and those on which its author chooses: of several families in turn.

The seeds of a split are those of `simnav.voyages`, which no board has.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib.metadata import version
from typing import Literal

from simnav.environment.seeds import FIRST_TRAINING_SEED
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record

__all__ = ["FIRST_SEEDS", "Split", "streams_of", "versions", "voyages"]

Split = Literal["train", "validation"]
#: Seed of the first voyage of each split and family (`simnav.leaderboard.dataset.splits.FIRST_SEEDS`; a test compares).
FIRST_SEEDS: dict[str, int] = {"train": 2 * FIRST_TRAINING_SEED, "validation": 3 * FIRST_TRAINING_SEED}


def voyages(families: tuple[str, ...], split: Split, numbers: Iterable[int]) -> Iterator[Recording]:
    """Record voyages: number k is voyage ``k // n`` of family ``k % n`` of n families.

    Raises
    ------
    ValueError
        If a family is ranked.
    """
    scenarios = [load(name) for name in families]
    for name, scenario in zip(families, scenarios):
        if not scenario.training:
            raise ValueError(f"{name} is ranked: a recipe learns from training families only")
    for k in numbers:
        yield record(scenarios[k % len(families)], FIRST_SEEDS[split] + k // len(families))


def streams_of(families: tuple[str, ...], split: Split, count: int) -> list[tuple[int, int]]:
    """The random streams of the first so many voyages (`simnav.estimator.Estimator.learned_from`)."""
    found = []
    for i, name in enumerate(families):
        own = len(range(i, count, len(families)))
        if own:
            first = load(name).root(FIRST_SEEDS[split])
            found.append((first, first + own - 1))
    return sorted(set(found))  # families may have the same streams


def versions() -> dict[str, str]:
    """The versions that a record of a training names."""
    return {name: version(name) for name in ("simnav", "torch", "numpy")}
