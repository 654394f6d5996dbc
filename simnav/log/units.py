"""Units that a column of a log may have."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Mapping, Sequence

from simnav.spec import UNITS, closest

__all__ = ["DIMENSIONS", "LOG_UNITS", "check_dimension", "check_units", "dimension", "factor", "spelt", "units_row"]

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

#: Units as headers write them, in brackets or after an underscore at the end, where they are not those of `LOG_UNITS`.
_SPELT = {
    "dps": "deg_s", "deg/s": "deg_s", "deg/sec": "deg_s", "degs": "deg_s", "\N{DEGREE SIGN}/s": "deg_s",
    "rad/s": "rad_s", "rad/sec": "rad_s", "rads": "rad_s", "rps": "rad_s",
    "rad s^-1": "rad_s", "m s^-2": "m_s2", "m s^-1": "m_s",
    "m/s2": "m_s2", "m/s^2": "m_s2", "m/s/s": "m_s2", "m/s\N{SUPERSCRIPT TWO}": "m_s2", "mps2": "m_s2", "ms2": "m_s2",
    "m/s": "m_s", "mps": "m_s", "km/h": "km_h", "kmh": "km_h", "kt": "kn", "kts": "kn", "knots": "kn",
    "sec": "s", "secs": "s", "seconds": "s", "msec": "ms", "usec": "us", "nsec": "ns",
    "degree": "deg", "degrees": "deg", "\N{DEGREE SIGN}": "deg", "e7": "1e-7 deg", "dege7": "1e-7 deg",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m",
}  # fmt: skip


def spelt(text: str) -> str:
    """A unit as a log writes it, by its name in `LOG_UNITS`; empty for what cannot be one.

    Examples
    --------
    >>> spelt("deg/s"), spelt("kts"), spelt("m")
    ('deg_s', 'kn', 'm')
    """
    return _SPELT.get(text.lower(), "" if " " in text else text)


def units_row(cells: Sequence[str]) -> tuple[str, ...] | None:
    """The units in a row of them below a header, empty where it has none; None for another row.

    Examples
    --------
    >>> units_row(["[s]", "deg", "", "hPa"])
    ('s', 'deg', '', '')
    >>> units_row(["0", "1"])
    """
    texts = [c.strip().strip("[]()").strip() for c in cells]
    units = tuple(next((u for u in (spelt(t), spelt(t.lower())) if dimension(u)), "") for t in texts)
    found, written = sum(map(bool, units)), sum(bool(t.strip("-")) for t in texts)
    return units if 2 * found >= max(1, written) else None


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
