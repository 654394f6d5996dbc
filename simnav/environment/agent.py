"""An estimator as an agent: observations are converted to measurements, and estimates to actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from simnav.estimator import Estimator
from simnav.types import NO_SIDE, Array, Estimate, ImuSamples, InitialState, Instruments, Measurement, Measurements

__all__ = ["EstimatorAgent", "unpack"]


def unpack(observation: Mapping[str, Any], instruments: Instruments) -> Measurements:
    """Convert an observation to the packet of measurements that an estimator receives.

    Parameters
    ----------
    observation : dict
        Observation of a `NavigationEnv`.
    instruments : Instruments
        The datasheets, from the info of `NavigationEnv.reset`.

    Returns
    -------
    Measurements
        The same numbers, in the same order, as in the packets of `Recording.steps`.
    """
    start, time = observation["interval"].tolist()
    imu = None
    if instruments.imu is not None:
        entry = observation["imu"]
        n = int(entry["valid"].sum())
        imu = ImuSamples(entry["time"][:n], entry["length"][:n], entry["angular_rate"][:n], entry["specific_force"][:n])
    aids = []
    for name, sheet in instruments.items():
        entry = observation[name]
        channels = sheet.channels
        for i in np.flatnonzero(entry["valid"]).tolist():
            m = Measurement(float(entry["time"][i]), name, sheet.kind, entry["value"][i])
            if channels:  # each has its slots
                m = m._replace(
                    channel=channels[i % len(channels)], side=entry["side"][i] if "side" in entry else NO_SIDE
                )
            aids.append(m)
    aids.sort(key=lambda m: m.time)
    return Measurements(start, time, imu, aids)


class EstimatorAgent:
    """An estimator as the agent of a `NavigationEnv`. It gives the same numbers as in a trial.

    Parameters
    ----------
    estimator : Estimator
        The estimator. A reference that needs the truth (``reference``) is refused.
    observation_space : gymnasium.spaces.Dict, optional
        Observation space of the `NavigationEnv`. It is needed for flat observations (Gymnasium's
        ``FlattenObservation``).

    Attributes
    ----------
    estimate : Estimate or None
        The last estimate, with its covariance and diagnostics, which are not part of the action.

    Raises
    ------
    ValueError
        If the estimator is a reference that needs the truth.
    """

    def __init__(self, estimator: Estimator, observation_space: spaces.Dict | None = None):
        if estimator.reference:
            raise ValueError(
                f"estimator {estimator.name or type(estimator).__name__!r} is a reference that is told the truth; "
                "an environment does not tell it"
            )
        self.estimator, self._space = estimator, observation_space
        self.estimate: Estimate | None = None

    def reset(self, info: Mapping[str, Any]) -> None:
        """Start a run, with the info of the environment's reset."""
        start: InitialState = info["start"]
        self._instruments: Instruments = info["instruments"]
        self._start = np.stack([start.position, start.velocity, start.attitude])
        self.estimate = None
        self.estimator.reset(start, self._instruments)

    def act(self, observation: Mapping[str, Any] | Array) -> Array:
        """The action: the estimate, with the initial state for components that are not estimated.

        Parameters
        ----------
        observation : dict or array
            Observation of the step.

        Returns
        -------
        (3, 3) array
            Position, velocity and attitude, see `NavigationEnv`.

        Raises
        ------
        ValueError
            If the observation is flat, and the agent does not know its space.
        """
        if not isinstance(observation, Mapping):
            if self._space is None:
                raise ValueError("a flat observation needs the space: EstimatorAgent(estimator, observation_space)")
            observation = spaces.unflatten(self._space, np.asarray(observation))
        self.estimate = estimate = self.estimator.update(unpack(observation, self._instruments))
        vectors = (estimate.position, estimate.velocity, estimate.attitude)
        given = np.stack([self._start[i] if v is None else v for i, v in enumerate(vectors)])
        return np.where(estimate.mask().reshape(3, 3), given, self._start)
