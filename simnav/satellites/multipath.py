"""The error of a range when a reflected signal arrives after the direct one, or alone.

With the amplitude a of the reflected signal relative to the direct one, the excess path p, the phase
``phi = 2 pi p / wavelength + pi`` (a reflection turns it by half a turn), the chip length C and the spacing s of early
and late correlator in chips, a coherent discriminator has the error ::

    a cos(phi) p / (1 + a cos(phi))     as long as both correlators are on the slopes of both peaks
    a cos(phi) s C / 2                  beyond, up to p = (1 - s / 2) C
    linearly to 0                       from there to p = (1 + s / 2) C

The error is the smaller of the first two, up to the last stretch. A signal that comes only by a reflection has the
error p, whatever the correlators. The direct and the reflected signal add to the amplitude ``|1 + a exp(i phi)|``.

Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., Artech
House 2013, section 9.3.4; A. J. Van Dierendonck, P. Fenton and T. Ford, *Theory and performance of narrow correlator
spacing in a GPS receiver*, Navigation 1992.
"""

from __future__ import annotations

import numpy as np

from simnav.satellites.orbit import SPEED_OF_LIGHT
from simnav.types import Array

__all__ = ["CHIP", "WAVELENGTH", "multipath_error", "sea_reflection", "strength_change"]

#: Length of a chip of GPS C/A, Galileo E1 and BeiDou B1C [m].
CHIP = SPEED_OF_LIGHT / 1.023e6
#: Wavelength of L1 [m].
WAVELENGTH = SPEED_OF_LIGHT / 1575.42e6


def _phase(excess: Array) -> Array:
    return np.asarray(2.0 * np.pi * excess / WAVELENGTH + np.pi)


def sea_reflection(height: Array, elevation: Array, amplitude: float, significant_height: float) -> tuple[Array, Array]:
    """The signal that the sea reflects to an antenna above it, as a plane mirror with waves.

    With the height h above the sea and the elevation e of the satellite the reflected way is ``2 h sin(e)`` longer.
    Waves of the standard deviation ``s = Hs / 4`` weaken the coherent part by ``exp(-8 pi^2 s^2 sin^2(e) / w^2)``, w
    being the wavelength (W. S. Ament, *Toward a theory of reflection by a rough surface*, Proc. IRE 1953; P. Beckmann
    and A. Spizzichino, *The Scattering of Electromagnetic Waves from Rough Surfaces*, 1963). The rest is diffuse, and
    not modelled.

    Parameters
    ----------
    height : array
        Of the antenna above the sea [m]; below it there is no reflection.
    elevation : array
        Of the satellite [rad], of a shape that goes with that of the height.
    amplitude : float
        Of the signal that a smooth sea reflects, in units of the direct one, after the antenna's suppression [-].
    significant_height : float
        Of the waves [m].

    Returns
    -------
    excess : array
        How much longer the reflected way is [m]; infinite without a reflection.
    amplitude : array
        Amplitude of the reflected signal [-].
    """
    up = np.sin(elevation)
    excess = np.where((height > 0.0) & (up > 0.0), 2.0 * height * up, np.inf)
    rough = 0.25 * significant_height * up / WAVELENGTH
    return excess, np.asarray(amplitude * np.exp(-8.0 * np.pi**2 * rough**2))


def multipath_error(excess: Array, amplitude: Array | float, spacing: float) -> Array:
    """Error of the range when direct and reflected signal arrive [m].

    Parameters
    ----------
    excess : array
        Excess path of the reflected signal [m]; infinite without one.
    amplitude : array_like
        Of the reflected signal, in units of the direct one, below 1 [-].
    spacing : float
        Of early and late correlator [chips].
    """
    there = excess < (1.0 + 0.5 * spacing) * CHIP
    p = np.where(there, excess, 0.0)
    share = amplitude * np.cos(_phase(p))
    slope, plateau = share * p / (1.0 + share), 0.5 * share * spacing * CHIP
    error = np.where(abs(slope) < abs(plateau), slope, plateau)
    fading = np.clip(((1.0 + 0.5 * spacing) * CHIP - p) / (spacing * CHIP), 0.0, 1.0)
    return np.asarray(np.where(there, error * fading, 0.0))


def strength_change(excess: Array, amplitude: Array | float) -> Array:
    """Change of C/N0 by a reflected signal that arrives with the direct one [dB]; arguments as above."""
    there = excess < CHIP
    phase = _phase(np.where(there, excess, 0.0))
    change = 10.0 * np.log10(1.0 + amplitude**2 + 2.0 * amplitude * np.cos(phase))
    return np.asarray(np.where(there, change, 0.0))
