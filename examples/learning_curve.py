"""Learning curves with intervals over training seeds: how the error falls on voyages that are not seen.

An agent is trained anew from each training seed, and scored now and then on the same voyages, whose seeds no training
has. The figure shows the mean error against the plain filter and its interval of 95 % over the training seeds. Run it::

    python examples/learning_curve.py --agent ppo --folder curve --output curve.png

The folder keeps the points and the last policy of each training seed. Started again, it does what is missing.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from simnav.estimators.learning.evaluation import interval, plain, scoring_envs, worth


def scored(policies, envs, seeds, before):
    """Mean error of each policy against the plain filter's (geometric mean over voyages), in percent."""
    return [100.0 * (float(np.exp(np.mean(np.log(worth(envs, seeds, p).error / before)))) - 1.0) for p in policies]


def curves(agent, training_seeds, scoring_seeds, folder=None, **options):
    """Steps, and of each training seed the errors after so many; a folder keeps what is done."""
    envs = scoring_envs("training-gnss-faults", scoring_seeds, instruments="fixes")
    before, found = None, []
    for seed in training_seeds:
        file = None if folder is None else Path(folder) / f"{agent.__name__}-{seed}.json"
        if file is not None and file.exists():
            found.append(json.loads(file.read_text()))
            continue
        points = []
        agent.train(seed=seed, after=lambda done, policy, points=points: points.append((done, policy)), **options)
        policies = [policy for _, policy in points]
        for policy in policies:
            policy.require_unseen(scoring_seeds)
        if before is None:
            before = worth(envs, scoring_seeds, plain(envs)).error
        errors = scored(policies, envs, scoring_seeds, before)
        found.append({"steps": [done for done, _ in points], "change": errors})
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            policies[-1].save(file.with_suffix(".npz"))
            file.write_text(json.dumps(found[-1]))
    return np.array(found[0]["steps"]), np.array([each["change"] for each in found])


def draw(curves, title, path):
    """The figure: mean and interval over the training seeds, of each agent by name: (steps, errors)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.6), dpi=120)
    axes = figure.add_subplot()
    axes.axhline(0.0, color="#33414e", linewidth=1.0)
    for (name, (steps, found)), colour in zip(curves.items(), ("#1f5f99", "#b4541a"), strict=False):
        bands = np.array([interval(column) for column in found.T])
        x = np.concatenate([[0.0], steps / 1e3])  # before training it is the plain filter
        mean, low, high = (np.concatenate([[0.0], band]) for band in bands.T)
        axes.fill_between(x, low, high, color=colour, alpha=0.25, linewidth=0)
        axes.plot(x, mean, color=colour, label=name)
    axes.set_xlabel("training steps, thousands")
    axes.set_ylabel("error against the plain filter [%]")
    axes.set_title(title, fontsize=10)
    axes.legend(frameon=False, fontsize=9)
    figure.tight_layout()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agent", choices=["cross-entropy", "ppo"], nargs="+", default=["cross-entropy"])
    parser.add_argument("--training-seeds", type=int, default=5)
    parser.add_argument("--scoring-seeds", type=int, default=48)
    parser.add_argument("--folder", help="keeps points and policies")
    parser.add_argument("--ppo-steps", type=int, help="of each training with PPO")
    parser.add_argument("--output", default="curve.png")
    arguments = parser.parse_args()
    seeds = list(range(1000, 1000 + arguments.scoring_seeds))
    drawn = {}
    for name in arguments.agent:
        if name == "ppo":
            import stable_baselines as agent
        else:
            import cross_entropy as agent
        options = {"steps": arguments.ppo_steps} if name == "ppo" and arguments.ppo_steps else {}
        steps, found = curves(agent, range(arguments.training_seeds), seeds, arguments.folder, **options)
        drawn[name] = steps, found
        for done, column in zip(steps, found.T, strict=True):
            mean, low, high = interval(column)
            print(
                f"{name}, {done:9d} steps: {mean:+6.1f} % [{low:+.1f}, {high:+.1f}] over {len(column)} training seeds"
            )
    draw(drawn, f"{len(seeds)} voyages not seen, {arguments.training_seeds} training seeds", arguments.output)


if __name__ == "__main__":
    main()
