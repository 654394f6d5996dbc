"""A pressure sensor in kilopascal, a unit that simnav does not have."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.kinds import Component, Kind
from simnav.sensors import AidSpec, Instrument, register_instrument
from simnav.spec import NonNegative, Positive, quantity, register_unit

register_unit("kpa", 1000.0)

#: Acceleration of gravity [m/s2], and growth of the density of sea water with depth [1/m].
GRAVITY, COMPRESSION = 9.81, 2.2e-6


def pressure(depth, density, surface):
    """Absolute pressure at a depth [Pa]."""
    return surface + density * GRAVITY * depth * (1.0 + COMPRESSION * depth)


def observe(point, sheet):
    """The pressure at a state, and its Jacobian."""
    depth, density = -point.position[2], sheet.details["density"]
    jacobian = np.zeros((1, 9))
    jacobian[0, 2] = density * GRAVITY * (1.0 + 2.0 * COMPRESSION * depth)
    return np.array([pressure(depth, density, sheet.details["surface"])]), jacobian


@register_instrument(
    Kind(
        "absolute pressure",
        role="depth",
        components=(Component("pressure", "kpa", limit=2e7),),
        equation=observe,
        datasheet=("density", "surface"),
    ),
    example={"sigma_kpa": 0.5},
)
class Pressure(AidSpec):
    """Absolute pressure of the sea water."""

    kind: Literal["pressure"] = "pressure"
    density: Positive = 1025.0
    surface: Positive = quantity("kpa", 101325.0)
    sigma: NonNegative = quantity("kpa")
    bias: NonNegative = quantity("kpa", 0.0)

    def build(self, name, seed):
        """The sensor of one run."""
        return _Pressure(self, name, seed)


class _Pressure(Instrument):
    def __init__(self, spec, name, seed):
        super().__init__(spec, name, seed)
        self.density, self.surface = spec.density, spec.surface

    def observe(self, tap):
        """(n, 1) pressures [Pa]."""
        return pressure(-tap.position[:, 2:], self.density, self.surface)
