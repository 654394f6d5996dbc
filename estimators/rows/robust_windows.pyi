# Of robust_windows.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.dynamic_covariance_scaling import DynamicCovarianceScaling
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.gradient_adaptive import GradientAdaptive
from simnav.estimators.weightings.graduated_non_convexity import GraduatedNonConvexity
from simnav.estimators.weightings.m_estimators import TunedMEstimator, cauchy, geman_mcclure, huber, tukey
from simnav.estimators.weightings.max_mixture import MaxMixture
from simnav.estimators.weightings.switchable_constraints import SwitchableConstraints

from .windows import SwFgoPaper

__all__ = ["CauchyFgo", "DcsFgo", "GaFgo", "GaFgoPaper", "GmFgo", "GncFgo", "HuberFgo", "MaxMixtureFgo"]
__all__ += ["SwitchableFgo", "TukeyFgo"]

class _Window(Row, solver=piece(WindowEstimator, defaults={"tolerance": 0.05}, every_sample=False), model=Suitable):
    def __init__(
        self,
        *,
        window: int | None = 20,
        tolerance: float = 0.05,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

class _Robust(_Window, isolation=FaultIsolation):
    version = 2
    def __init__(
        self,
        *,
        together: int = 3,
        recent: float = 5.0,
        sound: float = 0.999,
        window: int | None = 20,
        tolerance: float = 0.05,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("huber-fgo")
class HuberFgo(_Robust, weighting=piece(TunedMEstimator, weight=huber)):
    version = 5
    def __init__(
        self,
        *,
        efficiency: float = 0.98,
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

@register("tukey-fgo")
class TukeyFgo(_Robust, weighting=piece(TunedMEstimator, weight=tukey)):
    version = 5
    def __init__(
        self,
        *,
        efficiency: float = 0.98,
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

@register("cauchy-fgo")
class CauchyFgo(_Robust, weighting=piece(TunedMEstimator, weight=cauchy)):
    version = 5
    def __init__(
        self,
        *,
        efficiency: float = 0.98,
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

@register("gm-fgo")
class GmFgo(_Robust, weighting=piece(TunedMEstimator, weight=geman_mcclure)):
    version = 5
    def __init__(
        self,
        *,
        efficiency: float = 0.98,
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

@register("dcs-fgo")
class DcsFgo(_Robust, weighting=DynamicCovarianceScaling):
    version = 5
    def __init__(
        self,
        *,
        phi: float = 0.0,
        efficiency: float = 0.98,
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

@register("switchable-fgo")
class SwitchableFgo(_Robust, weighting=SwitchableConstraints):
    version = 5
    def __init__(
        self,
        *,
        sigma: float = 0.3,
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

@register("gnc-fgo")
class GncFgo(
    _Robust,
    solver=piece(WindowEstimator, defaults={"tolerance": 0.05, "iterations": 15}, every_sample=False),
    weighting=GraduatedNonConvexity,
):
    version = 7
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

@register("max-mixture-fgo")
class MaxMixtureFgo(_Robust, weighting=MaxMixture):
    version = 5
    def __init__(
        self,
        *,
        spread: float = 10.0,
        probability: float = 0.05,
        together: int = 3,
        recent: float = 5.0,
        sound: float = 0.999,
        window: int | None = 20,
        tolerance: float = 0.05,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("ga-fgo")
class GaFgo(_Window, weighting=piece(GradientAdaptive, fewest=5)):
    version = 4
    def __init__(
        self,
        *,
        preset: typing.Literal["default", "paper"] = "default",
        gnss: tuple[float, float, float] = (3.0, 1.5, 0.5),
        motion: tuple[float, float, float] = (2.0, 1.0, 0.3),
        other: tuple[float, float, float] | None = None,
        epsilon: float = 0.1,
        window: int | None = 20,
        tolerance: float = 0.05,
        iterations: int = 10,
        spacing: float = 0.5,
        prior: typing.Literal["differences", "group"] = "differences",
    ) -> None: ...

@register("ga-fgo-paper")
class GaFgoPaper(SwFgoPaper, weighting=piece(GradientAdaptive, defaults={"preset": "paper"}, fewest=5)):
    version = 3
    def __init__(
        self,
        *,
        preset: typing.Literal["default", "paper"] = "paper",
        gnss: tuple[float, float, float] = (3.0, 1.5, 0.5),
        motion: tuple[float, float, float] = (2.0, 1.0, 0.3),
        other: tuple[float, float, float] | None = None,
        epsilon: float = 0.1,
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
