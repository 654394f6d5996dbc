"""Position, velocity and time from the pseudoranges and their rates of one moment, by weighted least squares.

With the satellites at s_j and the antenna at r, the corrected pseudoranges are ``|s_j - r| + b + v_j`` and the rates
``u_j . (s'_j - r') + d + w_j``, with u_j from the antenna to the satellite. The solution minimises the sum of the
squared residuals, weighted by the inverse V of the covariance of the errors (Gauss-Newton for the position, linear for
the velocity). The covariance is not diagonal: the errors of the models of the atmosphere are common to all satellites.

RAIM: with n satellites and a correct covariance the weighted sum of squares is chi-square distributed with n - 4
degrees of freedom. If it is beyond the quantile of the false-alarm probability, the satellite with the largest
normalised residual is excluded, and the rest is tested again. At least one degree of freedom must be left for the test.
With the residuals e of the covariance Q the normalised residual of satellite j is ``(V e)_j / sqrt((V Q V)_jj)``.

Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., Artech
House 2013, sections 9.4.1 and 17.4.1; B. W. Parkinson and P. Axelrad, *Autonomous GPS integrity monitoring using the
pseudorange residual*, Navigation 1988; exclusion: W. Baarda, *A testing procedure for use in geodetic networks*, 1968.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import SEMI_MAJOR_AXIS
from simnav.geometry.ecef import geodetic_from_ecef, ned_from_ecef
from simnav.types import Array

__all__ = ["PointSolution", "Ranges", "monitored", "solve"]

#: Unknowns of a position with its clock: the least number of satellites.
UNKNOWNS = 4
_STEPS, _CONVERGED = 15, 1e-5
#: A geometry with a larger dilution of precision gives no solution.
_LARGEST_DOP = 30.0
#: Heights beyond these are no solution near the Earth's surface [m].
_LOWEST, _HIGHEST = -2e4, 1e5


class Ranges(NamedTuple):
    """The corrected observations of n satellites at one moment.

    Attributes
    ----------
    position, velocity : (n, 3) array
        Apparent position [m] and velocity [m/s] of the satellites, Earth-fixed.
    pseudorange, rate : (n,) array
        Pseudorange without clock error of the satellite and modelled delays [m], and its rate [m/s].
    covariance : (n, n) array
        Covariance of the errors of the pseudoranges [m^2].
    rate_sigma : (n,) array
        One sigma of the errors of the rates, which are independent [m/s].
    """

    position: Array
    velocity: Array
    pseudorange: Array
    rate: Array
    covariance: Array
    rate_sigma: Array

    def only(self, used: NDArray[np.bool_]) -> Ranges:
        """The observations of some satellites."""
        position, velocity, pseudorange, rate, covariance, rate_sigma = self
        return Ranges(
            position[used], velocity[used], pseudorange[used], rate[used], covariance[np.ix_(used, used)],
            rate_sigma[used],
        )  # fmt: skip


class PointSolution(NamedTuple):
    """A solution.

    Attributes
    ----------
    position : (3,) array
        Latitude, longitude [rad], height [m] of the antenna.
    velocity : (3,) array
        North-east-down [m/s].
    clock, drift : float
        Bias [m] and drift [m/s] of the receiver's clock.
    covariance, velocity_covariance : (3, 3) array
        Of the errors north-east-down, by the covariance of the observations.
    dilution : (3,) array
        Horizontal, vertical and position dilution of precision [-].
    residual : (m,) array
        Normalised residuals of the satellites that were used [-].
    statistic : float
        Weighted sum of the squared residuals [-].
    used : (n,) array of bool
        The satellites that were used.
    """

    position: Array
    velocity: Array
    clock: float
    drift: float
    covariance: Array
    velocity_covariance: Array
    dilution: Array
    residual: Array
    statistic: float
    used: NDArray[np.bool_]


def solve(ranges: Ranges) -> PointSolution | None:
    """The solution from all satellites; None with fewer than four, with a poor geometry, or far from the Earth."""
    n = len(ranges.pseudorange)
    if n < UNKNOWNS:
        return None
    weight = np.linalg.inv(ranges.covariance)
    mean = ranges.position.mean(axis=0)
    size = float(np.linalg.norm(mean))
    if size == 0.0:
        return None
    x = np.append(mean * (SEMI_MAJOR_AXIS / size), 0.0)
    for _ in range(_STEPS):
        away = ranges.position - x[:3]
        distance = np.linalg.norm(away, axis=1)
        sight = away / distance[:, None]
        design = np.column_stack([-sight, np.ones(n)])
        rest = ranges.pseudorange - distance - x[3]
        normal = design.T @ weight @ design
        if np.linalg.cond(normal) > 1e12:
            return None
        step = np.linalg.solve(normal, design.T @ (weight @ rest))
        x += step
        if np.linalg.norm(step) < _CONVERGED:
            break
    else:
        return None
    inverse, plain = np.linalg.inv(normal), np.linalg.inv(design.T @ design)
    position = geodetic_from_ecef(x[:3])
    axes = ned_from_ecef(position[0], position[1])
    geometry = axes @ plain[:3, :3] @ axes.T
    dilution = np.sqrt([geometry[0, 0] + geometry[1, 1], geometry[2, 2], np.trace(geometry)])
    if not (dilution[2] < _LARGEST_DOP and _LOWEST < position[2] < _HIGHEST):
        return None
    away = ranges.position - x[:3]
    distance = np.linalg.norm(away, axis=1)
    rest = ranges.pseudorange - distance - x[3]
    weighted = weight @ design
    spread = np.diag(weight) - np.einsum("ij,jk,ik->i", weighted, inverse, weighted)
    residual = weight @ rest / np.sqrt(np.maximum(spread, 1e-9 * np.diag(weight)))
    sight = away / distance[:, None]
    rates = ranges.rate - np.einsum("ij,ij->i", sight, ranges.velocity)
    weighted = np.column_stack([-sight, np.ones(n)]) / ranges.rate_sigma[:, None]
    moving = np.linalg.inv(weighted.T @ weighted)
    motion = moving @ (weighted.T @ (rates / ranges.rate_sigma))
    return PointSolution(
        position, axes @ motion[:3], float(x[3]), float(motion[3]), axes @ inverse[:3, :3] @ axes.T,
        axes @ moving[:3, :3] @ axes.T, dilution, residual, float(rest @ weight @ rest), np.ones(n, np.bool_),
    )  # fmt: skip


def monitored(ranges: Ranges, false_alarm: float) -> PointSolution | None:
    """The solution with RAIM and exclusion.

    Parameters
    ----------
    ranges : Ranges
        Observations of n satellites.
    false_alarm : float
        Probability that the test is failed without a fault; 0 for no test.

    Returns
    -------
    PointSolution or None
        None if there is no solution, or if the test is failed and no exclusion is possible. With four satellites there
        is no test.
    """
    used = np.ones(len(ranges.pseudorange), np.bool_)
    while True:
        found = solve(ranges.only(used))
        if found is None:
            return None
        redundant = int(used.sum()) - UNKNOWNS
        if false_alarm == 0.0 or redundant == 0 or found.statistic <= _threshold(redundant, false_alarm):
            return found._replace(used=used)
        if redundant < 2:
            return None
        worst = np.flatnonzero(used)[int(np.argmax(abs(found.residual)))]
        used = used.copy()
        used[worst] = False


@lru_cache(maxsize=256)
def _threshold(redundant: int, false_alarm: float) -> float:
    """Quantile of chi-square."""
    from scipy.special import chdtri  # to import scipy.stats takes 0.8 s

    return float(chdtri(redundant, false_alarm))
