"""The model that suits the instruments of a vessel."""

from __future__ import annotations

from typing import Protocol

from simnav.estimator.needs import AID, IMU, Needs
from simnav.types import Instruments

from .base import ErrorModel
from .inertial import InertialModel
from .ship import ShipModel

__all__ = ["ModelChoice", "Suitable"]


class ModelChoice(Protocol):
    """What a solver is given for a model: a model, or what chooses one when a run begins."""

    @property
    def needs(self) -> Needs:
        """The instruments without which it cannot work, as of `simnav.estimator.Estimator.needs`."""

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """The model for a set of instruments; UnsuitableScenario, in the name of an estimator, where none will do."""


class Suitable:
    """The inertial model where there is an IMU, else the ship model."""

    @property
    def needs(self) -> Needs:
        """What both need together: with an IMU anything beside it, otherwise what the ship model needs."""
        return (AID, *((IMU, *kinds) for kinds in ShipModel().needs))

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """A new model; UnsuitableScenario where neither will do."""
        model = ShipModel() if instruments.imu is None else InertialModel()
        return model.choose(instruments, name)
