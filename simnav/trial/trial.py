"""The result of a trial.

==================  ==================================================================================================
status              meaning
==================  ==================================================================================================
``ok``              every step gave a valid estimate
``error``           the estimator raised an exception
``invalid-output``  not an `Estimate`, wrong shape or time, NaN or infinity in an estimated component, a covariance that
                    is not symmetric or not positive semi-definite, or holds numbers of such a size (a variance below
                    1e-100 that is not 0, an entry above 1e100) that what follows from them overflows
``diverged``        finite, but horizontally more than `DIVERGENCE_LIMIT` from the truth
``out-of-memory``   the estimator raised MemoryError
``unsuitable``      an instrument is lacking that `Estimator.needs` names: no failure. To refuse a scenario that has all
                    of them (`UnsuitableScenario`) is an ``error``
==================  ==================================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array, NavigationStates

__all__ = ["Trial"]


@dataclass(frozen=True, eq=False, repr=False)
class Trial:
    """The answers of an estimator on one recording, up to the end or to its failure: T epochs.

    Attributes
    ----------
    estimator : str
        Registered name, or the name of the class.
    status, reason : str
        See the table in this module; ``reason`` is empty where the status is ``ok``.
    time : (T,) array
        Ends of the completed steps [s]: the first T of ``recording.data.truth.time``.
    position, velocity, attitude : (T, 3) array
        The vectors of each `Estimate`; NaN if a vector was not given.
    estimated : (T, 9) bool array
        True for each estimated component of `COMPONENTS`.
    covariance : (T, 9, 9) array or None
        Covariances; NaN at epochs without one. None if there was none at all, or they were not kept.
    diagnostics : dict of str to (T, ...) array
        Diagnostics by name; NaN at epochs without the diagnostic. Arrays of changing length are padded with NaN.
    flagged : list of (source, time)
        Measurements that the estimator considered faulty.
    update_seconds : (T,) array
        Wall time of each update [s].
    smoothed : NavigationStates or None
        The T states of ``smooth()``; None without smoothing.
    reset_seconds, smooth_seconds : float
        Wall time of ``reset()`` and ``smooth()`` [s].
    """

    estimator: str
    status: str
    reason: str
    time: Array
    position: Array
    velocity: Array
    attitude: Array
    estimated: NDArray[np.bool_]
    covariance: Array | None
    diagnostics: dict[str, Array]
    flagged: list[tuple[str, float]]
    update_seconds: Array
    smoothed: NavigationStates | None = None
    reset_seconds: float = 0.0
    smooth_seconds: float = 0.0

    def __repr__(self) -> str:
        return f"<Trial: {self.estimator}, {self.status}, {len(self.time)} epochs>"

    def __len__(self) -> int:
        return len(self.time)

    @property
    def failed(self) -> bool:
        """Whether the trial counts as a failure (an unsuitable scenario does not)."""
        return self.status not in ("ok", "unsuitable")
