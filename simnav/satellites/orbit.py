"""Position, velocity and clock of a satellite from one broadcast ephemeris.

GPS, Galileo and BeiDou broadcast the same Keplerian elements with secular and harmonic corrections. With the time t_k
since the reference time, and the elements as in `ELEMENTS`::

    M = M0 + (sqrt(mu / A^3) + dn) t_k,   M = E - e sin E
    u = nu + omega + C_us sin 2 phi + C_uc cos 2 phi,   phi = nu + omega
    r = A (1 - e cos E) + C_rs sin 2 phi + C_rc cos 2 phi
    i = i0 + idot t_k + C_is sin 2 phi + C_ic cos 2 phi
    Omega = Omega0 + (Omegadot - omega_E) t_k - omega_E t_oe

The geostationary satellites of BeiDou are computed in an inertial frame that is inclined by 5 degrees, and turned
afterwards. The velocity is the analytic derivative. The error of the clock is ``a0 + a1 t + a2 t^2`` plus the
relativistic effect of the eccentricity, ``-2 sqrt(mu A) e sin E / c^2``, with t since the clock's reference time.

Source: *IS-GPS-200N*, 2022, tables 20-IV and 20-V, section 20.3.3.3.3; *Galileo Open Service Signal-in-Space ICD*, 2.1,
2023, section 5.1; *BeiDou Open Service Signal-in-Space ICD*, B1I 3.0, 2019, section 5.2.4.12; the derivative: B. W.
Remondi, *Computing satellite velocity using the broadcast ephemeris*, GPS Solutions 2004.
"""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt
from typing import NamedTuple

from simnav.compiled import Array, helper
from simnav.structures import structure

__all__ = ["ELEMENTS", "EPHEMERIS", "SPEED_OF_LIGHT", "SatelliteState", "satellite_scalar"]

#: Speed of light in vacuum [m/s].
SPEED_OF_LIGHT = 299792458.0

#: The numbers of an ephemeris, in this order. Times ``toe`` and ``toc`` are in seconds of GPS time since the begin of
#: the week to which the table refers; ``toe_of_week`` is the second of the week of the satellite's own system. Angles
#: are in radians, lengths in metres; ``mu`` and ``earth_rate`` are the constants of the system, and ``geostationary``
#: is 1 for a geostationary satellite of BeiDou.
ELEMENTS = (
    "toe", "toc", "a0", "a1", "a2", "root_a", "eccentricity", "i0", "node0", "perigee", "anomaly0", "motion",
    "node_rate", "i_rate", "crc", "crs", "cuc", "cus", "cic", "cis", "toe_of_week", "mu", "earth_rate", "geostationary",
)  # fmt: skip
#: An ephemeris.
EPHEMERIS = structure(**dict.fromkeys(ELEMENTS, float))
_TILT = -5.0 / 180.0 * pi


class SatelliteState(NamedTuple):
    """A satellite at one time.

    Attributes
    ----------
    x, y, z : float
        Coordinates in the Earth-fixed frame at this time [m].
    vx, vy, vz : float
        Their derivatives [m/s].
    clock, drift : float
        Time of the satellite's clock minus GPS time [s], and its derivative [s/s].
    """

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    clock: float
    drift: float


@helper
def satellite_scalar(q: Array, time: float) -> SatelliteState:
    """Position, velocity and clock of a satellite at one time.

    Parameters
    ----------
    q : (24,) array
        The `EPHEMERIS`.
    time : float
        GPS time in seconds since the beginning of the week to which ``q`` refers [s].

    Returns
    -------
    SatelliteState
    """
    p = q.view(EPHEMERIS)[0]
    root_a, e, mu, earth_rate = p.root_a, p.eccentricity, p.mu, p.earth_rate
    t = time - p.toe
    a = root_a * root_a
    n = sqrt(mu / (a * a * a)) + p.motion
    mean = p.anomaly0 + n * t
    E = mean
    for _ in range(30):
        step = (E - e * sin(E) - mean) / (1.0 - e * cos(E))
        E -= step
        if abs(step) < 1e-14:
            break
    sin_E, cos_E = sin(E), cos(E)
    part = 1.0 - e * cos_E
    E_rate = n / part
    root = sqrt(1.0 - e * e)
    phi = atan2(root * sin_E, cos_E - e) + p.perigee
    phi_rate = root * E_rate / part
    s2, c2 = sin(2.0 * phi), cos(2.0 * phi)
    u = phi + p.cus * s2 + p.cuc * c2
    r = a * part + p.crs * s2 + p.crc * c2
    i = p.i0 + p.i_rate * t + p.cis * s2 + p.cic * c2
    u_rate = phi_rate * (1.0 + 2.0 * (p.cus * c2 - p.cuc * s2))
    r_rate = a * e * sin_E * E_rate + 2.0 * phi_rate * (p.crs * c2 - p.crc * s2)
    i_change = p.i_rate + 2.0 * phi_rate * (p.cis * c2 - p.cic * s2)
    sin_u, cos_u = sin(u), cos(u)
    px, py = r * cos_u, r * sin_u
    px_rate, py_rate = r_rate * cos_u - py * u_rate, r_rate * sin_u + px * u_rate
    turning = p.node_rate if p.geostationary > 0.0 else p.node_rate - earth_rate
    node = p.node0 + turning * t - earth_rate * p.toe_of_week
    sin_o, cos_o, sin_i, cos_i = sin(node), cos(node), sin(i), cos(i)
    x = px * cos_o - py * cos_i * sin_o
    y = px * sin_o + py * cos_i * cos_o
    z = py * sin_i
    level, level_rate = py * cos_i, py_rate * cos_i - py * sin_i * i_change
    vx = px_rate * cos_o - level_rate * sin_o - y * turning
    vy = px_rate * sin_o + level_rate * cos_o + x * turning
    vz = py_rate * sin_i + level * i_change
    if p.geostationary > 0.0:
        # R_z(omega_E t) R_x(-5 degrees)
        ct, st = cos(_TILT), sin(_TILT)
        y, z, vy, vz = ct * y + st * z, ct * z - st * y, ct * vy + st * vz, ct * vz - st * vy
        ce, se = cos(earth_rate * t), sin(earth_rate * t)
        x, y, vx, vy = ce * x + se * y, ce * y - se * x, ce * vx + se * vy, ce * vy - se * vx
        vx, vy = vx + earth_rate * y, vy - earth_rate * x
    since = time - p.toc
    relativity = -2.0 * sqrt(mu) * root_a * e / (SPEED_OF_LIGHT * SPEED_OF_LIGHT)
    clock = p.a0 + since * (p.a1 + since * p.a2) + relativity * sin_E
    drift = p.a1 + 2.0 * since * p.a2 + relativity * cos_E * E_rate
    return SatelliteState(x, y, z, vx, vy, vz, clock, drift)
