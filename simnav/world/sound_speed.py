"""The speed of sound with depth, for acoustic positioning: a measured table, or TEOS-10 from salinity and temperature.

Between the depths of the table the speed changes linearly. `simnav.world.rays` finds the rays in it.

Source: IOC, SCOR and IAPSO, *The international thermodynamic equation of seawater - 2010*, UNESCO 2010, by the library
``gsw``.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from simnav.spec import SpecError, quantity
from simnav.types import Array
from simnav.world.surroundings import SurroundingSpec, register_surrounding
from simnav.world.water_column import Figures, plausible_water

__all__ = ["SLOWEST", "SOUND_SPEED", "Profile", "SoundSpeedProfile", "plausible_speed"]

#: Speed of sound where nothing is said of it [m/s].
SOUND_SPEED = 1500.0
#: In water sound is between these speeds [m/s]: fresh water at its freezing point has 1402, the deepest sea 1660.
SLOWEST, _FASTEST = 1350.0, 1700.0
#: With salinity and temperature: spacing of the depths of the table [m], and how far it goes below the last depth [m].
_SPACING, _BELOW = 25.0, 1000.0


def plausible_speed(key: str, speed: float) -> None:
    """ValueError if a number [m/s] is no speed of sound in water; the message names the key."""
    if not SLOWEST <= speed <= _FASTEST:
        raise ValueError(f"{key} = {speed:g}: sound in water has {SLOWEST:g} to {_FASTEST:g} m/s")


@register_surrounding
class SoundSpeedProfile(SurroundingSpec):
    """Speed of sound at some depths, or salinity and temperature, from which it follows.

    Attributes
    ----------
    depth : tuple of float
        Depths below the surface [m], ascending. Above the first and below the last one the water is as there.
    speed : tuple of float
        Speed of sound at each depth [m/s]. Without it, it is that of TEOS-10 at the salinity and temperature, so it
        grows with the pressure below the last depth, too.
    salinity : tuple of float
        Absolute salinity at each depth [g/kg].
    temperature : tuple of float
        Conservative temperature at each depth [degrees Celsius].
    """

    kind: Literal["sound_speed_profile"] = "sound_speed_profile"
    depth: Figures = quantity("m", (0.0,))
    speed: Figures = quantity("m_s", ())
    salinity: Figures = quantity("g_kg", ())
    temperature: Figures = quantity("celsius", ())

    @model_validator(mode="after")
    def _as_many(self) -> Self:
        given = {"speed_m_s": self.speed, "salinity_g_kg": self.salinity, "temperature_celsius": self.temperature}
        if bool(self.speed) == bool(self.salinity or self.temperature):
            raise ValueError("give speed_m_s, or salinity_g_kg and temperature_celsius, at each depth of depth_m")
        for key in ("speed_m_s",) if self.speed else ("salinity_g_kg", "temperature_celsius"):
            if len(given[key]) != len(self.depth):
                raise ValueError(
                    f"{key} has {len(given[key])} numbers and depth_m {len(self.depth)}; each depth has one"
                )
        plausible_water(self.depth, self.salinity, self.temperature)
        for speed in self.speed:
            plausible_speed("speed_m_s", speed)
        return self

    def build(self, name: str, seed: int) -> Profile:
        """See `SurroundingSpec.build`."""
        if self.speed:
            return Profile(np.array(self.depth), np.array(self.speed))
        try:
            import gsw
        except ImportError:
            raise SpecError(
                f"surroundings.{name}: the speed of sound by salinity and temperature needs the library gsw: "
                "pip install 'simnav[ocean]'; or give speed_m_s"
            ) from None
        grid = np.arange(0.0, self.depth[-1] + _BELOW, _SPACING)
        depth = np.union1d(grid, self.depth)
        salinity = np.interp(depth, self.depth, self.salinity)
        temperature = np.interp(depth, self.depth, self.temperature)
        # From the equator to a pole the pressure at a depth differs by 0.5 %: at 1000 m by 0.08 m/s of the speed.
        return Profile(depth, np.asarray(gsw.sound_speed(salinity, temperature, gsw.p_from_z(-depth, 45.0))))


class Profile:
    """The speed of sound of one run, linear between k depths and constant above and below them.

    Parameters
    ----------
    depth : (k,) array
        Below the mean sea surface, ascending [m].
    speed : (k,) array
        [m/s]

    Examples
    --------
    >>> profile = Profile(np.array([0.0, 100.0]), np.array([1500.0, 1480.0]))
    >>> profile.at(np.array([50.0, 200.0]))
    array([1490., 1480.])
    >>> profile.harmonic_mean(np.array([0.0]), np.array([100.0])).round(3)
    array([1489.978])
    """

    def __init__(self, depth: Array, speed: Array):
        self.depth, self.speed = depth, speed

    def at(self, depth: Array) -> Array:
        """Speed at depths [m/s]."""
        return np.asarray(np.interp(depth, self.depth, self.speed))

    def between(self, first: Array, last: Array) -> Array:
        """(n, m) depths of n columns of water, from ``first`` to ``last`` and in steps in which the speed is linear.

        Parameters
        ----------
        first, last : (n,) arrays
            Depths, ``first`` not below ``last`` [m].
        """
        inside = self.depth[(self.depth > np.min(first, initial=np.inf)) & (self.depth < np.max(last, initial=-np.inf))]
        middle = np.clip(inside[None], first[:, None], last[:, None])
        return np.concatenate([first[:, None], middle, last[:, None]], axis=1)

    def harmonic_mean(self, first: Array, last: Array) -> Array:
        """(n,) mean speed [m/s] of a vertical ray between n pairs of depths, in either order [m]."""
        nodes = self.between(np.minimum(first, last), np.maximum(first, last))
        speed, thick = self.at(nodes), np.diff(nodes, axis=1)
        change = speed[:, 1:] / speed[:, :-1] - 1.0
        share = np.where(change == 0.0, 1.0, np.log1p(change) / np.where(change == 0.0, 1.0, change))
        takes, whole = np.sum(thick * share / speed[:, :-1], axis=1), np.sum(thick, axis=1)
        level = whole <= 0.0
        return np.where(level, speed[:, 0], whole / np.where(level, 1.0, takes))
