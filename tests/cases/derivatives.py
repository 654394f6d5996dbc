"""Derivatives of what a chain or a model says, by differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from simnav.estimators.models.base import ErrorModel
from simnav.estimators.models.chain import Chain
from simnav.types import Measurement

__all__ = ["along", "innovation"]


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


def innovation(model: ErrorModel, m: Measurement, error: np.ndarray) -> np.ndarray:
    """The innovation of a measurement at the state that an (n,) error leads to; the model stays as it is."""
    kept = model.snapshot()
    model.correct(error)
    found = model.measure(m)
    model.restore(kept)
    assert found is not None, "the state has no reading"
    return found.innovation
