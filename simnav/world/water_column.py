"""The water column: salinity and temperature with depth, and the pressure that follows from them (TEOS-10).

A depth sensor measures pressure. It converts it to depth by a density or by the formula of the standard ocean, while
the water above it has another density. The error is about one metre in a thousand, and more in brackish
water.

The pressure at the depth z is the integral of density times gravity, with the density of TEOS-10 at the salinity and
temperature of each depth, to 4 cm in 4000 m. The library ``gsw`` has the equation of state.

Sources: IOC, SCOR and IAPSO, *The international thermodynamic equation of seawater - 2010*, UNESCO 2010; T. J.
McDougall and P. M. Barker, *Getting started with TEOS-10 and the Gibbs Seawater (GSW) Oceanographic Toolbox*, 2011.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, model_validator

from simnav.spec import SpecError, quantity, register_unit
from simnav.types import Array
from simnav.world.surroundings import SurroundingSpec, register_surrounding

__all__ = ["Column", "Figures", "WaterColumn", "plausible_water"]

register_unit("celsius", 1.0)
register_unit("g_kg", 1.0)

#: Spacing of the depths over which the density is integrated [m].
_STEP = 0.5
#: Standard gravity [m/s^2], with which a sensor converts pressure by a density.
_STANDARD_GRAVITY = 9.80665


def _listed(value: Any) -> Any:
    return tuple(value) if isinstance(value, (list, tuple)) else (value,)


#: Numbers; TOML may have one alone.
Figures = Annotated[tuple[float, ...], BeforeValidator(_listed)]


def plausible_water(depth: Figures, salinity: Figures, temperature: Figures) -> None:
    """ValueError if depths do not ascend from the surface, or no sea water is so salt, warm or cold.

    Parameters
    ----------
    depth : tuple of float
        Depths, one or more [m].
    salinity, temperature : tuple of float
        Absolute salinities [g/kg] and conservative temperatures [degrees Celsius].
    """
    if any(b <= a for a, b in pairwise(depth)) or depth[0] < 0.0:
        raise ValueError(f"depth_m = {list(depth)}: depths are ascending, and not below 0")
    if any(not 0.0 <= s <= 42.0 for s in salinity):
        raise ValueError(f"salinity_g_kg = {list(salinity)}: sea water has 0 to 42")
    if any(not -2.0 <= t <= 40.0 for t in temperature):
        raise ValueError(f"temperature_celsius = {list(temperature)}: sea water has -2 to 40")


@register_surrounding
class WaterColumn(SurroundingSpec):
    """Salinity and temperature of the water at some depths; between them they change linearly.

    Attributes
    ----------
    depth : tuple of float
        Depths below the surface [m], ascending. Above the first and below the last one the water is as there.
    salinity : tuple of float
        Absolute salinity at each depth [g/kg].
    temperature : tuple of float
        Conservative temperature at each depth [degrees Celsius].
    """

    kind: Literal["water_column"] = "water_column"
    depth: Figures = quantity("m", (0.0,))
    salinity: Figures = quantity("g_kg", (35.16504,))
    temperature: Figures = quantity("celsius", (0.0,))

    @model_validator(mode="after")
    def _as_many(self) -> Self:
        if not len(self.depth) == len(self.salinity) == len(self.temperature) > 0:
            raise ValueError(
                f"depth_m, salinity_g_kg and temperature_celsius have {len(self.depth)}, {len(self.salinity)} and "
                f"{len(self.temperature)} numbers; each depth has one of each"
            )
        plausible_water(self.depth, self.salinity, self.temperature)
        return self

    def build(self, name: str, seed: int) -> Column:
        """See `SurroundingSpec.build`."""
        return Column(self, name)


class Column:
    """The water column of one run.

    Parameters
    ----------
    spec : WaterColumn
        Its description.
    name : str
        Name of the part, for messages.

    Raises
    ------
    SpecError
        If the library ``gsw`` is not installed.
    """

    def __init__(self, spec: WaterColumn, name: str = "water_column"):
        try:
            import gsw
        except ImportError:
            raise SpecError(
                f"surroundings.{name}: the pressure of sea water needs the library gsw: pip install 'simnav[ocean]'"
            ) from None
        self.spec, self._gsw, self._mass = spec, gsw, np.zeros(1)

    def pressure(self, depth: Array, latitude: Array) -> Array:
        """Pressure of the water at n depths below the surface.

        Parameters
        ----------
        depth : (n,) array
            [m]; 0 above the surface.
        latitude : (n,) array
            Geodetic latitude [rad], for the gravity.

        Returns
        -------
        (n,) array
            [dbar].
        """
        depth = np.maximum(depth, 0.0)
        self._reach(float(depth.max(initial=0.0)))
        mass = np.interp(depth, _STEP * np.arange(len(self._mass)), self._mass)
        # Gravity half way down is its mean, because it changes linearly.
        gravity = self._gsw.grav(np.degrees(latitude), 0.5e-4 * _STANDARD_GRAVITY * mass)
        return np.asarray(1e-4 * gravity * mass)

    def reported(self, depth: Array, latitude: Array, density: float | None) -> Array:
        """Depth that a pressure sensor reports at n depths [m].

        Parameters
        ----------
        depth, latitude : (n,) arrays
            See `pressure`.
        density : float or None
            Density with which the sensor converts [kg/m^3]; None: by the formula of the standard ocean.
        """
        pressure = self.pressure(depth, latitude)
        if density is None:
            return np.asarray(-self._gsw.z_from_p(pressure, np.degrees(latitude)))
        return pressure * 1e4 / (density * _STANDARD_GRAVITY)

    def _reach(self, depth: float) -> None:
        """Extend the mass of water above each depth [kg/m^2] down to a depth. What is there stays as it is."""
        while _STEP * (len(self._mass) - 1) < depth:
            first = len(self._mass) - 1
            edge = _STEP * np.arange(first, first + max(200, first) + 1)
            salinity = np.interp(edge, self.spec.depth, self.spec.salinity)
            temperature = np.interp(edge, self.spec.depth, self.spec.temperature)
            mass = self._mass[-1] + 1025.0 * (edge - edge[0])
            for _ in range(4):  # density and pressure depend on each other; each pass gains two digits
                density = self._gsw.rho(salinity, temperature, 1e-4 * _STANDARD_GRAVITY * mass)
                gained = np.cumsum(0.5 * _STEP * (density[1:] + density[:-1]))
                mass = np.append(self._mass[-1], self._mass[-1] + gained)
            self._mass = np.append(self._mass, mass[1:])
