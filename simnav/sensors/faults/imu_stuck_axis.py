"""Fault of the IMU: axes that are stuck at a value."""

from __future__ import annotations

from typing import Literal

from pydantic import field_validator

from simnav.sensors.faults.fault import Names, register_fault
from simnav.sensors.faults.imu_dropout import HeldSamples
from simnav.sensors.faults.imu_faults import ImuFaultSpec
from simnav.sensors.faults.layer import FaultLayer
from simnav.spec import closest

__all__ = ["IMU_AXES", "ImuStuckAxis"]

#: The axes of an IMU in the order of its output: gyroscopes and accelerometers, forward, starboard and down.
IMU_AXES = tuple(f"{triad}_{axis}" for triad in ("gyroscope", "accelerometer") for axis in "xyz")


@register_fault
class ImuStuckAxis(ImuFaultSpec):
    """Some axes of the IMU repeat their last value before the interval; the others go on.

    Attributes
    ----------
    axes : tuple of str
        Which ones, of `IMU_AXES`.
    """

    kind: Literal["imu_stuck_axis"] = "imu_stuck_axis"
    axes: Names

    @field_validator("axes")
    @classmethod
    def _known(cls, axes: tuple[str, ...]) -> tuple[str, ...]:
        for axis in axes:
            if axis not in IMU_AXES:
                raise ValueError(f"an IMU has no axis {axis!r}{closest(axis, IMU_AXES)}; it has {', '.join(IMU_AXES)}")
        if not axes:
            raise ValueError(f"should name at least one of {', '.join(IMU_AXES)}")
        return axes

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        columns = tuple(IMU_AXES.index(axis) for axis in self.axes)
        return HeldSamples(self, index, seed, self.key_of_streams(index, occurrence), columns)
