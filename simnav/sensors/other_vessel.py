"""The navigation of another vessel in one run: the error of the position that it believes to have, and its covariance.

Both are horizontal, north and east. The covariance is that of the error, so the vessel is honest. Its errors are common
to successive messages:

- `SatelliteNavigation`, of a ship at the surface: a slow error, a first-order Gauss-Markov process, and white noise
- `DeadReckoning`, of a second AUV: with the fix k at the time t_k, whose error f_k is white from fix to fix, and the
  displacement d since then ::

      e(t) = f_k + s d + h (d turned by 90 degrees) + W(t) - W(t_k)

  with an error s of the speed (a scale) and h of the heading, constant in a run, and a random walk W. A fix comes from
  what the vessel hears, or from the surface: it resets the error.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from simnav.blocks import StateBlock
from simnav.sensors.block_values import BlockValues
from simnav.sensors.planned_track import PlannedTrack
from simnav.streams import stream
from simnav.types import Array

__all__ = ["DeadReckoning", "Navigation", "SatelliteNavigation"]


class Navigation(ABC):
    """How another vessel navigates."""

    @abstractmethod
    def error(self, time: Array, variates: Array) -> Array:
        """(n, 2) errors of its position [m] at n times [s], with (n, 2) variates of unit variance for white noise."""

    @abstractmethod
    def covariance(self, time: Array) -> Array:
        """(n, 2, 2) covariances of these errors [m^2]."""


class SatelliteNavigation(Navigation):
    """A ship with GNSS.

    Parameters
    ----------
    noise : float
        White noise, one sigma of each component [m].
    slow : StateBlock
        The slow error, two components [m].
    label : str
        Name of the process in the run; its random stream is named after it.
    seed : int
        Seed of the run.
    """

    def __init__(self, noise: float, slow: StateBlock, label: str, seed: int):
        self.noise, self.slow = noise, slow
        self._values = BlockValues(slow, label, seed)

    def error(self, time: Array, variates: Array) -> Array:
        """See `Navigation.error`."""
        return np.asarray(self._values.at(time) + self.noise * variates)

    def covariance(self, time: Array) -> Array:
        """See `Navigation.covariance`."""
        return np.tile(self.slow.covariance(0.0) + self.noise**2 * np.eye(2), (len(time), 1, 1))


class DeadReckoning(Navigation):
    """A vehicle with a log and a compass between its fixes.

    Parameters
    ----------
    track : PlannedTrack
        Where it really is.
    fixes : sequence of float
        Times of its fixes after the start, ascending [s]; at the start it has one, too.
    fix : float
        One sigma of each component of a fix [m].
    drift : sequence of float
        One sigma of the errors s and h of speed and heading, along and across the displacement since the fix [-].
    walk : float
        Density of the random walk [m/sqrt(s)].
    label : str
        Name in the run; its random streams are named after it.
    seed : int
        Seed of the run.
    """

    def __init__(
        self,
        track: PlannedTrack,
        fixes: Sequence[float],
        fix: float,
        drift: Sequence[float],
        walk: float,
        label: str,
        seed: int,
    ):
        self.track, self.fix, self.drift, self.walk = track, fix, np.array(drift), walk
        self.fixes = np.array([0.0, *fixes])
        rng = stream(seed, "vessel", label, "navigation")
        self._drift = self.drift * rng.standard_normal(2)
        self._of_fixes = fix * rng.standard_normal((len(self.fixes), 2))
        self._walk = BlockValues(StateBlock("walk", 2, "m", 0.0, "random_walk", walk), f"{label}.walk", seed)

    def _since(self, time: Array) -> tuple[Array, Array, Array]:
        """(n,) numbers of the last fixes and their times [s], and (n, 2) displacements since then [m]."""
        last = np.maximum(np.searchsorted(self.fixes, time, side="right") - 1, 0)
        begin = self.fixes[last]
        return last, begin, self.track.at(time)[0] - self.track.at(begin)[0]

    def error(self, time: Array, variates: Array) -> Array:
        """See `Navigation.error`; nothing in it is white."""
        last, begin, moved = self._since(time)
        across = np.stack([-moved[:, 1], moved[:, 0]], axis=1)
        drifted = self._drift[0] * moved + self._drift[1] * across
        return np.asarray(self._of_fixes[last] + drifted + self._walk.at(time) - self._walk.at(begin))

    def covariance(self, time: Array) -> Array:
        """See `Navigation.covariance`."""
        _, begin, moved = self._since(time)
        across = np.stack([-moved[:, 1], moved[:, 0]], axis=1)
        found = np.einsum("ni,nj->nij", moved, moved) * self.drift[0] ** 2
        found += np.einsum("ni,nj->nij", across, across) * self.drift[1] ** 2
        white = self.fix**2 + self.walk**2 * np.maximum(time - begin, 0.0)
        return np.asarray(found + white[:, None, None] * np.eye(2))
