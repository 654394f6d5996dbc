"""Robust rows of the sliding window: each is ``sw-fgo`` with one weighting of its factors, and paper 000's presets."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from simnav.estimator import register
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.sliding_window import AidedWindow, InertialWindow
from simnav.estimators.weightings.base import Weighting
from simnav.estimators.weightings.dynamic_covariance_scaling import DynamicCovarianceScaling
from simnav.estimators.weightings.gradient_adaptive import GradientAdaptive, Shape
from simnav.estimators.weightings.graduated_non_convexity import GraduatedNonConvexity
from simnav.estimators.weightings.m_estimators import MEstimator, cauchy, constants, geman_mcclure, huber, tukey
from simnav.estimators.weightings.max_mixture import MaxMixture
from simnav.estimators.weightings.switchable_constraints import SwitchableConstraints
from simnav.types import Array

__all__ = [
    "CauchyFgo",
    "DcsFgo",
    "GaFgo",
    "GaFgoPaper",
    "GmFgo",
    "GncFgo",
    "HuberFgo",
    "MaxMixtureFgo",
    "SwFgoPaper",
    "SwitchableFgo",
    "TukeyFgo",
]


class _Robust(AidedWindow):
    """A window with a weighting, over the inertial model or, without an IMU, the ship model."""

    def __init__(self, weighting: Weighting, *, tolerance: float = 0.05, **options: Any):
        super().__init__(weighting=weighting, tolerance=tolerance, **options)


class _MEstimation(_Robust):
    """An M-estimator (`simnav.estimators.weightings.m_estimators`).

    Parameters
    ----------
    efficiency : float
        On Gaussian noise; the function's constant follows, for each number of components.
    smallest : float
        Least weight (`simnav.estimators.weightings.robust_weighting`).
    window, tolerance, iterations
        As for ``sw-fgo``.
    """

    function: ClassVar[staticmethod[[Array], Array]]

    def __init__(self, efficiency: float = 0.95, smallest: float = 1e-3, **options: Any):
        super().__init__(MEstimator(self.function, constants(self.function, efficiency), smallest), **options)


@register("huber-fgo")
class HuberFgo(_MEstimation):
    """Sliding window with Huber's weights: a residual beyond c sigma pulls no harder than one of c sigma."""

    function = staticmethod(huber)


@register("tukey-fgo")
class TukeyFgo(_MEstimation):
    """Sliding window with Tukey's biweight: a residual beyond c sigma counts for next to nothing."""

    function = staticmethod(tukey)


@register("cauchy-fgo")
class CauchyFgo(_MEstimation):
    """Sliding window with Cauchy's weights, which fall with the square of the residual."""

    function = staticmethod(cauchy)


@register("gm-fgo")
class GmFgo(_MEstimation):
    """Sliding window with Geman and McClure's weights, which fall with the fourth power of the residual."""

    function = staticmethod(geman_mcclure)


@register("dcs-fgo")
class DcsFgo(_Robust):
    """Sliding window with dynamic covariance scaling.

    See `simnav.estimators.weightings.dynamic_covariance_scaling`, and ``sw-fgo`` for the other parameters.
    """

    def __init__(
        self,
        phi: float = 0.0,
        efficiency: float = 0.95,
        smallest: float = 1e-3,
        **options: Any,
    ):
        super().__init__(DynamicCovarianceScaling(phi, efficiency, smallest), **options)


@register("switchable-fgo")
class SwitchableFgo(_Robust):
    """Sliding window with switchable constraints, the switches eliminated in closed form.

    See `simnav.estimators.weightings.switchable_constraints`, and ``sw-fgo`` for the other parameters.
    """

    def __init__(
        self,
        sigma: float = 0.3,
        smallest: float = 1e-3,
        **options: Any,
    ):
        super().__init__(SwitchableConstraints(sigma, smallest), **options)


@register("gnc-fgo")
class GncFgo(_Robust):
    """Sliding window with graduated non-convexity: after an outlier the robust cost begins convex and hardens.

    See `simnav.estimators.weightings.graduated_non_convexity`, and ``sw-fgo`` for the other parameters.
    """

    def __init__(
        self,
        cost: Literal["tls", "gm"] = "tls",
        growth: float = 3.0,
        efficiency: float = 0.95,
        smallest: float = 1e-3,
        *,
        iterations: int = 15,
        **options: Any,
    ):
        super().__init__(GraduatedNonConvexity(cost, growth, efficiency, smallest), iterations=iterations, **options)


@register("max-mixture-fgo")
class MaxMixtureFgo(_Robust):
    """Sliding window in which each measurement is of the nominal or of a wide noise, whichever is the more probable.

    See `simnav.estimators.weightings.max_mixture`, and ``sw-fgo`` for the other parameters.
    """

    def __init__(
        self,
        spread: float = 10.0,
        probability: float = 0.05,
        **options: Any,
    ):
        super().__init__(MaxMixture(spread, probability), **options)


@register("ga-fgo")
class GaFgo(_Robust):
    """Gradient-adaptive factor graph after paper 000, its residuals whitened and its scales consistent.

    See `simnav.estimators.weightings.gradient_adaptive`, and ``sw-fgo`` for the other parameters.
    """

    def __init__(
        self,
        gnss: Shape = (3.0, 1.5, 0.5),
        motion: Shape = (2.0, 1.0, 0.3),
        other: Shape = (2.0, 2.0, 0.3),
        epsilon: float = 0.1,
        **options: Any,
    ):
        super().__init__(GradientAdaptive("default", gnss, motion, other, epsilon), **options)


class _Paper(InertialWindow):
    """A window of paper 000's 9-state model.

    Parameters
    ----------
    sigma_position, sigma_velocity, sigma_attitude_deg : float
        Of one second of motion [m], [m/s], [deg].
    sigma_gnss_horizontal, sigma_gnss_vertical : float
        Of a GNSS position [m]; 0 for the datasheet's.
    sigma_dvl : float
        Of a DVL velocity [m/s]; 0 for the datasheet's.
    window, tolerance, iterations
        As for ``sw-fgo``.
    """

    def __init__(
        self,
        sigma_position: float = 0.01,
        sigma_velocity: float = 0.02,
        sigma_attitude_deg: float = 0.01,
        sigma_gnss_horizontal: float = 2.5,
        sigma_gnss_vertical: float = 5.0,
        sigma_dvl: float = 0.1,
        *,
        tolerance: float = 1e-6,
        **options: Any,
    ):
        front = NineStateModel(
            sigma_position, sigma_velocity, sigma_attitude_deg,
            sigma_gnss_horizontal, sigma_gnss_vertical, sigma_dvl,
        )  # fmt: skip
        super().__init__(front, weighting=self._weighting(), tolerance=tolerance, **options)

    def _weighting(self) -> Weighting | None:
        """None: every factor counts in full."""
        return None


@register("sw-fgo-paper")
class SwFgoPaper(_Paper):
    """Sliding-window factor graph as paper 000 has it: 9 states, fixed sigmas, no biases.

    See `simnav.estimators.models.nine_state` for what is settled of the print, and how; and ``ekf-9`` for the sigmas.
    """


@register("ga-fgo-paper")
class GaFgoPaper(_Paper):
    """Gradient-adaptive factor graph as paper 000 prints it: 9 states, fixed sigmas, unwhitened norms and their scale.

    See `simnav.estimators.models.nine_state`, and `simnav.estimators.weightings.gradient_adaptive` for the preset
    "paper".
    """

    def _weighting(self) -> Weighting:
        return GradientAdaptive("paper")
