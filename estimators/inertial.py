"""The row ``inertial``: what the IMU alone can do."""

from __future__ import annotations

from simnav.estimator import UnsuitableScenario, register
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.types import Datasheet, InitialState, Instruments

__all__ = ["PureInertial"]


class _Unaided(InertialModel):
    """The inertial model, blind to every aid."""

    def observes(self, instrument: Datasheet) -> bool:
        return False


@register("inertial", aliases=("pure-inertial",))
class PureInertial(KalmanEstimator):
    """Pure inertial navigation: the strapdown solution from the initial state, with its growing covariance."""

    def __init__(self) -> None:
        super().__init__(_Unaided())

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU."""
        if instruments.imu is None:
            raise UnsuitableScenario("pure inertial navigation needs an IMU; there is none")
        super().reset(start, instruments)
