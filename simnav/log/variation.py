"""Magnetic variation along a track, by the World Magnetic Model (an extra: pygeomag)."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from simnav.log.table import LogError
from simnav.types import Array

__all__ = ["dated", "variation_along"]

#: Clocks that count from 1970 have larger numbers [s]; others say nothing about the date.
_UTC = 1e8
#: Number of places along a track at which the model is evaluated.
_PLACES = 25


def dated(time: Array) -> bool:
    """Whether times count from 1970, so that they tell the date."""
    return len(time) > 0 and bool(time[0] >= _UTC)


def variation_along(track_time: Array, track: Array, time: Array) -> Array:
    """Magnetic variation at n times, positive east.

    Parameters
    ----------
    track_time : (m,) array
        Times of the positions, in seconds since 1970.
    track : (m, 3) array
        Latitude, longitude [rad], height [m], which is not used: the variation is that at sea level.
    time : (n,) array
        Times at which the variation is wanted.

    Returns
    -------
    (n,) array
        Interpolated between some places along the track [rad].

    Raises
    ------
    LogError
        If the library is not installed, the clock has no date, or no edition of the model holds at the date.
    """
    try:
        from pygeomag import GeoMag
    except ImportError:
        raise LogError(
            "variation_model = 'wmm' needs the library pygeomag: pip install 'simnav[logs]'; or give variation_deg"
        ) from None
    if not dated(track_time):
        raise LogError(
            f"variation_model = 'wmm' needs the date, but the clock of the reference starts at {track_time[0]:.0f} s, "
            "not in seconds since 1970; add the date by offset_s, or give variation_deg"
        )
    places = np.unique(np.linspace(0, len(track_time) - 1, _PLACES).astype(int))
    moments = [_decimal_year(float(track_time[k])) for k in places]
    try:
        model = GeoMag(coefficients_file=f"wmm/WMM_{max(2010, 5 * int(moments[0] // 5))}.COF")
        found = [
            model.calculate(np.degrees(track[k, 0]), np.degrees(track[k, 1]), 0.0, moment).d
            for k, moment in zip(places, moments, strict=True)
        ]
    except (ValueError, OSError) as error:
        raise LogError(
            f"variation_model = 'wmm': no edition of the model holds in {moments[0]:.1f} ({error}); give variation_deg"
        ) from None
    return np.interp(time, track_time[places], np.unwrap(np.radians(found)))


def _decimal_year(moment: float) -> float:
    date = datetime.fromtimestamp(moment, tz=UTC)
    begin = datetime(date.year, 1, 1, tzinfo=UTC)
    return date.year + (date - begin) / (datetime(date.year + 1, 1, 1, tzinfo=UTC) - begin)
