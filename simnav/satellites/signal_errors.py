"""Strength and errors of the signals of satellites.

- The density ratio C/N0 grows with the sine of the elevation, from 31.5 dB-Hz at the horizon to 49.5 dB-Hz at the
  zenith. This was fitted to a Septentrio mosaic-X5 with a geodetic antenna (22 satellites over 15 minutes on 19 March
  2021; 1.5 dB at most between fit and the mean of a satellite above 10 degrees).
- White noise grows with the amplitude of the thermal noise, so with 10^(-C/N0/20). Datasheets state it at 45 dB-Hz.
- The error of the multipath in open surroundings is 0.13 m + 0.53 m exp(-elevation / 10 degrees), one sigma.
- Two frequencies, L1 and L5, without the ionosphere: errors of the range times 2.59, which is the norm of the weights
  f1^2 / (f1^2 - f5^2) and f5^2 / (f1^2 - f5^2).

Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., Artech
House 2013, sections 9.3.3 (noise) and 9.4; multipath: RTCA DO-229D, appendix J; T. Murphy et al., *Results from the
program for the investigation of airborne multipath errors*, ION NTM 2005.
"""

from __future__ import annotations

from math import hypot, pi
from typing import TypeVar

import numpy as np

from simnav.compiled import helper
from simnav.types import Array

__all__ = ["NOMINAL_DENSITY_RATIO", "amplification", "density_ratio", "noise_factor", "range_error"]

Number = TypeVar("Number", float, Array)

#: C/N0 at which datasheets state the noise [dB-Hz].
NOMINAL_DENSITY_RATIO = 45.0
_AT_HORIZON, _GAIN = 31.5, 18.0
_MULTIPATH, _LOW_MULTIPATH, _MULTIPATH_ANGLE = 0.13, 0.53, 10.0 / 180.0 * pi
_L1, _L5 = 1575.42e6, 1176.45e6
_TWO_FREQUENCIES = hypot(_L1**2, _L5**2) / (_L1**2 - _L5**2)


def density_ratio(elevation: Array) -> Array:
    """C/N0 [dB-Hz] of signals with nothing in their way, from elevations [rad] of any shape."""
    return np.asarray(_AT_HORIZON + _GAIN * np.sin(elevation))


def noise_factor(ratio: Number) -> Number:
    """The white noise in units of that of the datasheet, from C/N0 [dB-Hz] of any shape."""
    factor: Number = 10.0 ** ((NOMINAL_DENSITY_RATIO - ratio) / 20.0)
    return factor


def amplification(frequencies: int) -> float:
    """What errors of the range are multiplied by that differ on each frequency: noise and multipath."""
    return 1.0 if frequencies == 1 else _TWO_FREQUENCIES


@helper
def range_error(elevation: Array | float, signal: float, multipath: float) -> Array:
    """One sigma [m] of the error of a satellite's range that lasts for minutes.

    Parameters
    ----------
    elevation : array_like
        Of the satellites [rad].
    signal : float
        Error of orbit and clock [m].
    multipath : float
        Error of the multipath in units of that of open surroundings [-].
    """
    bounced = _MULTIPATH + _LOW_MULTIPATH * np.exp(-elevation / _MULTIPATH_ANGLE)
    return np.hypot(signal, multipath * bounced)
