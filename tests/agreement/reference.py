"""Is the oracle right on every scenario of the catalogue?

For each simulated scenario: the oracle's error over many runs, over the Cramer-Rao bound, and its mean normalised error
squared of the horizontal position by degree of freedom, with standard errors. ::

    python -m tests.agreement.reference --runs 200
    python -m tests.agreement.reference --runs 40 open-sea ship-turn
"""

from __future__ import annotations

import argparse

from simnav.estimators.reference import ReferenceFigure, reference_figure
from simnav.scenario import load, names

__all__ = ["HEAD", "LEAST_NEES", "LEAST_RATIO", "MOST_NEES", "MOST_RATIO", "line"]

LEAST_RATIO, MOST_RATIO = 0.97, 1.08
LEAST_NEES, MOST_NEES = 0.95, 1.05
HEAD = f"{'scenario':26s} runs  oracle [m]  bound [m]  oracle / bound    NEES"


def line(figure: ReferenceFigure) -> str:
    """A line of the table; a star where a figure is out of its limits by more than two standard errors."""
    f = figure
    ratio_off = max(LEAST_RATIO - f.ratio, f.ratio - MOST_RATIO) > 2.0 * f.ratio_standard_error
    nees_off = max(LEAST_NEES - f.nees, f.nees - MOST_NEES) > 2.0 * f.nees_standard_error
    return (
        f"{f.scenario:26s} {f.runs:4d} {f.horizontal_rms:11.3f} {f.bound:10.3f}"
        f"  {f.ratio:.3f} +- {f.ratio_standard_error:.3f}{'*' if ratio_off else ' '}"
        f" {f.nees:.3f} +- {f.nees_standard_error:.3f}{'*' if nees_off else ' '}"
    )


def main() -> None:
    """The command of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", help="names; all simulated ones of the catalogue")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first run")
    arguments = parser.parse_args()
    print(HEAD)
    for name in arguments.scenarios or names():
        scenario = load(name)
        if scenario.recorded:
            continue
        print(line(reference_figure(scenario, range(arguments.first, arguments.first + arguments.runs))), flush=True)


if __name__ == "__main__":
    main()
