# Of adaptive.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.adaptations.adkf import AdaptiveFactor
from simnav.estimators.adaptations.correntropy import MaximumCorrentropy
from simnav.estimators.adaptations.fading import FadingMemory
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.innovation_based import FixedWindow, InnovationBased
from simnav.estimators.adaptations.robust import HuberWeights, Igg3Weights
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.adaptations.variational_bayes import VariationalBayes
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.dvl_calibration import DvlCalibrationModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.imm import ImmEstimator
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator

__all__ = ["Adkf", "Adkf23", "AdkfPaper", "FadingEkf", "GatedEkf", "HuberKf", "Iae", "IaeFixed", "IaePaper", "Igg3"]
__all__ += ["Imm", "Mckf", "Rae", "SageHusaKf", "SageHusaPaper", "VbAkf"]
INNOVATIONS_AS_PRINTED = piece(
    InnovationBased,
    defaults={
        "newest": True,
        "significance": 1.0,
        "lowest": 0.1,
        "highest": 100.0,
        "full": True,
        "scope": "fixes",
        "always": True,
    },
    source="innovation",
)
_FORMERLY = {"window": "innovations"}

class _Adaptive(Row, solver=KalmanEstimator, model=Suitable, iteration=poor_heading):
    def __init__(
        self,
        *,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("sage-husa")
class SageHusaKf(_Adaptive, adaptation=SageHusa):
    version = 6
    def __init__(
        self,
        *,
        fading: float = 0.96,
        prior: int = 10,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: typing.Literal["fixes", "all"] = "all",
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("sage-husa-paper")
class SageHusaPaper(
    _Adaptive, adaptation=piece(SageHusa, defaults={"fading": 1.0, "prior": 0, "lowest": 0.5, "scope": "fixes"})
):
    version = 5
    def __init__(
        self,
        *,
        fading: float = 1.0,
        prior: int = 0,
        lowest: float = 0.5,
        highest: float = 30.0,
        full: bool = False,
        scope: typing.Literal["fixes", "all"] = "fixes",
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("iae")
class Iae(_Adaptive, adaptation=piece(InnovationBased, source="innovation")):
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
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("iae-paper")
class IaePaper(_Adaptive, adaptation=INNOVATIONS_AS_PRINTED):
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
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("iae-fixed")
class IaeFixed(_Adaptive, adaptation=piece(FixedWindow, source="innovation")):
    version = 6
    formerly = _FORMERLY
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
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("rae")
class Rae(_Adaptive, adaptation=piece(FixedWindow, source="residual", newest=False)):
    version = 6
    formerly = _FORMERLY
    def __init__(
        self,
        *,
        innovations: int = 20,
        forgetting: float = 0.9,
        significance: float = 0.01,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: typing.Literal["fixes", "all"] = "all",
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("adkf")
class Adkf(_Adaptive, adaptation=AdaptiveFactor):
    version = 6
    def __init__(
        self,
        *,
        statistic: typing.Literal["discrepancy", "residual", "ratio"] = "residual",
        factor: typing.Literal["two-segment", "three-segment", "exponential"] = "three-segment",
        target: typing.Literal["R", "P"] = "R",
        preset: typing.Literal["default", "paper"] = "default",
        c0: float | None = None,
        c1: float | None = None,
        together: int = 3,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("adkf-paper")
class AdkfPaper(_Adaptive, adaptation=piece(AdaptiveFactor, preset="paper", c0=None, c1=None, together=0)):
    version = 3
    def __init__(
        self,
        *,
        statistic: typing.Literal["discrepancy", "residual", "ratio"] = "residual",
        factor: typing.Literal["two-segment", "three-segment", "exponential"] = "three-segment",
        target: typing.Literal["R", "P"] = "R",
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("adkf-23")
class Adkf23(Row, solver=KalmanEstimator, model=DvlCalibrationModel, adaptation=AdaptiveFactor, iteration=poor_heading):
    version = 4
    def __init__(
        self,
        *,
        statistic: typing.Literal["discrepancy", "residual", "ratio"] = "residual",
        factor: typing.Literal["two-segment", "three-segment", "exponential"] = "three-segment",
        target: typing.Literal["R", "P"] = "R",
        adaptation__preset: typing.Literal["default", "paper"] = "default",
        c0: float | None = None,
        c1: float | None = None,
        together: int = 3,
        lever_arm: float = 0.02,
        delay: float = 0.005,
        model__preset: typing.Literal["default", "paper"] = "default",
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("igg3")
class Igg3(_Adaptive, adaptation=Igg3Weights):
    version = 6
    def __init__(
        self,
        *,
        k0: float = 2.5,
        k1: float = 8.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("huber-kf")
class HuberKf(_Adaptive, adaptation=HuberWeights):
    version = 6
    def __init__(
        self,
        *,
        k: float = 2.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("gated-ekf")
class GatedEkf(_Adaptive, adaptation=ChiSquareGate):
    version = 6
    def __init__(
        self,
        *,
        probability: float = 0.999,
        patience: float = 10.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("fading-ekf")
class FadingEkf(_Adaptive, adaptation=FadingMemory):
    version = 3
    def __init__(
        self,
        *,
        memory: float = 1000.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("vb-akf")
class VbAkf(_Adaptive, adaptation=VariationalBayes):
    version = 6
    def __init__(
        self,
        *,
        forgetting: float = 0.902,
        prior: float = 4.63,
        iterations: int = 2,
        lowest: float = 1.0,
        highest: float = 63.1,
        scope: typing.Literal["fixes", "all"] = "all",
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("mckf")
class Mckf(_Adaptive, adaptation=piece(MaximumCorrentropy, smallest=1e-3)):
    version = 6
    def __init__(
        self,
        *,
        bandwidth: float = 4.0,
        iterations: int = 5,
        begin: typing.Literal["update", "prediction"] = "update",
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("imm")
class Imm(Row, solver=ImmEstimator, model=Suitable):
    version = 7
    def __init__(
        self,
        *,
        levels: tuple[float, ...] = (),
        highest: float = 77.5,
        ratio: float = 1.5,
        stay: float = 0.992,
        stay_high: float = 0.675,
    ) -> None: ...
