"""The satellites as an antenna sees them: where each was when it sent what arrives now, and the delays on the way.

An antenna at r(t) receives at t what a satellite sent at t - tau. In the Earth-fixed frame of the reception the
satellite is at ``s = R_z(omega_E tau) s(t - tau)``, its **apparent position**, and ``c tau = |s - r|``. The **apparent
velocity** is the derivative of the apparent position by the time of reception, so the rate of the range is the
component of apparent velocity minus antenna velocity along the line of sight, without further terms.

Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., Artech
House 2013, sections 8.5.2 and 8.5.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import asin, atan2, cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import Array, helper, kernel
from simnav.geometry.earth import ROTATION_RATE
from simnav.geometry.ecef import ecef_from_geodetic_scalar
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.satellites.atmosphere import (
    HUMIDITY,
    ionosphere_scalar,
    mapping_coefficients,
    mapping_scalar,
    zenith_delay_scalar,
)
from simnav.satellites.ephemeris import Ephemerides, nearest
from simnav.satellites.orbit import SPEED_OF_LIGHT, satellite_scalar
from simnav.satellites.time_scales import gps_time
from simnav.structures import filled, structure

__all__ = ["Sight", "Sky"]

#: What is known of a satellite, see `Sight`.
_SIGHTING = structure(
    position=3, velocity=3, range=float, range_rate=float, elevation=float, azimuth=float, clock=float, drift=float,
    ionosphere=float, troposphere=float, mapping=float,
)  # fmt: skip
#: The begin of a run: seconds since the begin of the week to which the ephemerides refer, second of the day, day of the
#: year.
_BEGIN = structure(second_of_week=float, second_of_day=float, day_of_year=float)
_TYPICAL_DELAY = 0.08  # of a signal [s]


@dataclass(frozen=True, eq=False)
class Sight:
    """What c satellites look like from an antenna at n times. NaN where a satellite has no valid ephemeris.

    Attributes
    ----------
    position, velocity : (n, c, 3) array
        Apparent position [m] and velocity [m/s], Earth-fixed frame of the time of reception.
    range, range_rate : (n, c) array
        Distance from the antenna [m] and its rate [m/s].
    elevation, azimuth : (n, c) array
        Direction from the antenna: above the horizon, and from north to east [rad].
    clock, drift : (n, c) array
        Error of the satellite's clock when the signal was sent [s], and its drift [s/s].
    ionosphere, troposphere : (n, c) array
        Delays by Klobuchar's and Saastamoinen's model [m]; NaN below the horizon.
    mapping : (n, c) array
        Wet mapping function [-]; likewise.
    """

    position: Array
    velocity: Array
    range: Array
    range_rate: Array
    elevation: Array
    azimuth: Array
    clock: Array
    drift: Array
    ionosphere: Array
    troposphere: Array
    mapping: Array


class Sky:
    """Some satellites during a run.

    Parameters
    ----------
    ephemerides : Ephemerides
        Broadcast ephemerides.
    satellites : sequence of str
        Names of c satellites.
    epoch : datetime
        GPS time at which the run begins.

    Attributes
    ----------
    satellites : tuple of str
        Their names.
    """

    def __init__(self, ephemerides: Ephemerides, satellites: Sequence[str], epoch: datetime):
        self.satellites = tuple(satellites)
        self._table = ephemerides.table(self.satellites)
        self._begin = gps_time(epoch).since(ephemerides.week)
        midnight = epoch.replace(hour=0, minute=0, second=0, microsecond=0)
        year = epoch.replace(month=1, day=1, hour=0, minute=0, second=0, microsecond=0)
        self._second_of_day = (epoch - midnight) / timedelta(seconds=1)
        self._day_of_year = 1.0 + (epoch - year) / timedelta(days=1)
        coefficients = ephemerides.klobuchar
        self._klobuchar = np.zeros(8) if coefficients is None else np.ascontiguousarray(coefficients)
        self._has_ionosphere = coefficients is not None

    def sight(self, time: Array, position: Array, velocity: Array) -> Sight:
        """What the satellites look like.

        Parameters
        ----------
        time : (n,) array
            Times since the begin of the run [s].
        position, velocity : (n, 3) array
            Of the antenna: latitude, longitude [rad], height [m]; north-east-down [m/s].
        """
        time, position, velocity = (np.ascontiguousarray(a, dtype=np.float64) for a in (time, position, velocity))
        out = np.empty((len(time), len(self.satellites), 1), _SIGHTING)
        begin = filled(
            _BEGIN,
            second_of_week=self._begin,
            second_of_day=self._second_of_day,
            day_of_year=self._day_of_year,
        )
        _look(_Sky(*self._table, self._klobuchar, begin), time, position, velocity, out.view(np.float64))
        seen = out[..., 0]
        if not self._has_ionosphere:
            seen["ionosphere"] = np.where(np.isnan(seen["ionosphere"]), np.nan, 0.0)
        return Sight(**{name: seen[name] for name in _SIGHTING.names or ()})


@helper
def _apparent(q: Array, time: float, antenna: tuple[float, float, float], out: Any) -> float:
    """Write apparent position, velocity without the change of the delay, and clock into a `_SIGHTING`; return tau [s].

    The delay is found along a straight orbit first. Its error is then under a picosecond, so one more evaluation of the
    orbit is exact to rounding.
    """
    tau = _TYPICAL_DELAY
    at = satellite_scalar(q, time - tau)
    for _ in range(4):
        earlier = _TYPICAL_DELAY - tau
        s, c = sin(ROTATION_RATE * tau), cos(ROTATION_RATE * tau)
        ax, ay, az = at.x + at.vx * earlier, at.y + at.vy * earlier, at.z + at.vz * earlier
        dx, dy, dz = c * ax + s * ay - antenna[0], c * ay - s * ax - antenna[1], az - antenna[2]
        tau = sqrt(dx * dx + dy * dy + dz * dz) / SPEED_OF_LIGHT
    at = satellite_scalar(q, time - tau)
    s, c = sin(ROTATION_RATE * tau), cos(ROTATION_RATE * tau)
    place, v = out.position, out.velocity
    place[0], place[1], place[2] = c * at.x + s * at.y, c * at.y - s * at.x, at.z
    v[0], v[1], v[2] = c * at.vx + s * at.vy, c * at.vy - s * at.vx, at.vz
    out.clock, out.drift = at.clock, at.drift
    dx, dy, dz = place[0] - antenna[0], place[1] - antenna[1], place[2] - antenna[2]
    return sqrt(dx * dx + dy * dy + dz * dz) / SPEED_OF_LIGHT


class _Sky(NamedTuple):
    """What decides on the signals of c satellites.

    Attributes
    ----------
    numbers, first, reach : array
        The table of `Ephemerides.table`.
    klobuchar : (8,) array
        Klobuchar's coefficients.
    begin : (3,) array
        A `_BEGIN`.
    """

    numbers: Matrix
    first: IntegerVector
    reach: Vector
    klobuchar: Vector
    begin: Vector


@kernel
def _look(
    sky: _Sky,
    time: Vector,
    position: Matrix,
    velocity: Matrix,
    out: Stack,
) -> None:
    """Overwrite the (n, c, 15) ``out``, a `_SIGHTING` each, for n times and c satellites."""
    numbers, first, begin = sky.numbers, sky.first, sky.begin.view(_BEGIN)[0]
    for i in range(out.shape[0]):
        latitude, longitude, height = position[i, 0], position[i, 1], position[i, 2]
        antenna = ecef_from_geodetic_scalar(latitude, longitude, height)
        sa, ca, so, co = sin(latitude), cos(latitude), sin(longitude), cos(longitude)
        n, e, d = velocity[i, 0], velocity[i, 1], velocity[i, 2]
        vx, vy, vz = -sa * co * n - so * e - ca * co * d, -sa * so * n + co * e - ca * so * d, ca * n - sa * d
        dry, wet = zenith_delay_scalar(latitude, height, HUMIDITY)
        second = begin.second_of_day + time[i]
        mapping = mapping_coefficients(begin.day_of_year + time[i] / 86400.0, latitude)
        for j in range(out.shape[1]):
            k = nearest(numbers, first[j], first[j + 1], sky.reach[j], begin.second_of_week + time[i])
            if k < 0:
                out[i, j] = float("nan")
                continue
            row = out[i, j].view(_SIGHTING)[0]
            at, v = row.position, row.velocity
            tau = _apparent(numbers[k], begin.second_of_week + time[i], antenna, row)
            distance = tau * SPEED_OF_LIGHT
            ux, uy, uz = (at[0] - antenna[0]) / distance, (at[1] - antenna[1]) / distance, 0.0
            uz = (at[2] - antenna[2]) / distance
            # d/dt of R(omega tau) s(t - tau), with the rate of tau from its projection on the line of sight
            wx, wy = ROTATION_RATE * at[1], -ROTATION_RATE * at[0]
            along = ux * (v[0] - vx) + uy * (v[1] - vy) + uz * (v[2] - vz)
            change = ux * (v[0] - wx) + uy * (v[1] - wy) + uz * v[2]
            rate = along / (SPEED_OF_LIGHT + change)
            v[0] += rate * (wx - v[0])
            v[1] += rate * (wy - v[1])
            v[2] -= rate * v[2]
            row.range, row.range_rate = distance, rate * SPEED_OF_LIGHT
            north = -sa * co * ux - sa * so * uy + ca * uz
            east = -so * ux + co * uy
            up = ca * co * ux + ca * so * uy + sa * uz
            elevation = asin(min(max(up, -1.0), 1.0))
            azimuth = atan2(east, north)
            row.elevation, row.azimuth = elevation, azimuth
            if elevation > 0.0:
                row.ionosphere = ionosphere_scalar(sky.klobuchar, second, latitude, longitude, azimuth, elevation)
                dry_mapping, wet_mapping = mapping_scalar(mapping, height, elevation)
                row.troposphere, row.mapping = dry * dry_mapping + wet * wet_mapping, wet_mapping
            else:
                row.ionosphere, row.troposphere, row.mapping = float("nan"), float("nan"), float("nan")
