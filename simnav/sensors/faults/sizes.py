"""Sizes of faults: from one size for each quantity to one size for each component of an instrument."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from simnav.types import KINDS, Array

__all__ = ["QUANTITIES", "QUANTITY_OF", "Size", "axes_of", "size_by_component", "size_range"]

#: A number for all axes, or one per axis.
Size = float | tuple[float, ...] | None

#: The quantities of sizes: the end of a field's name, and the units of the components to which it applies.
QUANTITIES = {
    "position": ("m", "mm", "cm", "km"),
    "velocity": ("m_s", "mm_s", "cm_s", "kn"),
    "heading": ("deg", "arcsec"),
}
QUANTITY_OF = {unit: name for name, units in QUANTITIES.items() for unit in units}


def axes_of(kind: str) -> dict[str, list[int]]:
    """The components of a kind of instrument, by the quantity of their errors; "" for components of no quantity."""
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
        Name of the size without the quantity, one of ``FaultSpec.stems``.
    kind : str
        Kind of the instrument.

    Returns
    -------
    (d,) array or None
        The size for each component, SI units; None if a size is not given.
    """
    result = np.empty(len(KINDS[kind].components))
    for name, axes in axes_of(kind).items():
        size = sizes.get(f"{stem}_{name}")
        if size is None:
            return None
        result[axes] = size
    return result


def size_range(sizes: Mapping[str, Any], stem: str, kind: str) -> tuple[Array, Array]:
    """The (d,) smallest and (d,) largest size for each component, if a size is [minimum, maximum]."""
    low, high = np.empty((2, len(KINDS[kind].components)))
    for name, axes in axes_of(kind).items():
        low[axes], high[axes] = sizes[f"{stem}_{name}"]
    return low, high
