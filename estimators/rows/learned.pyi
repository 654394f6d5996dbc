# Of learned.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.adaptations.learned_noise import LearnedNoise
from simnav.estimators.composition import piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.missing_velocity import MissingVelocityEstimator, PredictedVelocity
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.learned_weights import LearnedWeights

from .network_row import NetworkRow

__all__ = ["BeamsEkf", "NetEkf", "NetFgo"]

@register("net-ekf")
class NetEkf(NetworkRow, solver=KalmanEstimator, model=Suitable, iteration=poor_heading, adaptation=LearnedNoise):
    version = 2
    def __init__(
        self,
        *,
        file: str = "",
        highest: float = 30.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("net-fgo")
class NetFgo(
    NetworkRow,
    solver=piece(WindowEstimator, defaults={"tolerance": 0.05}, every_sample=False),
    model=Suitable,
    weighting=LearnedWeights,
    isolation=FaultIsolation,
):
    version = 2
    def __init__(
        self,
        *,
        file: str = "",
        smallest: float = 0.001,
        together: int = 3,
        recent: float = 5.0,
        sound: float = 0.999,
        window: int | None = 20,
        tolerance: float = 0.05,
        iterations: int = 10,
        spacing: float = 0.5,
    ) -> None: ...

@register("beams-ekf")
class BeamsEkf(
    NetworkRow,
    solver=MissingVelocityEstimator,
    model=InertialModel,
    velocity=PredictedVelocity,
    iteration=poor_heading,
):
    def __init__(
        self,
        *,
        calibrate: bool = True,
        file: str = "",
        lasting: float = 10.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...
