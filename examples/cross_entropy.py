"""An agent without gradients: the cross-entropy method on the tuning task, in NumPy.

A policy is linear in `SEEN`, a few numbers of the observation. Each generation draws policies from a normal
distribution, lets all of them steer filters over the same training voyages at once, and fits the distribution to the
best eighth. Run it::

    python examples/cross_entropy.py --output policy.npz

Source: R. Y. Rubinstein, "The cross-entropy method for combinatorial and continuous optimization", Methodology and
Computing in Applied Probability 1, 1999.
"""

from __future__ import annotations

import argparse
from importlib.metadata import version

import numpy as np

from simnav.estimators.learning.features import observation_names
from simnav.estimators.learning.policy import Policy, record_of_training
from simnav.estimators.learning.vector import FilterTaskVectorEnv

FAMILY = "training-gnss-faults"
SEEN = ("gnss.mean_innovation", "gnss.size_of_mean", "gnss.setting", "gnss.innovation[0]", "sigma_position")


def columns_of(layout):
    """Where the numbers of `SEEN` stand in the observation."""
    names = observation_names(layout.names, layout.most)
    return [names.index(name) for name in SEEN]


def returns_of(envs, weights, seed, repeats):
    """Mean return of each of n linear policies, (n, a, s + 1) weights, over the same voyages."""
    total, columns = np.zeros(len(weights)), columns_of(envs.options.layout)
    for repeat in range(repeats):
        observation, _ = envs.reset(seed=[seed + repeat] * len(weights))
        over = np.zeros(len(weights), bool)
        while not over.any():  # all voyages of a family are equally long
            action = np.einsum("nao,no->na", weights[:, :, :-1], observation[:, columns]) + weights[:, :, -1]
            observation, reward, _, over, _ = envs.step(np.clip(action, -1.0, 1.0))
            total += reward
    return total / repeats


def policy_of(mean, layout, told):
    """A linear policy as plain arrays."""
    weight = np.zeros((len(mean), layout.size))
    weight[:, columns_of(layout)] = mean[:, :-1]
    fits = {"kinds": layout.kinds, "most": layout.most, "instruments": "fixes"}
    return Policy([(weight, mean[:, -1])], task="Tuning", trained_on=told, **fits)


def train(*, generations=25, population=64, repeats=3, voyages=64, length=None, seed=0, after=None):
    """The policy, and the return of the mean policy in each generation; ``after`` is told of every fifth."""
    envs = FilterTaskVectorEnv(FAMILY, "Tuning", population, instruments="fixes", voyages=voyages, steps=length)
    layout, steps = envs.options.layout, length or envs.options.scenario.epochs
    shape = envs.single_action_space.shape[0], len(SEEN) + 1
    rng = np.random.default_rng(seed)
    mean, deviation, curve = np.zeros(shape), np.full(shape, 0.3), []
    how = {"algorithm": "cross-entropy method, linear policy", "versions": {"simnav": version("simnav")}, "steps": 0}
    told = record_of_training(envs.options.scenario, voyages, seed=seed, **how)
    for generation in range(generations):
        weights = mean + deviation * rng.standard_normal((population, *shape))
        weights[0] = mean
        returns = returns_of(envs, weights, 10_000 * seed + generation * repeats, repeats)
        best = weights[np.argsort(returns)[-population // 8 :]]
        mean = best.mean(axis=0)
        deviation = best.std(axis=0) + 0.1 * 0.95**generation  # not to settle too early
        curve.append(float(returns[0]))
        told["steps"] += population * repeats * steps
        if after and (generation + 1) % 5 == 0:
            after(told["steps"], policy_of(mean, layout, told))
    return policy_of(mean, layout, told), curve


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", default="policy.npz")
    arguments = parser.parse_args()
    trained, curve = train(generations=arguments.generations, seed=arguments.seed)
    print(f"return of the mean policy: first {curve[0]:.1f}, last {curve[-1]:.1f}")
    trained.save(arguments.output)
