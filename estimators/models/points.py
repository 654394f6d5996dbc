"""What a model is to a sigma-point solver: its true, nonlinear motion and measurements, for many states at once.

A point is a state near the model's own, given by its error with respect to it (``point = model retracted by error``, by
the same rule as `ErrorModel.correct`). All points travel as one (k, n) array of errors.
"""

from __future__ import annotations

from abc import abstractmethod

from simnav.estimators.models.base import ErrorModel
from simnav.types import Array, Measurement

__all__ = ["PointModel"]


class PointModel(ErrorModel):
    """An `ErrorModel` that moves and observes k points beside its own state."""

    @abstractmethod
    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state to a time, and k points through the same motion.

        Parameters
        ----------
        errors : (k, n) array
            Of the points with respect to the state; overwritten by their errors with respect to the advanced state.
        until : float
            Time to which the points are moved [s].

        Returns
        -------
        (n, n) array
            Covariance of the noise that the motion adds.
        """

    @abstractmethod
    def observe_points(self, measurement: Measurement, errors: Array) -> Array:
        """What an instrument should read at k points, minus what it should read at the state.

        Parameters
        ----------
        measurement : Measurement
            One that `measure` says something of.
        errors : (k, n) array
            Offsets of the points from the centre.

        Returns
        -------
        (k, m) array
            In the units of the innovation; angles in [-pi, pi].
        """
