"""The readings of the instruments of simnav without bias and noise, as one kernel.

The block form (`Instrument.sense`) and the stepwise form (`simnav.simulation.steps`) call the same code, so that they
agree bit for bit.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import helper, kernel
from simnav.geometry.earth import ECCENTRICITY_SQUARED, ROTATION_RATE, SEMI_MAJOR_AXIS, displace_scalar
from simnav.kernel_types import FlagVector, Matrix, Vector
from simnav.sensors.instrument import AidSpec, Instrument
from simnav.types import Array, TapStates

__all__ = [
    "BODY_VELOCITY",
    "COMPASS",
    "DEPTH",
    "GYROCOMPASS",
    "HORIZONTAL_POSITION",
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

#: The parameters of an instrument as an array of numbers: scale-factor error; lever arm, and 1 if it is not zero; nine
#: numbers that depend on the kind (for a DVL its matrix; for a compass the coefficients of deviation, and 1 if they are
#: not zero; for a gyrocompass 1 if it has a speed error); water depth (NaN: unknown), and smallest and largest altitude
#: with bottom lock; sigma of the white noise, and its square, by component; square of the speed-dependent noise.
SCALE, LEVER, LEVERED, OWN, DEPTH_OF_WATER, LOWEST, HIGHEST = 0, 1, 4, 5, 14, 15, 16
SIGMA, SIGMA_SQUARED, SPEED_NOISE_SQUARED = 17, 20, 23
NUMBERS = 24


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
    q : (24,) array
        Parameters of the instrument, in the order of `NUMBERS`.
    tap : (15,) array
        True state: position (latitude, longitude [rad], height [m]), velocity north-east-down [m/s], roll, pitch and
        yaw [rad], angular rate in body axes [rad/s], velocity of the water north-east-down [m/s].
    value : (d,) array
        The reading, overwritten.

    Returns
    -------
    bool
        True if the instrument delivers a measurement at this state.
    """
    has_lever_arm = q[LEVERED] > 0.0
    n, e, d = 0.0, 0.0, 0.0
    if has_lever_arm and (code <= HORIZONTAL_POSITION or code == DEPTH or q[DEPTH_OF_WATER] == q[DEPTH_OF_WATER]):
        n, e, d = _to_ned(tap[6], tap[7], tap[8], q[LEVER], q[LEVER + 1], q[LEVER + 2])
    wx = tap[10] * q[LEVER + 2] - tap[11] * q[LEVER + 1]
    wy = tap[11] * q[LEVER] - tap[9] * q[LEVER + 2]
    wz = tap[9] * q[LEVER + 1] - tap[10] * q[LEVER]
    if code <= HORIZONTAL_POSITION:
        latitude, longitude, height = tap[0], tap[1], tap[2]
        if has_lever_arm:
            latitude, longitude, height = displace_scalar(latitude, longitude, height, n, e, d)
        value[0], value[1] = latitude, longitude
        if code == POSITION:
            value[2] = height
    elif code == VELOCITY:
        value[0], value[1], value[2] = tap[3], tap[4], tap[5]
        if has_lever_arm:
            n, e, d = _to_ned(tap[6], tap[7], tap[8], wx, wy, wz)
            value[0], value[1], value[2] = tap[3] + n, tap[4] + e, tap[5] + d
    elif code == BODY_VELOCITY:
        x, y, z = _to_body(tap[6], tap[7], tap[8], tap[3], tap[4], tap[5])
        if has_lever_arm:
            x, y, z = x + wx, y + wy, z + wz
        for j in range(3):
            m = OWN + 3 * j
            value[j] = x * q[m] + y * q[m + 1] + z * q[m + 2]
    elif code == WATER_SPEED:
        x, _, _ = _to_body(tap[6], tap[7], tap[8], tap[3] - tap[12], tap[4] - tap[13], tap[5] - tap[14])
        if has_lever_arm:
            x += wx
        value[0] = (1.0 + q[SCALE]) * x
    elif code == COMPASS:
        heading = tap[8]
        value[0] = heading
        if q[OWN + 2] > 0.0:
            value[0] = heading + q[OWN] * sin(heading) + q[OWN + 1] * cos(heading)
    elif code == GYROCOMPASS:
        value[0] = tap[8]
        if q[OWN] > 0.0:
            s = sin(tap[0])
            x = 1.0 - ECCENTRICITY_SQUARED * (s * s)
            prime_vertical = SEMI_MAJOR_AXIS / sqrt(x)
            meridian = prime_vertical * (1.0 - ECCENTRICITY_SQUARED) / x
            north = ROTATION_RATE * cos(tap[0]) + tap[4] / (prime_vertical + tap[2])
            value[0] = tap[8] + atan2(tap[3] / (meridian + tap[2]), north)
    else:
        depth = -tap[2]
        if has_lever_arm:
            depth = depth + d
        value[0] = (1.0 + q[SCALE]) * depth
    if code == BODY_VELOCITY and q[DEPTH_OF_WATER] == q[DEPTH_OF_WATER]:
        altitude = q[DEPTH_OF_WATER] + tap[2]
        if has_lever_arm:
            altitude -= d
        within: bool = q[LOWEST] <= altitude <= q[HIGHEST]
        return within
    return True


@helper
def noise_scalar(q: Array, value: Array, j: int) -> float:
    """Standard deviation of the white noise of component j of a reading, from the reading without bias and noise."""
    if q[SPEED_NOISE_SQUARED] == 0.0:
        sigma: float = q[SIGMA + j]
        return sigma
    x, y, z = value[0], value[1], value[2]
    return sqrt(q[SIGMA_SQUARED + j] + q[SPEED_NOISE_SQUARED] * (x * x + y * y + z * z))


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
    numbers : (24,) array
        Parameters of the instrument, in the order of `NUMBERS`.
    in_kernel : bool
        Whether the kernel alone computes the readings. False: the instrument also asks its surroundings, and runs step
        by step call it in the block form.
    """

    code: ClassVar[int]
    in_kernel: bool = True

    def __init__(self, spec: AidSpec, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.numbers = q = np.zeros(NUMBERS)
        q[SCALE], q[LEVER : LEVER + 3], q[LEVERED] = self.scale, self.lever_arm, float(self.has_lever_arm)
        q[DEPTH_OF_WATER] = np.nan
        d = len(self.sigma)
        q[SIGMA : SIGMA + d], q[SIGMA_SQUARED : SIGMA_SQUARED + d] = self.sigma, self.sigma**2

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
