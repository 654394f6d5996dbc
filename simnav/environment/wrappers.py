"""Wrappers of `NavigationEnv` for learning agents: actions relative to the last estimate, observations of order one.

For windows over the last observations use Gymnasium's ``FrameStackObservation``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from simnav.environment.navigation import Observation
from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.kinds import Component
from simnav.types import KINDS, Array, InitialState, Instruments

__all__ = ["NormaliseObservation", "RelativeAction"]

#: Units of a relative action: position [m], velocity [m/s], attitude [rad].
STEPS = np.array([[100.0] * 3, [10.0] * 3, [1.0] * 3])
#: Units of a normalised observation: distance [m], speed [m/s], angular rate [rad/s], specific force [m/s^2].
DISTANCE, SPEED, RATE, FORCE = 1000.0, 10.0, 0.1, 9.81
#: Bound of its numbers.
LIMIT = 100.0


class RelativeAction(gymnasium.Wrapper[Any, NDArray[Any], Observation, Array]):
    """Actions as differences from the last estimate, at first from the initial state.

    An action is a (9,) float32 array of numbers in [-1, 1]; others are clipped: north, east, down in units of 100 m;
    velocity north, east, down in units of 10 m/s; roll, pitch, yaw in units of 1 rad. Zero: nothing has changed.

    Parameters
    ----------
    env : gymnasium.Env
        A `NavigationEnv`, or a wrapper of it with the same actions.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]):
        super().__init__(env)
        self._action_space = spaces.Box(-1.0, 1.0, (9,), dtype=np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start a run. The initial state is the first estimate."""
        observation, info = super().reset(seed=seed, options=options)
        start: InitialState = info["start"]
        self._estimate = np.stack([start.position, start.velocity, start.attitude])
        return observation, info

    def step(self, action: NDArray[Any]) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Give the last estimate plus the action as the new estimate.

        Raises
        ------
        ValueError
            If the action has another shape or is not finite.
        """
        array = np.asarray(action, dtype=np.float64)
        if array.shape != (9,) or not np.isfinite(array).all():
            raise ValueError(f"a relative action is a (9,) array of finite numbers, not {action!r}")
        change = np.clip(array, -1.0, 1.0).reshape(3, 3) * STEPS
        before = self._estimate
        attitude = wrap_angle(before[2] + change[2])
        self._estimate = np.stack([displace(before[0], change[0]), before[1] + change[1], attitude])
        return super().step(self._estimate)


class NormaliseObservation(gymnasium.ObservationWrapper[Observation, Array, Observation]):
    """Observations as a flat `Dict` of float32 arrays of order one, which also hold the initial state.

    ``interval`` is (time since the start divided by 3600 s, length of the step [s]). Each instrument has the entries
    ``<name>.age`` (end of the step minus time of validity [s]), ``<name>.valid`` and ``<name>.value``, with channels
    ``<name>.side``; the IMU has ``imu.angular_rate`` and ``imu.specific_force``. Positions are north, east, down from
    the start, divided by 1000 m; depths are divided by 1000 m, speeds by 10 m/s, angular rates by 0.1 rad/s, specific
    forces by 9.81 m/s^2; angles are in rad. ``start`` is the velocity divided by 10 m/s, the attitude [rad], and the
    nine sigmas in m, m/s and rad.

    Parameters
    ----------
    env : gymnasium.Env
        A `NavigationEnv`, or a wrapper of it with the same observations.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]):
        super().__init__(env)
        old = env.observation_space
        assert isinstance(old, spaces.Dict)
        entries: dict[str, spaces.Space[Any]] = {"interval": _box(2), "start": _box(15)}
        for name, space in old.items():
            if not isinstance(space, spaces.Dict):
                continue
            for key, part in space.items():
                assert part.shape is not None
                if key != "length":
                    entries[f"{name}.{'age' if key == 'time' else key}"] = _box(*part.shape)
        self._observation_space = spaces.Dict(entries)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start a run, and store its initial state."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._start: InitialState = info["start"]
        self._instruments: Instruments = info["instruments"]
        return self.observation(observation), info

    def observation(self, observation: Observation) -> Observation:
        """The observation in the units of the class."""
        start, end = observation["interval"].tolist()
        initial = self._start
        sigmas = np.sqrt(np.diag(initial.covariance))
        out = {
            "interval": np.array([end / 3600.0, end - start]),
            "start": np.concatenate([initial.velocity / SPEED, initial.attitude, sigmas]),
        }
        for name, entry in observation.items():
            if not isinstance(entry, dict):
                continue
            valid = entry["valid"]
            out[f"{name}.valid"] = valid
            out[f"{name}.age"] = (end - entry["time"]) * valid
            if name == "imu":
                out["imu.angular_rate"] = entry["angular_rate"] / RATE
                out["imu.specific_force"] = entry["specific_force"] / FORCE
            else:
                out[f"{name}.value"] = self._value(name, entry["value"]) * valid[:, None]
                if "side" in entry:
                    out[f"{name}.side"] = self._side(name, entry["side"]) * valid[:, None]
        return {name: np.clip(array, -LIMIT, LIMIT).astype(np.float32) for name, array in out.items()}

    def _value(self, name: str, value: Array) -> Array:
        kind = KINDS[self._instruments[name].kind] if name in self._instruments else None
        if kind is None:
            return value
        if kind.geodetic:
            position = np.concatenate([value, np.zeros((len(value), max(0, 3 - value.shape[1])))], axis=1)
            return relative_position(position[:, :3], self._start.position)[:, : value.shape[1]] / DISTANCE
        return value / _units(kind.components)

    def _side(self, name: str, side: Array) -> Array:
        """Side information; a position by latitude, longitude and height is north, east and down from the start."""
        if name not in self._instruments:
            return side
        kind = KINDS[self._instruments[name].kind]
        out = side / _units(kind.side)
        names = ("latitude", "longitude", "height")
        if set(names) <= set(kind.side_names):
            place = [kind.side_names.index(n) for n in names]
            out[:, place] = relative_position(side[:, place], self._start.position) / DISTANCE
        return out


def _units(components: Sequence[Component]) -> Array:
    return np.array([SPEED if c.error_unit == "m_s" else DISTANCE if c.error_unit == "m" else 1.0 for c in components])


def _box(*shape: int) -> spaces.Box:
    return spaces.Box(-LIMIT, LIMIT, shape, dtype=np.float32)
