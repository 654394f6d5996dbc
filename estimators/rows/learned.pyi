# Of learned.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.adaptations.learned_noise import LearnedNoise
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.missing_velocity import MissingVelocityEstimator, PredictedVelocity
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.learned_weights import LearnedWeights

__all__ = ["BeamsEkf", "BeamsEkf20000", "NetEkf", "NetEkf20000", "NetFgo", "NetFgo20000"]

@register("net-ekf")
class NetEkf(Row, solver=KalmanEstimator, model=Suitable, iteration=poor_heading, adaptation=LearnedNoise):
    version = 4
    def __init__(
        self,
        *,
        file: str = "",
        highest: float = 30.0,
        budget: int = 1000,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("net-fgo")
class NetFgo(
    Row,
    solver=piece(WindowEstimator, defaults={"tolerance": 0.05}, every_sample=False),
    model=Suitable,
    weighting=LearnedWeights,
    isolation=FaultIsolation,
):
    version = 3
    def __init__(
        self,
        *,
        file: str = "",
        smallest: float = 0.001,
        budget: int = 1000,
        together: int = 3,
        recent: float = 5.0,
        sound: float = 0.999,
        window: int | None = 20,
        tolerance: float = 0.05,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("beams-ekf")
class BeamsEkf(
    Row,
    solver=MissingVelocityEstimator,
    model=InertialModel,
    velocity=PredictedVelocity,
    iteration=poor_heading,
):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        file: str = "",
        lasting: float = 10.0,
        budget: int = 1000,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("net-ekf-20000")
class NetEkf20000(NetEkf, adaptation=piece(LearnedNoise, budget=20_000)):
    version = 3
    def __init__(
        self,
        *,
        file: str = "",
        highest: float = 30.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("net-fgo-20000")
class NetFgo20000(NetFgo, weighting=piece(LearnedWeights, budget=20_000)):
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
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("beams-ekf-20000")
class BeamsEkf20000(BeamsEkf, velocity=piece(PredictedVelocity, budget=20_000)):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        file: str = "",
        lasting: float = 10.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...
