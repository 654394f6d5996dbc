"""Many runs in closed loop, advanced together: compiled passes over all worlds, instruments and observations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.environment.navigation import NavigationEnv, Observation
from simnav.environment.observed_steps import crowded, entries, horizontal, keep, no_imu, padded
from simnav.simulation.steps import SteppedRuns

__all__ = ["SteeredRuns"]


class SteeredRuns:
    """The runs of n environments of one scenario in closed loop, which begin them.

    Parameters
    ----------
    envs : list of NavigationEnv
        The environments. They have the usual reward, no chart and no truth in their infos.

    Attributes
    ----------
    observation : dict
        The observations of the last step, with a first axis of n; zeros for runs that were not advanced.
    """

    @staticmethod
    def suits(env: NavigationEnv) -> bool:
        """Whether runs of such environments can be advanced together."""
        return env.closed_loop and env.plain and env.render_mode is None and not env.reveal_truth

    def __init__(self, envs: list[NavigationEnv]):
        self.n, self._envs = len(envs), envs
        self._runs = SteppedRuns(self.n)
        for i, env in enumerate(envs):
            env.share(self._runs, i)
        self._names, self._most, self._widths = envs[0].layout
        shape = (self.n, len(self._names))
        self._slots = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
        self._left = np.zeros(self.n, np.int64)
        self._rows: list[list[float]] = [[] for _ in envs]
        self.observation: Observation = {}

    def begin(self, i: int, seed: int | None) -> tuple[Observation, dict[str, Any]]:
        """Reset an environment; its first observation, and its info."""
        observation, info = self._envs[i].reset(seed=seed)
        self._rows[i], self._left[i] = self._envs[i].hand_over()
        place, most = self._slots
        for j, name in enumerate(self._runs.names[i]):
            place[i, j], most[i, j] = self._names.index(name), self._most[name]
        return observation, info

    def steer(self, i: int, estimate: list[float]) -> float:
        """Steer a vessel by the nine numbers of an estimate; its reward."""
        row = self._rows[i]
        north, east = horizontal(estimate, row)
        simulator = self._runs.simulators[i]
        assert simulator is not None
        simulator.steer_by(north, east, math.remainder(estimate[8] - row[5], math.tau))
        return -math.hypot(north, east)

    def advance(self, steered: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Advance the runs that were steered, but for those that are at their end; which of them were advanced.

        Raises
        ------
        ValueError
            If an instrument delivers more samples than the rate of its datasheet allows.
        """
        runs, going = self._runs, steered & (self._left > 0)
        samples, aids = padded(self.n, self._names, self._most)
        intervals, states = np.zeros((self.n, 2)), np.zeros((self.n, 3, 3))
        which = np.flatnonzero(going)
        if len(which):
            runs.advance(going)
            self._left -= going
            rows = np.zeros((len(which), 6))
            imu = runs.imu_steps if samples.time.shape[1] else no_imu(self.n)
            many = keep((which, which), runs.truth, imu, runs.delivered, self._slots, samples, aids, states, rows)
            if many >= 0:
                raise crowded(runs, self._slots, many)
            for i, row in zip(which.tolist(), rows.tolist(), strict=True):
                self._rows[i], intervals[i] = row, runs.interval_of(i)
        columns = entries(samples, aids, self._widths)
        self.observation = {"interval": intervals, **{
            name: {key: np.ascontiguousarray(array) for key, array in entry.items()} for name, entry in columns.items()
        }}  # fmt: skip
        return going

    def last(self, i: int) -> Observation:
        """The observation that comes with the end of a run."""
        return self._envs[i].empty(self._runs.interval_of(i)[1])
