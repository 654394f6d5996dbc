"""Stable-Baselines3 on the tuning task: PPO sets how noisy the receiver is, and becomes an estimator.

Install the extra ``rl`` (``pip install simnav[rl]``) and run it; it takes less than ten minutes on two cores::

    python examples/stable_baselines.py --output policy.npz

The policy learns from training voyages with noise steps and multipath. It is scored on other voyages of the same
family, beside the plain filter, and written to a file of plain arrays that ``simnav`` runs without this library. Short
runs with these settings have not beaten the plain filter; ``cross_entropy.py`` does (docs/reference/tasks/tuning.md).
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

from simnav.environment.seeds import FIRST_TRAINING_SEED
from simnav.estimators.learning.evaluation import interval, plain, scoring_envs, worth
from simnav.estimators.learning.policy import Policy
from simnav.estimators.learning.vector import FilterTaskVectorEnv

FAMILY = "training-gnss-faults"


class BankOfFilters(VecEnv):
    """The vector form as Stable-Baselines3 wants it: a voyage that is over begins anew within the step."""

    def __init__(self, envs: FilterTaskVectorEnv):
        assert envs.autoreset_mode.name == "SAME_STEP"
        self.envs = envs
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self):
        seed = self._seeds[0]
        self._reset_seeds()
        return self.envs.reset(seed=seed)[0]

    def step_async(self, actions):
        self._actions = actions

    def step_wait(self):
        observation, reward, _, truncated, info = self.envs.step(self._actions)
        infos = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(truncated):
            infos[i] = {"terminal_observation": info["final_obs"][i], "TimeLimit.truncated": True}
        return observation, reward.astype(np.float32), truncated, infos

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


def policy_of(model: PPO, envs: FilterTaskVectorEnv, trained_on: dict) -> Policy:
    """The mean of a policy of PPO, as plain arrays."""
    net = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    layers = [(m.weight.detach().numpy(), m.bias.detach().numpy()) for m in net if hasattr(m, "weight")]
    layout, o = envs.options.layout, envs.options
    return Policy(
        layers, task=o.task.name, kinds=layout.kinds, most=layout.most, instruments="fixes", trained_on=trained_on
    )


def train(*, steps=600_000, num_envs=64, voyages=128, seed=0, length=None, after=None):
    """PPO on the tuning task.

    Parameters
    ----------
    steps : int
        Of all environments together.
    num_envs, voyages, seed : int
        Filters side by side, training voyages, and the seed of everything that is drawn.
    length : int, optional
        Of an episode.
    after : callable, optional
        Called now and then, with the steps done and the policy.
    """
    envs = FilterTaskVectorEnv(
        FAMILY, "Tuning", num_envs, instruments="fixes", voyages=voyages, steps=length, autoreset_mode="SAME_STEP"
    )
    venv = BankOfFilters(envs)
    venv.seed(seed)
    model = PPO(
        "MlpPolicy", venv, n_steps=64, batch_size=16 * num_envs, n_epochs=4, learning_rate=1e-3, gamma=0.95,
        gae_lambda=0.9, seed=seed, device="cpu", policy_kwargs={"net_arch": [32, 32], "log_std_init": -1.0},
    )  # fmt: skip
    told = {
        "scenario": FAMILY, "voyages": voyages, "first_seed": FIRST_TRAINING_SEED, "steps": steps, "seed": seed,
        "algorithm": "PPO of Stable-Baselines3, two layers of 32",
    }  # fmt: skip
    done, parts = 0, 5 if after else 1
    for part in range(parts):
        model.learn(steps // parts, reset_num_timesteps=part == 0)
        done += steps // parts
        if after:
            after(done, policy_of(model, envs, told))
    return policy_of(model, envs, told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=600_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--voyages", type=int, default=128)
    parser.add_argument("--output", default="policy.npz")
    arguments = parser.parse_args()
    begun = time.perf_counter()
    policy = train(steps=arguments.steps, voyages=arguments.voyages, seed=arguments.seed)
    print(f"trained for {time.perf_counter() - begun:.0f} s")
    seeds = list(range(64))  # of scoring: they are below every seed of training
    policy.require_unseen(seeds)
    envs = scoring_envs(FAMILY, seeds, instruments="fixes")
    before, learned = worth(envs, seeds, plain(envs)), worth(envs, seeds, policy)
    mean, low, high = interval(100.0 * (learned.error / before.error - 1.0))
    print(f"error against the plain filter, on 64 voyages not seen: {mean:+.0f} % [{low:+.0f}, {high:+.0f}]")
    policy.save(arguments.output)


if __name__ == "__main__":
    main()
