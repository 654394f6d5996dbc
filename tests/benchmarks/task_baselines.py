"""Returns of baselines in the learning tasks: chance, the plain filter, and an agent that is told the truth.

``python -m tests.benchmarks.task_baselines --task Detection --scenario training-gnss-faults --runs 12`` prints the rows
of the table on the task's page: mean and interval of 95 % over the seeds 0, 1, ..., which no training has.
"""

from __future__ import annotations

import argparse

import numpy as np

from simnav.estimators.learning.environment import FilterTaskEnv
from simnav.estimators.learning.evaluation import interval, plain, scoring_envs, worth
from simnav.estimators.learning.guidance import LineOfSight
from simnav.estimators.learning.guidance_vector import GuidanceVectorEnv
from simnav.estimators.learning.policy import Policy
from simnav.estimators.learning.tasks import CORRECTIONS, TASKS
from simnav.estimators.learning.voyage import Voyage

STEPS = 240


def told(task, voyage, env):
    """The action of an agent that is told the truth on the step."""
    layout = env.options.layout
    if task == "Detection":
        bits = np.zeros((len(layout.names), layout.most), np.int8)
        counts = dict.fromkeys(layout.names, 0)
        linear = voyage.filter.linear
        for e in range(voyage.filter.count):
            name = layout.watched[linear.instrument[e]] if linear.size[e] else ""
            if name in counts:
                j = min(counts[name], layout.most - 1)
                counts[name] += 1
                bits[layout.names.index(name), j] |= bool(voyage.faulty[e])
        return bits.ravel()
    wanted = -np.nan_to_num(voyage.error[[0, 1, 2, 3, 4, 5, 8]])
    return np.clip(wanted / CORRECTIONS, -1.0, 1.0).astype(np.float32)


def sailed(task, scenario, seed, agent):
    """Return, and RMS of the horizontal error [m], of ``random``, ``plain`` or ``told`` on a voyage."""
    env = FilterTaskEnv(scenario, task, instruments="fixes", steps=STEPS, reveal_truth=True)
    env.reset(seed=seed)
    env.action_space.seed(seed)
    o = env.options
    voyage = Voyage(o.scenario, seed, o.layout.watched, STEPS, oracle=False) if agent == "told" else None
    total, squares, steps, over = 0.0, 0.0, 0, False
    while not over:
        if voyage is not None:
            voyage.advance()
            action = told(task, voyage, env)
        elif agent == "random":
            action = env.action_space.sample()
        else:
            action = np.zeros(o.action_shape, env.action_space.dtype)
        _, reward, _, over, info = env.step(action)
        total, squares, steps = total + reward, squares + info["error"] ** 2, steps + 1
    return total, (squares / steps) ** 0.5


def tuned(scenario, seeds, policy):
    """Rows of Tuning, where the oracle is the environment's own."""
    envs = scoring_envs(scenario, seeds, instruments="fixes", steps=STEPS)
    envs.action_space.seed(0)
    before = worth(envs, seeds, plain(envs))
    found = {"random": worth(envs, seeds, lambda _: envs.action_space.sample()), "plain EKF": before}
    if policy:
        found[policy] = worth(envs, seeds, Policy.load(policy))
    rows = {name: [w.returns, w.error, 100.0 * np.log(w.error / before.error)] for name, w in found.items()}
    return {**rows, "oracle": [np.zeros(len(seeds)), before.oracle, 100.0 * np.log(before.oracle / before.error)]}


def steered(scenario, seeds):
    """Rows of Guidance."""
    envs = GuidanceVectorEnv(scenario, len(seeds), steps=STEPS)
    envs.action_space.seed(0)
    by = {
        "random": lambda _: envs.action_space.sample(),
        "planned heading": lambda seen: np.zeros((len(seen), 2), np.float32),
        "line of sight by the plain filter": lambda seen: np.stack([LineOfSight()(row) for row in seen]),
    }
    rows = {}
    for name, agent in by.items():
        observation, _ = envs.reset(seed=seeds)
        total, over = np.zeros(len(seeds)), np.zeros(len(seeds), bool)
        while not over.all():
            observation, reward, ended, truncated, _ = envs.step(agent(observation))
            total += np.where(over, 0.0, reward)
            over |= ended | truncated
        rows[name] = [total]
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", choices=[*TASKS, "Guidance"], default="Tuning")
    parser.add_argument("--scenario", default="training-gnss-faults")
    parser.add_argument("--runs", type=int, default=12)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--policy", help="a file, of Tuning")
    given = parser.parse_args()
    seeds = list(range(given.first, given.first + given.runs))
    if given.task == "Tuning":
        rows = tuned(given.scenario, seeds, given.policy)
    elif given.task == "Guidance":
        rows = steered(given.scenario, seeds)
    else:
        agents = {"random": "random", "plain EKF": "plain", "told the truth": "told"}
        rows = {
            name: np.transpose([sailed(given.task, given.scenario, seed, agent) for seed in seeds])
            for name, agent in agents.items()
        }
    print(f"{given.task}, {given.scenario}, seeds {seeds[0]} to {seeds[-1]}: return; error [m]; change [%]")
    for name, columns in rows.items():
        cells = []
        for column, exponent in zip(columns, (False, False, True), strict=False):
            values = np.array(interval(np.asarray(column)))
            mean, low, high = 100.0 * np.expm1(values / 100.0) if exponent else values
            cells.append(f"{mean:8.2f} [{low:.2f}, {high:.2f}]")
        print(f"  {name:<34}" + "  ".join(cells))


if __name__ == "__main__":
    main()
