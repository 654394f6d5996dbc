"""The interface of weightings: a weighting receives all factors of a window at each iteration, and sets the weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array, Instruments

__all__ = ["Factors", "Isolation", "Weighting"]


@dataclass(slots=True)
class Factors:
    """The factors of a window at the present linearisation: M measurements (up to 3 components), N motion factors.

    Attributes
    ----------
    names : tuple of str
        Names of the instruments; for one with channels, the source of each channel, ``INSTRUMENT:CHANNEL``.
    instrument : (M,) array of int
        Instrument or channel of each measurement, as an index into ``names``.
    components : (M,) array of int
        Number of components of each measurement, 1 to 3.
    time : (M,) array
        Time of validity of each measurement [s], in ascending order.
    residual : (M, 3) array
        Measured minus predicted, in the units of ``KINDS[kind].errors``; zero beyond the components.
    noise : (M, 3, 3) array
        Covariance R of the measurement noise; identity beyond the components.
    whitened : (M, 3) array
        Whitened residual ``L^-1 residual`` with ``R = L L'``.
    norm : (M,) array
        Norm of the whitened residual, ``sqrt(residual' R^-1 residual)``.
    motion_time : (N,) array
        Time of the node at the end of each motion factor [s].
    motion_residual : (N, n) array
        Error e of each motion factor, in the units of the n states of the model's error.
    motion_norm : (N,) array
        Norm of the whitened motion residual, ``sqrt(e' Q^-1 e)``, with the process noise Q.
    weight : (M,) array
        Factor on each measurement's information R^-1. It holds the value of the last iteration, 1 for a new factor, and
        is overwritten in place.
    motion_weight : (N,) array
        Factor on the information Q^-1 of each motion factor, in the same way.
    iteration : int
        Number of the iteration in this epoch, from 0. Numbers of rejected steps are missing.
    """

    names: tuple[str, ...]
    instrument: NDArray[np.intp]
    components: NDArray[np.intp]
    time: Array
    residual: Array
    noise: Array
    whitened: Array
    norm: Array
    motion_time: Array
    motion_residual: Array
    motion_norm: Array
    weight: Array
    motion_weight: Array
    iteration: int


class Weighting:
    """Base class of all weightings. It gives every factor the weight 1.

    A weighting that limits the influence of residuals beyond k sigma::

        class Huber(Weighting):
            def weigh(self, factors):
                np.minimum(1.0, 1.345 / np.maximum(factors.norm, 1e-9), out=factors.weight)
                return True
    """

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""

    def weigh(self, factors: Factors) -> bool:
        """Set ``factors.weight`` and ``factors.motion_weight`` in place, once an iteration.

        The solver ignores a change of a weight that is within its tolerance.

        Returns
        -------
        bool
            True if the weights are final for these residuals. The solver does not stop before. False if the weights of
            the next iteration would differ at the same residuals, as in graduated non-convexity.
        """
        factors.weight[:] = 1.0
        factors.motion_weight[:] = 1.0
        return True

    def diagnostics(self) -> dict[str, float | Array]:
        """Named values of the last step, which are recorded at each epoch."""
        return {}


class Isolation(Protocol):
    """Decides, after a weighting, which factors are faulty (`simnav.estimators.weightings.fault_isolation`)."""

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""

    def judge(self, factors: Factors) -> bool:
        """Change the weights of the weighting in place; the result is that of `Weighting.weigh`."""
