"""Adaptive and robust rows: the Kalman filter with one adaptation each.

Every row takes the inertial model where there is an IMU and the ship model where there is none, so that it is ``ekf``
or ``ship-ekf`` but for its adaptation. All but ``imm`` have the parameter ``iterate_above_deg`` of ``ekf``.
"""

from __future__ import annotations

from typing import Any, Literal

from simnav.estimator import register
from simnav.estimators.adaptations.adkf import AdaptiveFactor, Factor, Statistic
from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.adaptations.correntropy import MaximumCorrentropy
from simnav.estimators.adaptations.fading import FadingMemory
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.innovation_based import InnovationBased
from simnav.estimators.adaptations.noise import Scope
from simnav.estimators.adaptations.robust import EquivalentWeights, huber, igg3
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.adaptations.variational_bayes import VariationalBayes
from simnav.estimators.ekf import PoorHeadingStart
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.suitable import model_for
from simnav.estimators.solvers.imm import ImmEstimator
from simnav.types import InitialState, Instruments

__all__ = [
    "Adkf",
    "AdkfPaper",
    "FadingEkf",
    "GatedEkf",
    "HuberKf",
    "Iae",
    "IaeFixed",
    "Igg3",
    "Imm",
    "Mckf",
    "Rae",
    "SageHusaKf",
    "SageHusaPaper",
    "VbAkf",
]


class _Adaptive(PoorHeadingStart):
    """A Kalman filter over the model that suits the instruments."""

    def __init__(self, adaptation: Adaptation, **options: Any):
        super().__init__(InertialModel(), adaptation, **options)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU and another instrument, or what the ship model needs."""
        self.model = model_for(instruments, self.name)
        super().reset(start, instruments)


@register("sage-husa")
class SageHusaKf(_Adaptive):
    """Sage-Husa filter: the measurement noise estimated from all innovations, the old ones fading.

    See `simnav.estimators.adaptations.sage_husa`, also for the parameters.
    """

    def __init__(
        self,
        fading: float = 0.96,
        prior: int = 10,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: Scope = "fixes",
        **options: Any,
    ):
        super().__init__(SageHusa(fading, prior, lowest, highest, full, scope), **options)


@register("sage-husa-paper")
class SageHusaPaper(_Adaptive):
    """Sage-Husa filter without fading, as the figures of paper 001 have it.

    See `simnav.estimators.adaptations.sage_husa`, also for the parameters.
    """

    def __init__(
        self,
        fading: float = 1.0,
        prior: int = 0,
        lowest: float = 0.5,
        highest: float = 30.0,
        full: bool = False,
        **options: Any,
    ):
        super().__init__(SageHusa(fading, prior, lowest, highest, full), **options)


@register("iae")
class Iae(_Adaptive):
    """Innovation-based adaptive estimation of the measurement noise, window after paper 001, eqs. 16-20.

    See `simnav.estimators.adaptations.innovation_based`, also for the parameters.
    """

    def __init__(
        self,
        shortest: int = 10,
        longest: int = 20,
        low: float = 2.0,
        high: float = 5.0,
        forgetting: float = 0.9,
        newest: bool = False,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: Scope = "fixes",
        **options: Any,
    ):
        super().__init__(
            InnovationBased(
                "innovation", shortest, longest, low, high, forgetting, newest, lowest, highest, full, scope
            ),
            **options,
        )


@register("iae-fixed")
class IaeFixed(_Adaptive):
    """Innovation-based adaptive estimation of the measurement noise over a fixed window.

    See `simnav.estimators.adaptations.innovation_based`, also for the parameters.
    """

    def __init__(
        self,
        window: int = 20,
        forgetting: float = 0.9,
        newest: bool = False,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: Scope = "fixes",
        **options: Any,
    ):
        super().__init__(
            InnovationBased(
                "innovation", window, window, forgetting=forgetting, newest=newest, lowest=lowest, highest=highest,
                full=full, scope=scope,
            ),
            **options,
        )  # fmt: skip


@register("rae")
class Rae(_Adaptive):
    """Residual-based adaptive estimation of the measurement noise over a fixed window.

    See `simnav.estimators.adaptations.innovation_based`, also for the parameters.
    """

    def __init__(
        self,
        window: int = 20,
        forgetting: float = 0.9,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: Scope = "fixes",
        **options: Any,
    ):
        super().__init__(
            InnovationBased(
                "residual",
                window,
                window,
                forgetting=forgetting,
                lowest=lowest,
                highest=highest,
                full=full,
                scope=scope,
            ),
            **options,
        )


@register("adkf")
class Adkf(_Adaptive):
    """Adaptive robust filter after paper 003: R or P over a factor that falls with a statistic of the innovation.

    See `simnav.estimators.adaptations.adkf`, also for the parameters.
    """

    def __init__(
        self,
        statistic: Statistic = "residual",
        factor: Factor = "three-segment",
        target: Literal["R", "P"] = "R",
        preset: Literal["default", "paper"] = "default",
        c0: float | None = None,
        c1: float | None = None,
        together: int = 3,
        **options: Any,
    ):
        super().__init__(AdaptiveFactor(statistic, factor, target, preset, c0, c1, together), **options)


@register("adkf-paper")
class AdkfPaper(_Adaptive):
    """Adaptive robust filter with the statistics and thresholds as paper 003 prints them.

    See `simnav.estimators.adaptations.adkf`, also for the parameters.
    """

    def __init__(
        self,
        statistic: Statistic = "residual",
        factor: Factor = "three-segment",
        target: Literal["R", "P"] = "R",
        **options: Any,
    ):
        super().__init__(AdaptiveFactor(statistic, factor, target, "paper"), **options)


@register("igg3")
class Igg3(_Adaptive):
    """IGG-III equivalent weights: full weight up to k0 sigma, almost none from k1 sigma on.

    See `simnav.estimators.adaptations.robust`.
    """

    def __init__(self, k0: float = 2.5, k1: float = 8.0, **options: Any):
        if not 0.0 < k0 < k1:
            raise ValueError(f"k0 = {k0:g} and k1 = {k1:g}: it must be 0 < k0 < k1")
        super().__init__(EquivalentWeights(lambda u: igg3(u, k0, k1)), **options)


@register("huber-kf")
class HuberKf(_Adaptive):
    """Huber's equivalent weights: an innovation beyond k sigma pulls no harder than one of k sigma.

    See `simnav.estimators.adaptations.robust`. Huber's k = 1.345 keeps 95 % of the efficiency for each component; it
    cost up to 8 % of RMSE on clean data.
    """

    def __init__(self, k: float = 2.0, **options: Any):
        if not k > 0.0:
            raise ValueError(f"k = {k:g}: it must be above 0")
        super().__init__(EquivalentWeights(lambda u: huber(u, k)), **options)


@register("gated-ekf")
class GatedEkf(_Adaptive):
    """Chi-square gating: measurements that fail the test are left out; a filter that fails for long is doubted.

    See `simnav.estimators.adaptations.gating`, also for the parameters.
    """

    def __init__(self, probability: float = 0.999, patience: float = 10.0, **options: Any):
        super().__init__(ChiSquareGate(probability, patience), **options)


@register("fading-ekf")
class FadingEkf(_Adaptive):
    """Fading memory: information loses weight with its age.

    See `simnav.estimators.adaptations.fading`, also for the parameters.
    """

    def __init__(self, memory: float = 1000.0, **options: Any):
        super().__init__(FadingMemory(memory), **options)


@register("vb-akf")
class VbAkf(_Adaptive):
    """Variational-Bayes adaptive filter: state and noise variances estimated together.

    See `simnav.estimators.adaptations.variational_bayes`, also for the parameters.
    """

    def __init__(
        self,
        forgetting: float = 0.96,
        prior: float = 10.0,
        iterations: int = 2,
        lowest: float = 1.0,
        highest: float = 30.0,
        scope: Scope = "fixes",
        **options: Any,
    ):
        super().__init__(VariationalBayes(forgetting, prior, iterations, lowest, highest, scope), **options)


@register("mckf")
class Mckf(_Adaptive):
    """Maximum correntropy Kalman filter: residuals weighted by a Gaussian kernel.

    See `simnav.estimators.adaptations.correntropy`, also for the parameters.
    """

    def __init__(
        self,
        bandwidth: float = 4.0,
        iterations: int = 5,
        begin: Literal["update", "prediction"] = "update",
        **options: Any,
    ):
        super().__init__(MaximumCorrentropy(bandwidth, iterations, begin=begin), **options)


@register("imm")
class Imm(ImmEstimator):
    """Interacting multiple models: the noise of each instrument jumps between levels.

    See `simnav.estimators.solvers.imm`, also for the parameters.
    """

    def __init__(self, levels: tuple[float, ...] = (1.0, 3.0, 10.0, 30.0), stay: float = 0.99, stay_high: float = 0.8):
        super().__init__(InertialModel(), levels, stay, stay_high)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU and another instrument, or what the ship model needs."""
        self.model = model_for(instruments, self.name)
        super().reset(start, instruments)
