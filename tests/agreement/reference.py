"""Is the oracle right on every scenario of the catalogue?

For each simulated scenario: the oracle's error over its Cramer-Rao bound, and its mean normalised error squared of the
horizontal position by degree of freedom, with standard errors. ::

    python -m tests.agreement.reference                     the figures that come with simnav
    python -m tests.agreement.reference --smoothed          likewise, of smoothed output
    python -m tests.agreement.reference --runs 200          runs of its own, on all scenarios of the catalogue
    python -m tests.agreement.reference --runs 40 open-sea ship-turn
"""

from __future__ import annotations

import argparse

from simnav.estimators.reference import ReferenceFigure, oracle_run
from simnav.leaderboard.ranking import reference
from simnav.scenario import load, names

__all__ = ["HEAD", "LEAST_NEES", "LEAST_RATIO", "MOST_NEES", "MOST_RATIO", "right"]

LEAST_RATIO, MOST_RATIO = 0.97, 1.08
LEAST_NEES, MOST_NEES = 0.95, 1.05
#: Of the seeds of these runs: far from those of campaigns.
FIRST = 1000
HEAD = "| scenario | runs | error [m] | error / bound | NEES |\n|---|---|---|---|---|"


def right(value: float, error: float, least: float, most: float, sigmas: float = 2.0) -> bool:
    """Whether a figure is within its limits, or outside by no more than so many standard errors."""
    return least - sigmas * error <= value <= most + sigmas * error


def line(scenario: str, runs: int, value: float, ratio: float, ratio_error: float, nees: float, error: float) -> str:
    """A line of the table; a figure that is out of its limits by more than two standard errors is marked."""
    marks = [
        "" if right(ratio, ratio_error, LEAST_RATIO, MOST_RATIO) else " (!)",
        "" if right(nees, error, LEAST_NEES, MOST_NEES) else " (!)",
    ]
    return (
        f"| {scenario} | {runs} | {value:.3g} | {ratio:.3f} ± {ratio_error:.3f}{marks[0]} "
        f"| {nees:.3f} ± {error:.3f}{marks[1]} |"
    )


def main() -> None:
    """The command of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", help="names; default: all")
    parser.add_argument("--runs", type=int, default=0, help="runs of its own; default: what is stored")
    parser.add_argument("--smoothed", action="store_true", help="of smoothed output")
    arguments = parser.parse_args()
    wanted = arguments.scenarios or names()
    print(HEAD)
    score = "smoothed_horizontal_rmse" if arguments.smoothed else "horizontal_rmse"
    for k, scenario in enumerate(load(name) for name in wanted):
        if scenario.recorded:
            continue
        if arguments.runs:
            first = FIRST * (k + 1)  # the same seed gives the same noise in every scenario
            runs = [oracle_run(scenario, seed) for seed in range(first, first + arguments.runs)]
            f = ReferenceFigure.of(scenario.id, runs, arguments.smoothed)
            figures = (f.ratio, f.ratio_standard_error, f.nees, f.nees_standard_error)
            print(line(f.scenario, f.runs, f.horizontal_rms, *figures), flush=True)
            continue
        r = reference.stored().get(scenario.id, {}).get(score)
        if r is not None and r.bounds:
            print(line(scenario.id, r.runs, r.value, r.to_bound, r.to_bound_error, r.nees, r.nees_error))


if __name__ == "__main__":
    main()
