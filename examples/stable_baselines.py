"""Stable-Baselines3 on the tuning task: PPO learns how noisy a receiver is, and becomes an estimator.

Install the extra ``rl`` (``pip install '.[rl]'``) and run it; it takes less than ten minutes on two cores::

    python examples/stable_baselines.py --output policy.npz

The policy learns from training voyages with noise steps and multipath. It is scored on other voyages of the same
family, beside the plain filter, and written to a file of plain arrays that ``simnav`` runs without this library.

Four things decide whether it learns (docs/how-to/learn-to-navigate.md): the reward is relative to the plain filter;
several filters sail the same voyage, and what counts is who does better than the others; the advantage is not
bootstrapped, for a critic does not see the error; exploration is small.
"""

from __future__ import annotations

import argparse
import time
from importlib.metadata import version

import numpy as np
import torch
from gymnasium.spaces import Box
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from simnav.estimators.learning.evaluation import interval, plain, scoring_envs, worth
from simnav.estimators.learning.policy import Policy, record_of_training
from simnav.estimators.learning.vector import FilterTaskVectorEnv

FAMILY = "training-gnss-faults"
STEPS = 30 * 64 * 240  # thirty updates
LIBRARIES = ("simnav", "stable-baselines3", "torch", "numpy")


class BankOfFilters(VecEnv):
    """The vector form as Stable-Baselines3 wants it: a voyage that is over begins anew within the step.

    Groups of ``same`` filters sail the same voyages. The reward is less the mean of the group, which does not depend on
    what a filter does itself, but for its own share. The agent sets the noise of the receivers, and the process noise
    stays as it is.
    """

    def __init__(self, envs: FilterTaskVectorEnv, same: int):
        assert envs.autoreset_mode.name == "SAME_STEP"
        assert envs.num_envs % same == 0
        self.envs, self.same = envs, same
        asked = len(envs.options.layout.kinds)
        super().__init__(envs.num_envs, envs.single_observation_space, Box(-1.0, 1.0, (asked,), np.float32))

    def reset(self):
        groups = np.random.default_rng(self._seeds[0]).integers(2**31, size=self.num_envs // self.same)
        self._reset_seeds()
        return self.envs.reset(seed=np.repeat(groups, self.same).tolist())[0]

    def step_async(self, actions):
        self._actions = np.pad(actions, ((0, 0), (0, 1)))

    def step_wait(self):
        observation, reward, _, over, info = self.envs.step(self._actions)
        infos = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(over):  # nothing is lost after the end of a voyage: its value is 0
            infos[i] = {"terminal_observation": info["final_obs"][i]}
        reward = reward.reshape(-1, self.same)
        reward = (reward - reward.mean(axis=1, keepdims=True)).ravel()
        return observation, reward.astype(np.float32), over, infos

    def close(self):
        self.envs.close()

    def get_attr(self, attr_name, indices=None):
        return [getattr(self.envs, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None):
        raise NotImplementedError

    def env_method(self, method_name, *arguments, indices=None, **keywords):
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * len(list(self._get_indices(indices)))


class Now(BaseCallback):
    """Calls a function with the steps done, ``parts`` times, after an update of the policy."""

    def __init__(self, steps, parts, function):
        super().__init__()
        self.marks, self.function = [steps * (i + 1) / parts for i in range(parts)], function

    def _on_step(self):
        return True

    def _on_rollout_start(self):
        while self.marks and self.num_timesteps >= self.marks[0]:
            self.marks.pop(0)
            self.function(self.num_timesteps)

    def _on_training_end(self):
        self._on_rollout_start()


def made(*, num_envs=64, same=8, voyages=64, seed=0, length=None):
    """The environments, and PPO as it begins: its mean action is close to zero, so that it is the plain filter."""
    envs = FilterTaskVectorEnv(
        FAMILY, "Tuning", num_envs, reward="gain", instruments="fixes", voyages=voyages, steps=length,
        autoreset_mode="SAME_STEP",
    )  # fmt: skip
    steps, gamma = length or envs.options.scenario.epochs, 0.98  # each update sees whole voyages
    # The large epsilon: what hardly varies in training must not become large on other voyages.
    venv = VecNormalize(BankOfFilters(envs, same), gamma=gamma, clip_obs=np.inf, epsilon=0.01)
    venv.seed(seed)
    model = PPO(
        "MlpPolicy", venv, n_steps=steps, batch_size=num_envs * steps // 8, n_epochs=8, gamma=gamma, gae_lambda=1.0,
        learning_rate=lambda left: 4e-3 * left, clip_range=0.4, seed=seed, device="cpu",
        policy_kwargs={"net_arch": {"pi": [], "vf": [32, 32]}, "log_std_init": -1.5},
    )  # fmt: skip
    return envs, model


def policy_of(model: PPO, envs: FilterTaskVectorEnv, trained_on: dict) -> Policy:
    """The mean of a policy of PPO, as plain arrays, with the normalisation of its observations."""
    net = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    layers = [(m.weight.detach().numpy(), m.bias.detach().numpy()) for m in net if hasattr(m, "weight")]
    weight, bias = layers[-1]
    layers[-1] = np.pad(weight, ((0, 1), (0, 0))), np.pad(bias, (0, 1))  # 0 for the process noise
    seen, layout = model.get_vec_normalize_env(), envs.options.layout
    return Policy(
        layers, task=envs.options.task.name, kinds=layout.kinds, most=layout.most, instruments="fixes",
        mean=seen.obs_rms.mean, deviation=np.sqrt(seen.obs_rms.var + seen.epsilon), trained_on=trained_on,
    )  # fmt: skip


def train(*, steps=STEPS, num_envs=64, same=8, voyages=64, seed=0, length=None, after=None, parts=5):
    """PPO on the tuning task.

    Parameters
    ----------
    steps : int
        Of all environments together; whole voyages are done.
    num_envs, same, voyages, seed : int
        Filters side by side, how many of them sail the same voyage, training voyages, and the seed of everything that
        is drawn.
    length : int, optional
        Of an episode.
    after : callable, optional
        Called so many times (``parts``), with the steps done and the policy.
    """
    torch.set_num_threads(1)
    envs, model = made(num_envs=num_envs, same=same, voyages=voyages, seed=seed, length=length)
    told = record_of_training(
        envs.options.scenario, voyages, seed=seed, algorithm="PPO of Stable-Baselines3, linear policy",
        versions={name: version(name) for name in LIBRARIES},
    )  # fmt: skip

    def policy():
        return policy_of(model, envs, {**told, "steps": model.num_timesteps})

    model.learn(steps, callback=Now(steps, parts, lambda done: after(done, policy())) if after else None)
    return policy()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--voyages", type=int, default=64)
    parser.add_argument("--output", default="policy.npz")
    arguments = parser.parse_args()
    begun = time.perf_counter()
    policy = train(steps=arguments.steps, voyages=arguments.voyages, seed=arguments.seed)
    print(f"trained for {time.perf_counter() - begun:.0f} s")
    policy.save(arguments.output)
    seeds = list(range(64))  # of scoring: they are below every seed of training
    policy.require_unseen(seeds)
    envs = scoring_envs(FAMILY, seeds, instruments="fixes")
    before, learned = worth(envs, seeds, plain(envs)), worth(envs, seeds, policy)
    mean, low, high = interval(np.log(learned.error / before.error))
    change = ", ".join(f"{100.0 * (np.exp(x) - 1.0):+.0f}" for x in (low, high))
    print(f"error against the plain filter, on 64 voyages not seen: {100.0 * (np.exp(mean) - 1.0):+.0f} % [{change}]")


if __name__ == "__main__":
    main()
