"""The current: a set, a drift and a shear with depth, and eddies that change it with time and place."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from simnav.spec import NonNegative, Positive, Spec, quantity
from simnav.streams import stream
from simnav.types import Array

__all__ = ["Current", "eddies"]

#: Plane waves of velocity that make up what changes.
_EDDIES = 8


class Current(Spec):
    """A current whose speed falls linearly with depth, to nothing and no further.

    With ``variation`` it changes with time and place, as tides and eddies make it: a sum of plane waves of velocity
    whose lengths and periods are around ``length_scale`` and ``time_scale``, each across its wave number, so that no
    water gathers anywhere.

    Attributes
    ----------
    speed : float
        Mean at the surface [m/s].
    direction : float
        Towards which it flows on average, from north over east [rad].
    shear : float
        Loss of speed per metre of depth [1/s].
    variation : float
        Standard deviation of the north and of the east component [m/s].
    length_scale, time_scale : float
        Over which it changes once to the other side and back [m, s].
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
    """Draw the changing part of the current of one run.

    Parameters
    ----------
    current : Current or None
        None is still water.
    seed : int
        Seed of the run.

    Returns
    -------
    (n, 6) array
        Of each plane wave: wave number north and east [rad/m], frequency [rad/s], phase [rad], and amplitude of the
        velocity north and east [m/s]. No row where nothing changes.
    """
    if current is None or current.variation == 0.0:
        return np.zeros((0, 6))
    rng = stream(seed, "current")
    n = _EDDIES
    # Directions evenly around the compass, with a random turn each, so that both components have their variance.
    heading = 2.0 * np.pi * (np.arange(n) + rng.random(n)) / n
    number = 2.0 * np.pi / (current.length_scale * rng.uniform(0.7, 1.4, n))
    omega = 2.0 * np.pi / (current.time_scale * rng.uniform(0.7, 1.4, n))
    phase = 2.0 * np.pi * rng.random(n)
    amplitude = 2.0 * current.variation / np.sqrt(n)
    north, east = np.cos(heading), np.sin(heading)
    return np.stack([number * north, number * east, omega, phase, -amplitude * east, amplitude * north], axis=1)
