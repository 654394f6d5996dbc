"""The splits of a data set: seeds that neither the board nor the training runs that come with simnav have.

The random streams of a training family start from numbers that no ranked scenario reaches, sealed or not
(`simnav.scenario.TRAINING_ROOT`). Within a family the splits have ranges of seeds of their own. Those of `TEST` are
below `FIRST_TRAINING_SEED`, as of all that is scored, and above all seeds that parameters of simnav were chosen on. The
others are above all seeds of learning agents. The seeds of `TEST` follow from a key: from public ones anybody could
simulate its truth.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from simnav.environment.seeds import FIRST_TRAINING_SEED
from simnav.leaderboard.campaign.seal import Seal
from simnav.leaderboard.results.errors import MOST_RUNS, RequestError
from simnav.scenario import Scenario
from simnav.spec import closest

__all__ = [
    "FIRST_SEEDS",
    "OPEN",
    "SPLITS",
    "TEST",
    "TRAIN",
    "named_splits",
    "require_family",
    "require_key",
    "seed_of",
    "sizes",
    "streams_of",
]

TRAIN, VALIDATION, TEST = "train", "validation", "test"

#: Names of the splits.
SPLITS = (TRAIN, VALIDATION, TEST)

#: Those with truth and labels, whose seeds are public.
OPEN = (TRAIN, VALIDATION)

#: Seed of the first voyage of each split; the others count up.
FIRST_SEEDS = {TRAIN: 2 * FIRST_TRAINING_SEED, VALIDATION: 3 * FIRST_TRAINING_SEED, TEST: FIRST_TRAINING_SEED // 2}

#: For each voyage of `TEST` and of the validation there are so many in `TRAIN`.
_SHARE = 10


def require_family(family: Scenario) -> None:
    """Check that a data set may be made of a scenario.

    Raises
    ------
    RequestError
        If it is ranked, or is a log.
    """
    if family.log is not None:
        raise RequestError(f"{family.id} is a log: a data set is made of simulated voyages")
    if not family.training:
        raise RequestError(
            f"{family.id} is ranked, so nothing may be learned from it; a data set is made of a training family, such "
            "as training-voyages ('simnav list scenarios' shows the track 'training')"
        )


def named_splits(given: str | Iterable[str]) -> list[str]:
    """The splits that were asked for: names, or a text with commas.

    Raises
    ------
    RequestError
        If there is no such split, or none was named.
    """
    asked = given.split(",") if isinstance(given, str) else list(given)
    found = [name.strip() if isinstance(name, str) else name for name in asked]
    for name in found:
        if name not in SPLITS:
            raise RequestError(f"there is no split {name!r}{closest(str(name), SPLITS)}; there are {', '.join(SPLITS)}")
    if not found:
        raise RequestError(f"no split was named; there are {', '.join(SPLITS)}")
    return [split for split in SPLITS if split in found]


def require_key(splits: Iterable[str], seal: Seal) -> None:
    """Check that there is a key where split `TEST` is asked for.

    Raises
    ------
    RequestError
        If there is none.
    """
    if TEST in splits and not seal.secret:
        raise RequestError(
            f"split {TEST} needs 'sealed', a key file: from public seeds anybody could simulate its truth; "
            "'simnav campaign seal KEYFILE' makes one"
        )


def sizes(size: int) -> dict[str, int]:
    """The number of voyages of each split of a data set with so many voyages to train on.

    Raises
    ------
    RequestError
        If it is too large.

    Examples
    --------
    >>> sizes(1000)
    {'train': 1000, 'validation': 100, 'test': 100}
    """
    if size > MOST_RUNS:
        raise RequestError(f"size = {size}: at most {MOST_RUNS} voyages are possible")
    few = max(1, size // _SHARE)
    return {TRAIN: size, VALIDATION: few, TEST: few}


def seed_of(family: Scenario, split: str, number: int, seal: Seal) -> int:
    """The seed of a voyage.

    Parameters
    ----------
    family : Scenario
        The family.
    split : str
        One of `SPLITS`.
    number : int
        Number of the voyage in its split: 0, 1, 2, ...
    seal : Seal
        From which the seeds of `TEST` are derived. Other splits are always public.
    """
    seed = FIRST_SEEDS[split] + number
    return seal.seed(family.id, seed) if split == TEST else seed


def streams_of(family: Scenario, split: str, size: int) -> tuple[int, int]:
    """What an estimator tells that learned from a split (`simnav.estimator.Estimator.learned_from`)."""
    first: Sequence[int] = range(family.root(FIRST_SEEDS[split]), family.root(FIRST_SEEDS[split]) + size)
    return first[0], first[-1]
