"""Learning curves with intervals over training seeds: how the error falls on voyages that are not seen.

An agent is trained anew from each training seed, and scored now and then on the same voyages, whose seeds no training
has. The figure shows the mean error against the plain filter and its interval of 95 % over the training seeds. Run it::

    python examples/learning_curve.py --agent cross-entropy --output curve.png
"""

from __future__ import annotations

import argparse

import numpy as np

from simnav.estimators.learning.evaluation import interval, plain, scoring_envs, worth


def scored(policies, envs, seeds, before):
    """Mean error of each policy against the plain filter's, in percent."""
    return [100.0 * (float(np.exp(np.mean(np.log(worth(envs, seeds, p).error / before)))) - 1.0) for p in policies]


def curves(agent, training_seeds, scoring_seeds, **options):
    """Steps, and of each training seed the errors after so many."""
    envs = scoring_envs("training-gnss-faults", scoring_seeds, instruments="fixes")
    before = worth(envs, scoring_seeds, plain(envs)).error
    steps, found = [], []
    for seed in training_seeds:
        points = []
        agent.train(seed=seed, after=lambda done, policy, points=points: points.append((done, policy)), **options)
        steps = [done for done, _ in points]
        found.append(scored([policy for _, policy in points], envs, scoring_seeds, before))
    return np.array(steps), np.array(found)


def draw(steps, found, title, path):
    """The figure: mean and interval over the training seeds."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.6), dpi=120)
    axes = figure.add_subplot()
    bands = np.array([interval(column) for column in found.T])
    axes.axhline(0.0, color="#33414e", linewidth=1.0)
    axes.text(steps[-1] / 1e3, -0.4, "plain filter", ha="right", va="top", fontsize=9)
    axes.fill_between(steps / 1e3, bands[:, 1], bands[:, 2], color="#6aa9d8", alpha=0.35, linewidth=0)
    axes.plot(steps / 1e3, bands[:, 0], color="#1f5f99")
    axes.set_xlabel("training steps, thousands")
    axes.set_ylabel("error against the plain filter [%]")
    axes.set_title(title, fontsize=10)
    figure.tight_layout()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agent", choices=["cross-entropy", "ppo"], default="cross-entropy")
    parser.add_argument("--training-seeds", type=int, default=4)
    parser.add_argument("--scoring-seeds", type=int, default=48)
    parser.add_argument("--output", default="curve.png")
    arguments = parser.parse_args()
    if arguments.agent == "ppo":
        import stable_baselines as agent
    else:
        import cross_entropy as agent
    seeds = list(range(1000, 1000 + arguments.scoring_seeds))
    steps, found = curves(agent, range(arguments.training_seeds), seeds)
    for done, column in zip(steps, found.T, strict=True):
        mean, low, high = interval(column)
        print(f"{done:9d} steps: {mean:+6.1f} % [{low:+.1f}, {high:+.1f}] over {len(column)} training seeds")
    draw(steps, found, f"{arguments.agent}, {len(seeds)} voyages not seen", arguments.output)


if __name__ == "__main__":
    main()
