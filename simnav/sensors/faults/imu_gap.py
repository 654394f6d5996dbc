"""Fault of the IMU: its samples stop for a moment, and the last one is delivered again in their place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from simnav.recording import ImuLabels
from simnav.sensors.faults.fault import Effect, FaultSpec, Names, register_fault
from simnav.sensors.faults.layer import FaultLayer
from simnav.spec import SpecError
from simnav.types import Array, ImuSamples

__all__ = ["ImuGap"]


@register_fault
class ImuGap(FaultSpec):
    """The samples of the IMU are missing, and its last sample before the interval is repeated in their place.

    A driver that has to deliver a sample at each time does this when samples are lost on their way. If there is no
    sample before the interval, the first one within it is repeated.
    """

    effect: ClassVar[Effect] = "imu"
    kind: Literal["imu_gap"] = "imu_gap"
    instruments: Names = ("imu",)

    @model_validator(mode="after")
    def _imu_only(self) -> Self:
        if self.instruments != ("imu",):
            raise ValueError("an imu_gap is on 'imu' and nothing else; other instruments have 'outage' and 'frozen'")
        return self

    def touched(self, instruments: Mapping[str, str]) -> tuple[str, ...]:
        """The IMU."""
        return ("imu",)

    def check(self, instruments: Mapping[str, str], *, imu: bool = True) -> None:
        """See `FaultSpec.check`."""
        if not imu:
            raise SpecError(f"fault {self.kind!r}: the scenario has no IMU whose samples could be missing")

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _ImuGap(self, index, seed, self.key_of_streams(index, occurrence))


class _ImuGap(FaultLayer):
    def __init__(self, spec: ImuGap, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key)
        self._last: Array | None = None
        self._held: tuple[int, Array] | None = None

    def apply_imu(self, samples: ImuSamples, labels: ImuLabels | None) -> tuple[ImuSamples, ImuLabels | None]:
        """See `FaultLayer.apply_imu`."""
        n = len(samples)
        if labels is None:
            labels = ImuLabels(np.zeros(n, np.uint32), np.zeros((n, 6)))
        if n == 0:
            return samples, labels
        value = np.hstack([samples.angular_rate, samples.specific_force])
        before, self._last = self._last, value[-1].copy()
        found = self.activity.locate(samples.time)
        if found is None:
            return samples, labels
        rows, interval = found
        repeated = value.copy()
        for number in np.unique(interval).tolist():
            here = rows[interval == number]
            if self._held is None or self._held[0] != number:
                first = int(here[0])
                last = value[first - 1] if first > 0 else before
                self._held = number, (value[first] if last is None else last).copy()
            repeated[here] = self._held[1]
        faults, fault_error = labels.faults.copy(), labels.fault_error + (repeated - value)
        faults[rows] |= self.bits(interval)
        return (
            ImuSamples(samples.time, samples.interval, repeated[:, :3].copy(), repeated[:, 3:].copy()),
            ImuLabels(faults, fault_error),
        )
