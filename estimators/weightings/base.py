"""What a weighting is: it sees all factors of a window at each iteration, and decides how much each counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array, Instruments

__all__ = ["Factors", "Isolation", "Weighting"]


@dataclass(slots=True)
class Factors:
    """The factors of a window as linearised now: M of measurements (up to 3 components), N of motion (n states).

    Attributes
    ----------
    names : tuple of str
        Of the instruments.
    instrument : (M,) array of int
        Index into ``names``.
    components : (M,) array of int
        Of the measurement, 1 to 3.
    time : (M,) array
        Of validity [s], in ascending order.
    residual : (M, 3) array
        Measured minus predicted, in the units of ``KINDS[kind].errors``; zero beyond the components.
    noise : (M, 3, 3) array
        R; identity beyond the components.
    whitened : (M, 3) array
        ``L^-1 residual`` with ``R = L L'``.
    norm : (M,) array
        ``sqrt(residual' R^-1 residual)``.
    motion_time : (N,) array
        Of the node at the end of the motion [s].
    motion_residual : (N, n) array
        In the units of the model's error.
    motion_norm : (N,) array
        ``sqrt(e' Q^-1 e)``.
    weight : (M,) array
        What each measurement's information R^-1 is multiplied by: the last iteration's, 1 for a new factor; to be
        overwritten in place.
    motion_weight : (N,) array
        Likewise, of Q^-1.
    iteration : int
        0 at the first of an epoch; a step that was taken back is not asked about, and leaves a gap.
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
    """Lets every factor count in full; the base of all weightings.

    One that has residuals beyond k sigma pull no harder than one of k sigma::

        class Huber(Weighting):
            def weigh(self, factors):
                np.minimum(1.0, 1.345 / np.maximum(factors.norm, 1e-9), out=factors.weight)
                return True
    """

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""

    def weigh(self, factors: Factors) -> bool:
        """Set ``factors.weight`` and ``factors.motion_weight`` in place, once an iteration.

        The solver leaves a weight as it was where the change is within its tolerance.

        Returns
        -------
        bool
            Whether the weights are those that are wanted at these residuals; the solver does not stop before. False
            where the next iteration's would differ even if nothing moved, as while a cost hardens.
        """
        factors.weight[:] = 1.0
        factors.motion_weight[:] = 1.0
        return True

    def diagnostics(self) -> dict[str, float | Array]:
        """Named values of the last step, recorded by epoch."""
        return {}


class Isolation(Protocol):
    """Decides, after a weighting, which factors are at fault (`simnav.estimators.weightings.fault_isolation`)."""

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""

    def judge(self, factors: Factors) -> bool:
        """Change the weights that the weighting has set, in place; as `Weighting.weigh`."""
