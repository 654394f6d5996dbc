"""A recording as an estimator sees it: without truth, labels and seed, for those who work on exported files."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from simnav.types import NavigationStates

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["NO_SEED", "has_truth", "without_truth"]

#: The seed of a recording that does not say it.
NO_SEED = -1


def without_truth(recording: Recording) -> Recording:
    """A copy without truth, fault labels, drawn values, true datasheets, notes and the seed.

    Parameters
    ----------
    recording : Recording
        The whole run.

    Returns
    -------
    Recording
        The times of the truth, which are the ends of the steps, stay; its states are NaN.
    """
    data = recording.data
    aids = {
        name: replace(
            s.as_delivered(),
            faults=np.zeros_like(s.faults),
            fault_error=np.zeros_like(s.fault_error),
            sigma=np.tile(recording.instruments[name].sigma, (len(s), 1)),
            dropped=np.empty(0),
            dropped_channel=np.empty(0, dtype=s.dropped_channel.dtype),
        )
        for name, s in data.aids.items()
    }
    return replace(
        recording,
        seed=NO_SEED,
        initial_truth=_nothing(recording.initial_truth),
        faults=(),
        data=replace(data, imu_labels=None, aids=aids, truth=_nothing(data.truth)),
        note="",
        draws={},
        actual=None,
        actual_covariance=None,
    )


def has_truth(recording: Recording) -> bool:
    """Whether a recording has a truth that is known at some epoch."""
    return bool(np.isfinite(recording.data.truth.position).all(axis=1).any())


def _nothing(states: NavigationStates) -> NavigationStates:
    empty = np.full((len(states), 3), np.nan)
    return NavigationStates(states.time, empty, empty.copy(), empty.copy())
