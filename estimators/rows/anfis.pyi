# Of anfis.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.adaptations.anfis import Anfis
from simnav.estimators.composition import piece

from .kalman import ShipEkf
from .windows import ShipFgo

__all__ = ["AnfisEkf", "AnfisFgo", "AnfisFgoMotion"]

@register("anfis-fgo")
class AnfisFgo(ShipFgo, adaptation=Anfis):
    version = 3
    def __init__(
        self,
        *,
        features: typing.Literal["innovation", "motion", "recent"] = "innovation",
        file: str = "",
        lowest: float = 1.0,
        highest: float = 30.0,
        level: typing.Literal["datasheet", "learned"] = "learned",
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

@register("anfis-fgo-motion")
class AnfisFgoMotion(ShipFgo, adaptation=piece(Anfis, features="motion")):
    version = 3
    def __init__(
        self,
        *,
        file: str = "",
        lowest: float = 1.0,
        highest: float = 30.0,
        level: typing.Literal["datasheet", "learned"] = "learned",
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

@register("anfis-ekf")
class AnfisEkf(ShipEkf, adaptation=Anfis):
    version = 3
    def __init__(
        self,
        *,
        features: typing.Literal["innovation", "motion", "recent"] = "innovation",
        file: str = "",
        lowest: float = 1.0,
        highest: float = 30.0,
        level: typing.Literal["datasheet", "learned"] = "learned",
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
    ) -> None: ...
