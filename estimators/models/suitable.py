"""Which model suits the instruments of a vessel, and what a row says where none does."""

from __future__ import annotations

from simnav.estimator import UnsuitableScenario
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.ship import ShipModel, require_ship_aids
from simnav.types import Instruments

__all__ = ["model_for", "require_inertial_aids"]


def require_inertial_aids(instruments: Instruments, name: str) -> None:
    """UnsuitableScenario, in the name of an estimator, without an IMU or without anything to aid it."""
    if instruments.imu is None:
        raise UnsuitableScenario(f"{name} needs an IMU and at least one other instrument; there is not an IMU")
    if not instruments:
        raise UnsuitableScenario(
            f"{name} needs an IMU and at least one other instrument; there is not an instrument beside the IMU"
        )


def model_for(instruments: Instruments, name: str) -> InertialModel | ShipModel:
    """The inertial model where there is an IMU, else the ship model; UnsuitableScenario where neither will do."""
    if instruments.imu is not None:
        require_inertial_aids(instruments, name)
        return InertialModel()
    require_ship_aids(instruments, name)
    return ShipModel()
