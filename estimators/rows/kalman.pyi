# Of kalman.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.dvl_calibration import DvlCalibrationModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.kinematic import KinematicModel
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.standing_ship import StandingShip
from simnav.estimators.models.unaided import UnaidedModel
from simnav.estimators.solvers.invariant import InvariantKalmanEstimator
from simnav.estimators.solvers.iterated import Iteration, poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.linear import LinearKalmanEstimator

__all__ = ["Ekf", "Ekf9", "Ekf23", "GnssOnly", "InvariantEkf", "IteratedEkf", "Kf", "Kf9", "Kf23", "PureInertial"]
__all__ += ["ShipEkf", "ShipEkfStanding"]

@register("ekf", aliases=("eskf",))
class Ekf(Row, solver=KalmanEstimator, model=InertialModel, iteration=poor_heading):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("ekf-23", aliases=("ekf-paper-003",))
class Ekf23(Row, solver=KalmanEstimator, model=DvlCalibrationModel, iteration=poor_heading):
    version = 2
    def __init__(
        self,
        *,
        lever_arm: float = 0.02,
        delay: float = 0.005,
        preset: typing.Literal["default", "paper"] = "default",
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("ekf-9", aliases=("ekf-paper-000",))
class Ekf9(Row, solver=KalmanEstimator, model=NineStateModel, iteration=poor_heading):
    version = 2
    def __init__(
        self,
        *,
        sigma_position: float = 0.01,
        sigma_velocity: float = 0.02,
        sigma_attitude_deg: float = 0.01,
        sigma_gnss_horizontal: float = 2.5,
        sigma_gnss_vertical: float = 5.0,
        sigma_dvl: float = 0.1,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("iekf", aliases=("iterated-ekf",))
class IteratedEkf(Row, solver=KalmanEstimator, model=InertialModel, iteration=piece(Iteration, above_deg=0.0)):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        limit: int = 10,
        threshold: float = 0.001,
    ) -> None: ...

@register("inekf", aliases=("invariant-ekf",))
class InvariantEkf(Row, solver=InvariantKalmanEstimator, model=InertialModel):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        error: typing.Literal["left", "right"] = "left",
    ) -> None: ...

@register("kf", aliases=("linear-kf",))
class Kf(Row, solver=LinearKalmanEstimator, model=InertialModel):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        feedback: float = 0.0,
    ) -> None: ...

@register("kf-9")
class Kf9(Row, solver=piece(LinearKalmanEstimator, defaults={"feedback": 1.0}), model=NineStateModel):
    version = 2
    def __init__(
        self,
        *,
        sigma_position: float = 0.01,
        sigma_velocity: float = 0.02,
        sigma_attitude_deg: float = 0.01,
        sigma_gnss_horizontal: float = 2.5,
        sigma_gnss_vertical: float = 5.0,
        sigma_dvl: float = 0.1,
        feedback: float = 1.0,
    ) -> None: ...

@register("kf-23", aliases=("kf-paper-003",))
class Kf23(Row, solver=LinearKalmanEstimator, model=DvlCalibrationModel):
    version = 2
    def __init__(
        self,
        *,
        lever_arm: float = 0.02,
        delay: float = 0.005,
        preset: typing.Literal["default", "paper"] = "default",
        feedback: float = 0.0,
    ) -> None: ...

@register("ship-ekf")
class ShipEkf(Row, solver=KalmanEstimator, model=ShipModel):
    def __init__(
        self,
        *,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
    ) -> None: ...

@register("ship-ekf-standing")
class ShipEkfStanding(Row, solver=KalmanEstimator, model=StandingShip):
    def __init__(
        self,
        *,
        patience: float = 1.5,
    ) -> None: ...

@register("gnss-only", aliases=("gnss",))
class GnssOnly(Row, solver=KalmanEstimator, model=KinematicModel):
    def __init__(
        self,
        *,
        acceleration: float = 0.2,
    ) -> None: ...

@register("inertial", aliases=("pure-inertial",))
class PureInertial(Row, solver=KalmanEstimator, model=UnaidedModel):
    version = 2
    def __init__(self) -> None: ...
