# Of sigma_point.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.models.nine_state_points import NineStatePoints
from simnav.estimators.models.ship_points import ShipPoints
from simnav.estimators.solvers.filterpy_unscented import FilterpyUnscentedEstimator
from simnav.estimators.solvers.sigma_point import SigmaPointEstimator

__all__ = ["Ckf", "FilterpyUkf", "ShipCkf", "ShipUkf", "Ukf", "Ukf9"]
_CUBATURE = piece(SigmaPointEstimator, alpha=1.0, beta=0.0, kappa=0.0)

@register("ukf")
class Ukf(Row, solver=SigmaPointEstimator, model=InertialPoints):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        alpha: float = 0.5,
        beta: float = 2.0,
        kappa: float = 0.0,
    ) -> None: ...

@register("ukf-9")
class Ukf9(Row, solver=SigmaPointEstimator, model=NineStatePoints):
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
        alpha: float = 0.5,
        beta: float = 2.0,
        kappa: float = 0.0,
    ) -> None: ...

@register("ckf")
class Ckf(Row, solver=_CUBATURE, model=InertialPoints):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
    ) -> None: ...

@register("ship-ukf")
class ShipUkf(Row, solver=SigmaPointEstimator, model=ShipPoints):
    def __init__(
        self,
        *,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
        alpha: float = 0.5,
        beta: float = 2.0,
        kappa: float = 0.0,
    ) -> None: ...

@register("ship-ckf")
class ShipCkf(Row, solver=_CUBATURE, model=ShipPoints):
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

@register("filterpy-ukf")
class FilterpyUkf(Row, solver=FilterpyUnscentedEstimator, model=ShipPoints):
    def __init__(
        self,
        *,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
        alpha: float = 0.5,
        beta: float = 2.0,
        kappa: float = 0.0,
    ) -> None: ...
