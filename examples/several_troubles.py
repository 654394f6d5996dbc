"""A policy of Tuning for several instruments and troubles, for the row ``policy-ekf``.

A rule is linear in what the filter tells of an instrument (`SEEN`). There is one for fixes, one for velocities and one
for headings, whatever the instrument, so that the same numbers fit families with other instruments; and one for the
process noise. The cross-entropy method draws the numbers of many policies, lets all of them act on a voyage of each
family at once, and fits the distribution to the best eighth. What counts is the gain over the plain filter on the same
voyage, by the likelihood of the true position, between -1 and 1: so a loss where nothing is wrong counts as much as a
gain where much is wrong. With gains without bounds the policy had four times the error of ``ekf`` on clean voyages.
Run it; it takes less than half an hour on one core::

    python examples/several_troubles.py --output policy.npz
"""

from __future__ import annotations

import argparse
import time
from importlib.metadata import version

import numpy as np
from cross_entropy import returns_of

from simnav.estimators.learning.features import observation_names
from simnav.estimators.learning.policy import Policy, record_of_training
from simnav.estimators.learning.vector import FilterTaskVectorEnv
from simnav.types import KINDS

#: Receivers; outages with bad fixes behind them; disturbed IMUs, DVLs and fixes; compasses and logs without an IMU; and
#: nothing wrong.
FAMILIES = ("training-gnss-faults", "training-outages", "training-motion", "training-ships", "training-clean")
ROLES = ("fix", "velocity", "heading")
SEEN = ("mean_innovation", "size_of_mean", "setting", "innovation[0]")  # and the sigma of the position, and a constant
NUMBERS = len(ROLES) * (len(SEEN) + 2) + len(ROLES) + 1
#: The kinds for which the policy decides where they are there; of other kinds of a role the filter keeps the noise.
DECIDED = ("gnss_position", "terrain_fix", "dvl", "speed_log", "gyrocompass")


def matrices(drawn, kinds, names, columns):
    """Weights and constants of linear policies for a layout: (n, a, o) and (n, a) arrays."""
    rules = drawn[:, : len(ROLES) * (len(SEEN) + 2)].reshape(len(drawn), len(ROLES), -1)
    motion = drawn[:, -len(ROLES) - 1 :]
    weight, constant = np.zeros((len(drawn), len(names) + 1, len(columns))), np.zeros((len(drawn), len(names) + 1))
    asked = set()
    for i, (name, kind) in enumerate(zip(names, kinds, strict=True)):
        role = KINDS[kind].role
        if kind not in DECIDED or kind in asked:
            continue
        r = ROLES.index(role)
        for j, seen in enumerate(SEEN):
            weight[:, i, columns.index(f"{name}.{seen}")] = rules[:, r, j]
        weight[:, i, columns.index("sigma_position")] = rules[:, r, -2]
        constant[:, i] = rules[:, r, -1]
        if not any(KINDS[k].role == role for k in asked):
            weight[:, -1, columns.index(f"{name}.mean_innovation")] = motion[:, r]
        asked.add(kind)
    constant[:, -1] = motion[:, -1]
    return weight, constant


def policy_of(numbers, told):
    """The policy as plain arrays, for one instrument of each kind and one measurement a step."""
    weight, constant = matrices(numbers[None], DECIDED, DECIDED, observation_names(list(DECIDED), 1))
    return Policy([(weight[0], constant[0])], task="Tuning", kinds=DECIDED, most=1, instruments="all", trained_on=told)


def train(families=FAMILIES, *, generations=25, population=40, voyages=16, length=None, seed=0, after=None):
    """The policy, and the mean gain of the mean policy in each generation; ``after`` is told of every generation."""
    options = {"reward": "likelihood", "voyages": voyages, "steps": length, "memory_gb": 6.0}  # most stays unused
    made = [FilterTaskVectorEnv(family, "Tuning", population, **options) for family in families]
    layouts = [(e.options.layout.kinds, e.options.layout.names, e.options.layout.most) for e in made]
    columns = [observation_names(names, most) for _, names, most in layouts]
    rng = np.random.default_rng(seed)
    mean, deviation, curve, steps = np.zeros(NUMBERS), np.full(NUMBERS, 0.3), [], 0
    records = [record_of_training(family, voyages) for family in families]
    told = {
        **records[0], "scenario": ", ".join(r["scenario"] for r in records), "voyages": voyages * len(families),
        "seed": seed, "algorithm": "cross-entropy method, linear policy", "versions": {"simnav": version("simnav")},
        "parameters": NUMBERS,
    }  # fmt: skip
    assert all(r["streams"] == records[0]["streams"] for r in records)  # training families share them
    for generation in range(generations):
        drawn = mean + deviation * rng.standard_normal((population, NUMBERS))
        drawn[0], drawn[1] = mean, 0.0  # the second is the plain filter
        gains = np.zeros(population)
        for envs, (kinds, names, _), seen in zip(made, layouts, columns, strict=True):
            weight, constant = matrices(drawn, kinds, names, seen)
            returns = returns_of(
                envs,
                lambda o, w=weight, c=constant: np.clip(np.einsum("nao,no->na", w, o) + c, -1.0, 1.0),
                [10_000 * seed + generation] * population,
            )
            count = length or envs.options.scenario.epochs
            gains += np.tanh((returns - returns[1]) / count) / len(families)
            steps += population * count
        best = drawn[np.argsort(gains)[-population // 8 :]]
        mean = best.mean(axis=0)
        deviation = best.std(axis=0) + 0.1 * 0.9**generation  # not to settle too early
        curve.append(float(gains[0]))
        if after:
            after(generation, curve[-1], policy_of(mean, {**told, "steps": steps}))
    return policy_of(mean, {**told, "steps": steps}), curve


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", default="policy.npz")
    arguments = parser.parse_args()
    begin = time.process_time()

    def kept(generation, gain, policy):
        policy.save(arguments.output)
        print(f"{generation}: gain of the mean policy {gain:.3f}, {time.process_time() - begin:.0f} s", flush=True)

    train(generations=arguments.generations, seed=arguments.seed, after=kept)
