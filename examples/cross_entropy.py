"""An agent without gradients: the cross-entropy method on each of the tasks, in NumPy.

A policy is linear in what it has `SEEN`, a few numbers of the observation. Each generation draws policies from a normal
distribution, lets all of them act on the same training voyages at once, and fits the distribution to the best eighth.
Run it::

    python examples/cross_entropy.py --task Tuning --output policy.npz

Source: R. Y. Rubinstein, "The cross-entropy method for combinatorial and continuous optimization", Methodology and
Computing in Applied Probability 1, 1999.
"""

from __future__ import annotations

import argparse
from importlib.metadata import version

import numpy as np

from simnav.estimators.learning.features import GUIDANCE, observation_names
from simnav.estimators.learning.guidance_vector import GuidanceVectorEnv
from simnav.estimators.learning.policy import Policy, record_of_training
from simnav.estimators.learning.vector import FilterTaskVectorEnv

FAMILY = "training-gnss-faults"
SEEN = {
    "Tuning": ("gnss.mean_innovation", "gnss.size_of_mean", "gnss.setting", "gnss.innovation[0]", "sigma_position"),
    "Detection": ("gnss.innovation[0]", "gnss.mean_innovation"),  # against a threshold, which is the constant
    "Correction": ("gnss.mean_0", "gnss.mean_1", "gnss.mean_2"),
    "Guidance": ("aside", "sin_course", "turn_10_s", "turn_rate"),
}
# Of weights. Tuning: the process noise is left as it is; to lower it gained nothing, and cost much on some voyages.
UNIT = {"Tuning": np.array([[1.0], [0.0]]), "Detection": 1.0, "Correction": 0.03, "Guidance": 1.0}  # 30 cm of 10 m
REWARD = {"Tuning": "likelihood"}  # the covariance counts, too


def made(task, num_envs, **options):
    """The vector form of a task."""
    if task == "Guidance":
        return GuidanceVectorEnv(FAMILY, num_envs, **options)
    return FilterTaskVectorEnv(FAMILY, task, num_envs, instruments="fixes", reward=REWARD.get(task), **options)


def returns_of(envs, agent, seeds):
    """Return of each voyage."""
    total, over = np.zeros(envs.num_envs), np.zeros(envs.num_envs, bool)
    observation, _ = envs.reset(seed=seeds)
    while not over.any():  # all voyages of a family are equally long
        observation, reward, _, over, _ = envs.step(agent(observation))
        total += reward
    return total


def policy_of(weights, columns, size, told, **fits):
    """A linear policy as plain arrays."""
    weight = np.zeros((len(weights), size))
    weight[:, columns] = weights[:, :-1]
    return Policy([(weight, weights[:, -1])], trained_on=dict(told), **fits)


def train(task="Tuning", *, generations=25, population=64, repeats=3, voyages=64, length=None, seed=0, after=None):
    """The policy, and the return of the mean policy in each generation; ``after`` is told of every fifth."""
    envs = made(task, population, voyages=voyages, steps=length)
    o, size = envs.options, envs.single_observation_space.shape[0]
    guidance = task == "Guidance"
    names = GUIDANCE if guidance else observation_names(o.layout.names, o.layout.most)
    about = ([], 0, "all") if guidance else (o.layout.kinds, o.layout.most, "fixes")
    fits = {"task": task, **dict(zip(("kinds", "most", "instruments"), about, strict=True))}
    columns = [names.index(name) for name in SEEN[task]]
    shape = envs.single_action_space.shape[0], len(columns) + 1
    rng = np.random.default_rng(seed)
    mean, deviation, curve = np.zeros(shape), np.full(shape, 0.3), []
    how = {"algorithm": "cross-entropy method, linear policy", "versions": {"simnav": version("simnav")}, "steps": 0}
    told = record_of_training(o.scenario, voyages, seed=seed, **how)

    def policy():
        return policy_of(UNIT[task] * mean, columns, size, told, **fits)

    for generation in range(generations):
        drawn = mean + deviation * rng.standard_normal((population, *shape))
        drawn[0] = mean
        weights = UNIT[task] * drawn

        def act(observation, weights=weights):
            action = np.einsum("nao,no->na", weights[:, :, :-1], observation[:, columns]) + weights[:, :, -1]
            return action > 0.0 if task == "Detection" else np.clip(action, -1.0, 1.0)

        first = 10_000 * seed + generation * repeats
        returns = np.mean([returns_of(envs, act, [first + i] * population) for i in range(repeats)], axis=0)
        best = drawn[np.argsort(returns)[-population // 8 :]]
        mean = best.mean(axis=0)
        deviation = best.std(axis=0) + 0.1 * 0.95**generation  # not to settle too early
        curve.append(float(returns[0]))
        told["steps"] += population * repeats * (length or o.scenario.epochs)
        if after and (generation + 1) % 5 == 0:
            after(told["steps"], policy())
    return policy(), curve


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", choices=list(SEEN), default="Tuning")
    parser.add_argument("--generations", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", default="policy.npz")
    arguments = parser.parse_args()
    trained, curve = train(arguments.task, generations=arguments.generations, seed=arguments.seed)
    print(f"return of the mean policy: first {curve[0]:.1f}, last {curve[-1]:.1f}")
    trained.save(arguments.output)
