"""The rows of the sliding window over the inertial model: plain, and with a noise estimated from the innovations."""

from __future__ import annotations

from estimators.adaptations.base import Adaptation
from estimators.adaptations.weighting import Weighting
from estimators.models.inertial import InertialModel
from estimators.models.inertial_chain import InertialChain
from estimators.solvers.window import WindowEstimator
from simnav.estimator import UnsuitableScenario, register
from simnav.types import InitialState, Instruments

__all__ = ["InertialWindow", "SwFgo"]


class InertialWindow(WindowEstimator):
    """What rows over the inertial model share: they need an IMU and something to aid it.

    Parameters
    ----------
    front : InertialModel
    adaptation, weighting, window, tolerance, iterations, every_sample
        As for `WindowEstimator`.
    """

    def __init__(
        self,
        front: InertialModel,
        adaptation: Adaptation | None = None,
        weighting: Weighting | None = None,
        window: int | None = 20,
        tolerance: float = 1e-3,
        iterations: int = 10,
        every_sample: bool = False,
    ):
        super().__init__(InertialChain(front), adaptation, weighting, window, tolerance, iterations, every_sample)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU and at least one aiding instrument."""
        if instruments.imu is None or not instruments:
            lacks = "an IMU" if instruments.imu is None else "an instrument beside the IMU"
            raise UnsuitableScenario(f"it needs an IMU and at least one other instrument; there is not {lacks}")
        super().reset(start, instruments)


@register("sw-fgo", aliases=("fgo", "fgo-simplified"))
class SwFgo(InertialWindow):
    """Sliding-window factor graph: preintegrated IMU factors, every measurement with its nominal noise.

    SW-FGO of paper 000, FGO of paper 001, and the simplified graph of paper 004 (a node per measurement, one equivalent
    IMU factor between).

    Parameters
    ----------
    window : int
        Epochs in the window (steps that bring measurements).
    tolerance : float
        Largest component of a step, in its sigmas, at which the nodes have converged.
    iterations : int
        Most Gauss-Newton steps an epoch.
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    """

    def __init__(self, window: int = 20, tolerance: float = 1e-3, iterations: int = 10, calibrate: bool = True):
        super().__init__(InertialModel(calibrate), window=window, tolerance=tolerance, iterations=iterations)
