"""How many runs are repeated so that forged ones are found, and what a sample can find.

The sample is drawn without replacement, so the number of forged runs in it is hypergeometric.
"""

from __future__ import annotations

import math

__all__ = ["CONFIDENCE", "SHARE", "findable", "finds", "sample_size"]

#: Share of forged runs that should be found, and with which probability.
SHARE, CONFIDENCE = 0.05, 0.95


def finds(total: int, forged: int, sample: int) -> float:
    """Probability that a random sample holds at least one of the forged runs.

    Parameters
    ----------
    total, forged, sample : int
        Runs, forged ones among them, and runs in the sample.

    Examples
    --------
    >>> round(finds(100_000, 5000, 59), 3), finds(10, 1, 10), finds(10, 0, 10)
    (0.952, 1.0, 0.0)
    """
    if forged <= 0 or sample <= 0:
        return 0.0
    if sample > total - forged:
        return 1.0
    missed = math.fsum(math.log((total - forged - k) / (total - k)) for k in range(sample))
    return -math.expm1(missed)


def sample_size(total: int, share: float = SHARE, confidence: float = CONFIDENCE) -> int:
    """The fewest runs among which a share of forged runs is found.

    Parameters
    ----------
    total : int
        Runs of which the sample is drawn.
    share, confidence : float
        Share that is forged, rounded up to whole runs, and probability with which it is found.

    Examples
    --------
    >>> sample_size(1_000_000), sample_size(1000), sample_size(100), sample_size(20), sample_size(0)
    (59, 57, 45, 19, 0)
    """
    forged = math.ceil(share * total - 1e-9)
    low, high = 0, total
    while low < high:
        middle = (low + high) // 2
        if finds(total, forged, middle) >= confidence:
            high = middle
        else:
            low = middle + 1
    return low


def findable(total: int, sample: int, confidence: float = CONFIDENCE) -> str:
    """What a sample can find, in one sentence.

    Examples
    --------
    >>> findable(1000, 57)
    'a sample of 57 of 1000 results finds forged ones with 95 % probability if they are 50 or more (5 %)'
    >>> findable(1000, 1000)
    'all 1000 results were repeated'
    """
    if sample >= total:
        return f"all {total} results were repeated"
    forged = next((k for k in range(1, total + 1) if finds(total, k, sample) >= confidence), total)
    return (
        f"a sample of {sample} of {total} results finds forged ones with {100.0 * confidence:g} % probability if they "
        f"are {forged} or more ({100.0 * forged / max(total, 1):.2g} %)"
    )
