"""Derivatives of what a chain says, by differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from simnav.estimators.models.chain import Chain

__all__ = ["along"]


def along(chain: Chain, step: np.ndarray, look: Callable[[], np.ndarray]) -> np.ndarray:
    """What an array changes by as the nodes move by a small step, by a central difference; the nodes stay as they are.

    Parameters
    ----------
    chain : Chain
        Its states are put back.
    step : (N, n) array
        Of its N nodes.
    look : callable
        Linearises, and gives the array.
    """
    states, ends = chain.copy_states(), []
    for sign in (1.0, -1.0):
        chain.retract(sign * step)
        ends.append(look().copy())
        chain.restore_states(states)
    return 0.5 * (ends[0] - ends[1])
