"""The 9-state model of Guo et al. (2026) for sigma-point solvers: nine states, no biases, fixed sigmas.

The motion and the readings of the points are those of `simnav.estimators.models.inertial_points`, without errors of
the biases. The paper prints neither the points nor the weights of its UKF.
"""

from __future__ import annotations

import numpy as np

from simnav.types import Array, Measurement

from .inertial_errors import PART
from .inertial_points import InertialPoints
from .measurements import NAVIGATION_STATES
from .nine_state import NineStateModel

__all__ = ["NineStatePoints"]


class NineStatePoints(NineStateModel, InertialPoints):
    """`NineStateModel` with sigma points; the parameters are its own."""

    def point_functions(self) -> None:
        """As `PointModel.point_functions`: those of the inertial model have fifteen states."""
        return None

    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state and the points; return the process noise."""
        full = _with_biases(errors)
        noise = super().propagate_points(full, until)
        errors[:] = full[:, PART.navigation]
        return noise

    def observe_points(self, measurement: Measurement, errors: Array) -> Array:
        """What the instrument should read at the points, minus what it should read at the state."""
        return super().observe_points(measurement, _with_biases(errors))


def _with_biases(errors: Array) -> Array:
    """(k, 15) errors of points: those of nine states, and none of the biases."""
    full = np.zeros((len(errors), NAVIGATION_STATES))
    full[:, PART.navigation] = errors
    return full
