"""The rows ``federated`` and ``federated-no-reset``: Carlson's federated filter over the inertial model."""

from __future__ import annotations

from simnav.estimator import register
from simnav.estimators.ekf import AidedInertial
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.federated import FederatedEstimator

__all__ = ["Federated", "FederatedNoReset"]


@register("federated")
class Federated(FederatedEstimator, AidedInertial):
    """Federated Kalman filter: a local filter for each aiding sensor, fused and reset when the slowest has delivered.

    The rival of paper 004 (`simnav.estimators.solvers.federated`); every measurement is used, at its own time, in its
    local filter.

    Parameters
    ----------
    fusion_period : float, optional
        Time between fusions [s]; 0 fuses after every measurement; none: the period of the slowest sensor.
    master_share : float
        Information that the master keeps for itself, in [0, 1).
    shares : tuple of float, optional
        Information shares of the aiding sensors in the scenario's order; with the master's they sum to 1. Empty: equal.
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    """

    resets = True

    def __init__(
        self,
        fusion_period: float | None = None,
        master_share: float = 0.0,
        shares: tuple[float, ...] = (),
        calibrate: bool = True,
    ):
        super().__init__(InertialModel(calibrate), None, fusion_period, self.resets, master_share, shares)


@register("federated-no-reset")
class FederatedNoReset(Federated):
    """Federated Kalman filter whose local filters are never told what the others saw.

    Its covariance is an upper bound, not the error's: conservative where the sensors differ
    (`simnav.estimators.solvers.federated`).

    Parameters
    ----------
    fusion_period, master_share, shares, calibrate
        As for ``federated``.
    """

    resets = False
