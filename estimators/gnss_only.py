"""The row ``gnss-only``: what the GNSS receiver alone can do."""

from __future__ import annotations

from simnav.estimator import register
from simnav.estimators.models.kinematic import KinematicModel
from simnav.estimators.solvers.kalman import KalmanEstimator

__all__ = ["GnssOnly"]


@register("gnss-only", aliases=("gnss",))
class GnssOnly(KalmanEstimator):
    """GNSS alone: fixes (and velocities, if any) smoothed by a constant-velocity Kalman filter.

    Between fixes and in an outage the ship goes on as she went (`simnav.estimators.models.kinematic`).

    Parameters
    ----------
    acceleration : float
        Noise density of the velocity, each axis [m/s/sqrt(s)].
    """

    def __init__(self, acceleration: float = 0.2):
        super().__init__(KinematicModel(acceleration))
