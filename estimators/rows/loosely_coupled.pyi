# Of loosely_coupled.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.graduated_non_convexity import GraduatedNonConvexity

__all__ = ["EkfLoose", "GatedEkfLoose", "GncFgoLoose"]

@register("ekf-loose")
class EkfLoose(Row, solver=KalmanEstimator, model=InertialModel, iteration=poor_heading):
    version = 2
    loose = True
    def __init__(
        self,
        *,
        calibrate: bool = True,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("gated-ekf-loose")
class GatedEkfLoose(Row, solver=KalmanEstimator, model=Suitable, adaptation=ChiSquareGate, iteration=poor_heading):
    version = 4
    loose = True
    def __init__(
        self,
        *,
        probability: float = 0.999,
        patience: float = 10.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("gnc-fgo-loose")
class GncFgoLoose(
    Row,
    solver=piece(WindowEstimator, defaults={"tolerance": 0.05, "iterations": 15}, every_sample=False),
    model=Suitable,
    weighting=GraduatedNonConvexity,
    isolation=FaultIsolation,
):
    version = 4
    loose = True
    def __init__(
        self,
        *,
        cost: typing.Literal["tls", "gm"] = "tls",
        growth: float = 3.0,
        efficiency: float = 0.95,
        smallest: float = 0.001,
        together: int = 3,
        recent: float = 5.0,
        sound: float = 0.999,
        window: int | None = 20,
        tolerance: float = 0.05,
        iterations: int = 15,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...
