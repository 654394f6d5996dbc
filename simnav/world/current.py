"""The current: mean direction, speed, shear with depth, and eddies that change with time and place."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from simnav.geometry.earth import relative_position
from simnav.spec import NonNegative, Positive, Spec, quantity
from simnav.streams import stream
from simnav.structures import length, structure
from simnav.types import Array

__all__ = ["EDDY", "EDDY_NUMBERS", "Current", "WaterFlow", "eddies"]

#: Number of plane waves of velocity whose sum is the variable part of the current.
_EDDIES = 8
#: A plane wave of velocity: wave number north and east [rad/m], angular frequency [rad/s], phase [rad], and amplitude
#: of the velocity north and east [m/s].
EDDY = structure(wave_north=float, wave_east=float, frequency=float, phase=float, north=float, east=float)
#: Length of an array that holds it.
EDDY_NUMBERS = length(EDDY)


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
        One `EDDY` a row. Without a variable part there is no row.
    """
    if current is None or current.variation == 0.0:
        return np.zeros((0, EDDY_NUMBERS))
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


class WaterFlow:
    """The current of one run, which can be asked at any place and time.

    Parameters
    ----------
    current : Current
        Its description.
    seed : int
        Seed of the world: it fixes the variable part.
    origin : (3,) array
        Geodetic position from which the phases of the variable part count: that of the start, at the surface.
    """

    def __init__(self, current: Current, seed: int, origin: Array):
        self.current, self._seed, self._origin = current, seed, origin

    @cached_property
    def _eddies(self) -> Array:
        return eddies(self.current, self._seed)

    def velocity(self, position: Array, time: Array) -> Array:
        """Velocity of the water.

        Parameters
        ----------
        position : (n, 3) array
            Latitude, longitude [rad] and height [m].
        time : (n,) array
            Time since the start of the run [s].

        Returns
        -------
        (n, 3) array
            North-east-down [m/s].
        """
        north, east, down = relative_position(position, self._origin).T
        c = self.current
        flow = np.zeros((len(time), 3))
        flow[:, 0], flow[:, 1] = c.speed * np.cos(c.direction), c.speed * np.sin(c.direction)
        for k_north, k_east, omega, phase, a_north, a_east in self._eddies:
            wave = np.cos(k_north * north + k_east * east - omega * time + phase)
            flow[:, 0] += a_north * wave
            flow[:, 1] += a_east * wave
        if c.speed > 0.0:  # the variable part decreases with depth like the mean
            flow *= np.maximum(0.0, 1.0 - c.shear / c.speed * np.maximum(0.0, down))[:, None]
        return flow
