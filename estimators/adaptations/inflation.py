"""Where an adaptation takes the prediction as wrong: what of the covariance a filter inflates.

An adaptation hands one of these functions over to the filter (`Adaptation.inflate`), which calls it before it uses the
reading. It returns whether the reading has to be predicted again.
"""

from __future__ import annotations

from simnav.compiled import kernel
from simnav.estimators.algebra.inflation import inflate_motion
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings

__all__ = ["inflate_all", "inflate_moving"]


@kernel(passed=True)
def inflate_moving(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Inflate the covariance of position, velocity and attitude.

    The prediction is wrong if the motion does not follow the model, or if the IMU is disturbed. Position and velocity
    are then uncertain. The errors of the instruments have not changed. If their covariance were inflated, too, they
    would follow the first wrong measurement. The variance of the attitude is not inflated beyond that at the start, so
    that corrections stay in the linear range.
    """
    inflate_motion(dynamics.covariance, readings.inflation[k], dynamics.first_variances, dynamics.moving)
    return True


@kernel(passed=True)
def inflate_all(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Inflate the whole covariance, and the prediction with it."""
    n, d, factor = dynamics.covariance.shape[0], prediction.innovation.size, readings.inflation[k]
    for a in range(n):
        for b in range(n):
            dynamics.covariance[a, b] *= factor
        for b in range(d):
            prediction.cross[a, b] *= factor
    for a in range(d):
        for b in range(d):
            prediction.predicted[a, b] *= factor
    return False
