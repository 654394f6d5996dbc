"""Seeds of training and of scoring: two ranges that never meet.

A learning agent sees training voyages only. Their seeds begin at `FIRST_TRAINING_SEED`; whatever is scored (campaigns,
leaderboards, tables) has a seed below it. So nothing that was learned from can be scored by mistake.
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
        0, 1, 2, ...

    Raises
    ------
    ValueError
        If the number is negative.
    """
    if number < 0:
        raise ValueError(f"training voyages are numbered from 0, not {number}")
    return FIRST_TRAINING_SEED + int(number)


def is_training(seed: int) -> bool:
    """Whether a seed is one of a training voyage."""
    return seed >= FIRST_TRAINING_SEED


def require_disjoint(training: Iterable[int], scoring: Iterable[int]) -> None:
    """Refuse to score on what was learned from.

    Raises
    ------
    ValueError
        If a seed is in both, a training seed is none, or a scoring seed is one of training.
    """
    trained, scored = set(training), set(scoring)
    if both := sorted(trained & scored):
        raise ValueError(f"seeds {both[:5]} are trained on and scored on; a score says nothing there")
    if wrong := sorted(s for s in trained if not is_training(s)):
        raise ValueError(f"seeds {wrong[:5]} are below {FIRST_TRAINING_SEED}: they are for scoring, not for training")
    if wrong := sorted(s for s in scored if is_training(s)):
        raise ValueError(f"seeds {wrong[:5]} are from {FIRST_TRAINING_SEED} on: they are for training, not for scoring")
