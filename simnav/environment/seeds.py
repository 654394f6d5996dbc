"""Seeds of training and of scoring: two ranges without a common seed.

A learning agent is trained on training voyages only. Their seeds begin at `FIRST_TRAINING_SEED`. Scored runs
(campaigns, leaderboards, tables) have smaller seeds. So no training voyage can be scored by mistake.
"""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["FIRST_TRAINING_SEED", "is_training", "require_disjoint", "training_seed"]

#: Seeds from here on are for training, those below for scoring.
FIRST_TRAINING_SEED = 2**40


def training_seed(number: int) -> int:
    """The seed of a training voyage.

    Parameters
    ----------
    number : int
        Number of the voyage: 0, 1, 2, ...

    Raises
    ------
    ValueError
        If the number is negative.
    """
    if number < 0:
        raise ValueError(f"training voyages are numbered from 0, not {number}")
    return FIRST_TRAINING_SEED + int(number)


def is_training(seed: int) -> bool:
    """Whether a seed is that of a training voyage."""
    return seed >= FIRST_TRAINING_SEED


def require_disjoint(training: Iterable[int], scoring: Iterable[int]) -> None:
    """Check that training and scoring have no seed in common.

    Raises
    ------
    ValueError
        If a seed is in both, a training seed is below `FIRST_TRAINING_SEED`, or a scoring seed is not below it.
    """
    trained, scored = set(training), set(scoring)
    if both := sorted(trained & scored):
        raise ValueError(f"seeds {both[:5]} are trained on and scored on; a score says nothing there")
    if wrong := sorted(s for s in trained if not is_training(s)):
        raise ValueError(f"seeds {wrong[:5]} are below {FIRST_TRAINING_SEED}: they are for scoring, not for training")
    if wrong := sorted(s for s in scored if is_training(s)):
        raise ValueError(f"seeds {wrong[:5]} are from {FIRST_TRAINING_SEED} on: they are for training, not for scoring")
