"""The evaluation of an agent on unseen voyages, compared with the plain filter and the oracle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode

from simnav.environment.seeds import is_training
from simnav.scenario import Scenario
from simnav.types import Array

from .features import Numbers
from .vector import FilterTaskVectorEnv

__all__ = ["Agent", "Worth", "interval", "plain", "scoring_envs", "worth"]

#: From (b, o) observations to (b, ...) actions.
Agent = Callable[[Numbers], Numbers]

_LEVEL = 0.975


class Worth(NamedTuple):
    """For each of n voyages: return of the episode, and RMS horizontal errors of the agent and of the oracle [m]."""

    returns: Array
    error: Array
    oracle: Array


def plain(envs: FilterTaskVectorEnv) -> Agent:
    """The agent that does not change the filter."""
    shape, dtype = envs.action_space.shape, envs.single_action_space.dtype
    return lambda observation: np.zeros(shape or (), dtype)


def scoring_envs(
    scenario: Scenario | str | Path, seeds: Sequence[int], task: str = "Tuning", **options: object
) -> FilterTaskVectorEnv:
    """The environments of the scored voyages; ValueError if a seed is one of training."""
    if wrong := [s for s in seeds if is_training(s)]:
        raise ValueError(f"seed {wrong[0]} is one of training; scores are of seeds below it")
    return FilterTaskVectorEnv(
        scenario, task, len(seeds), reveal_truth=True, autoreset_mode=AutoresetMode.DISABLED, **options,  # type: ignore[arg-type]
    )  # fmt: skip


def worth(envs: FilterTaskVectorEnv, seeds: Sequence[int], agent: Agent) -> Worth:
    """Run an agent over voyages to their ends.

    Parameters
    ----------
    envs : FilterTaskVectorEnv
        The environments from `scoring_envs`.
    seeds : sequence of int
        Seed of each voyage, one for each environment.
    agent : callable
        From the observations to the actions of all environments.
    """
    observation, _ = envs.reset(seed=list(seeds))
    n = envs.num_envs
    returns, squares, knowing, steps = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    over = np.zeros(n, np.bool_)
    while not over.all():
        observation, reward, _, truncated, info = envs.step(agent(observation))
        active = ~over
        returns += reward
        squares[active] += np.nan_to_num(info["error"][active]) ** 2
        knowing[active] += np.nan_to_num(info["oracle_error"][active]) ** 2
        steps[active] += 1
        over = truncated
    return Worth(returns, np.sqrt(squares / steps), np.sqrt(knowing / steps))


def interval(values: Array) -> tuple[float, float, float]:
    """Mean, and the ends of its interval of 95 % (Student's t) over n independent values."""
    from scipy.stats import t

    n = len(values)
    half = float(t.ppf(_LEVEL, n - 1) * np.std(values, ddof=1) / np.sqrt(n))
    mean = float(np.mean(values))
    return mean, mean - half, mean + half
