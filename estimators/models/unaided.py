"""The inertial model of a vessel that looks at no other instrument."""

from __future__ import annotations

from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import IMU, Needs
from simnav.types import Datasheet, Instruments

from .base import ErrorModel
from .inertial import InertialModel

__all__ = ["UnaidedModel"]


class UnaidedModel(InertialModel):
    """The inertial model, blind to every aid."""

    unaided = True

    def __init__(self) -> None:
        super().__init__()

    @property
    def needs(self) -> Needs:
        """An IMU."""
        return (IMU,)

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """Itself; UnsuitableScenario without an IMU."""
        if instruments.imu is None:
            raise UnsuitableScenario("pure inertial navigation needs an IMU; there is none")
        return self

    def observes(self, instrument: Datasheet) -> bool:
        """None of them."""
        return False
