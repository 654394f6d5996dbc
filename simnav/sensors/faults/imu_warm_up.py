"""Fault of the IMU: biases that move away while it warms up."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from simnav.sensors.faults.fault import register_fault
from simnav.sensors.faults.imu_faults import AddedErrors, ImuFaultSpec
from simnav.sensors.faults.layer import FaultLayer
from simnav.sensors.instrument import ZERO, Triple
from simnav.spec import Positive, quantity
from simnav.types import Array

__all__ = ["ImuWarmUp"]


@register_fault
class ImuWarmUp(ImuFaultSpec):
    """The biases of the IMU move by ``size (1 - exp(-(t - start) / time))``, as does the temperature.

    In each of several intervals it begins anew. One number sets all three axes.

    Attributes
    ----------
    time : float
        Time constant [s].
    angular_rate, specific_force : tuple
        Change of the bias of each axis in the end [rad/s, m/s^2].
    """

    kind: Literal["imu_warm_up"] = "imu_warm_up"
    time: Positive = quantity("s")
    angular_rate: Triple = quantity("deg_h", ZERO, also=("deg_s",))
    specific_force: Triple = quantity("ug", ZERO, also=("mg", "m_s2"))

    @model_validator(mode="after")
    def _something(self) -> Self:
        if not {"angular_rate", "specific_force"} & self.model_fields_set:
            raise ValueError("an imu_warm_up needs angular_rate_deg_h or specific_force_ug")
        return self

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _WarmUp(self, index, seed, self.key_of_streams(index, occurrence))


class _WarmUp(AddedErrors):
    def __init__(self, spec: ImuWarmUp, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key)
        self._constant, self._size = spec.time, np.array(spec.angular_rate + spec.specific_force)

    def errors(self, since: Array, length: Array) -> Array:
        risen: Array = -np.expm1(-since / self._constant)
        return np.outer(risen, self._size)
