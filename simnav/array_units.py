"""Units of the values in arrays, beside those of files: SI and radians, whatever the unit of a file is."""

from __future__ import annotations

__all__ = ["in_arrays"]

#: Units in which arrays are, for those of files that differ; others of `simnav.spec.UNITS` are SI themselves.
_IN_ARRAYS = {
    **dict.fromkeys(("deg", "arcsec", "mrad"), "rad"),
    **dict.fromkeys(("mm", "cm", "km"), "m"),
    **dict.fromkeys(("min", "h"), "s"),
    **dict.fromkeys(("ug", "mg", "g", "mm_s2", "m_s2"), "m/s²"),
    **dict.fromkeys(("m_s", "mm_s", "cm_s", "kn"), "m/s"),
    **dict.fromkeys(("deg_s", "deg_min", "deg_h"), "rad/s"),
    **dict.fromkeys(("", "percent", "ppm"), "-"),
    "hz": "Hz",
    "k": "K",
    "nt": "T",
}


def in_arrays(unit: str) -> str:
    """The unit in which arrays have a value that is in ``unit`` in files.

    >>> in_arrays("deg"), in_arrays("m_s"), in_arrays("m"), in_arrays("kpa")
    ('rad', 'm/s', 'm', 'kpa in SI')
    """
    if unit in _IN_ARRAYS:
        return _IN_ARRAYS[unit]
    return unit if unit in ("m", "s") else f"{unit} in SI"
