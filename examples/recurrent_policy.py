"""A policy with a memory on the tuning task: recurrent PPO of sb3-contrib, beside the plain filter.

Install the extra ``rl`` (``pip install '.[rl]'``) and run it; it takes about half an hour on two cores::

    python examples/recurrent_policy.py

The environments, the reward and the normalisation are those of ``stable_baselines.py``. The policy has a layer of 16
cells with a long memory (LSTM), so it may tell a fault that lasts from one that passes. It is scored on voyages that it
has not seen. It is no file for ``policy-ekf``, which takes policies without a memory.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from stable_baselines import FAMILY, STEPS, BankOfFilters, Now
from stable_baselines3.common.vec_env import VecNormalize

from simnav.environment.seeds import require_disjoint, training_seed
from simnav.estimators.learning.evaluation import interval, plain, scoring_envs, worth
from simnav.estimators.learning.vector import FilterTaskVectorEnv


def made(*, num_envs=64, same=8, voyages=64, seed=0, length=None, cells=16):
    """The environments, and the agent as it begins: its mean action is close to zero."""
    envs = FilterTaskVectorEnv(
        FAMILY, "Tuning", num_envs, reward="gain", instruments="fixes", voyages=voyages, steps=length,
        autoreset_mode="SAME_STEP",
    )  # fmt: skip
    steps = length or envs.options.scenario.epochs
    venv = VecNormalize(BankOfFilters(envs, same), gamma=0.98, clip_obs=np.inf, epsilon=0.01)
    venv.seed(seed)
    return RecurrentPPO(
        "MlpLstmPolicy", venv, n_steps=steps, batch_size=num_envs * steps // 8, n_epochs=4, gamma=0.98, gae_lambda=1.0,
        learning_rate=lambda left: 2e-3 * left, clip_range=0.4, seed=seed, device="cpu",
        policy_kwargs={"lstm_hidden_size": cells, "net_arch": {"pi": [], "vf": [32]}, "log_std_init": -1.5},
    )  # fmt: skip


def agent_of(model: RecurrentPPO, num_envs: int):
    """The mean of the policy, with a memory of its own for each environment, from the begin of the voyages on."""
    memory, begins = None, np.ones(num_envs, bool)

    def act(observation):
        nonlocal memory, begins
        seen = model.get_vec_normalize_env().normalize_obs(observation)
        action, memory = model.predict(seen, state=memory, episode_start=begins, deterministic=True)
        begins = np.zeros(num_envs, bool)
        return np.pad(action, ((0, 0), (0, 1)))  # the process noise stays as it is

    return act


def train(*, steps=STEPS, seed=0, after=None, parts=5, **options):
    """Recurrent PPO on the tuning task; ``after`` is called ``parts`` times, with the steps done and the model."""
    torch.set_num_threads(1)
    model = made(seed=seed, **options)
    model.learn(steps, callback=Now(steps, parts, lambda done: after(done, model)) if after else None)
    return model


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--voyages", type=int, default=64)
    arguments = parser.parse_args()
    seeds, begun = list(range(64)), time.perf_counter()  # of scoring: they are below every seed of training
    require_disjoint(map(training_seed, range(arguments.voyages)), seeds)
    envs = scoring_envs(FAMILY, seeds, instruments="fixes")
    before = worth(envs, seeds, plain(envs))

    def tell(done, model):
        mean, low, high = interval(np.log(worth(envs, seeds, agent_of(model, len(seeds))).error / before.error))
        change = ", ".join(f"{100.0 * (np.exp(x) - 1.0):+.0f}" for x in (mean, low, high))
        print(f"{done} steps, {time.perf_counter() - begun:.0f} s: error (mean, interval) {change} %", flush=True)

    train(steps=arguments.steps, seed=arguments.seed, voyages=arguments.voyages, after=tell)


if __name__ == "__main__":
    main()
