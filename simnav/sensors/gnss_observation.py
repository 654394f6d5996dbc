"""What an estimator knows of a raw observation of a satellite: the predicted reading, its Jacobian, and its noise.

The equation is in `simnav.sensors.gnss_raw`. The rate of the range is the component of the satellite's apparent
velocity minus the antenna's velocity along the line of sight (`simnav.satellites.sky`), so the side information of a
reading is all that is needed.
"""

from __future__ import annotations

import numpy as np

from simnav.compiled import kernel
from simnav.geometry.earth import displace_scalar
from simnav.geometry.ecef import ecef_from_geodetic_scalar
from simnav.kinds import Component, Datasheet, NavigationPoint, NavigationPoints
from simnav.satellites.signal_errors import amplification, noise_factor, range_error
from simnav.sensors.one_of_many import one_of_many
from simnav.types import Array

__all__ = ["DENSITY_RATIO", "SIDE", "observe", "observe_all", "reading_sigma"]

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
ELEVATION, DENSITY_RATIO, IONOSPHERE, TROPOSPHERE, MAPPING = 6, 8, 9, 10, 11
_CLOCK = np.eye(2)


@kernel()
def _predict(
    position: Array, velocity: Array, dcm: Array, rate: Array, arm: Array, side: Array, reading: Array, jacobian: Array
) -> None:
    """Overwrite range, rate of the range, and their (2, 9) Jacobian; arguments as of `NavigationPoint`."""
    a, swing = np.empty(3), np.empty(3)
    w0 = rate[1] * arm[2] - rate[2] * arm[1]
    w1 = rate[2] * arm[0] - rate[0] * arm[2]
    w2 = rate[0] * arm[1] - rate[1] * arm[0]
    for k in range(3):
        a[k] = dcm[k, 0] * arm[0] + dcm[k, 1] * arm[1] + dcm[k, 2] * arm[2]
        swing[k] = dcm[k, 0] * w0 + dcm[k, 1] * w1 + dcm[k, 2] * w2
    latitude, longitude, height = displace_scalar(position[0], position[1], position[2], a[0], a[1], a[2])
    x, y, z = ecef_from_geodetic_scalar(latitude, longitude, height)
    sa, ca, so, co = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    x, y, z = side[0] - x, side[1] - y, side[2] - z
    distance = np.sqrt(x * x + y * y + z * z)
    u, v = np.empty(3), np.empty(3)
    u[0], u[1], u[2] = -sa * co * x - sa * so * y + ca * z, -so * x + co * y, -ca * co * x - ca * so * y - sa * z
    x, y, z = side[3], side[4], side[5]
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


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, :, ::1])")
def _predict_all(
    position: Array, velocity: Array, dcm: Array, rate: Array, arm: Array, side: Array, reading: Array, jacobian: Array
) -> None:
    """Apply `_predict` to n readings."""
    for i in range(len(position)):
        _predict(position[i], velocity[i], dcm[i], rate[i], arm, side[i], reading[i], jacobian[i])


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """Pseudorange and its rate at a state, and their Jacobian by block (`simnav.kinds.Observation`)."""
    return one_of_many(observe_all, point, sheet)


def observe_all(points: NavigationPoints, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """The same for n readings (`simnav.kinds.Observations`)."""
    side, blocks, at, n = np.ascontiguousarray(points.side), points.blocks, points.channel, len(points.position)
    reading, jacobian = np.empty((n, 2)), np.empty((n, 2, 9))
    position, velocity, dcm, rate = (np.ascontiguousarray(array) for array in points[1:5])
    _predict_all(position, velocity, dcm, rate, sheet.lever_arm, side, reading, jacobian)
    sigma, frequencies = _figures(sheet, side[:, ELEVATION])
    ionosphere, mapping, row = side[:, IONOSPHERE], side[:, MAPPING], np.arange(n)
    reading += blocks["clock"]
    reading[:, 0] += side[:, TROPOSPHERE] + mapping * blocks["troposphere"][:, 0] + sigma * blocks["signals"][row, at]
    signals, troposphere = np.zeros((n, 2, len(sheet.channels))), np.zeros((n, 2, 1))
    signals[row, 0, at], troposphere[:, 0, 0] = sigma, mapping
    given = {
        "navigation": jacobian, "clock": np.broadcast_to(_CLOCK, (n, 2, 2)), "troposphere": troposphere,
        "signals": signals,
    }  # fmt: skip
    if frequencies == 1:
        reading[:, 0] += ionosphere * (1.0 + blocks["ionosphere"][:, 0])
        given["ionosphere"] = np.zeros((n, 2, 1))
        given["ionosphere"][:, 0, 0] = ionosphere
    return reading, given


def _figures(sheet: Datasheet, elevation: Array) -> tuple[Array, int]:
    """One sigma of the lasting error of each range [m], and the number of frequencies."""
    details = sheet.details
    frequencies = int(details["frequencies"])
    multipath = details["multipath"] * amplification(frequencies)
    return np.asarray(range_error(elevation, details["signal_error"], multipath)), frequencies


def reading_sigma(side: Array, sheet: Datasheet) -> Array:
    """The white noise of readings, from their C/N0 (`simnav.kinds.ReadingSigma`)."""
    factor = noise_factor(side[..., DENSITY_RATIO])
    sigma: Array = sheet.sigma * (factor[..., None] if side.ndim > 1 else factor)
    sigma[..., 0] *= amplification(int(sheet.details["frequencies"]))
    return sigma
