# Of windows.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.adaptations.innovation_based import FixedWindow, InnovationBased
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.full_graph import FullGraph
from simnav.estimators.solvers.window import WindowEstimator

from .adaptive import INNOVATIONS_AS_PRINTED

__all__ = ["FgoFull", "FgoUnsimplified", "IaeFgo", "IaeFgoFixed", "IaeFgoPaper", "ShipFgo", "ShipFgoFull", "SwFgo"]
__all__ += ["SwFgoPaper"]
_WINDOW = piece(WindowEstimator, every_sample=False)

@register("sw-fgo", aliases=("fgo", "fgo-simplified"))
class SwFgo(Row, solver=_WINDOW, model=InertialModel):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        window: int | None = 20,
        tolerance: float = 0.001,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("fgo-unsimplified")
class FgoUnsimplified(
    Row, solver=piece(WindowEstimator, defaults={"window": 5}, every_sample=True), model=InertialModel
):
    version = 2
    slow = True
    def __init__(
        self,
        *,
        calibrate: bool = True,
        window: int | None = 5,
        tolerance: float = 0.001,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("fgo-full")
class FgoFull(Row, solver=FullGraph, model=InertialModel):
    version = 2
    def __init__(
        self,
        *,
        calibrate: bool = True,
        tolerance: float = 0.001,
        iterations: int = 10,
        spacing: float = 0.5,
    ) -> None: ...

@register("iae-fgo")
class IaeFgo(Row, solver=_WINDOW, model=Suitable, adaptation=piece(InnovationBased, source="innovation")):
    version = 6
    def __init__(
        self,
        *,
        shortest: int = 10,
        longest: int = 20,
        low: float = 2.0,
        high: float = 5.0,
        forgetting: float = 0.9,
        newest: bool = False,
        significance: float = 0.01,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: typing.Literal["fixes", "all"] = "all",
        always: bool = False,
        window: int | None = 20,
        tolerance: float = 0.001,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("iae-fgo-paper")
class IaeFgoPaper(Row, solver=_WINDOW, model=Suitable, adaptation=INNOVATIONS_AS_PRINTED):
    version = 2
    def __init__(
        self,
        *,
        shortest: int = 10,
        longest: int = 20,
        low: float = 2.0,
        high: float = 5.0,
        forgetting: float = 0.9,
        newest: bool = True,
        significance: float = 1.0,
        lowest: float = 0.1,
        highest: float = 100.0,
        full: bool = True,
        scope: typing.Literal["fixes", "all"] = "fixes",
        always: bool = True,
        window: int | None = 20,
        tolerance: float = 0.001,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("iae-fgo-fixed")
class IaeFgoFixed(Row, solver=_WINDOW, model=Suitable, adaptation=piece(FixedWindow, source="innovation")):
    version = 6
    def __init__(
        self,
        *,
        innovations: int = 20,
        forgetting: float = 0.9,
        newest: bool = False,
        significance: float = 0.01,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: typing.Literal["fixes", "all"] = "all",
        window: int | None = 20,
        tolerance: float = 0.001,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("sw-fgo-paper")
class SwFgoPaper(
    Row,
    solver=piece(WindowEstimator, defaults={"tolerance": 1e-6, "spacing": 0.2}, every_sample=False),
    model=NineStateModel,
):
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
        window: int | None = 20,
        tolerance: float = 1e-06,
        iterations: int = 10,
        spacing: float = 0.2,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("ship-fgo")
class ShipFgo(Row, solver=_WINDOW, model=ShipModel):
    def __init__(
        self,
        *,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
        window: int | None = 20,
        tolerance: float = 0.001,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("ship-fgo-full")
class ShipFgoFull(Row, solver=FullGraph, model=ShipModel):
    def __init__(
        self,
        *,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
        tolerance: float = 0.001,
        iterations: int = 10,
        spacing: float = 0.5,
    ) -> None: ...
