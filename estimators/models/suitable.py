"""The model that suits the instruments of a vessel."""

from __future__ import annotations

from typing import Protocol

from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import AID, IMU, Needs, lacking
from simnav.types import KINDS, Instruments

from .base import ErrorModel
from .inertial import InertialModel
from .ship import ShipModel

__all__ = ["ModelChoice", "Suitable", "WithMessages"]


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


class WithMessages(Suitable):
    """The model of `Suitable`, where there are messages of other vessels (`simnav.kinds.Kind.message_noise`)."""

    @property
    def needs(self) -> Needs:
        """Those of `Suitable`, and an instrument with messages."""
        return (*super().needs, self._messages)

    @property
    def _messages(self) -> tuple[str, ...]:
        return tuple(name for name, kind in KINDS.items() if kind.message_noise is not None)

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """A new model; UnsuitableScenario where there is no message, or neither model will do."""
        if lack := lacking((self._messages,), instruments):
            raise UnsuitableScenario(f"{name}: {lack}")
        return super().choose(instruments, name)
