"""What an estimator knows of a raw observation of a satellite: the predicted reading, its Jacobian, and its noise.

The equation is in `simnav.sensors.gnss_raw`. The rate of the range is the component of the satellite's apparent
velocity minus the antenna's velocity along the line of sight (`simnav.satellites.sky`), so the side information of a
reading is all that is needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simnav.compiled import helper, kernel, ready
from simnav.geometry.earth import displace_scalar
from simnav.geometry.ecef import ecef_from_geodetic_scalar
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.kinds import Component, Datasheet, NavigationPoint, NavigationPoints
from simnav.satellites.signal_errors import amplification, noise_factor, range_error
from simnav.sensors.single_reading import single_reading
from simnav.structures import length, structure
from simnav.types import Array

__all__ = ["SEEN", "SIDE", "observe", "observe_all", "reading_sigma"]

#: The side information of a reading: apparent position and velocity of the satellite in the Earth-fixed frame of the
#: time of reception, its direction from the antenna, C/N0 [dB-Hz], the delays that the models predict, and the wet
#: mapping function.
SIDE = (
    Component("satellite_x", "m"),
    Component("satellite_y", "m"),
    Component("satellite_z", "m"),
    Component("satellite_vx", "m_s"),
    Component("satellite_vy", "m_s"),
    Component("satellite_vz", "m_s"),
    Component("elevation", "deg"),
    Component("azimuth", "deg"),
    Component("density_ratio", ""),
    Component("ionosphere", "m"),
    Component("troposphere", "m"),
    Component("mapping", ""),
)
#: The same as kernels know it.
SEEN = structure(
    satellite=3, satellite_velocity=3, elevation=float, azimuth=float, density_ratio=float, ionosphere=float,
    troposphere=float, mapping=float,
)  # fmt: skip
#: What all satellites have in common at a state: the lever arm and its swing in north, east and down, the place in the
#: Earth-fixed frame, and sine and cosine of latitude and longitude.
_ANTENNA = structure(
    arm=3, swing=3, place=3, sin_latitude=float, cos_latitude=float, sin_longitude=float, cos_longitude=float
)
_ANTENNA_NUMBERS = length(_ANTENNA)
_DENSITY_RATIO = [c.name for c in SIDE].index("density_ratio")


@helper
def _antenna(position: Array, dcm: Array, rate: Array, arm: Array, antenna: Array) -> None:
    """Overwrite the `_ANTENNA` of a state; arguments as of `NavigationPoint`."""
    own = antenna.view(_ANTENNA)[0]
    lever, swing, place = own.arm, own.swing, own.place
    w0 = rate[1] * arm[2] - rate[2] * arm[1]
    w1 = rate[2] * arm[0] - rate[0] * arm[2]
    w2 = rate[0] * arm[1] - rate[1] * arm[0]
    for k in range(3):
        lever[k] = dcm[k, 0] * arm[0] + dcm[k, 1] * arm[1] + dcm[k, 2] * arm[2]
        swing[k] = dcm[k, 0] * w0 + dcm[k, 1] * w1 + dcm[k, 2] * w2
    latitude, longitude, height = displace_scalar(position[0], position[1], position[2], lever[0], lever[1], lever[2])
    place[0], place[1], place[2] = ecef_from_geodetic_scalar(latitude, longitude, height)
    own.sin_latitude, own.cos_latitude = np.sin(latitude), np.cos(latitude)
    own.sin_longitude, own.cos_longitude = np.sin(longitude), np.cos(longitude)


@helper
def _predict(antenna: Array, velocity: Array, side: Array, reading: Array, jacobian: Array) -> None:
    """Overwrite range, rate of the range, and their (2, 9) Jacobian; the antenna is that of `_antenna`."""
    own, seen = antenna.view(_ANTENNA)[0], side.view(SEEN)[0]
    a, swing, place, u, v = own.arm, own.swing, own.place, np.empty(3), np.empty(3)
    sa, ca, so, co = own.sin_latitude, own.cos_latitude, own.sin_longitude, own.cos_longitude
    satellite, moving = seen.satellite, seen.satellite_velocity
    x, y, z = satellite[0] - place[0], satellite[1] - place[1], satellite[2] - place[2]
    distance = np.sqrt(x * x + y * y + z * z)
    u[0], u[1], u[2] = -sa * co * x - sa * so * y + ca * z, -so * x + co * y, -ca * co * x - ca * so * y - sa * z
    x, y, z = moving[0], moving[1], moving[2]
    v[0], v[1], v[2] = -sa * co * x - sa * so * y + ca * z, -so * x + co * y, -ca * co * x - ca * so * y - sa * z
    along = 0.0
    for k in range(3):
        u[k] /= distance
        v[k] -= velocity[k] + swing[k]
        along += u[k] * v[k]
    reading[0], reading[1] = distance, along
    jacobian[:] = 0.0
    for k in range(3):
        jacobian[0, k] = -u[k]
        jacobian[1, k] = -(v[k] - along * u[k]) / distance
        jacobian[1, 3 + k] = -u[k]
    for row in range(2):
        p0, p1, p2 = jacobian[row, 0], jacobian[row, 1], jacobian[row, 2]
        jacobian[row, 6] = a[1] * p2 - a[2] * p1
        jacobian[row, 7] = a[2] * p0 - a[0] * p2
        jacobian[row, 8] = a[0] * p1 - a[1] * p0
    jacobian[1, 6] += -(swing[1] * u[2] - swing[2] * u[1])
    jacobian[1, 7] += -(swing[2] * u[0] - swing[0] * u[2])
    jacobian[1, 8] += -(swing[0] * u[1] - swing[1] * u[0])


@helper
def _equal(x: Array, y: Array) -> bool:
    for k in range(x.size):  # noqa: SIM110 (compiled)
        if x[k] != y[k]:
            return False
    return True


class _States(NamedTuple):
    """n states, as of `NavigationPoints`."""

    position: Matrix
    velocity: Matrix
    dcm: Stack
    rate: Matrix


class _Blocks(NamedTuple):
    """The states of the receiver at n readings: (n, 2), (n, 1), (n, channels) and (n, 1) arrays.

    The last one has no columns with two frequencies.
    """

    clock: Matrix
    troposphere: Matrix
    signals: Matrix
    ionosphere: Matrix


class _Errors(NamedTuple):
    """The errors of signals and of multipath that last for minutes, as of `range_error`."""

    signal: float
    multipath: float


class _Jacobians(NamedTuple):
    """The derivatives of n readings by position, velocity and attitude (n, 2, 9), and by blocks (n, 2, ...)."""

    navigation: Stack
    clock: Stack
    troposphere: Stack
    signals: Stack
    ionosphere: Stack


@kernel
def _predict_all(
    states: _States,
    arm: Vector,
    side: Matrix,
    channel: IntegerVector,
    errors: _Errors,
    blocks: _Blocks,
    reading: Matrix,
    jacobians: _Jacobians,
) -> None:
    """Predict n readings, and their Jacobians.

    Parameters
    ----------
    states : _States
        The states.
    arm : (3,) array
        Lever arm of the antenna [m].
    side : (n, 12) array
        Side information.
    channel : (n,) int array
        Channels.
    errors : _Errors
        The lasting errors of ranges.
    blocks : _Blocks
        The states of the receiver.
    reading : (n, 2) array
        Overwritten with range and its rate.
    jacobians : _Jacobians
        Zeros, overwritten.
    """
    position, dcm, rate = states.position, states.dcm, states.rate
    clock, ionosphere = blocks.clock, blocks.ionosphere
    antenna = np.empty(_ANTENNA_NUMBERS)
    for i in range(len(position)):
        # Satellites at one state follow each other.
        if i == 0 or not (
            _equal(position[i], position[i - 1])
            and _equal(rate[i], rate[i - 1])
            and _equal(dcm[i, 0], dcm[i - 1, 0])
            and _equal(dcm[i, 1], dcm[i - 1, 1])
            and _equal(dcm[i, 2], dcm[i - 1, 2])
        ):
            _antenna(position[i], dcm[i], rate[i], arm, antenna)
        _predict(antenna, states.velocity[i], side[i], reading[i], jacobians.navigation[i])
        seen, c = side[i].view(SEEN)[0], channel[i]
        mapping, sigma = seen.mapping, range_error(seen.elevation, errors.signal, errors.multipath)
        reading[i, 1] += clock[i, 1]
        x = reading[i, 0] + clock[i, 0]
        x += seen.troposphere + mapping * blocks.troposphere[i, 0] + sigma * blocks.signals[i, c]
        jacobians.clock[i, 0, 0] = jacobians.clock[i, 1, 1] = 1.0
        jacobians.troposphere[i, 0, 0], jacobians.signals[i, 0, c] = mapping, sigma
        if ionosphere.shape[1] > 0:
            x += seen.ionosphere * (1.0 + ionosphere[i, 0])
            jacobians.ionosphere[i, 0, 0] = seen.ionosphere
        reading[i, 0] = x


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """Pseudorange and its rate at a state, and their Jacobian by block (`simnav.kinds.Observation`)."""
    return single_reading(observe_all, point, sheet)


def observe_all(points: NavigationPoints, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """The same for n readings (`simnav.kinds.Observations`)."""
    _, position, velocity, dcm, rate, blocks, channel, side = points
    n, details = len(position), sheet.details
    frequencies = int(details["frequencies"])
    errors = _Errors(float(details["signal_error"]), float(details["multipath"]) * amplification(frequencies))
    reading, navigation, signals = np.empty((n, 2)), np.empty((n, 2, 9)), np.zeros((n, 2, len(sheet.channels)))
    clock, troposphere, ionosphere = np.zeros((n, 2, 2)), np.zeros((n, 2, 1)), np.zeros((n, 2, 1))
    delay = blocks["ionosphere"] if frequencies == 1 else np.empty((n, 0))
    states = _States(ready(position), ready(velocity), ready(dcm), ready(rate))
    receiver = _Blocks(ready(blocks["clock"]), ready(blocks["troposphere"]), ready(blocks["signals"]), ready(delay))
    jacobians = _Jacobians(navigation, clock, troposphere, signals, ionosphere)
    _predict_all.unchecked(states, sheet.lever_arm, ready(side), channel, errors, receiver, reading, jacobians)
    by_block = {"navigation": navigation, "clock": clock, "troposphere": troposphere, "signals": signals}
    if frequencies == 1:
        by_block["ionosphere"] = ionosphere
    return reading, by_block


def reading_sigma(side: Array, sheet: Datasheet) -> Array:
    """The white noise of readings, from their C/N0 (`simnav.kinds.ReadingSigma`)."""
    ratio = side[..., _DENSITY_RATIO]
    # Each by itself: functions of NumPy may differ in the last digit between one number and many.
    factor = np.array([noise_factor(each) for each in ratio.ravel().tolist()]).reshape(ratio.shape)
    sigma: Array = sheet.sigma * factor[..., None]
    sigma[..., 0] *= amplification(int(sheet.details["frequencies"]))
    return sigma
