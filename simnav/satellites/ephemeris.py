"""A table of broadcast ephemerides, and which of them is valid when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simnav.compiled import Array, Flags, Integers, helper, kernel
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.satellites.orbit import ELEMENTS, EPHEMERIS, satellite_scalar
from simnav.satellites.time_scales import GpsTime
from simnav.spec import SpecError
from simnav.structures import structure

__all__ = ["VALIDITY", "Ephemerides", "SatelliteStates", "is_geostationary", "nearest"]

#: An ephemeris is used up to this time before and after its reference time, by the letter of the system [s]: GPS has
#: four-hour fits, Galileo's data are valid for four hours, BeiDou's are renewed every hour. Galileo's figure is that of
#: RTKLIB (MAXDTOE); BeiDou's is half of a geostationary fit's growth to a metre.
VALIDITY = {"G": 7200.0, "E": 14400.0, "C": 7200.0}

#: Position and velocity of a satellite in the Earth-fixed frame [m], [m/s], its clock [s] and the drift of it [s/s].
_STATE = structure(position=3, velocity=3, clock=float, drift=float)
#: BeiDou's geostationary satellites (*BeiDou Open Service Signal-in-Space ICD*, B1I 3.0, table 4-1).
_GEOSTATIONARY = (*(f"C{n:02d}" for n in range(1, 6)), *(f"C{n}" for n in range(59, 64)))


def is_geostationary(satellite: str) -> bool:
    """Whether it is one of BeiDou's satellites in a geostationary orbit."""
    return satellite in _GEOSTATIONARY


@dataclass(frozen=True, eq=False)
class SatelliteStates:
    """States of c satellites at n times, in the Earth-fixed frame of each time.

    Attributes
    ----------
    position, velocity : (n, c, 3) array
        Coordinates [m] and their derivatives [m/s]; NaN where no ephemeris is valid.
    clock, drift : (n, c) array
        Time of the satellite's clock minus GPS time [s], and its derivative [s/s].
    """

    position: Array
    velocity: Array
    clock: Array
    drift: Array


@dataclass(frozen=True, eq=False)
class Ephemerides:
    """Broadcast ephemerides: m messages of some satellites.

    Attributes
    ----------
    satellite : tuple of str
        Satellite of each message: the letter of its system and two digits, ``G05``, ``E11``, ``C30``.
    numbers : (m, 24) array
        Numbers of each message, in the order of `simnav.satellites.orbit.ELEMENTS`.
    week : int
        GPS week to whose beginning the times in ``numbers`` refer.
    group_delay : (m,) array
        Delay of the first frequency, T_GD or B_GD [s]: a user of that frequency alone subtracts it from the clock.
    issue : (m,) array of int
        Issue of data.
    healthy : (m,) array of bool
        Whether the satellite is healthy.
    klobuchar : (8,) array or None
        Coefficients alpha_0 to alpha_3 and beta_0 to beta_3 of GPS's model of the ionosphere [s, s/semicircle, ...].
    source : str
        The file, for messages.
    """

    satellite: tuple[str, ...]
    numbers: Array
    week: int
    group_delay: Array
    issue: Integers
    healthy: Flags
    klobuchar: Array | None
    source: str

    def __len__(self) -> int:
        return len(self.satellite)

    @property
    def _toe(self) -> Array:
        """(m,) array: reference times of the messages [s]."""
        toe: Array = self.numbers.view(EPHEMERIS)["toe"][:, 0]
        return toe

    def satellites(self, systems: str = "GEC") -> tuple[str, ...]:
        """Names of the satellites of the given systems that have a message, sorted by system and number."""
        there = {s for s in self.satellite if s[0] in systems}
        return tuple(sorted(there, key=lambda s: (systems.index(s[0]), s)))

    def usable(self, begin: GpsTime, duration: float, systems: str = "GEC") -> tuple[str, ...]:
        """The healthy satellites that have a valid message at each time of an interval.

        Parameters
        ----------
        begin : GpsTime
            Begin of the interval.
        duration : float
            Its length [s].
        systems : str
            Letters of the systems.

        Raises
        ------
        SpecError
            If there is none: the message says which times the file covers.
        """
        first = begin.since(self.week)
        found = tuple(s for s in self.satellites(systems) if self._covers(s, first, first + duration))
        if not found:
            toe = self._toe[[s[0] in systems for s in self.satellite]]
            if not len(toe):
                raise SpecError(f"{self.source} has no ephemeris of the systems {', '.join(systems)}")
            days = f"{min(toe) / 86400.0:.2f} to {max(toe) / 86400.0:.2f}"
            raise SpecError(
                f"{self.source}: its ephemerides have reference times from day {days} of GPS week {self.week}; none is "
                f"valid from day {first / 86400.0:.2f} to {(first + duration) / 86400.0:.2f} of that week, so the "
                "epoch should be another, or the file"
            )
        return found

    def _covers(self, satellite: str, first: float, last: float) -> bool:
        rows = self.rows(satellite)
        if not self.healthy[rows].all():
            return False
        reach, edge = VALIDITY[satellite[0]], first
        for toe in self._toe[rows]:
            if toe - reach > edge:
                return False
            edge = max(edge, toe + reach)
            if edge >= last:
                return True
        return False

    def rows(self, satellite: str) -> Integers:
        """Indices of the messages of one satellite, by reference time."""
        rows = np.array([i for i, s in enumerate(self.satellite) if s == satellite], dtype=np.int64)
        return rows[np.argsort(self._toe[rows], kind="stable")]

    def table(self, satellites: Sequence[str]) -> tuple[Array, Integers, Array]:
        """The messages of some satellites as arrays for kernels.

        Returns
        -------
        numbers : (k, 24) array
            Messages, those of one satellite together and by reference time.
        begin : (c + 1,) array of int
            The messages of satellite j are ``begin[j]`` to ``begin[j + 1] - 1``.
        reach : (c,) array
            How long before and after its reference time a message is valid [s].

        Raises
        ------
        SpecError
            If a satellite has no message.
        """
        rows = [self.rows(s) for s in satellites]
        for satellite, found in zip(satellites, rows, strict=True):
            if not len(found):
                raise SpecError(f"{self.source} has no ephemeris of satellite {satellite!r}")
        begin = np.cumsum([0, *(len(r) for r in rows)]).astype(np.int64)
        numbers = self.numbers[np.concatenate(rows)] if rows else np.empty((0, len(ELEMENTS)))
        return numbers, begin, np.array([VALIDITY[s[0]] for s in satellites])

    def states(self, satellites: Sequence[str], time: Array) -> SatelliteStates:
        """States of satellites, from the valid message with the nearest reference time.

        Parameters
        ----------
        satellites : sequence of str
            c satellites.
        time : (n,) array
            GPS times, seconds since the beginning of the GPS week `week` [s].

        Returns
        -------
        SatelliteStates
            For each time and satellite; NaN where no message is valid.
        """
        time = np.ascontiguousarray(time, dtype=np.float64)
        out = np.empty((len(time), len(satellites), 1), _STATE)
        _states(*self.table(satellites), time, out.view(np.float64))
        at = out[..., 0]
        return SatelliteStates(at["position"], at["velocity"], at["clock"], at["drift"])


@helper
def nearest(numbers: Array, first: int, last: int, reach: float, time: float) -> int:
    """Index of the message in [first, last) with the nearest reference time; -1 if that is more than ``reach`` away."""
    best, least = -1, reach
    for k in range(first, last):
        away = abs(time - numbers[k].view(EPHEMERIS)[0].toe)
        if away < least or (best < 0 and away == least):
            best, least = k, away
    return best


@kernel
def _states(numbers: Matrix, begin: IntegerVector, reach: Vector, time: Vector, out: Stack) -> None:
    """Overwrite the (n, c, 8) ``out``, a `_STATE` each, with `satellite_scalar` of each time and satellite."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            k = nearest(numbers, begin[j], begin[j + 1], reach[j], time[i])
            if k < 0:
                out[i, j, :] = float("nan")
            else:
                at, state = satellite_scalar(numbers[k], time[i]), out[i, j].view(_STATE)[0]
                state.position[0], state.position[1], state.position[2] = at.x, at.y, at.z
                state.velocity[0], state.velocity[1], state.velocity[2] = at.vx, at.vy, at.vz
                state.clock, state.drift = at.clock, at.drift
