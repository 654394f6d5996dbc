"""The form of a model for a sigma-point solver: its nonlinear motion and measurements, for many states at once.

A point is a state near the model's own, given by its difference from it (``point = model retracted by error``, as in
`ErrorModel.correct`). All points are one (k, n) array of such errors.
"""

from __future__ import annotations

from abc import abstractmethod

from simnav.types import Array, Measurement

from .base import ErrorModel

__all__ = ["PointModel"]


class PointModel(ErrorModel):
    """An `ErrorModel` that propagates and observes k points in addition to its own state."""

    @abstractmethod
    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state to a time, and k points through the same motion.

        Parameters
        ----------
        errors : (k, n) array
            Differences of the points from the state; overwritten with those from the propagated state.
        until : float
            Time to which state and points are propagated [s].

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
