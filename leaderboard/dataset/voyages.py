"""The voyages of a split, one after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from simnav.leaderboard.campaign.seal import Seal
from simnav.leaderboard.results.hidden import without_truth
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.source import record

from .splits import FIRST_SEEDS, TEST, seed_of

__all__ = ["recordings"]


def recordings(family: Scenario, split: str, numbers: Iterable[int], seal: Seal) -> Iterator[Recording]:
    """Record voyages of a split.

    Parameters
    ----------
    family : Scenario
        A training family.
    split : str
        One of `simnav.leaderboard.dataset.splits.SPLITS`.
    numbers : iterable of int
        Numbers of the voyages in the split.
    seal : Seal
        From which the seeds of split ``test`` are derived.

    Yields
    ------
    Recording
        Those of split ``test`` have neither truth nor labels, and their seed is the number that ``simnav score --seed``
        takes.
    """
    for number in numbers:
        recording = record(family, seed_of(family, split, number, seal))
        yield replace(without_truth(recording), seed=FIRST_SEEDS[TEST] + number) if split == TEST else recording
