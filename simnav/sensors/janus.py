"""Four beams of a Doppler velocity log (a Janus array): their directions, their noise, and the velocity that they give.

The beam j points down at the angle theta from the vertical axis of the instrument, at the azimuth ``a_j``; the azimuths
are 90 degrees apart. Its reading is the component of the velocity of the transducer along it. Noise by range follows
from the sonar equation: a bottom that is wider than the beam weakens the echo by ``20 log r + 2 alpha r`` dB, with the
absorption alpha of sea water, and the standard deviation of a Doppler estimate from the correlation of two pulses is
``sqrt(rho^-2 - 1)`` in proportion, with ``rho = rho_0 / (1 + 1/S)`` at the ratio S of signal to noise.

Sources: B. H. Brumley, R. G. Cabrera, K. L. Deines and E. A. Terray, *Performance of a broad-band acoustic Doppler
current profiler*, IEEE Journal of Oceanic Engineering 16 (4), 1991 (noise by correlation); M. A. Ainslie and J. G.
McColm, *A simplified formula for viscous and chemical absorption in sea water*, Journal of the Acoustical Society of
America 103 (3), 1998; R. J. Urick, *Principles of Underwater Sound*, 3rd edition, 1983, chapter 8 (echo of the bottom);
Teledyne RD Instruments, *ADCP coordinate transformation: formulas and calculations*, 2010 (error velocity, solutions of
three beams).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simnav.compiled import Integers
from simnav.types import Array

__all__ = ["JanusSolution", "absorption", "beam_axes", "noise_by_range", "signal_margin", "solve_beams"]

#: Correlation of the two halves of a coded pulse without noise: each is correlated with the other half only.
_CORRELATION = 0.5
#: Range below which spreading is not counted further [m].
_NEAREST = 0.1


def beam_axes(azimuth: Array, slant: Array | float) -> Array:
    """(..., 3) unit vectors of beams in the axes of the instrument (forward, starboard, down).

    Parameters
    ----------
    azimuth : (...) array
        From forward to starboard [rad].
    slant : (...) array or float
        Angle from straight down [rad].
    """
    level = np.sin(slant)
    return np.stack(np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), np.cos(slant)), axis=-1)


def absorption(frequency: float, temperature: float = 10.0, salinity: float = 35.0, depth: float = 0.0) -> float:
    """Absorption of sound in sea water of pH 8 by Ainslie and McColm (1998).

    Parameters
    ----------
    frequency : float
        [kHz]
    temperature : float
        [deg C]
    salinity : float
        Practical salinity.
    depth : float
        [km]

    Returns
    -------
    float
        [dB/m]

    Examples
    --------
    >>> round(absorption(300.0), 3), round(absorption(600.0), 3)
    (0.076, 0.17)
    """
    boric = 0.78 * np.sqrt(salinity / 35.0) * np.exp(temperature / 26.0)
    magnesium = 42.0 * np.exp(temperature / 17.0)
    f2 = frequency**2
    in_boric = 0.106 * boric * f2 / (boric**2 + f2)
    in_magnesium = (
        0.52 * (1.0 + temperature / 43.0) * (salinity / 35.0) * magnesium * f2 / (magnesium**2 + f2)
    ) * np.exp(-depth / 6.0)
    in_water = 0.00049 * f2 * np.exp(-(temperature / 27.0 + depth / 17.0))
    return float(1e-3 * (in_boric + in_magnesium + in_water))


def signal_margin(distance: Array, reach: float, damping: float) -> Array:
    """Ratio of signal to noise of an echo of the bottom, by range [dB]: 0 at the reach.

    Parameters
    ----------
    distance : array
        Slant range [m].
    reach : float
        Slant range at which the echo is as strong as the noise [m].
    damping : float
        Absorption [dB/m].
    """
    r = np.maximum(distance, _NEAREST)
    with np.errstate(invalid="ignore"):
        margin: Array = 20.0 * np.log10(reach / r) + 2.0 * damping * (reach - r)
    return np.where(np.isfinite(r), margin, -np.inf)


def noise_by_range(margin: Array) -> Array:
    """The noise of a beam in units of that of a strong echo, at a ratio of signal to noise [dB] (see the module)."""
    with np.errstate(over="ignore"):
        weaker = 1.0 + 10.0 ** (-np.asarray(margin) / 10.0)
    return np.sqrt(((weaker / _CORRELATION) ** 2 - 1.0) / (_CORRELATION**-2 - 1.0))


@dataclass(frozen=True)
class JanusSolution:
    """The velocities that the beams of n pings give; NaN with fewer than three beams.

    Attributes
    ----------
    velocity : (n, 3) array
        Forward, starboard, down in the axes of the instrument [m/s].
    error_velocity : (n,) array
        With four beams the disagreement of their two opposite pairs, as large as the noise of a horizontal component
        [m/s]; NaN with three.
    figure_of_merit : (n,) array
        Predicted standard deviation of the horizontal velocity, root of the sum of both components [m/s].
    covariance : (n, 3, 3) array
        Of the velocity [m^2/s^2].
    beams : (n,) array of int
        Number of beams that were heard.
    """

    velocity: Array
    error_velocity: Array
    figure_of_merit: Array
    covariance: Array
    beams: Integers


def solve_beams(radial: Array, azimuth: Array, slant: Array, sigma: Array) -> JanusSolution:
    """Solve the beams of n pings by least squares with equal weights, as instruments do.

    Parameters
    ----------
    radial : (n, 4) array
        Velocity along each beam [m/s]; NaN where the beam is lost.
    azimuth, slant : (4,) array
        Directions of the beams [rad].
    sigma : (n, 4) array
        Standard deviation of each reading [m/s].

    Examples
    --------
    >>> azimuth = np.radians([45.0, 135.0, 225.0, 315.0])
    >>> slant = np.full(4, np.radians(30.0))
    >>> radial = beam_axes(azimuth, slant) @ [2.0, 0.5, -0.1]
    >>> found = solve_beams(radial[None], azimuth, slant, np.full((1, 4), 0.002))
    >>> found.velocity.round(6), found.figure_of_merit.round(6)
    (array([[ 2. ,  0.5, -0.1]]), array([0.004]))
    """
    n = len(radial)
    axes, heard = beam_axes(azimuth, slant), np.isfinite(radial)
    beams = heard.sum(axis=1)
    velocity, covariance, wrong = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full(n, np.nan)
    for lost in (None, 0, 1, 2, 3):
        use = np.arange(4) != (-1 if lost is None else lost)
        of = (heard == use).all(axis=1)
        inverse = np.linalg.pinv(axes[use])
        # Summed beam by beam: the last bits of a product of matrices depend on how many pings there are.
        velocity[of] = sum(radial[of, beam, None] * part for beam, part in zip(np.flatnonzero(use), inverse.T))
        covariance[of] = np.einsum("ik,nk,jk->nij", inverse, np.square(sigma[of][:, use]), inverse)
    signs = np.empty(4)
    signs[np.argsort(azimuth)] = [1.0, -1.0, 1.0, -1.0]
    whole = beams == 4
    wrong[whole] = radial[whole] @ signs / (2.0 * np.sqrt(2.0) * float(np.sin(np.mean(slant))))
    merit = np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])
    return JanusSolution(velocity, wrong, merit, covariance, beams)
