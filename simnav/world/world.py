"""The world as a state machine. It is advanced in blocks of any length, with the same numbers and constant memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.rotation import wrap_angle
from simnav.structures import filled, length
from simnav.true_state import TRUE_NUMBERS, TRUE_STATE
from simnav.types import Array, ImuSamples, NavigationStates, TapStates
from simnav.world import motion
from simnav.world.current import Current, eddies
from simnav.world.manoeuvres import Manoeuvre, table
from simnav.world.manoeuvring import dynamics
from simnav.world.manoeuvring.hull import Hull
from simnav.world.sea import Sea, components, steady, wave_number
from simnav.world.start import Start
from simnav.world.track import Follower, PlannedTrack
from simnav.world.trajectory import WorldBlock
from simnav.world.vessel import KinematicVessel
from simnav.world.wind import AirFlow

__all__ = ["World"]

_ON = np.ones(1, np.bool_)

#: Lookahead distance for the return to the track: smallest distance [m], and time at the present speed [s].
LEAST_LOOKAHEAD, LOOKAHEAD_TIME = 30.0, 20.0


class World:
    """A vessel in its sea.

    Parameters
    ----------
    start : Start
        State of the vessel at time 0.
    vessel : KinematicVessel
        Response of the vessel to commands and waves.
    manoeuvres : sequence of Manoeuvre
        Commands, one after the other.
    sea : Sea or None
        Sea state; None: a flat sea.
    current : Current or None
        Current; None: there is none.
    rate : float
        Sample rate of the ideal IMU [Hz].
    seed : int
        Seed of the wave components and of the variable part of the current.
    depth : float, optional
        Depth of the water [m], which a sea with the response ``encounter`` knows.
    air : AirFlow, optional
        The wind, which acts on a vessel with a hull.

    Attributes
    ----------
    sizes : (4,) int array
        What it consists of, a `simnav.world.motion.SIZES`.
    """

    def __init__(
        self,
        start: Start,
        vessel: KinematicVessel,
        manoeuvres: Sequence[Manoeuvre] = (),
        sea: Sea | None = None,
        current: Current | None = None,
        *,
        rate: float,
        seed: int,
        depth: float | None = None,
        air: AirFlow | None = None,
    ):
        if not rate > 0.0:
            raise ValueError(f"rate = {rate!r} Hz should be positive")
        self.rate = float(rate)
        self._follower: Follower | None = None
        self._voyage = start, vessel, manoeuvres, current, air
        self._p = filled(
            motion.PARAMETERS, step=1.0 / rate, speed_time=vessel.speed_time_constant,
            turn_time=vessel.turn_time_constant, climb_time=vessel.climb_time_constant, turn_rate=vessel.turn_rate,
            heel=vessel.heel, dives=vessel.dives,
        )  # fmt: skip
        p = self._p.view(motion.PARAMETERS)
        if current is not None and current.speed > 0.0:
            p["current_north"] = current.speed * np.cos(current.direction)
            p["current_east"] = current.speed * np.sin(current.direction)
            p["shear"] = current.shear / current.speed  # the variable part decreases with depth like the mean
        if sea is not None:
            p["longest_phase"] = sea.longest_step
        if sea is not None and vessel.dives:
            # Waves decrease as exp(-k z); the wave number at the peak is used for all, to keep the motion smooth.
            known = depth if sea.response == "encounter" else None
            p["attenuation"] = wave_number(np.array([2.0 * np.pi / sea.peak_period]), known)[0]
        heading, down = wrap_angle(start.heading), -start.altitude if vessel.dives else 0.0
        x = filled(
            motion.STATE, speed=start.speed, commanded_speed=start.speed, target_speed=start.speed,
            largest_speed_change=np.inf, heading=heading, target_heading=heading, largest_yaw_rate=vessel.turn_rate,
            depth=down, target_depth=down, largest_path_angle=0.26,
            position=[start.latitude, start.longitude, start.altitude],
        )  # fmt: skip
        self.use_state(x, np.zeros(length(motion.PROGRESS), np.int64))
        self._rows, self._points = table(manoeuvres)
        self._phase, self._waves = components(sea, seed, depth)
        self._eddies = eddies(current, seed)
        sizes = np.zeros(1, motion.SIZES)
        sizes["manoeuvres"], sizes["points"] = len(self._rows), len(self._points)
        sizes["waves"], sizes["eddies"] = self._phase.shape[1], len(self._eddies)
        self.sizes = sizes.view(np.int64)
        if sea is not None and sea.response == "encounter" and len(self._phase[0]):
            p["oscillators"] = np.ravel(sea.oscillators)
            north, east = start.speed * np.cos(start.heading), start.speed * np.sin(start.heading)
            at = steady(sea, self._phase, self._waves, north, east, start.heading)
            self._state["oscillations"] = at.ravel()
        if vessel.hull is not None:
            self._launch(vessel.hull, start.speed, air)
        motion.initialise(self._x, self._p, self._phase, self._waves, self._eddies)

    def _launch(self, hull: Hull, speed: float, air: AirFlow | None) -> None:
        """Put the numbers of a hull and of the wind into the constants, and its state on a straight course."""
        h = hull.vector
        if air is not None:
            numbers = h.view(dynamics.HULL)[0]
            numbers.wind, numbers.gusts[: air.gusts.size] = air.mean, air.gusts.ravel()
        p = self._p.view(motion.PARAMETERS)
        p["has_hull"], p["hull"] = True, h
        self._state["hull"] = filled(dynamics.SAIL, propeller=hull.propeller(speed), speed=speed)

    @property
    def _state(self) -> NDArray[Any]:
        """The present state with its names, (1,) `simnav.world.motion.STATE`."""
        return self._x.view(motion.STATE)

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return int(self._index.view(motion.PROGRESS)["sample"][0]) / self.rate

    def state(self) -> NavigationStates:
        """The present state, as a series of one state."""
        x = self._state
        dcm = x["dcm"][0]
        attitude = np.stack([x["roll"], x["pitch"], np.arctan2(dcm[1, :1], dcm[0, :1])], axis=1)
        return NavigationStates(np.array([self.time]), x["position"].copy(), x["velocity"].copy(), attitude)

    def steer_by(self, north: float, east: float, heading: float = 0.0) -> None:
        """Closed loop: set the errors of the estimated position and heading that the guidance uses from now on.

        The vessel steers for waypoints from the estimated position. In every other manoeuvre it returns to the planned
        track (`simnav.world.track.PlannedTrack`) by the estimated distance from it.

        Parameters
        ----------
        north, east : float
            Estimated minus true position [m].
        heading : float
            Estimated minus true heading [rad].
        """
        x = self._state
        x["north_error"], x["east_error"], x["heading_error"] = north, east, heading
        if self._follower is None:
            self._follower = Follower(_planned(*self._voyage))
        aside, speed = self._follower.aside(x["north"].item() + north, x["east"].item() + east, self.time)
        ahead = max(LEAST_LOOKAHEAD, LOOKAHEAD_TIME * speed)
        x["to_track"] = -np.arctan(aside / ahead)

    @classmethod
    def plan(
        cls,
        start: Start,
        vessel: KinematicVessel,
        manoeuvres: Sequence[Manoeuvre] = (),
        current: Current | None = None,
        air: AirFlow | None = None,
    ) -> PlannedTrack:
        """The planned track: without waves, in the mean current and the mean wind."""
        steady = None if current is None else current.model_copy(update={"variation": 0.0})
        calm = None if air is None else air.steady()
        return PlannedTrack(cls(start, vessel, manoeuvres, None, steady, rate=PlannedTrack.RATE, seed=0, air=calm))

    def command(self, heading: float, speed: float) -> None:
        """Command an estimated heading [rad] and a speed through the water [m/s]. It works without manoeuvres only.

        Raises
        ------
        ValueError
            If there are manoeuvres, because these command the vessel.
        """
        if len(self._rows):
            raise ValueError("a world with manoeuvres steers for itself")
        motion.command(_ON, self._x[None], np.array([np.nan]), np.array([heading]), np.array([speed]))

    def _one(self) -> tuple[Any, ...]:
        """The first arguments of `simnav.world.motion.advance` for this world alone."""
        rows, points, phase, waves, eddies = (
            a.reshape(1, -1) for a in (self._rows, self._points, self._phase, self._waves, self._eddies)
        )
        state = self._x[None], self._index[None]
        return _ON, state, self._p[None], self.sizes[None], (rows, points), (phase, waves, eddies)

    def trace(self, seconds: int) -> tuple[Array, Array, Array]:
        """Advance second by second, without the samples of instruments.

        Parameters
        ----------
        seconds : int
            Time by which the world is advanced [s].

        Returns
        -------
        track : (seconds, 4) array
            The values of `track` at the end of each second.
        position : (seconds, 3) array
            Latitude, longitude [rad], height [m].
        dive : (seconds, 2) array
            The values of `dive`.
        """
        n = round(self.rate)
        room = np.empty((1, n, 3))
        none, states = np.zeros(1, np.int64), np.empty((1, 0, TRUE_NUMBERS))
        nowhere = motion.RequestedStates(np.empty((1, 0)), none, none, states)
        imu = np.array([n]), room, room.copy()
        arguments: Any = (*self._one(), nowhere, imu)
        track, position, dive = np.empty((seconds, 4)), np.empty((seconds, 3)), np.empty((seconds, 2))
        for i in range(seconds):
            motion.advance.unchecked(*arguments)
            track[i], position[i], dive[i] = self.track, self._state["position"][0], self.dive
        return track, position, dive

    def share_state(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of this world, by the names of the arguments of `simnav.world.motion.advance`.

        The world must not be advanced by itself any more.
        """
        return {
            "x": self._x, "index": self._index, "p": self._p, "sizes": self.sizes, "rows": self._rows.ravel(),
            "points": self._points.ravel(), "phase": self._phase.ravel(), "table": self._waves.ravel(),
            "eddies": self._eddies.ravel(),
        }  # fmt: skip

    def use_state(self, x: Array, index: NDArray[Any]) -> None:
        """Use these arrays as the state from now on. The caller of `share_state` advances them."""
        self._x, self._index = x, index

    @property
    def track(self) -> Array:
        """(4,) array: north and east of the start [m], heading [rad], speed through the water [m/s]."""
        return self._values("north", "east", "heading", "speed")

    @property
    def dive(self) -> Array:
        """(2,) array: depth that is steered for [m], and largest path angle [rad]."""
        return self._values("target_depth", "largest_path_angle")

    def _values(self, *names: str) -> Array:
        """Numbers of the present state, by name."""
        state = self._state
        return np.array([state[name].item() for name in names])

    def advance(self, until: float, taps: Mapping[str, Array]) -> WorldBlock:
        """Advance to a time.

        Parameters
        ----------
        until : float
            End of the block, a multiple of the sample interval [s].
        taps : mapping of str to (m,) array
            Ascending times within (now, until] at which states are requested [s], by name.

        Returns
        -------
        WorldBlock
            The ideal IMU samples and the requested states.
        """
        first = int(self._index.view(motion.PROGRESS)["sample"][0])
        n = round(until * self.rate) - first
        if n < 0:
            raise ValueError(f"the world is at {self.time} s and does not go back to {until} s")
        # One piece of memory: in a long run the system gives it in large pages, which takes a tenth of the time.
        memory = np.empty(8 * n)
        time, interval = memory[:n], memory[n : 2 * n]
        rate, force = memory[2 * n : 5 * n].reshape(1, n, 3), memory[5 * n :].reshape(1, n, 3)
        times = np.concatenate([np.empty(0), *taps.values()])
        order = np.argsort(times, kind="stable")
        sorted_states = np.empty((1, len(times), TRUE_NUMBERS))
        requested = motion.RequestedStates(
            times[None, order], np.zeros(1, np.int64), np.array([len(times)]), sorted_states
        )
        arguments: Any = (*self._one(), requested, (np.array([n]), rate, force))
        motion.advance.unchecked(*arguments)
        states = np.empty_like(sorted_states[0])
        states[order] = sorted_states[0]
        out, i = {}, 0
        for name, t in taps.items():
            s = states[i : i + len(t)].view(TRUE_STATE)[:, 0]
            i += len(t)
            out[name] = TapStates(t, s["position"], s["velocity"], s["attitude"], s["angular_rate"], s["water"].copy())
        # Division, not multiplication by the interval: the time is then the float nearest to the decimal, 2.29 s.
        time[:] = np.arange(first + 1, first + n + 1)
        time /= self.rate
        interval[:] = 1.0 / self.rate
        return WorldBlock(ImuSamples(time, interval, rate[0], force[0]), out)


#: The tracks that were planned last, by what they follow from.
_plans: dict[tuple[type, str], PlannedTrack] = {}


def _planned(
    start: Start,
    vessel: KinematicVessel,
    manoeuvres: Sequence[Manoeuvre],
    current: Current | None,
    air: AirFlow | None,
) -> PlannedTrack:
    """The planned track, one for all runs with the same voyage: to plan it takes as long as a fifth of the run."""
    key = type(vessel), repr((start, vessel, tuple(manoeuvres), current, None if air is None else air.wind))
    track = _plans.get(key)
    if track is None:
        if len(_plans) > 7:
            _plans.pop(next(iter(_plans)), None)
        track = _plans[key] = World.plan(start, vessel, manoeuvres, current, air)
    return track
