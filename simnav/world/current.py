"""The current: mean direction, speed, shear with depth, and eddies that change with time and place."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from simnav.spec import NonNegative, Positive, Spec, quantity
from simnav.streams import stream
from simnav.types import Array

__all__ = ["Current", "eddies"]

#: Number of plane waves of velocity whose sum is the variable part of the current.
_EDDIES = 8


class Current(Spec):
    """A current whose speed decreases linearly with depth, down to zero.

    With ``variation`` the current has a variable part, like that of tides and eddies: a sum of plane waves of velocity
    whose wavelengths and periods are near ``length_scale`` and ``time_scale``. The velocity of each wave is
    perpendicular to its wave vector, so that the sum has no divergence.

    Attributes
    ----------
    speed : float
        Mean speed at the surface [m/s].
    direction : float
        Direction towards which the water flows on average, clockwise from north [rad].
    shear : float
        Decrease of the speed per metre of depth [1/s].
    variation : float
        Standard deviation of the north and of the east component of the variable part [m/s].
    length_scale, time_scale : float
        Typical wavelength [m] and typical period [s] of the variable part.
    """

    speed: NonNegative = quantity("m_s", 0.0)
    direction: Annotated[float, Field(ge=-6.2832, le=6.2832)] = quantity("deg", 0.0)
    shear: NonNegative = quantity("per_s", 0.0)
    variation: NonNegative = quantity("m_s", 0.0)
    length_scale: Positive = quantity("m", 2000.0)
    time_scale: Positive = quantity("s", 7200.0)

    @model_validator(mode="after")
    def _smooth(self) -> Self:
        if self.length_scale < 50.0 or self.time_scale < 60.0:
            raise ValueError("a current changes over length_scale_m of 50 or more and time_scale_s of 60 or more")
        return self


def eddies(current: Current | None, seed: int) -> Array:
    """Draw the variable part of the current of one run.

    Parameters
    ----------
    current : Current or None
        The current; None: there is none.
    seed : int
        Seed of the run.

    Returns
    -------
    (n, 6) array
        One row for each plane wave: wave number north and east [rad/m], angular frequency [rad/s], phase [rad], and
        amplitude of the velocity north and east [m/s]. Without a variable part there is no row.
    """
    if current is None or current.variation == 0.0:
        return np.zeros((0, 6))
    rng = stream(seed, "current")
    n = _EDDIES
    # Directions are spread evenly around the compass, each with a random offset, so that both components have their
    # variance.
    heading = 2.0 * np.pi * (np.arange(n) + rng.random(n)) / n
    number = 2.0 * np.pi / (current.length_scale * rng.uniform(0.7, 1.4, n))
    omega = 2.0 * np.pi / (current.time_scale * rng.uniform(0.7, 1.4, n))
    phase = 2.0 * np.pi * rng.random(n)
    amplitude = 2.0 * current.variation / np.sqrt(n)
    north, east = np.cos(heading), np.sin(heading)
    return np.stack([number * north, number * east, omega, phase, -amplitude * east, amplitude * north], axis=1)
