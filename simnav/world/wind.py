"""The wind: mean speed and direction, and gusts.

The gusts are a sum of harmonics of equal energy whose frequencies are drawn from the spectrum of ISO 19901-1:2015,
A.7.4 (that of the Norwegian Petroleum Directorate). They change the speed and not the direction, everywhere at once.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from simnav.spec import NonNegative, quantity
from simnav.streams import stream
from simnav.types import Array
from simnav.world.surroundings import SurroundingSpec, register_surrounding

__all__ = ["AirFlow", "Wind"]

#: Lowest and highest frequency of the gusts [Hz]: an hour's mean is constant, and a hull does not follow faster ones.
_SLOWEST, _FASTEST = 1.0 / 2400.0, 0.1


@register_surrounding
class Wind(SurroundingSpec):
    """Wind at 10 m above the water.

    Attributes
    ----------
    speed : float
        Mean speed of an hour [m/s].
    direction : float
        Direction from which it comes, clockwise from north [rad].
    gustiness : float
        Standard deviation of the gusts as a multiple of that of the spectrum [-]; 0: a steady wind.
    harmonics : int
        Number of harmonics of the gusts.
    """

    kind: Literal["wind"] = "wind"
    speed: Annotated[float, Field(ge=0.0, le=60.0)] = quantity("m_s")
    direction: Annotated[float, Field(ge=-6.2832, le=6.2832)] = quantity("deg", 0.0)
    gustiness: NonNegative = 1.0
    harmonics: Annotated[int, Field(ge=4, le=16)] = 16

    def build(self, name: str, seed: int) -> AirFlow:
        """See `SurroundingSpec.build`."""
        return AirFlow(self, seed, name)


def gust_spectrum(speed: float, frequency: Array) -> Array:
    """Spectral density of the speed at 10 m [m^2/s^2 / Hz]; ISO 19901-1:2015, equation A.4.

    Parameters
    ----------
    speed : float
        Mean speed of an hour [m/s].
    frequency : (n,) array
        [Hz].
    """
    n = 0.468
    ratio = 172.0 * frequency * (speed / 10.0) ** -0.75
    density: Array = 320.0 * (speed / 10.0) ** 2 / (1.0 + ratio**n) ** (5.0 / (3.0 * n))
    return density


class AirFlow:
    """The wind of one run.

    Parameters
    ----------
    wind : Wind
        Its description.
    seed : int
        Seed of the world: it fixes the gusts.
    name : str
        Name of the part in the scenario.
    """

    def __init__(self, wind: Wind, seed: int, name: str = "wind"):
        self.wind = wind
        #: (k, 3) array: angular frequency [rad/s], phase [rad], amplitude as a share of the mean speed.
        self.gusts = np.zeros((0, 3))
        if wind.speed == 0.0 or wind.gustiness == 0.0:
            return
        rng, n = stream(seed, "surroundings", name, "gusts"), wind.harmonics
        grid = np.geomspace(_SLOWEST, _FASTEST, 2000)
        density = gust_spectrum(wind.speed, grid)
        energy = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(grid))])
        frequency = np.interp((np.arange(n) + rng.random(n)) / n * energy[-1], energy, grid)
        amplitude = wind.gustiness * np.sqrt(2.0 * energy[-1] / n) / wind.speed
        self.gusts = np.stack([2.0 * np.pi * frequency, 2.0 * np.pi * rng.random(n), np.full(n, amplitude)], axis=1)

    @property
    def mean(self) -> tuple[float, float]:
        """Mean velocity of the air, north and east [m/s]."""
        towards = self.wind.direction + np.pi
        return float(self.wind.speed * np.cos(towards)), float(self.wind.speed * np.sin(towards))

    def steady(self) -> AirFlow:
        """The same wind without gusts."""
        return AirFlow(self.wind.model_copy(update={"gustiness": 0.0}), 0)

    def velocity(self, position: Array, time: Array) -> Array:
        """The (n, 3) velocities of the air [m/s], north-east-down, at n positions and times."""
        share = np.ones(len(time))
        for omega, phase, amplitude in self.gusts:
            share += amplitude * np.cos(omega * np.asarray(time) + phase)
        north, east = self.mean
        return np.stack([north * share, east * share, np.zeros(len(time))], axis=1)
