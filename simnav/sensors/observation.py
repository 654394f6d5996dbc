"""The readings of the instruments of simnav without bias and noise, as one kernel.

The block form (`Instrument.sense`) and the stepwise form (`simnav.simulation.steps`) call the same code, so that they
agree bit for bit.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import helper, kernel
from simnav.geometry.earth import ECCENTRICITY_SQUARED, ROTATION_RATE, SEMI_MAJOR_AXIS, displace_scalar
from simnav.kernel_types import FlagVector, Matrix, Vector
from simnav.sensors.instrument import AidSpec, Instrument
from simnav.structures import length, structure
from simnav.true_state import TRUE_STATE
from simnav.types import Array, TapStates

__all__ = [
    "BODY_VELOCITY",
    "COMPASS",
    "DEPTH",
    "GYROCOMPASS",
    "HORIZONTAL_POSITION",
    "INSTRUMENT",
    "NUMBERS",
    "POSITION",
    "VELOCITY",
    "WATER_SPEED",
    "CompiledInstrument",
    "noise_scalar",
    "observe_one",
    "observe_rows",
]

#: Codes of the observed quantities.
POSITION, HORIZONTAL_POSITION, VELOCITY, BODY_VELOCITY, WATER_SPEED, COMPASS, GYROCOMPASS, DEPTH = range(8)

#: The parameters of an instrument. Scale-factor error [-]; lever arm [m], and 1 if it is not zero. For a DVL the matrix
#: from body axes to its own; for a compass the two coefficients of its deviation [rad], and 1 if they are not zero; for
#: a gyrocompass 1 if it has a speed error. Depth of the water, NaN if it is unknown, smallest and largest altitude with
#: bottom lock [m]. Standard deviation and variance of the white noise by component, and the square of the
#: speed-dependent noise.
INSTRUMENT = structure(
    scale=float, lever_arm=3, has_lever_arm=int, axes=(3, 3), deviation=2, has_deviation=int, has_speed_error=int,
    water_depth=float, lowest=float, highest=float, sigma=3, variance=3, speed_variance=float,
)  # fmt: skip
#: Length of an array that holds it.
NUMBERS = length(INSTRUMENT)


@helper
def _to_ned(roll: float, pitch: float, yaw: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Turn one vector from body axes to north-east-down, as `simnav.sensors.instrument.turn_to_ned`."""
    sr, cr, sp, cp, sy, cy = sin(roll), cos(roll), sin(pitch), cos(pitch), sin(yaw), cos(yaw)
    y, z = cr * y - sr * z, sr * y + cr * z
    x, z = cp * x + sp * z, cp * z - sp * x
    return cy * x - sy * y, sy * x + cy * y, z


@helper
def _to_body(roll: float, pitch: float, yaw: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Turn one vector from north-east-down to body axes, as `simnav.sensors.instrument.turn_to_body`."""
    sr, cr, sp, cp, sy, cy = sin(roll), cos(roll), sin(pitch), cos(pitch), sin(yaw), cos(yaw)
    x, y = cy * x + sy * y, cy * y - sy * x
    x, z = cp * x - sp * z, sp * x + cp * z
    return x, cr * y + sr * z, cr * z - sr * y


@helper
def observe_one(code: int, q: Array, tap: Array, value: Array) -> bool:
    """Compute one reading without bias and noise.

    Parameters
    ----------
    code : int
        Code of the observed quantity (the constants of this module).
    q : (n,) array
        The `INSTRUMENT`.
    tap : (15,) array
        True state (`simnav.true_state.TRUE_STATE`).
    value : (d,) array
        The reading, overwritten.

    Returns
    -------
    bool
        True if the instrument delivers a measurement at this state.
    """
    own, at = q.view(INSTRUMENT)[0], tap.view(TRUE_STATE)[0]
    position, velocity, water = at.position, at.velocity, at.water
    roll, pitch, yaw = at.attitude[0], at.attitude[1], at.attitude[2]
    arm, rate, water_depth = own.lever_arm, at.angular_rate, own.water_depth
    has_lever_arm = own.has_lever_arm > 0
    n, e, d = 0.0, 0.0, 0.0
    if has_lever_arm and (code <= HORIZONTAL_POSITION or code == DEPTH or water_depth == water_depth):
        n, e, d = _to_ned(roll, pitch, yaw, arm[0], arm[1], arm[2])
    wx = rate[1] * arm[2] - rate[2] * arm[1]
    wy = rate[2] * arm[0] - rate[0] * arm[2]
    wz = rate[0] * arm[1] - rate[1] * arm[0]
    if code <= HORIZONTAL_POSITION:
        latitude, longitude, height = position[0], position[1], position[2]
        if has_lever_arm:
            latitude, longitude, height = displace_scalar(latitude, longitude, height, n, e, d)
        value[0], value[1] = latitude, longitude
        if code == POSITION:
            value[2] = height
    elif code == VELOCITY:
        value[0], value[1], value[2] = velocity[0], velocity[1], velocity[2]
        if has_lever_arm:
            n, e, d = _to_ned(roll, pitch, yaw, wx, wy, wz)
            value[0], value[1], value[2] = velocity[0] + n, velocity[1] + e, velocity[2] + d
    elif code == BODY_VELOCITY:
        x, y, z = _to_body(roll, pitch, yaw, velocity[0], velocity[1], velocity[2])
        if has_lever_arm:
            x, y, z = x + wx, y + wy, z + wz
        for j in range(3):
            value[j] = x * own.axes[j, 0] + y * own.axes[j, 1] + z * own.axes[j, 2]
    elif code == WATER_SPEED:
        north, east, down = velocity[0] - water[0], velocity[1] - water[1], velocity[2] - water[2]
        x, _, _ = _to_body(roll, pitch, yaw, north, east, down)
        if has_lever_arm:
            x += wx
        value[0] = (1.0 + own.scale) * x
    elif code == COMPASS:
        value[0] = yaw
        if own.has_deviation:
            value[0] = yaw + own.deviation[0] * sin(yaw) + own.deviation[1] * cos(yaw)
    elif code == GYROCOMPASS:
        value[0] = yaw
        if own.has_speed_error:
            s = sin(position[0])
            x = 1.0 - ECCENTRICITY_SQUARED * (s * s)
            prime_vertical = SEMI_MAJOR_AXIS / sqrt(x)
            meridian = prime_vertical * (1.0 - ECCENTRICITY_SQUARED) / x
            north = ROTATION_RATE * cos(position[0]) + velocity[1] / (prime_vertical + position[2])
            value[0] = yaw + atan2(velocity[0] / (meridian + position[2]), north)
    else:
        depth = -position[2]
        if has_lever_arm:
            depth = depth + d
        value[0] = (1.0 + own.scale) * depth
    if code == BODY_VELOCITY and water_depth == water_depth:
        altitude = water_depth + position[2]
        if has_lever_arm:
            altitude -= d
        within: bool = own.lowest <= altitude <= own.highest
        return within
    return True


@helper
def noise_scalar(q: Array, value: Array, j: int) -> float:
    """Standard deviation of the white noise of component j of a reading, from the reading without bias and noise."""
    own = q.view(INSTRUMENT)[0]
    if own.speed_variance == 0.0:
        sigma: float = own.sigma[j]
        return sigma
    x, y, z = value[0], value[1], value[2]
    return sqrt(own.variance[j] + own.speed_variance * (x * x + y * y + z * z))


@kernel
def observe_rows(code: int, q: Vector, taps: Matrix, values: Matrix, sigmas: Matrix, there: FlagVector) -> None:
    """Compute n readings by `observe_one` and `noise_scalar`.

    Overwritten are the (n, d) ``values``, the (n, d) ``sigmas``, and the (n,) mask ``there`` of delivered readings.
    """
    for i in range(taps.shape[0]):
        there[i] = observe_one(code, q, taps[i], values[i])
        for j in range(values.shape[1]):
            sigmas[i, j] = noise_scalar(q, values[i], j)


class CompiledInstrument(Instrument):
    """An instrument whose readings come from `observe_one`.

    Attributes
    ----------
    code : int
        Code of the observed quantity.
    numbers : (n,) array
        The `INSTRUMENT`; `parameters` is the record of it.
    in_kernel : bool
        Whether the kernel alone computes the readings. False: the instrument also asks its surroundings, and runs step
        by step call it in the block form.
    """

    code: ClassVar[int]
    in_kernel: bool = True

    def __init__(self, spec: AidSpec, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.numbers, d = np.zeros(NUMBERS), len(self.sigma)
        own = self.parameters
        own.scale, own.lever_arm, own.has_lever_arm = self.scale, self.lever_arm, self.has_lever_arm
        own.water_depth = np.nan
        own.sigma[:d], own.variance[:d] = self.sigma, self.sigma**2

    @property
    def parameters(self) -> Any:
        """The record of ``numbers``; what is written into it is written there."""
        return self.numbers.view(INSTRUMENT)[0]

    def _rows(self, tap: TapStates) -> tuple[Array, Array, NDArray[np.bool_]]:
        states = (tap.position, tap.velocity, tap.attitude, tap.angular_rate, tap.water_velocity)
        n, d = len(tap.time), len(self.definition.components)
        values, sigmas, there = np.empty((n, d)), np.empty((n, d)), np.empty(n, np.bool_)
        observe_rows(self.code, self.numbers, np.concatenate(states, axis=1), values, sigmas, there)
        return values, sigmas, there

    def observe(self, tap: TapStates) -> Array:
        """See `Instrument.observe`."""
        return self._rows(tap)[0]

    def reading(self, tap: TapStates) -> tuple[Array, Array, NDArray[np.bool_] | None]:
        """See `Instrument.reading`."""
        return self._rows(tap)
