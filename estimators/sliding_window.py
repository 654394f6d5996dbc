"""Rows of the graph over the inertial model: sliding and full, and with a noise estimated from the innovations."""

from __future__ import annotations

from typing import Any

from simnav.estimator import register
from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.adaptations.innovation_based import InnovationBased
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_chain import InertialChain
from simnav.estimators.models.ship_chain import ShipChain
from simnav.estimators.models.suitable import model_for, require_inertial_aids
from simnav.estimators.solvers.full_graph import FullGraph
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.base import Weighting
from simnav.types import InitialState, Instruments

__all__ = ["AidedWindow", "FgoFull", "FgoUnsimplified", "IaeFgo", "IaeFgoFixed", "InertialWindow", "SwFgo"]


class InertialWindow(WindowEstimator):
    """What rows over the inertial model share: they need an IMU and something to aid it.

    Parameters
    ----------
    front : InertialModel
    adaptation, weighting, window, tolerance, iterations
        As for `WindowEstimator`.
    """

    def __init__(
        self,
        front: InertialModel,
        adaptation: Adaptation | None = None,
        weighting: Weighting | None = None,
        **options: Any,
    ):
        super().__init__(InertialChain(front), adaptation, weighting, **options)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU and at least one aiding instrument."""
        require_inertial_aids(instruments, self.name)
        super().reset(start, instruments)


class AidedWindow(WindowEstimator):
    """What adaptive and robust rows share: the inertial model where there is an IMU, else the ship model.

    So each is ``sw-fgo`` or ``ship-fgo`` but for its adaptation or weighting.

    Parameters
    ----------
    adaptation, weighting, window, tolerance, iterations
        As for `WindowEstimator`.
    """

    def __init__(self, adaptation: Adaptation | None = None, weighting: Weighting | None = None, **options: Any):
        super().__init__(InertialChain(InertialModel()), adaptation, weighting, **options)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU and another instrument, or what the ship model needs."""
        model = model_for(instruments, self.name)
        self.chain = InertialChain(model) if isinstance(model, InertialModel) else ShipChain(model)
        super().reset(start, instruments)


@register("sw-fgo", aliases=("fgo", "fgo-simplified"))
class SwFgo(InertialWindow):
    """Sliding-window factor graph: preintegrated IMU factors, every measurement with its nominal noise.

    SW-FGO of paper 000, FGO of paper 001, and the simplified graph of paper 004 (a node per measurement, one equivalent
    IMU factor between).

    Parameters
    ----------
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    window : int
        Epochs in the window (steps that bring measurements).
    tolerance : float
        Largest component of a step, in its sigmas, at which the nodes have converged.
    iterations : int
        Most Gauss-Newton steps an epoch.
    """

    def __init__(self, calibrate: bool = True, **options: Any):
        super().__init__(InertialModel(calibrate), **options)


@register("fgo-unsimplified")
class FgoUnsimplified(SwFgo):
    """The sliding window with a node for every IMU sample: paper 004's graph without the equivalent IMU factor.

    The same estimate as ``sw-fgo`` at many times its cost, which is what it is for. A shorter window keeps that
    bearable: 5 epochs are 500 nodes and more.

    Parameters
    ----------
    window, calibrate, tolerance, iterations
        As for `SwFgo`.
    """

    slow = True
    every_sample = True

    def __init__(self, window: int = 5, calibrate: bool = True, **options: Any):
        super().__init__(calibrate, window=window, **options)


@register("fgo-full")
class FgoFull(FullGraph, InertialWindow):
    """The full graph: every step estimates the whole trajectory; after the run, the batch solution is its smoother.

    Parameters
    ----------
    calibrate, tolerance, iterations
        As for `SwFgo`.
    """

    slow = True

    def __init__(self, calibrate: bool = True, **options: Any):
        super().__init__(InertialModel(calibrate), **options)


@register("iae-fgo")
class IaeFgo(AidedWindow):
    """The sliding window with innovation-based estimation of the measurement noise, window after paper 001, eqs. 16-20.

    Parameters
    ----------
    shortest, longest, low, high, forgetting, lowest, highest
        Of the estimation (`simnav.estimators.adaptations.innovation_based`).
    window, tolerance, iterations
        As for `SwFgo`.
    """

    def __init__(
        self,
        shortest: int = 10,
        longest: int = 20,
        low: float = 2.0,
        high: float = 5.0,
        forgetting: float = 0.9,
        lowest: float = 1.0,
        highest: float = 30.0,
        **options: Any,
    ):
        noise = InnovationBased("innovation", shortest, longest, low, high, forgetting, lowest=lowest, highest=highest)
        super().__init__(noise, **options)


@register("iae-fgo-fixed")
class IaeFgoFixed(AidedWindow):
    """The sliding window with innovation-based estimation of the measurement noise over a fixed number of innovations.

    IAE-FGO-Fix of paper 001.

    Parameters
    ----------
    innovations : int
        M of eq. 17.
    forgetting, lowest, highest
        Of the estimation (`simnav.estimators.adaptations.innovation_based`).
    window, tolerance, iterations
        As for `SwFgo`.
    """

    def __init__(
        self,
        innovations: int = 20,
        forgetting: float = 0.9,
        lowest: float = 1.0,
        highest: float = 30.0,
        **options: Any,
    ):
        noise = InnovationBased(
            "innovation", innovations, innovations, forgetting=forgetting, lowest=lowest, highest=highest
        )
        super().__init__(noise, **options)
