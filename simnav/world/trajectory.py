"""Trajectories: whatever gives position, velocity and attitude at the times of an IMU.

The simulator needs a `Trajectory` and knows nothing else of the vessel. `simnav.world.world.World` is the trajectory of
the vessels of simnav. `SampledTrajectory` makes one of velocities and attitudes as functions of time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from simnav.geometry.earth import ROTATION_RATE
from simnav.geometry.rotation import dcm_from_rpy, wrap_angle
from simnav.inverse_strapdown import increments
from simnav.spec import SpecError
from simnav.types import Array, ImuSamples, NavigationStates, TapStates
from simnav.world.manoeuvres import Manoeuvre
from simnav.world.start import Start
from simnav.world.surroundings import Surroundings

__all__ = ["SampledTrajectory", "Steered", "Trajectory", "Voyage", "WorldBlock"]


@dataclass(frozen=True)
class Voyage:
    """What a vessel needs to make the trajectory of one run.

    Attributes
    ----------
    start : Start or None
        State at time 0, of the table ``[start]``; None if the vessel says itself where it starts.
    manoeuvres : tuple of Manoeuvre
        Commands, one after the other.
    surroundings : Surroundings
        Sea, current, bottom and other parts.
    rate : float
        Sample rate of the ideal IMU [Hz].
    duration : float
        Length of the run [s].
    seed : int
        Seed of the world.
    """

    start: Start | None
    manoeuvres: tuple[Manoeuvre, ...]
    surroundings: Surroundings
    rate: float
    duration: float
    seed: int


@dataclass(frozen=True, eq=False)
class WorldBlock:
    """The truth in an interval of time.

    Attributes
    ----------
    imu : ImuSamples
        The samples of an ideal IMU.
    taps : dict of str to TapStates
        The true states at the requested times, by the name of the request.
    """

    imu: ImuSamples
    taps: dict[str, TapStates]


@runtime_checkable
class Trajectory(Protocol):
    """The motion of a vessel in one run. It is advanced in blocks; their division does not change the numbers.

    The ideal IMU samples re-integrate to the truth (`simnav.strapdown.integrate`) up to rounding.
    """

    def state(self) -> NavigationStates:
        """The present state, as a series of one state; before the first block the state at time 0."""
        ...

    def advance(self, until: float, taps: Mapping[str, Array]) -> WorldBlock:
        """Advance to a time.

        Parameters
        ----------
        until : float
            End of the block, a multiple of the sample interval [s].
        taps : mapping of str to (m,) array
            Ascending times within (now, until] at which states are requested [s], by name.
        """
        ...


@runtime_checkable
class Steered(Trajectory, Protocol):
    """A trajectory that can be steered by an estimate (closed loop)."""

    def steer_by(self, north: float, east: float, heading: float = 0.0) -> None:
        """Set the errors of the estimated position [m] and heading [rad] that the guidance uses from now on."""
        ...


class SampledTrajectory(ABC):
    """A trajectory whose velocity and attitude are given as functions of time.

    Position follows from the velocity by the rule of the mechanization, a trapezoid over each sample interval. It
    differs from the integral of a smooth velocity by micrometres. Velocity and attitude should have no steps: a step
    is a large acceleration or angular rate of one IMU sample.

    Parameters
    ----------
    position : (3,) array
        Latitude, longitude [rad] and height [m] at time 0.
    voyage : Voyage
        The run.
    """

    def __init__(self, position: Array, voyage: Voyage):
        self.rate, self._surroundings = float(voyage.rate), voyage.surroundings
        self._index = 0
        self._position = np.array(position, dtype=np.float64)
        self._memory, self._turning = np.zeros(6), np.zeros(3)  # of the interval before: increments, angular rate
        velocity, attitude = self._checked(np.zeros(1))
        self._velocity, self._attitude = velocity[0], attitude[0]

    @abstractmethod
    def motion(self, time: Array) -> tuple[Array, Array]:
        """Velocity and attitude at n times.

        Parameters
        ----------
        time : (n,) array
            Times since the start of the run [s].

        Returns
        -------
        velocity : (n, 3) array
            North-east-down [m/s].
        attitude : (n, 3) array
            Roll, pitch, yaw [rad].
        """

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._index / self.rate

    def state(self) -> NavigationStates:
        """See `Trajectory.state`."""
        return NavigationStates(
            np.array([self.time]), self._position[None].copy(), self._velocity[None], self._attitude[None]
        )

    def advance(self, until: float, taps: Mapping[str, Array]) -> WorldBlock:
        """See `Trajectory.advance`."""
        first = self._index
        n = round(until * self.rate) - first
        if n < 0:
            raise ValueError(f"the trajectory is at {self.time} s and does not go back to {until} s")
        # Absolute times, so that the intervals are the same numbers in blocks of any length.
        edge = np.arange(first, first + n + 1) / self.rate
        velocity, attitude = self._checked(edge[1:])
        velocity = np.concatenate([self._velocity[None], velocity])
        attitude = np.concatenate([self._attitude[None], attitude])
        samples, position = increments(edge, self._position, velocity, attitude, memory=self._memory)
        middle = 0.5 * (position[1:, 0] + position[:-1, 0])
        earth = ROTATION_RATE * np.stack([np.cos(middle), np.zeros(n), -np.sin(middle)], axis=1)
        turning = samples.angular_rate - np.einsum("nji,nj->ni", dcm_from_rpy(attitude[1:]), earth)
        turning = np.concatenate([self._turning[None], turning])
        states = {name: self._tap(t, edge, position, velocity, attitude, turning) for name, t in taps.items()}
        self._index, self._position, self._turning = first + n, position[-1], turning[-1]
        self._velocity, self._attitude = velocity[-1], attitude[-1]
        return WorldBlock(samples, states)

    def _checked(self, time: Array) -> tuple[Array, Array]:
        velocity, attitude = (np.asarray(a, dtype=np.float64) for a in self.motion(time))
        for name, array in (("velocity", velocity), ("attitude", attitude)):
            where = f"{type(self).__qualname__}.motion() returned"
            if array.shape != (len(time), 3):
                raise SpecError(f"{where} a {name} of shape {array.shape}, where {(len(time), 3)} is wanted")
            wrong = ~np.isfinite(array).all(axis=1)
            if wrong.any():
                k = int(np.argmax(wrong))
                raise SpecError(f"{where} a {name} of {array[k].tolist()} at {time[k]:g} s; it should be finite")
        return velocity, attitude

    def _tap(
        self, time: Array, edge: Array, position: Array, velocity: Array, attitude: Array, turning: Array
    ) -> TapStates:
        """States between the samples, by the rules of `simnav.world.motion`: velocity and angles are linear."""
        if len(edge) < 2:
            return TapStates(time, *(np.empty((0, 3)) for _ in range(5)))
        k = np.clip(np.searchsorted(edge, time - 1e-9 / self.rate) - 1, 0, len(edge) - 2)
        a = np.clip((time - edge[k]) * self.rate, 0.0, 1.0)[:, None]
        change = velocity[k + 1] - velocity[k]
        mean = velocity[k] + 0.5 * change
        gained = velocity[k] * a + 0.5 * change * a * a
        share = np.where(np.abs(mean) > 1e-9, gained / np.where(np.abs(mean) > 1e-9, mean, 1.0), a)
        place = position[k] + np.where(a >= 1.0, 1.0, share) * (position[k + 1] - position[k])
        return TapStates(
            time,
            place,
            velocity[k] + a * change,
            wrap_angle(attitude[k] + a * wrap_angle(attitude[k + 1] - attitude[k])),
            # Of the instant, extrapolated from the means over this interval and the one before.
            turning[k + 1] + (a - 0.5) * (turning[k + 1] - turning[k]),
            self._water(place, time),
        )

    def _water(self, position: Array, time: Array) -> Array:
        flow = self._surroundings.get("current")
        return np.zeros((len(time), 3)) if flow is None else np.asarray(flow.velocity(position, time))
