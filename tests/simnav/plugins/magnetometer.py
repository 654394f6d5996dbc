"""A three-axis magnetometer in a vessel with iron: six states, three of hard iron and three of soft iron."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.blocks import StateBlock
from simnav.kinds import Component, Kind
from simnav.sensors import AidSpec, Instrument, register_instrument
from simnav.sensors.instrument import turn_to_body
from simnav.spec import NonNegative, Positive, quantity, register_unit

register_unit("ut", 1e-6)


def field(sheet_or_spec):
    """The field of the Earth, north-east-down [T]."""
    level, down = sheet_or_spec["field_north"], sheet_or_spec["field_down"]
    return np.array([level, 0.0, down])


def observe(point, sheet):
    """The field in body axes, stretched by the soft iron and displaced by the hard iron; its Jacobian by block."""
    in_body = point.dcm.T @ field(sheet.details)
    iron = point.blocks["iron"]
    stretch = np.diag(1.0 + iron[3:])
    navigation = np.zeros((3, 9))
    x, y, z = field(sheet.details)
    navigation[:, 6:9] = stretch @ point.dcm.T @ [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return stretch @ in_body + iron[:3], {"navigation": navigation, "iron": np.hstack([np.eye(3), np.diag(in_body)])}


@register_instrument(
    Kind(
        "magnetic field in body axes",
        role="other",
        components=tuple(Component(axis, "ut", limit=1e-3) for axis in ("forward", "starboard", "down")),
        equation=observe,
        datasheet=("field_north", "field_down"),
    ),
    example={"sigma_ut": 0.3, "hard_iron_ut": 4.0, "soft_iron": 0.05},
)
class Magnetometer(AidSpec):
    """The magnetic field along three axes of the vessel, with its hard and soft iron."""

    errors = (*AidSpec.errors, "hard_iron", "soft_iron")

    kind: Literal["magnetometer"] = "magnetometer"
    sigma: NonNegative = quantity("ut")
    hard_iron: NonNegative = quantity("ut", 0.0, description="constant field of the vessel, each axis, one sigma")
    soft_iron: NonNegative = 0.0
    field_north: Positive = quantity("ut", 18e-6)
    field_down: float = quantity("ut", 46e-6)

    def blocks(self):
        """Six states: hard iron [T] and soft iron [-] of the three axes."""
        sigma = (self.hard_iron,) * 3 + (self.soft_iron,) * 3
        return (StateBlock("iron", 6, ("ut", "ut", "ut", "", "", ""), sigma),)

    def build(self, name, seed):
        """The magnetometer of one run."""
        return _Magnetometer(self, name, seed)


class _Magnetometer(Instrument):
    def __init__(self, spec, name, seed):
        super().__init__(spec, name, seed)
        self.field = field({"field_north": spec.field_north, "field_down": spec.field_down})

    def observe(self, tap):
        """(n, 3) fields, before noise."""
        iron = self.block("iron", tap.time)
        return (1.0 + iron[:, 3:]) * turn_to_body(tap.attitude, self.field) + iron[:, :3]
