# Of smoothers.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.smoother import Smoother
from simnav.estimators.solvers.two_filter import TwoFilterSmoother

from .kalman import Ekf, ShipEkf

__all__ = ["EkfRts", "EkfTwoFilter", "ShipEkfRts"]

@register("ekf-rts")
class EkfRts(Ekf, smoother=Smoother):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("ekf-two-filter")
class EkfTwoFilter(Row, solver=KalmanEstimator, model=InertialModel, smoother=TwoFilterSmoother):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        seed_backward: bool = False,
    ) -> None: ...

@register("ship-ekf-rts")
class ShipEkfRts(ShipEkf, smoother=Smoother):
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
