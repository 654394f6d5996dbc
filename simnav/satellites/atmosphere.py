"""Delays of signals in the ionosphere and the troposphere.

The ionosphere: Klobuchar's model with the coefficients that GPS broadcasts, for the frequency of GPS L1, Galileo E1 and
BeiDou B1C, 1575.42 MHz. The troposphere: Saastamoinen's zenith delays in a standard atmosphere, and Niell's mapping
functions.

Source: J. A. Klobuchar, *Ionospheric time-delay algorithm for single-frequency GPS users*, IEEE Transactions on
Aerospace and Electronic Systems 1987, and *IS-GPS-200N*, 2022, section 20.3.3.5.2.5; J. Saastamoinen, *Atmospheric
correction for the troposphere and stratosphere in radio ranging of satellites*, Geophysical Monograph Series 15, 1972;
A. E. Niell, *Global mapping functions for the atmosphere delay at radio wavelengths*, Journal of Geophysical Research
1996, tables 3 and 4. The standard atmosphere is that of the program RTKLIB 2.4.2, manual, appendix E.5.
"""

from __future__ import annotations

from math import cos, exp, pi, sin
from typing import NamedTuple

from simnav.compiled import Array, helper
from simnav.satellites.orbit import SPEED_OF_LIGHT

__all__ = [
    "HUMIDITY",
    "MappingCoefficients",
    "ionosphere_scalar",
    "mapping_coefficients",
    "mapping_scalar",
    "zenith_delay_scalar",
]

#: Relative humidity of the standard atmosphere [-].
HUMIDITY = 0.5
_SHORTEST = 5e-9  # the delay at night [s]
#: Niell's coefficients at latitudes 15, 30, 45, 60 and 75 degrees: hydrostatic average, its annual amplitude, and wet,
#: a, b and c of each.
_NIELL = (
    (1.2769934e-3, 1.2683230e-3, 1.2465397e-3, 1.2196049e-3, 1.2045996e-3),
    (2.9153695e-3, 2.9152299e-3, 2.9288445e-3, 2.9022565e-3, 2.9024912e-3),
    (62.610505e-3, 62.837393e-3, 63.721774e-3, 63.824265e-3, 64.258455e-3),
    (0.0, 1.2709626e-5, 2.6523662e-5, 3.4000452e-5, 4.1202191e-5),
    (0.0, 2.1414979e-5, 3.0160779e-5, 7.2562722e-5, 11.723375e-5),
    (0.0, 9.0128400e-5, 4.3497037e-5, 84.795348e-5, 170.37206e-5),
    (5.8021897e-4, 5.6794847e-4, 5.8118019e-4, 5.9727542e-4, 6.1641693e-4),
    (1.4275268e-3, 1.5138625e-3, 1.4572752e-3, 1.5007428e-3, 1.7599082e-3),
    (4.3472961e-2, 4.6729510e-2, 4.3908931e-2, 4.4626982e-2, 5.4736038e-2),
)
_HEIGHT_A, _HEIGHT_B, _HEIGHT_C = 2.53e-5, 5.49e-3, 1.14e-3


@helper
def ionosphere_scalar(
    coefficients: Array, second_of_day: float, latitude: float, longitude: float, azimuth: float, elevation: float
) -> float:
    """Klobuchar's delay of a signal on 1575.42 MHz.

    Parameters
    ----------
    coefficients : (8,) array
        alpha_0 to alpha_3 and beta_0 to beta_3.
    second_of_day : float
        GPS time of the day [s].
    latitude, longitude : float
        Of the receiver [rad].
    azimuth, elevation : float
        Of the satellite [rad].

    Returns
    -------
    float
        Delay as a length [m].
    """
    e = elevation / pi
    angle = 0.0137 / (e + 0.11) - 0.022
    phi = latitude / pi + angle * cos(azimuth)
    phi = min(max(phi, -0.416), 0.416)
    lam = longitude / pi + angle * sin(azimuth) / cos(phi * pi)
    phi += 0.064 * cos((lam - 1.617) * pi)
    t = (43200.0 * lam + second_of_day) % 86400.0
    slant = 1.0 + 16.0 * (0.53 - e) ** 3
    amplitude = coefficients[0] + phi * (coefficients[1] + phi * (coefficients[2] + phi * coefficients[3]))
    period = coefficients[4] + phi * (coefficients[5] + phi * (coefficients[6] + phi * coefficients[7]))
    amplitude, period = max(amplitude, 0.0), max(period, 72000.0)
    x = 2.0 * pi * (t - 50400.0) / period
    delay = _SHORTEST
    if abs(x) < 1.57:
        delay += amplitude * (1.0 - x * x / 2.0 + x**4 / 24.0)
    return SPEED_OF_LIGHT * slant * delay


@helper
def zenith_delay_scalar(latitude: float, height: float, humidity: float) -> tuple[float, float]:
    """Saastamoinen's hydrostatic and wet delay at the zenith [m], at a latitude [rad], height [m] and humidity [-]."""
    h = max(height, 0.0)
    pressure = 1013.25 * (1.0 - 2.2557e-5 * h) ** 5.2568
    temperature = 15.0 - 6.5e-3 * h + 273.16
    vapour = 6.108 * humidity * exp((17.15 * temperature - 4684.0) / (temperature - 38.45))
    dry = 0.0022768 * pressure / (1.0 - 0.00266 * cos(2.0 * latitude) - 0.00028 * h / 1000.0)
    return dry, 0.002277 * (1255.0 / temperature + 0.05) * vapour


@helper
def _fraction(s: float, a: float, b: float, c: float) -> float:
    """Marini's continued fraction, 1 at the zenith."""
    return (1.0 + a / (1.0 + b / (1.0 + c))) / (s + a / (s + b / (s + c)))


@helper
def _between(row: int, degrees: float) -> float:
    """A coefficient at a latitude [deg]: linear between the latitudes of the table, constant beyond them."""
    place = min(max((degrees - 15.0) / 15.0, 0.0), 4.0)
    k = min(int(place), 3)
    share: float = place - k
    first: float = _NIELL[row][k]
    second: float = _NIELL[row][k + 1]
    return first + share * (second - first)


class MappingCoefficients(NamedTuple):
    """Niell's coefficients of the mapping functions.

    Attributes
    ----------
    dry_a, dry_b, dry_c : float
        Of the hydrostatic mapping function.
    wet_a, wet_b, wet_c : float
        Of the wet mapping function.
    """

    dry_a: float
    dry_b: float
    dry_c: float
    wet_a: float
    wet_b: float
    wet_c: float


@helper
def mapping_coefficients(day_of_year: float, latitude: float) -> MappingCoefficients:
    """Niell's coefficients a, b, c of the hydrostatic and of the wet mapping function.

    Parameters
    ----------
    day_of_year : float
        1.0 is the begin of 1 January [d].
    latitude : float
        Of the receiver [rad].
    """
    degrees = abs(latitude) * 180.0 / pi
    season = cos(2.0 * pi * ((day_of_year - 28.0) / 365.25 + (0.5 if latitude < 0.0 else 0.0)))
    a = _between(0, degrees) - _between(3, degrees) * season
    b = _between(1, degrees) - _between(4, degrees) * season
    c = _between(2, degrees) - _between(5, degrees) * season
    return MappingCoefficients(a, b, c, _between(6, degrees), _between(7, degrees), _between(8, degrees))


@helper
def mapping_scalar(mapping: MappingCoefficients, height: float, elevation: float) -> tuple[float, float]:
    """Niell's hydrostatic and wet mapping function: the slant delay in units of the zenith delay.

    Parameters
    ----------
    mapping : MappingCoefficients
        The coefficients.
    height : float
        Of the receiver [m].
    elevation : float
        Of the satellite, above 0 [rad].
    """
    s = sin(elevation)
    above = (1.0 / s - _fraction(s, _HEIGHT_A, _HEIGHT_B, _HEIGHT_C)) * height / 1000.0
    dry = _fraction(s, mapping.dry_a, mapping.dry_b, mapping.dry_c) + above
    return dry, _fraction(s, mapping.wet_a, mapping.wet_b, mapping.wet_c)
