"""Learning curves with intervals over training seeds: what is learned for voyages that are not seen.

An agent is trained anew from each training seed, and scored now and then on the same voyages, whose seeds no training
has. The figure shows the mean over these voyages with an interval of 95 % over the training seeds: of Tuning the error
against the plain filter, of the other tasks the return. Run it::

    python examples/learning_curve.py --agent ppo --folder curve --output curve.png
    python examples/learning_curve.py --task Detection --output curve.png

The folder keeps the points and the last policy of each training seed. Started again, it does what is missing.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from cross_entropy import FAMILY, SEEN, made, returns_of

from simnav.estimators.learning.evaluation import interval, plain, scoring_envs, worth


def judge(task, seeds):
    """The score of an agent, a function, and what the agent scores that leaves everything as it is."""
    if task == "Tuning":  # percent by which the error is larger than the plain filter's, a geometric mean
        envs = scoring_envs(FAMILY, seeds, instruments="fixes")
        before = worth(envs, seeds, plain(envs)).error
        return lambda agent: 100.0 * float(np.expm1(np.mean(np.log(worth(envs, seeds, agent).error / before)))), 0.0
    envs = made(task, len(seeds))

    def score(agent):
        return float(np.mean(returns_of(envs, agent, seeds)))

    return score, score(plain(envs))


def curves(agent, training_seeds, scoring_seeds, folder=None, task="Tuning", **options):
    """Steps, and of each training seed the scores after so many; a folder keeps what is done."""
    score, found = None, []
    if task != "Tuning":
        options["task"] = task
    for seed in training_seeds:
        file = None if folder is None else Path(folder) / f"{agent.__name__}-{task}-{seed}.json"
        if file is not None and file.exists():
            found.append(json.loads(file.read_text()))
            continue
        points = []
        agent.train(seed=seed, after=lambda done, policy, points=points: points.append((done, policy)), **options)
        policies = [policy for _, policy in points]
        for policy in policies:
            policy.require_unseen(scoring_seeds)
        if score is None:
            score, before = judge(task, scoring_seeds)
        scores = [before, *map(score, policies)]
        found.append({"steps": [0, *(done for done, _ in points)], "scores": scores})
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            policies[-1].save(file.with_suffix(".npz"))
            file.write_text(json.dumps(found[-1]))
    return np.array(found[0]["steps"]), np.array([each["scores"] for each in found])


def draw(curves, title, path, label="error against the plain filter [%]"):
    """The figure: mean and interval over the training seeds, of each agent by name: (steps, scores)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.6), dpi=120)
    axes = figure.add_subplot()
    for (name, (steps, found)), colour in zip(curves.items(), ("#1f5f99", "#b4541a"), strict=False):
        mean, low, high = np.array([interval(column) for column in found.T]).T
        axes.fill_between(steps / 1e3, low, high, color=colour, alpha=0.25, linewidth=0)
        axes.plot(steps / 1e3, mean, color=colour, label=name)
    axes.axhline(mean[0], color="#33414e", linewidth=1.0, label="before training")  # all is left as it is
    axes.set_xlabel("training steps, thousands")
    axes.set_ylabel(label)
    axes.set_title(title, fontsize=10)
    axes.legend(frameon=False, fontsize=9)
    figure.tight_layout()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agent", choices=["cross-entropy", "ppo"], nargs="+", default=["cross-entropy"])
    parser.add_argument("--task", choices=list(SEEN), default="Tuning", help="ppo has only Tuning")
    parser.add_argument("--training-seeds", type=int, default=5)
    parser.add_argument("--scoring-seeds", type=int, default=48)
    parser.add_argument("--folder", help="keeps points and policies")
    parser.add_argument("--ppo-steps", type=int, help="of each training with PPO")
    for name in ("generations", "population", "repeats"):
        parser.add_argument(f"--{name}", type=int, help="of the cross-entropy method")
    parser.add_argument("--output", default="curve.png")
    arguments = parser.parse_args()
    if "ppo" in arguments.agent and arguments.task != "Tuning":
        parser.error("the example of PPO learns Tuning only")
    seeds = list(range(1000, 1000 + arguments.scoring_seeds))
    drawn = {}
    for name in arguments.agent:
        if name == "ppo":
            import stable_baselines as agent

            options = {"steps": arguments.ppo_steps}
        else:
            import cross_entropy as agent

            options = {key: getattr(arguments, key) for key in ("generations", "population", "repeats")}
        options = {key: value for key, value in options.items() if value}
        training = range(arguments.training_seeds)
        steps, found = curves(agent, training, seeds, arguments.folder, arguments.task, **options)
        drawn[name] = steps, found
        for done, column in zip(steps, found.T, strict=True):
            mean, low, high = interval(column)
            print(f"{name}, {done:9d} steps: {mean:+6.1f} [{low:+.1f}, {high:+.1f}] over {len(column)} training seeds")
    title = f"{arguments.task}: {len(seeds)} voyages not seen, {arguments.training_seeds} training seeds"
    label = "error against the plain filter [%]" if arguments.task == "Tuning" else "return"
    draw(drawn, title, arguments.output, label)


if __name__ == "__main__":
    main()
