"""The vector form of the tasks around a running filter: a bank of filters, stepped in one compiled pass.

A voyage is prepared once (simulated, filtered by the plain filter and by the oracle, linearised) and kept. A step of
the bank is then one pass over shared arrays. The numbers are those of `FilterTaskEnv`
(`simnav.estimators.learning.environment`), bit for bit. What is new to the pool costs its preparation at the reset:
learn from a number of ``voyages``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from simnav.environment.vector import autoreset_of, reset_mask, seeds_of
from simnav.estimators.learning.environment import FilterTaskEnv, TaskOptions, run_seed
from simnav.estimators.learning.features import Numbers
from simnav.estimators.learning.filters import Filters, checked_actions
from simnav.estimators.learning.pool import Pool
from simnav.scenario import Scenario

__all__ = ["FilterTaskVectorEnv"]


class FilterTaskVectorEnv(VectorEnv[Numbers, Numbers, NDArray[Any]]):
    """One of the tasks of `simnav.estimators.learning.tasks`, over n voyages at a time.

    Parameters
    ----------
    scenario, task, reward, instruments, steps, voyages, reveal_truth
        As of `simnav.estimators.learning.environment.TaskOptions`.
    num_envs : int
        Number n of voyages.
    autoreset_mode : AutoresetMode or str
        ``NEXT_STEP`` (as of Gymnasium: the step after the last one begins a new voyage, and its action is not read),
        ``SAME_STEP`` (the last step returns the new voyage's observation, and its own in ``final_obs``), or
        ``DISABLED`` (a voyage that is over stands still until ``reset(options={"reset_mask": ...})``).
    independent_seeds : bool
        What an integer seed becomes: False: ``seed + i`` for voyage i, as in Gymnasium; True: independent seeds
        (`simnav.environment.spawn_seeds`).
    cache : int, optional
        Prepared voyages that are kept; by default twice n, or all ``voyages`` where those are more.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path,
        task: str = "Tuning",
        num_envs: int = 1,
        *,
        reward: str | None = None,
        instruments: str = "all",
        steps: int | None = None,
        voyages: int | None = None,
        reveal_truth: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        independent_seeds: bool = False,
        cache: int | None = None,
        render_mode: str | None = None,
    ):
        if isinstance(num_envs, bool) or not isinstance(num_envs, int) or num_envs < 1:
            raise ValueError(f"num_envs is a positive integer, not {num_envs!r}")
        if render_mode is not None:
            raise ValueError(f"{task}: the vector form draws no charts; render one environment")
        self.options = o = TaskOptions(scenario, task, reward, instruments, steps, voyages, reveal_truth)
        self.num_envs, self.render_mode = num_envs, None
        self.autoreset_mode, self._independent = autoreset_of(autoreset_mode), independent_seeds
        self.metadata = {**FilterTaskEnv.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = o.observation_space, o.action_space
        self.observation_space = batch_space(o.observation_space, num_envs)
        self.action_space = batch_space(o.action_space, num_envs)
        self._pool = Pool(o, max(num_envs + 1, cache or max(2 * num_envs, voyages or 0)))
        self._rngs: list[np.random.Generator] = []
        self._slots, self._k = np.zeros(num_envs, np.int64), np.zeros(num_envs, np.int64)
        self._over = np.ones(num_envs, np.bool_)
        self._filters: Filters | None = None

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
        info : dict
            ``seed`` and ``start`` of each voyage that begins.
        """
        seeds = seeds_of(seed, self.num_envs, self._independent)
        mask = reset_mask(options, self.num_envs)
        if self._filters is None and not mask.all():
            raise gymnasium.error.ResetNeeded("the first reset begins all voyages: leave reset_mask out")
        while len(self._rngs) < self.num_envs:
            self._rngs.append(seeding.np_random()[0])
        begun = np.flatnonzero(mask).tolist()
        for i in begun:
            if seeds[i] is not None:
                self._rngs[i] = seeding.np_random(seeds[i])[0]
        infos = self._begin(begun, seeds)
        filters = self._filters
        assert filters is not None
        return filters.observation.copy(), infos

    def step(self, actions: Numbers) -> tuple[Numbers, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Decide on the steps that were observed.

        Raises
        ------
        ValueError
            If the actions have another shape, or one that is read is not finite; no voyage is stepped then.
        gymnasium.error.ResetNeeded
            If no voyage is under way.
        """
        filters, pool, o = self._filters, self._pool, self.options
        if filters is None or (self.autoreset_mode == AutoresetMode.DISABLED and self._over.all()):
            raise gymnasium.error.ResetNeeded("no voyage is under way: call reset() first")
        over = self._over.copy()
        active = ~over
        array = np.asarray(actions)
        if over.any() and array.shape[:1] == over.shape:
            array = np.where(over.reshape(-1, *[1] * (array.ndim - 1)), 0, array)  # not read
        what = f"the actions of {self.num_envs} agents in {o.task.name} are"
        array = checked_actions(array, (self.num_envs, *o.action_shape), what)
        slots, k = self._slots, self._k
        linear = pool.linear
        first, last = pool.edges[slots, k], pool.edges[slots, k + 1]
        filters.decide(array)
        filters.step(linear, first, last, active)
        error, oracle = pool.rows(pool.error, slots, k), pool.rows(pool.oracle, slots, k)
        rewards = filters.reward(linear, first, last, active, error, oracle, pool.faulty)
        infos: dict[str, Any] = {}
        if o.reveal_truth:
            shift = filters.decision.correction
            north = error[:, 0] + filters.delta[:, 0] + shift[:, 0]
            east = error[:, 1] + filters.delta[:, 1] + shift[:, 1]
            infos |= {"error": np.sqrt(north * north + east * east), "_error": active.copy()}
            infos |= {"oracle_error": oracle[:, 0].copy(), "_oracle_error": active.copy()}
        k[active] += 1
        ended = active & (k >= pool.length[slots])
        k[ended] -= 1  # a voyage that is over has no next step to look at
        self._over |= ended
        self._observe(active & ~ended)
        filters.observation[ended] = 0.0
        if self.autoreset_mode == AutoresetMode.NEXT_STEP and over.any():
            infos |= self._begin(np.flatnonzero(over).tolist(), None)
        elif self.autoreset_mode == AutoresetMode.SAME_STEP and ended.any():
            final = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(ended).tolist():
                final[i] = filters.observation[i].copy()
            infos |= {"final_obs": final, "_final_obs": ended.copy(), "final_info": infos, "_final_info": ended.copy()}
            infos |= self._begin(np.flatnonzero(ended).tolist(), None)
        truncated: NDArray[Any] = ended if self.autoreset_mode != AutoresetMode.DISABLED else self._over.copy()
        return filters.observation.copy(), rewards, np.zeros(self.num_envs, np.bool_), truncated, infos

    def _begin(self, voyages: list[int], seeds: Sequence[int | None] | None) -> dict[str, Any]:
        """Begin some voyages; the infos."""
        o = self.options
        infos: dict[str, Any] = {}
        used = set(self._slots[~self._over].tolist()) if self._filters is not None else set()
        for i in voyages:
            run = run_seed(None if seeds is None else seeds[i], self._rngs[i], o.voyages)
            slot = self._pool.slot(run, used)
            if self._filters is None:
                self._filters = Filters(o.task, o.layout, o.reward, self.num_envs, self._pool.n)
            used.add(slot)
            self._slots[i], self._k[i], self._over[i] = slot, 0, False
            self._filters.begin(i, self._pool.covariance[slot], self._pool.period[slot])
            infos = self._add_info(infos, {"seed": run, "start": self._pool.start[slot]}, i)
        mask = np.zeros(self.num_envs, np.bool_)
        mask[voyages] = True
        self._observe(mask)
        return infos

    def _observe(self, mask: NDArray[np.bool_]) -> None:
        if not mask.any():
            return
        pool, slots, k, filters = self._pool, self._slots, self._k, self._filters
        assert filters is not None
        filters.observe(
            pool.linear, pool.edges[slots, k], pool.edges[slots, k + 1], pool.end[slots, k],
            pool.rows(pool.context, slots, k), mask,
        )  # fmt: skip
