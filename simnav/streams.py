"""Independent random streams, derived from one seed and stable names.

Every process of a run (the sea, each instrument, each fault, the initial error) draws from its own
stream, so that switching one of them off does not change one bit of the others.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

import numpy as np

__all__ = ["stream"]


def stream(seed: int, *names: str) -> np.random.Generator:
    """The generator of one process.

    Parameters
    ----------
    seed : int
        Seed of the run, non-negative.
    *names : str
        Name of the process, from the general to the particular: ``"instrument", "dvl", "noise"``.

    Returns
    -------
    numpy.random.Generator
        A generator with SFC64, which is the fastest bit generator of NumPy for normal variates.

    Raises
    ------
    ValueError
        If the seed is negative or not an integer.
    """
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"a seed is a non-negative integer, not {seed!r}")
    # As the list of these integers, which NumPy converts to the same words in five times the time.
    words = int(seed).to_bytes(max(1, (int(seed).bit_length() + 31) // 32) * 4, "little")
    entropy = np.frombuffer(words + _digest("/".join(names)), dtype="<u4")
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(entropy.astype(np.uint32))))


@lru_cache(maxsize=4096)
def _digest(name: str) -> bytes:
    return hashlib.blake2b(name.encode(), digest_size=16).digest()
