"""Fault of the IMU: a disturbance on specific force and angular rate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from simnav.recording import ImuLabels
from simnav.sensors.faults.fault import Effect, FaultSpec, Names, register_fault
from simnav.sensors.faults.layer import DISTURBS_IMU, FaultLayer
from simnav.sensors.instrument import ZERO, SigmaTriple, Triple
from simnav.spec import SpecError, quantity
from simnav.types import Array, ImuSamples

__all__ = ["ConstantDisturbance", "ImuDisturbance"]


@register_fault
class ImuDisturbance(FaultSpec):
    """A constant error and white noise on the IMU's output, for each body axis; one number sets all three axes.

    ``specific_force_noise`` and ``angular_rate_noise`` are the standard deviation of a sample.

    Attributes
    ----------
    specific_force, angular_rate : tuple
        Constant error of each axis [m/s^2, rad/s].
    specific_force_noise, angular_rate_noise : tuple
        Standard deviation of a sample of each axis [m/s^2, rad/s].
    """

    effect: ClassVar[Effect] = "imu"
    kind: Literal["imu_disturbance"] = "imu_disturbance"
    instruments: Names = ("imu",)
    specific_force: Triple = quantity("m_s2", ZERO)
    angular_rate: Triple = quantity("deg_s", ZERO)
    specific_force_noise: SigmaTriple = quantity("m_s2", ZERO)
    angular_rate_noise: SigmaTriple = quantity("deg_s", ZERO)

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.instruments != ("imu",):
            raise ValueError("an imu_disturbance is on 'imu' and nothing else")
        sizes = {"specific_force", "angular_rate", "specific_force_noise", "angular_rate_noise"}
        if not sizes & self.model_fields_set:
            raise ValueError(
                "an imu_disturbance needs specific_force_m_s2, angular_rate_deg_s, or one of their noises"
                " (specific_force_noise_m_s2, angular_rate_noise_deg_s)"
            )
        return self

    def touched(self, instruments: Mapping[str, str]) -> tuple[str, ...]:
        """The IMU."""
        return ("imu",)

    def check(self, instruments: Mapping[str, str], *, imu: bool = True) -> None:
        """See `FaultSpec.check`."""
        if not imu:
            raise SpecError(f"fault {self.kind!r}: the scenario has no IMU to disturb")

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _ImuDisturbance(self, index, seed, self.key_of_streams(index, occurrence))


class ConstantDisturbance(FaultLayer):
    """A constant error on the output of the IMU.

    Parameters
    ----------
    spec, index, seed, key
        See `FaultLayer`.
    constant : (6,) array
        Errors of angular rate [rad/s] and specific force [m/s^2].
    """

    operation = DISTURBS_IMU

    def __init__(self, spec: FaultSpec, index: int, seed: int, key: str, constant: Array):
        super().__init__(spec, index, seed, key)
        self._constant = constant

    def ahead_imu(self, time: Array) -> tuple[NDArray[np.bool_], Array]:
        """See `FaultLayer.ahead_imu`."""
        active, error = np.zeros(len(time), np.bool_), np.zeros((len(time), 6))
        found = self.activity.locate(time)
        if found is not None:
            rows = found[0]
            active[rows] = True
            error[rows] = self._error(len(rows))
        return active, error

    def _error(self, n: int) -> Array:
        return self._constant[None].repeat(n, axis=0)

    def apply_imu(self, samples: ImuSamples, labels: ImuLabels | None) -> tuple[ImuSamples, ImuLabels | None]:
        """See `FaultLayer.apply_imu`."""
        n = len(samples)
        if labels is None:
            labels = ImuLabels(np.zeros(n, np.uint32), np.zeros((n, 6)))
        found = self.activity.locate(samples.time)
        if found is None:
            return samples, labels
        rows, interval = found
        error = self._error(len(rows))
        angular_rate, specific_force = samples.angular_rate.copy(), samples.specific_force.copy()
        angular_rate[rows] += error[:, :3]
        specific_force[rows] += error[:, 3:]
        faults, fault_error = labels.faults.copy(), labels.fault_error.copy()
        faults[rows] |= self.bits(interval)
        fault_error[rows] += error
        return (
            ImuSamples(samples.time, samples.interval, angular_rate, specific_force),
            ImuLabels(faults, fault_error),
        )


class _ImuDisturbance(ConstantDisturbance):
    def __init__(self, spec: ImuDisturbance, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key, np.array(spec.angular_rate + spec.specific_force))
        self._sigma = np.array(spec.angular_rate_noise + spec.specific_force_noise)
        self._noise = self.rng("noise")

    def _error(self, n: int) -> Array:
        error = super()._error(n)
        if self._sigma.any():
            error += self._sigma * self._noise.standard_normal(error.shape)
        return error
