"""Sizes of faults: one for each quantity, and from it one for each component of an instrument."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from simnav.types import KINDS, Array

__all__ = ["QUANTITIES", "QUANTITY_OF", "Size", "axes_of", "size_by_component", "size_range"]

#: A number for all axes, or one per axis.
Size = float | tuple[float, ...] | None

#: Sizes are given for errors of these: the end of a field's name, and the units of the components that it is for.
QUANTITIES = {
    "position": ("m", "mm", "cm", "km"),
    "velocity": ("m_s", "mm_s", "cm_s", "kn"),
    "heading": ("deg", "arcsec"),
}
QUANTITY_OF = {unit: name for name, units in QUANTITIES.items() for unit in units}


def axes_of(kind: str) -> dict[str, list[int]]:
    """The components of a kind of instrument whose errors are of each quantity; "" for those of none."""
    axes: dict[str, list[int]] = {}
    for i, component in enumerate(KINDS[kind].components):
        axes.setdefault(QUANTITY_OF.get(component.error_unit, ""), []).append(i)
    return axes


def size_by_component(sizes: Mapping[str, Any], stem: str, kind: str) -> Array | None:
    """The size of a fault for each of the d components of a kind of instrument.

    Parameters
    ----------
    sizes : mapping
        Fields of the fault's specification, or of its label, SI units.
    stem : str
        As in ``FaultSpec.stems``.
    kind : str
        Kind of the instrument.

    Returns
    -------
    (d,) array or None
        None where a size is not given.
    """
    result = np.empty(len(KINDS[kind].components))
    for name, axes in axes_of(kind).items():
        size = sizes.get(f"{stem}_{name}")
        if size is None:
            return None
        result[axes] = size
    return result


def size_range(sizes: Mapping[str, Any], stem: str, kind: str) -> tuple[Array, Array]:
    """Likewise the (d,) smallest and largest size, where a size is [minimum, maximum]."""
    low, high = np.empty((2, len(KINDS[kind].components)))
    for name, axes in axes_of(kind).items():
        low[axes], high[axes] = sizes[f"{stem}_{name}"]
    return low, high
