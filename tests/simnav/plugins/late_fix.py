"""A receiver whose time stamps are late: a state says by how much."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.blocks import StateBlock
from simnav.geometry.earth import displace
from simnav.kinds import Kind, geodetic_components
from simnav.sensors import AidSpec, Instrument, register_instrument
from simnav.sensors.instrument import SigmaTriple
from simnav.spec import NonNegative, quantity


def observe(point, sheet):
    """The position at which the fix was made, before its time stamp. The derivative by the delay is left to simnav."""
    delay = point.blocks["delay"][0]
    identity = np.eye(3)
    navigation = np.hstack([identity, -delay * identity, np.zeros((3, 3))])
    return displace(point.position, -delay * point.velocity), {"navigation": navigation}


@register_instrument(
    Kind(
        "position, stamped late",
        role="fix",
        components=geodetic_components(height=True),
        equation=observe,
        geodetic=True,
    ),
    example={"sigma_m": 1.0, "delay_s": 0.3},
)
class LateFix(AidSpec):
    """A position whose time stamp is late by a constant."""

    errors = (*AidSpec.errors, "delay")

    kind: Literal["late_fix"] = "late_fix"
    sigma: SigmaTriple = quantity("m")
    delay: NonNegative = quantity("s", 0.0, description="error of the time stamp, one sigma")

    def blocks(self):
        """One state: by how much a fix is older than its time stamp [s]."""
        return (StateBlock("delay", 1, "s", self.delay),)

    def build(self, name, seed):
        """The receiver of one run."""
        return _LateFix(self, name, seed)


class _LateFix(Instrument):
    def observe(self, tap):
        """(n, 3) positions, before noise."""
        return displace(tap.position, -self.block("delay", tap.time) * tap.velocity)
