"""Faults inside an IMU: what they have in common, a step of the biases, and a range that is too small (clipping)."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from math import inf
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from simnav.recording import ImuLabels
from simnav.sensors.faults.fault import Effect, FaultSpec, Names, register_fault
from simnav.sensors.faults.imu_disturbance import ConstantDisturbance
from simnav.sensors.faults.layer import FaultLayer
from simnav.sensors.instrument import ZERO, Triple
from simnav.spec import Positive, SpecError, quantity
from simnav.types import Array, ImuSamples

__all__ = ["AddedErrors", "ImuBiasStep", "ImuClipping", "ImuFaultSpec", "ReplacedSamples"]


class ImuFaultSpec(FaultSpec):
    """Base of the faults of an IMU."""

    effect: ClassVar[Effect] = "imu"
    instruments: Names = ("imu",)

    @model_validator(mode="after")
    def _only_the_imu(self) -> Self:
        if self.instruments != ("imu",):
            raise ValueError(f"an {self.kind} is on 'imu' and nothing else")
        return self

    def touched(self, instruments: Mapping[str, str]) -> tuple[str, ...]:
        """The IMU."""
        return ("imu",)

    def check(self, instruments: Mapping[str, str], *, imu: bool = True) -> None:
        """See `FaultSpec.check`."""
        if not imu:
            raise SpecError(f"fault {self.kind!r}: the scenario has no IMU")


@register_fault
class ImuBiasStep(ImuFaultSpec):
    """The biases of the IMU change at the start, in the units of datasheets; one number sets all three axes.

    Attributes
    ----------
    angular_rate, specific_force : tuple
        Change of the bias of each axis [rad/s, m/s^2].
    """

    kind: Literal["imu_bias_step"] = "imu_bias_step"
    angular_rate: Triple = quantity("deg_h", ZERO, also=("deg_s",))
    specific_force: Triple = quantity("ug", ZERO, also=("mg", "m_s2"))

    @model_validator(mode="after")
    def _something(self) -> Self:
        if not {"angular_rate", "specific_force"} & self.model_fields_set:
            raise ValueError("an imu_bias_step needs angular_rate_deg_h or specific_force_ug")
        return self

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        size = np.array(self.angular_rate + self.specific_force)
        return ConstantDisturbance(self, index, seed, self.key_of_streams(index, occurrence), size)


@register_fault
class ImuClipping(ImuFaultSpec):
    """The output of the IMU saturates at smaller values than its range.

    Attributes
    ----------
    angular_rate_limit, specific_force_limit : float
        Size at which the output saturates [rad/s, m/s^2].
    """

    kind: Literal["imu_clipping"] = "imu_clipping"
    angular_rate_limit: Positive = quantity("deg_s", inf)
    specific_force_limit: Positive = quantity("g", inf, also=("m_s2",))

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.angular_rate_limit == self.specific_force_limit == inf:
            raise ValueError("an imu_clipping needs angular_rate_limit_deg_s or specific_force_limit_g")
        return self

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        limits = np.repeat([self.angular_rate_limit, self.specific_force_limit], 3)
        return _Clipping(self, index, seed, self.key_of_streams(index, occurrence), limits)


class ReplacedSamples(FaultLayer):
    """A layer that replaces samples of the IMU. Only samples that change are labelled."""

    def apply_imu(self, samples: ImuSamples, labels: ImuLabels | None) -> tuple[ImuSamples, ImuLabels | None]:
        """See `FaultLayer.apply_imu`."""
        n = len(samples)
        if labels is None:
            labels = ImuLabels(np.zeros(n, np.uint32), np.zeros((n, 6)))
        found = self.activity.locate(samples.time)
        value = np.hstack([samples.angular_rate, samples.specific_force])
        if found is None:
            self.seen(value)
            return samples, labels
        rows, interval = found
        changed = self.replaced(samples, value, rows, interval)
        self.seen(value)
        error = changed - value[rows]
        touched = np.any(error != 0.0, axis=1)
        value[rows] = changed
        faults, fault_error = labels.faults.copy(), labels.fault_error.copy()
        faults[rows[touched]] |= self.bits(interval[touched])
        fault_error[rows] += error
        angular_rate, specific_force = np.ascontiguousarray(value[:, :3]), np.ascontiguousarray(value[:, 3:])
        return ImuSamples(samples.time, samples.interval, angular_rate, specific_force), ImuLabels(faults, fault_error)

    @abstractmethod
    def replaced(self, samples: ImuSamples, value: Array, rows: NDArray[np.intp], interval: NDArray[np.intp]) -> Array:
        """The (m, 6) values in place of those of some rows.

        Parameters
        ----------
        samples : ImuSamples
            All samples of the block, before this fault.
        value : (n, 6) array
            Their angular rate and specific force.
        rows, interval : (m,) int arrays
            The rows within an interval, and the number of the interval of each.
        """

    def seen(self, value: Array) -> None:
        """Keep what the next block needs of this one, before this fault."""
        del value


class AddedErrors(ReplacedSamples):
    """A layer that adds an error to each sample, which depends on the time since the start of the interval."""

    def replaced(self, samples: ImuSamples, value: Array, rows: NDArray[np.intp], interval: NDArray[np.intp]) -> Array:
        """See `ReplacedSamples.replaced`."""
        changed: Array = value[rows] + self.errors(
            samples.time[rows] - self.activity.starts[interval], samples.interval[rows]
        )
        return changed

    @abstractmethod
    def errors(self, since: Array, length: Array) -> Array:
        """The (m, 6) errors of samples.

        Parameters
        ----------
        since, length : (m,) array
            From the start of the interval of the fault to the end of each sample, and the length of the sample [s].
        """


class _Clipping(ReplacedSamples):
    def __init__(self, spec: FaultSpec, index: int, seed: int, key: str, limits: Array):
        super().__init__(spec, index, seed, key)
        self._limits = limits

    def replaced(self, samples: ImuSamples, value: Array, rows: NDArray[np.intp], interval: NDArray[np.intp]) -> Array:
        return np.clip(value[rows], -self._limits, self._limits)
