"""Units that a column of a log may have."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Mapping

from simnav.spec import UNITS, closest

__all__ = ["DIMENSIONS", "LOG_UNITS", "check_dimension", "check_units", "dimension", "factor"]

#: Factor to SI of every unit that a column of a log may have: those of TOML keys, and some that only logs have.
LOG_UNITS: Mapping[str, float] = ChainMap(
    {
        "1": 1.0,
        "rad": 1.0,
        "rad_s": 1.0,
        "ft": 0.3048,
        "km_h": 1.0 / 3.6,
        "ms": 1e-3,
        "us": 1e-6,
        "ns": 1e-9,
    },
    UNITS,
)

#: Units by what they measure, for those that a column may well have.
DIMENSIONS: Mapping[str, tuple[str, ...]] = {
    "length": ("m", "mm", "cm", "km", "ft"),
    "speed": ("m_s", "mm_s", "cm_s", "kn", "km_h"),
    "acceleration": ("m_s2", "g", "mg", "ug"),
    "angle": ("deg", "rad", "arcsec"),
    "angular rate": ("deg_s", "rad_s", "deg_min", "deg_h"),
    "time": ("s", "ms", "us", "ns", "min", "h"),
}


def _parts(unit: str) -> tuple[float, str]:
    """The number before a unit, 1 where there is none, and the unit."""
    number, blank, name = unit.strip().partition(" ")
    if not blank:
        return 1.0, unit
    try:
        scale = float(number)
    except ValueError:
        scale = math.nan
    if not math.isfinite(scale) or scale == 0.0:
        raise ValueError(f"unit {unit!r}: a number other than 0 and a unit are wanted, like '1e-7 deg'")
    return scale, name.strip()


def factor(unit: str) -> float:
    """Factor of a unit to SI; a number may stand before its name.

    Raises
    ------
    ValueError
        If there is no such unit.

    Examples
    --------
    >>> factor("km"), factor("0.1 m")
    (1000.0, 0.1)
    """
    scale, name = _parts(unit)
    if name not in LOG_UNITS:
        raise ValueError(f"unknown unit {name!r}{closest(name, list(LOG_UNITS))}")
    return scale * LOG_UNITS[name]


def dimension(unit: str) -> str:
    """What a unit measures: a key of `DIMENSIONS`, or empty where none of them."""
    name = _parts(unit)[1]
    return next((what for what, units in DIMENSIONS.items() if name in units), "")


def check_dimension(key: str, unit: str, *wanted: str) -> None:
    """ValueError where a unit is of none of these dimensions; "1" is SI and always fits."""
    if _parts(unit)[1] != "1" and dimension(unit) not in wanted:
        known = ", ".join(name for dimension in wanted for name in DIMENSIONS[dimension])
        raise ValueError(f"{key} = {unit!r} is no unit of {' or '.join(wanted)} ({known})")


def check_units(units: tuple[str, ...]) -> None:
    """ValueError where one of them is unknown."""
    for unit in units:
        factor(unit)
