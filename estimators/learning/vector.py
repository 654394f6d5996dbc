"""The vector form of the tasks around a running filter: a bank of filters, stepped in one compiled pass.

A voyage is prepared once (simulated, filtered by the plain filter and by the oracle, linearised) and kept. A step of
the bank is then one pass over shared arrays. The numbers are those of `FilterTaskEnv`
(`simnav.estimators.learning.environment`), bit for bit. The preparation of a new voyage takes time at the reset, so use
the same ``voyages`` many times.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from simnav.scenario import Scenario

from .batch import Decided, Flags, VoyagesVectorEnv
from .environment import TaskOptions, check_counts
from .features import Numbers
from .filters import Filters
from .pool import Pool, capacity_within

__all__ = ["FilterTaskVectorEnv"]


class FilterTaskVectorEnv(VoyagesVectorEnv):
    """One of the tasks of `simnav.estimators.learning.tasks`, over n voyages at a time.

    Parameters
    ----------
    scenario, task, reward, instruments, steps, voyages, reveal_truth
        The options of the task, see `simnav.estimators.learning.environment.TaskOptions`.
    num_envs, autoreset_mode, independent_seeds, render_mode
        The options of a vector form, see `simnav.estimators.learning.batch.VoyagesVectorEnv`.
    cache : int, optional
        Number of prepared voyages that are kept; by default twice n, or all ``voyages`` if these are more, as far as
        they fit into ``memory_gb``.
    memory_gb : float
        Most memory of the prepared voyages [GB]. It is estimated before it is taken.

    Raises
    ------
    ValueError
        If an argument is not valid, or n voyages do not fit into ``memory_gb``.

    Warns
    -----
    UserWarning
        If fewer voyages are kept than by default, because of ``memory_gb``.
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
        memory_gb: float = 4.0,
        render_mode: str | None = None,
    ):
        self.options = o = TaskOptions(scenario, task, reward, instruments, steps, voyages, reveal_truth)
        super().__init__(
            task, num_envs, o.observation_space, o.action_space, autoreset_mode, independent_seeds, voyages, render_mode
        )
        check_counts(cache=cache)
        least = num_envs + 1
        wanted = max(least, cache or max(2 * num_envs, voyages or 0))
        self._pool = Pool(o, capacity_within(o, least, wanted, cache is not None, memory_gb))
        self._slots, self._k = np.zeros(num_envs, np.int64), np.zeros(num_envs, np.int64)
        self._filters: Filters | None = None

    def _begin_voyage(self, i: int, seed: int) -> dict[str, Any]:
        o, pool = self.options, self._pool
        used = set(self._slots[~self._over].tolist())
        slot = pool.slot(seed, used)
        if self._filters is None:
            self._filters = Filters(o.task, o.layout, o.reward, self.num_envs, pool.n)
        self._slots[i], self._k[i] = slot, 0
        self._filters.begin(i, pool.covariance[slot], pool.period[slot])
        return {"seed": seed, "start": pool.start[slot], "instruments": pool.instruments[slot]}

    def _look(self, mask: Flags) -> None:
        if not mask.any():
            return
        pool, slots, k, filters = self._pool, self._slots, self._k, self._filters
        assert filters is not None
        filters.observe(
            pool.linear, pool.edges[slots, k], pool.edges[slots, k + 1], pool.end[slots, k],
            pool.rows(pool.context, slots, k), mask,
        )  # fmt: skip

    def _observations(self) -> Numbers:
        assert self._filters is not None
        return self._filters.observation

    def _decide(self, actions: Numbers, active: Flags) -> Decided:
        filters, pool, slots, k = self._filters, self._pool, self._slots, self._k
        assert filters is not None
        linear = pool.linear
        first, last = pool.edges[slots, k], pool.edges[slots, k + 1]
        filters.decide(actions)
        filters.step(linear, first, last, active)
        error, oracle = pool.rows(pool.error, slots, k), pool.rows(pool.oracle, slots, k)
        rewards = filters.reward(linear, first, last, active, error, oracle, pool.faulty)
        infos: dict[str, Any] = {}
        if self.options.reveal_truth:
            shift = filters.decision.correction
            north = error[:, 0] + filters.delta[:, 0] + shift[:, 0]
            east = error[:, 1] + filters.delta[:, 1] + shift[:, 1]
            infos |= {"error": np.sqrt(north * north + east * east), "_error": active.copy()}
            infos |= {"oracle_error": oracle[:, 0].copy(), "_oracle_error": active.copy()}
        k[active] += 1
        ended = active & (k >= pool.length[slots])
        k[ended] -= 1  # a voyage that is over has no next step to look at
        self._look(active & ~ended)
        filters.observation[ended] = 0.0
        return Decided(rewards, np.zeros(self.num_envs, np.bool_), ended, infos)
