"""The errors of a campaign's rows, run by run, over those of a plain row, by the number of faults in the run. ::

    simnav campaign --scenario random-voyages --runs 300 --estimator ekf,oracle,imm,student-t -o FOLDER
    python -m tests.agreement.against FOLDER
    simnav campaign --scenario clean-voyages --runs 200 --estimator ekf,iekf,ukf,ckf,inekf,sw-fgo -o FOLDER
    python -m tests.agreement.against FOLDER --over ekf,iekf,ukf,ckf,inekf,sw-fgo

The horizontal RMSE is divided by that of ``--over`` in the same run; of several rows, by the least of theirs. Printed
are, in Markdown, the geometric mean over the runs by number of faults, the median and the 90th percentile with its 95 %
interval, the largest ratio and its seed, how many runs are above the limit, and how many of these have more than one
fault. Failed runs are counted apart. A second table says how often a row diverges (mean horizontal NEES by degree of
freedom above 5), how often it does not report so, and how often it reports so though it is consistent. With
``--lost N``, the runs above the limit are listed, the N worst of each row.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from simnav.leaderboard.ranking.lost_runs import LOSS
from simnav.leaderboard.results import store
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site.losses import faults_of
from simnav.scenario import load
from tests.agreement.voyages import LARGEST_NEES, percentile_interval

__all__ = ["honesty", "ratios", "table"]

#: A mean NEES by degree of freedom below this is consistent.
CONSISTENT = 1.5


def ratios(results: Sequence[Result], over: Sequence[str]) -> dict[str, dict[int, float]]:
    """By row and seed: horizontal RMSE over the least one of some rows; infinite where the row failed.

    Parameters
    ----------
    results : sequence of Result
        Of one scenario.
    over : sequence of str
        Rows that are divided by. A run that none of them ended well is left out.
    """

    def error(r: Result) -> float:
        return r.scores["horizontal_rmse"] if r.status == "ok" else np.inf

    best: dict[int, float] = {}
    for r in results:
        if r.estimator in over and r.tried:
            best[r.seed] = min(best.get(r.seed, np.inf), error(r))
    found: dict[str, dict[int, float]] = {}
    for r in results:
        if r.tried and np.isfinite(best.get(r.seed, np.inf)):
            found.setdefault(r.estimator, {})[r.seed] = error(r) / best[r.seed]
    return found


def table(found: Mapping[str, Mapping[int, float]], faults: Mapping[int, int]) -> str:
    """The ratios of each row in Markdown, in the order of their means.

    Parameters
    ----------
    found : mapping of str to mapping
        As `ratios` gives them.
    faults : mapping of int to int
        Number of faults of each run.
    """

    def mean(values: Sequence[float]) -> float:
        return float(np.exp(np.mean(np.log(values)))) if values else np.nan

    lines = [
        f"| row | runs | no fault | one | two or more | all | median | p90 [95 %] | largest (seed) | above {LOSS:g} "
        "(of these, two faults) | failed |",
        "|" + "---|" * 11,
    ]
    ended = {name: {k: v for k, v in by.items() if np.isfinite(v)} for name, by in found.items()}
    for name, by in sorted(ended.items(), key=lambda item: mean(list(item[1].values()))):
        if not by:
            continue
        values = list(by.values())
        groups = [
            mean([v for k, v in by.items() if low <= faults[k] <= high]) for low, high in ((0, 0), (1, 1), (2, 99))
        ]
        low, high = percentile_interval(values, 0.9)
        worst = max(by, key=lambda k: by[k])
        lost = [k for k, v in by.items() if v > LOSS]
        lines.append(
            f"| `{name}` | {len(by)} | "
            + " | ".join(f"{g:.3g}" for g in (*groups, mean(values), float(np.median(values))))
            + f" | {np.percentile(values, 90.0):.3g} [{low:.3g}, {high:.3g}] | {by[worst]:.3g} ({worst}) | {len(lost)} "
            f"({sum(faults[k] > 1 for k in lost)}) | {len(found[name]) - len(by)} |"
        )
    return "\n".join(lines)


def honesty(results: Sequence[Result]) -> str:
    """How often each row diverges without saying so, and says so without reason, in Markdown."""
    lines = [
        f"| row | runs | NEES above {LARGEST_NEES:g} | of these, never reported | ended as inconsistent "
        f"| of these, with a NEES below {CONSISTENT:g} |",
        "|" + "---|" * 6,
    ]
    by: dict[str, list[Result]] = {}
    for r in results:
        nees = r.scores.get("nees_horizontal", np.nan)
        if r.status == "ok" and np.isfinite(nees) and np.isfinite(r.scores.get("inconsistent", np.nan)):
            by.setdefault(r.estimator, []).append(r)
    for name, mine in sorted(by.items()):
        wide = [r for r in mine if r.scores["nees_horizontal"] > LARGEST_NEES]
        silent = [r for r in wide if r.scores["inconsistent"] == 0.0]
        reported = [r for r in mine if r.ending == "inconsistent"]
        false = [r for r in reported if r.scores["nees_horizontal"] < CONSISTENT]
        lines.append(f"| `{name}` | {len(mine)} | {len(wide)} | {len(silent)} | {len(reported)} | {len(false)} |")
    return "\n".join(lines)


def main() -> None:
    """The command of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of the campaign")
    parser.add_argument("--over", default="ekf", help="rows that are divided by")
    parser.add_argument("--faults", type=int, default=0, help="only runs with at least so many faults")
    parser.add_argument("--lost", type=int, default=0, help="list so many runs of each row that are above the limit")
    given = parser.parse_args()
    results = store.load(given.folder, series=False)
    for identity in dict.fromkeys(r.scenario for r in results):
        mine = [r for r in results if r.scenario == identity]
        scenario = load(identity)
        faults = {seed: len(scenario.drawn(seed).faults) for seed in {r.seed for r in mine}}
        mine = [r for r in mine if faults[r.seed] >= given.faults]
        faults = {seed: n for seed, n in faults.items() if n >= given.faults}
        found = ratios(mine, given.over.split(","))
        count = [sum(low <= n <= high for n in faults.values()) for low, high in ((0, 0), (1, 1), (2, 99))]
        print(
            f"{identity}: {len(faults)} runs, {count[0]} without a fault, {count[1]} with one, {count[2]} with more\n"
        )
        print(table(found, faults), honesty(mine), sep="\n\n")
        for name, by in found.items() if given.lost else ():
            lost = sorted(((v, k) for k, v in by.items() if LOSS < v < np.inf), reverse=True)[: given.lost]
            if lost:
                print(f"\n{name}")
            for value, seed in lost:
                print(f"  {value:8.3g}  seed {seed:3d}  {faults_of(identity, seed)}")


if __name__ == "__main__":
    main()
