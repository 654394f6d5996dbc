"""A one-way acoustic range: by the time of arrival on a clock of its own, whose error and drift are states."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.blocks import StateBlock
from simnav.geometry.earth import relative_position
from simnav.kinds import Component, Kind
from simnav.sensors import AidSpec, Instrument, register_instrument
from simnav.spec import NonNegative, quantity


def observe(point, sheet):
    """Distance to the transponder and the error of the clock, as a length; the Jacobian by block."""
    place = np.array([sheet.details[name] for name in ("latitude", "longitude", "height")])
    away = relative_position(place, point.position)
    distance = np.linalg.norm(away)
    navigation = np.zeros((1, 9))
    navigation[0, 0:3] = -away / distance
    return np.array([distance + point.blocks["clock"][0]]), {"navigation": navigation, "clock": np.array([[1.0, 0.0]])}


@register_instrument(
    Kind(
        "range to a transponder, with the error of a clock",
        role="range",
        components=(Component("range", "m", limit=50e3),),
        equation=observe,
        datasheet=("latitude", "longitude", "height"),
    ),
    example={
        "latitude_deg": 54.003, "longitude_deg": 7.903, "height_m": -20.0, "sigma_m": 0.5, "clock_m": 30.0,
        "drift_m_s": 0.05,
    },
)  # fmt: skip
class OneWayRange(AidSpec):
    """A range from the time that a ping took, by two clocks that do not quite agree."""

    errors = (*AidSpec.errors, "clock", "drift", "clock_noise", "drift_noise")

    kind: Literal["one_way_range"] = "one_way_range"
    latitude: float = quantity("deg")
    longitude: float = quantity("deg")
    height: float = quantity("m", 0.0)
    sigma: NonNegative = quantity("m")
    clock: NonNegative = quantity("m", 0.0)
    drift: NonNegative = quantity("m_s", 0.0)
    clock_noise: NonNegative = 0.0
    drift_noise: NonNegative = 0.0

    def blocks(self):
        """Bias [m] and drift [m/s] of the clock, which all transponders of a vessel have in common."""
        sigma, density = (self.clock, self.drift), (self.clock_noise, self.drift_noise)
        return (StateBlock("clock", 2, ("m", "m_s"), sigma, "clock", density, shared="receiver_clock"),)

    def build(self, name, seed):
        """The instrument of one run."""
        return _OneWayRange(self, name, seed)


class _OneWayRange(Instrument):
    def __init__(self, spec, name, seed):
        super().__init__(spec, name, seed)
        self.place = np.array([spec.latitude, spec.longitude, spec.height])

    def observe(self, tap):
        """(n, 1) ranges, before noise."""
        north, east, down = relative_position(self.place, tap.position).T
        return (np.sqrt(north**2 + east**2 + down**2) + self.block("clock", tap.time)[:, 0])[:, None]
