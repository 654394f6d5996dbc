"""The mounting of an IMU: how its axes lie in the vessel, by comparison with the attitude of the reference.

Between two epochs of the reference the vessel turns by a rotation vector, and its mean specific force has a direction.
The same two vectors follow from the readings of the IMU. The rotation that brings those of the IMU onto those of the
reference is found by least squares (W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta
Crystallographica A32, 1976), for each delay that is tried; the delay with the smallest sum of squares is that of the
IMU. Rotation vectors are compared over short intervals, in which the axis of the rotation hardly moves.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import earth_rate, gravity
from simnav.geometry.rotation import dcm_from_rpy, rpy_from_dcm
from simnav.log.imu_series import ImuSeries
from simnav.log.source import LogSource
from simnav.types import Array

__all__ = ["MOUNTING", "imu_alignment", "mounting_of"]

MOUNTING = ("mounting_roll", "mounting_pitch", "mounting_yaw")
#: Length of the intervals [s], and how many are used at most.
_INTERVAL, _MOST = 1.0, 3000
#: Delays that are tried, either way [s]: coarse, then fine steps.
_WIDEST, _COARSE, _FINE = 2.0, 0.1, 0.01
#: Fewer intervals, or larger standard errors of an angle [rad], say nothing.
_LEAST, _KNOWN = 20, np.radians(5.0)
#: Sizes of one standard deviation by which the two kinds of vectors are divided: rad, m/s^2. The acceleration of the
#: vessel is in the latter.
_TURN, _FORCE = 0.002, 0.5


Found: TypeAlias = tuple[float, float, dict[str, tuple[float, float]], str, dict[float, float]]


def imu_alignment(source: LogSource, imu: ImuSeries) -> Found:
    """Delay and mounting of an IMU, relative to the scenario as it is.

    Parameters
    ----------
    source : LogSource
        The log, whose reference has an attitude.
    imu : ImuSeries
        Its samples, in the axes that the scenario says.

    Returns
    -------
    delay, sigma : float
        By how much the IMU is late, and its standard deviation [s]; NaN where the motion does not tell.
    mounting : dict of str to (float, float)
        Roll, pitch, yaw of the IMU in those axes [rad], with sigma; empty where they cannot be told.
    remark : str
        What could not be found.
    costs : dict of float to float
        Mean square of what is left, by the delay that was tried.
    """
    integral = np.zeros((len(imu.edge), 6))
    np.cumsum(imu.mean * np.diff(imu.edge)[:, None], axis=0, out=integral[1:])
    first, last = imu.edge[0] + _WIDEST, imu.edge[-1] - _WIDEST
    count = int(min(max((last - first) / _INTERVAL, 0.0), 1e6))
    starts = first + _INTERVAL * np.arange(count)
    starts = starts[:: max(1, count // _MOST)]
    turned, pull, known = _of_reference(source, starts)
    if np.sum(known) < _LEAST:
        return np.nan, np.nan, {}, f"fewer than {_LEAST} seconds of the reference have an attitude", {}
    starts, turned, pull = starts[known], turned[known], pull[known]
    attempts: dict[float, tuple[float, Array, Array]] = {}

    def cost(delay: float) -> float:
        if delay not in attempts:
            between = [
                np.stack([np.interp(t + delay, imu.edge, c) for c in integral.T], axis=-1)
                for t in (starts, starts + _INTERVAL)
            ]
            own = between[1] - between[0]
            attempts[delay] = mounting_of(own[:, :3], own[:, 3:] / _INTERVAL, turned, pull)
        return attempts[delay][0]

    best = min(np.round(np.arange(-_WIDEST, _WIDEST + 0.5 * _COARSE, _COARSE), 9).tolist(), key=cost)
    delay = min(np.round(np.arange(best - _COARSE, best + _COARSE + 0.5 * _FINE, _FINE), 9).tolist(), key=cost)
    total, rotation, covariance = attempts[delay]
    spread = np.sqrt(np.diag(covariance))
    curvature = (cost(delay + _COARSE) + cost(delay - _COARSE) - 2.0 * cost(delay)) / _COARSE**2
    sharp = curvature > 0.0 and abs(delay) < _WIDEST - _COARSE
    sigma = float(np.sqrt(2.0 * total / (3.0 * len(starts) * curvature))) if sharp else np.nan
    remark = "" if sharp and sigma < 0.5 else "the motion is too steady to tell a delay"
    if remark:
        delay = sigma = np.nan
    angles = rpy_from_dcm(rotation)
    found = {n: (float(a), float(s)) for n, a, s in zip(MOUNTING, angles, spread, strict=True) if s < _KNOWN}
    if len(found) < 3:
        remark = "; ".join(filter(None, [remark, "the vessel turns too little about some axis to tell all angles"]))
    return delay, sigma, found, remark, {d: a[0] for d, a in attempts.items()}


def mounting_of(turns: Array, forces: Array, turned: Array, pull: Array) -> tuple[float, Array, Array]:
    """The rotation from the axes of an IMU to those of the vessel.

    Parameters
    ----------
    turns, forces : (n, 3) array
        Rotation vectors [rad] and mean specific forces [m/s^2] of n intervals, in the axes of the IMU.
    turned, pull : (n, 3) array
        The same in those of the vessel.

    Returns
    -------
    total : float
        Mean of squares of what is left, in units of the standard deviations assumed.
    rotation : (3, 3) array
        Direction cosines from the axes of the IMU to those of the vessel.
    covariance : (3, 3) array
        Of its rotation vector, in the axes of the vessel [rad^2], with the scatter of what is left.
    """
    # Outliers (a reference that jumps) get less weight: twice as much as the median is too far.
    measured = np.concatenate([turns / _TURN, forces / _FORCE])
    wanted = np.concatenate([turned / _TURN, pull / _FORCE])
    weight: Array = np.ones(len(measured))
    rotation: Array = np.eye(3)
    residual: Array = wanted - measured
    for _ in range(3):
        u, _, vt = np.linalg.svd((wanted * weight[:, None]).T @ measured)
        rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
        residual = wanted - measured @ rotation.T
        size = np.linalg.norm(residual, axis=1)
        for part in (slice(0, len(turns)), slice(len(turns), None)):
            limit = 2.0 * max(float(np.median(size[part])), 1e-12)
            weight[part] = np.minimum(1.0, limit / np.maximum(size[part], 1e-300))
    turned_to = measured @ rotation.T
    squares = np.sum(turned_to**2, axis=1)
    information: Array = np.zeros((3, 3))
    for part in (slice(0, len(turns)), slice(len(turns), None)):
        v, w = turned_to[part], weight[part]
        variance = max(float(np.sum(w[:, None] * residual[part] ** 2)) / max(2.0 * float(np.sum(w)), 1.0), 1e-18)
        information += (np.eye(3) * np.sum(w * squares[part]) - (v * w[:, None]).T @ v) / variance
    total = float(np.mean(weight * np.sum(residual**2, axis=1)))
    return total, np.asarray(rotation), np.asarray(np.linalg.pinv(information))


def _of_reference(source: LogSource, starts: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Rotation vectors and specific forces of the intervals from the reference, and where it knows them."""
    a, b = source.reference_states(starts), source.reference_states(starts + _INTERVAL)
    known = np.isfinite(a.attitude).all(axis=1) & np.isfinite(b.attitude).all(axis=1)
    known &= np.isfinite(a.position).all(axis=1) & np.isfinite(b.position).all(axis=1)
    first, second = dcm_from_rpy(np.nan_to_num(a.attitude)), dcm_from_rpy(np.nan_to_num(b.attitude))
    middle = dcm_from_rpy(np.nan_to_num(source.reference_states(starts + 0.5 * _INTERVAL).attitude))
    relative = np.swapaxes(first, 1, 2) @ second
    latitude = float(np.nanmedian(a.position[:, 0])) if known.any() else 0.0
    height = float(np.nanmedian(a.position[:, 2])) if known.any() else 0.0
    turned = _rotation_vector(relative) + _INTERVAL * np.einsum("nji,j->ni", middle, earth_rate(latitude))
    up = np.array([0.0, 0.0, -gravity(latitude, height)])
    change = np.nan_to_num((b.velocity - a.velocity) / _INTERVAL)
    return turned, np.einsum("nji,nj->ni", middle, up + change), np.asarray(known, dtype=np.bool_)


def _rotation_vector(dcm: Array) -> Array:
    """(n, 3) rotation vectors of (n, 3, 3) matrices whose angles are below half a turn."""
    axis = 0.5 * np.stack(
        [dcm[:, 2, 1] - dcm[:, 1, 2], dcm[:, 0, 2] - dcm[:, 2, 0], dcm[:, 1, 0] - dcm[:, 0, 1]], axis=-1
    )
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(dcm, axis1=1, axis2=2) - 1.0))
    small = sine < 1e-9  # there the vector is its sine
    return np.asarray(axis * np.where(small, 1.0, angle / np.where(small, 1.0, sine))[:, None])
