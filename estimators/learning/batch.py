"""The common part of the vector forms of the learning tasks: seeds, resets and autoreset modes.

They behave like Gymnasium's own vector forms, with the numbers of the environment of one voyage.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from simnav.environment.charted import ChartedEnv
from simnav.environment.vector import autoreset_of, reset_mask, seeds_of

from .environment import run_seed
from .features import Numbers
from .filters import checked_actions

__all__ = ["Decided", "VoyagesVectorEnv"]

Flags = NDArray[np.bool_]


class Decided(NamedTuple):
    """What a decision on n voyages has led to; the order is that of Gymnasium.

    Attributes
    ----------
    rewards : (n,) array
        Rewards.
    terminated, truncated : (n,) array of bool
        Whether the task has ended a voyage; whether its recording has ended.
    infos : dict
        Further values, as Gymnasium's vector environments return them.
    """

    rewards: NDArray[Any]
    terminated: Flags
    truncated: Flags
    infos: dict[str, Any]


class VoyagesVectorEnv(VectorEnv[Numbers, Numbers, NDArray[Any]]):
    """n voyages of one task, stepped together.

    Parameters
    ----------
    task : str
        Name of the task.
    num_envs : int
        Number n of voyages.
    observation_space, action_space : Space
        Spaces of a single voyage.
    autoreset_mode : AutoresetMode or str
        ``NEXT_STEP`` (as in Gymnasium: the step after the last one starts a new voyage, and its action is not read),
        ``SAME_STEP`` (the last step returns the observation of the new voyage, and the last one in ``final_obs``), or
        ``DISABLED`` (a finished voyage waits until ``reset(options={"reset_mask": ...})`` restarts it).
    independent_seeds : bool
        Meaning of an integer seed. False: voyage i has ``seed + i``, as in Gymnasium; True: independent seeds
        (`simnav.environment.spawn_seeds`).
    voyages : int, optional
        Number of training voyages (`simnav.environment.seeds`); None: the seed of a reset is the seed of the run.
    render_mode : None
        Must be None: only the single environment draws charts.

    Raises
    ------
    ValueError
        If an argument is not valid.
    """

    def __init__(
        self,
        task: str,
        num_envs: int,
        observation_space: spaces.Box,
        action_space: spaces.Space[Any],
        autoreset_mode: AutoresetMode | str,
        independent_seeds: bool,
        voyages: int | None,
        render_mode: str | None,
    ):
        if isinstance(num_envs, bool) or not isinstance(num_envs, int) or num_envs < 1:
            raise ValueError(f"num_envs is a positive integer, not {num_envs!r}")
        if render_mode is not None:
            raise ValueError(f"{task}: the vector form draws no charts; render one environment")
        self.task_name, self.num_envs, self.render_mode = task, num_envs, None
        self.autoreset_mode, self._independent = autoreset_of(autoreset_mode), independent_seeds
        self.metadata = {**ChartedEnv.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = observation_space, action_space
        self.observation_space = batch_space(observation_space, num_envs)
        self.action_space = batch_space(action_space, num_envs)
        assert action_space.shape is not None
        self._action_shape = action_space.shape
        self._voyages = voyages
        self._rngs: list[np.random.Generator] = []
        self._over, self._under_way = np.ones(num_envs, np.bool_), False

    @abstractmethod
    def _begin_voyage(self, i: int, seed: int) -> dict[str, Any]:
        """Begin a voyage with the seed of a run; its info."""

    @abstractmethod
    def _look(self, mask: Flags) -> None:
        """Observe some voyages."""

    @abstractmethod
    def _observations(self) -> Numbers:
        """(n, o) float32 array: what was observed last; it may be written to."""

    @abstractmethod
    def _decide(self, actions: Numbers, active: Flags) -> Decided:
        """Step some voyages and observe them."""

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin the voyages.

        Parameters
        ----------
        seed : int or sequence of int, optional
            One integer is ``seed + i`` for voyage i, or spawns independent seeds (see the class); a sequence assigns
            them.
        options : dict, optional
            ``reset_mask``: (n,) bool array, the voyages to begin anew; the others go on.

        Returns
        -------
        observation : (n, o) float32 array
            What each agent sees: o features of each voyage.
        info : dict
            ``seed``, ``start`` and ``instruments`` of each voyage that begins.
        """
        seeds = seeds_of(seed, self.num_envs, self._independent)
        mask = reset_mask(options, self.num_envs)
        if not self._under_way and not mask.all():
            raise gymnasium.error.ResetNeeded("the first reset begins all voyages: leave reset_mask out")
        while len(self._rngs) < self.num_envs:
            self._rngs.append(seeding.np_random()[0])
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._rngs[i] = seeding.np_random(seeds[i])[0]
        infos = self._begin(mask, seeds)
        return self._observations().copy(), infos

    def step(self, actions: Numbers) -> tuple[Numbers, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Decide on the steps that were observed.

        Raises
        ------
        ValueError
            If the actions have another shape, or one that is read is not finite; no voyage is stepped then.
        gymnasium.error.ResetNeeded
            If no voyage is under way.
        """
        mode = self.autoreset_mode
        if not self._under_way or (mode == AutoresetMode.DISABLED and self._over.all()):
            raise gymnasium.error.ResetNeeded("no voyage is under way: call reset() first")
        over = self._over.copy()
        active = ~over
        array = np.asarray(actions)
        if over.any() and array.shape[:1] == over.shape:
            array = np.where(over.reshape(-1, *[1] * (array.ndim - 1)), 0, array)  # not read
        what = f"the actions of {self.num_envs} agents in {self.task_name} are"
        array = checked_actions(array, (self.num_envs, *self._action_shape), what)
        rewards, terminated, truncated, infos = self._decide(array, active)  # as Gymnasium orders them
        infos = _of(infos, active)
        ended = active & (terminated | truncated)
        self._over |= ended
        if mode == AutoresetMode.NEXT_STEP and over.any():
            infos |= self._begin(over, None)
        elif mode == AutoresetMode.SAME_STEP and ended.any():
            final = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(ended).tolist():
                final[i] = self._observations()[i].copy()
            last: dict[str, Any] = {"final_obs": final, "_final_obs": ended.copy()}
            last |= {"final_info": _of(infos, ended), "_final_info": ended.copy()}
            infos = {**_of(infos, ~ended), **last, **self._begin(ended, None)}
        elif mode == AutoresetMode.DISABLED:
            truncated = truncated | (over & ~terminated)
        return self._observations().copy(), rewards, terminated, truncated, infos

    def _begin(self, mask: Flags, seeds: Sequence[int | None] | None) -> dict[str, Any]:
        """Begin some voyages; the infos."""
        infos: dict[str, Any] = {}
        for i in np.flatnonzero(mask).tolist():
            run = run_seed(None if seeds is None else seeds[i], self._rngs[i], self._voyages)
            infos = self._add_info(infos, self._begin_voyage(i, run), i)
            self._over[i] = False
        self._under_way = True
        self._look(mask)
        return infos


def _of(infos: dict[str, Any], mask: Flags) -> dict[str, Any]:
    """The infos of some voyages; what none of them has is left out."""
    part: dict[str, Any] = {}
    for key, value in infos.items():
        if not key.startswith("_") and (there := infos[f"_{key}"] & mask).any():
            part |= {key: value, f"_{key}": there}
    return part
