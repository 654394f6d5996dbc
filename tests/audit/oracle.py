"""Whether the oracle is right on the ranked scenarios: its error over the Cramer-Rao bound, and its consistency.

The runs are new ones, with other seeds than the stored reference figures and others in each scenario (the same seed
gives the same noise in every scenario). Some twenty runs a scenario leave an error of a tenth, so all scenarios
together are judged by their mean, and each one by four standard errors, because the squares of few runs are skewed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np

from simnav.estimators.reference import ReferenceFigure, oracle_run
from simnav.leaderboard.ranking import reference
from simnav.scenario import Scenario, load, names
from tests.agreement.reference import (
    FIRST,
    LEAST_NEES,
    LEAST_RATIO,
    MOST_NEES,
    MOST_RATIO,
    right,
)

#: Runs a scenario, and the longest scenario that is run [s].
RUNS, LONGEST = int(os.environ.get("SIMNAV_AUDIT_ORACLE_RUNS", "20")), 2000.0
_SIGMAS = 4.0


def ranked() -> list[Scenario]:
    """The simulated scenarios that are ranked."""
    found = [load(name) for name in names()]
    return [s for s in found if not s.recorded and s.track not in ("papers", "training")]


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """What, figure, promised, kept."""
    ratios, consistencies = [], []
    for k, scenario in enumerate(ranked()):
        if scenario.duration > LONGEST:
            continue
        first = FIRST * (k + 100)
        runs = [oracle_run(scenario, seed) for seed in range(first, first + RUNS)]
        for smoothed in (False, True):
            f = ReferenceFigure.of(scenario.id, runs, smoothed)
            what = f"{scenario.id}{', smoothed' if smoothed else ''}"
            kept = right(f.ratio, f.ratio_standard_error, LEAST_RATIO, MOST_RATIO, _SIGMAS)
            kept &= right(f.nees, f.nees_standard_error, LEAST_NEES, MOST_NEES, _SIGMAS)
            found = f"{f.ratio:.3f}+-{f.ratio_standard_error:.3f} {f.nees:.3f}+-{f.nees_standard_error:.3f}"
            yield f"{what}: error/bound, NEES", found, "0.97-1.08, 0.95-1.05", kept
            if not smoothed:
                ratios.append((f.ratio, f.ratio_standard_error))
                consistencies.append((f.nees, f.nees_standard_error))
    for what, figures, least, most in (
        ("error/bound, all scenarios", ratios, LEAST_RATIO, MOST_RATIO),
        ("NEES, all scenarios", consistencies, LEAST_NEES, MOST_NEES),
    ):
        value, error = np.array(figures).T
        mean, spread = float(value.mean()), float(np.sqrt(np.sum(error**2)) / len(error))
        kept = right(mean, spread, least, most)
        yield what, f"{mean:.3f} +- {spread:.3f}", f"{least:.2f} to {most:.2f}", kept
    stored = {s.id: reference.stored().get(s.id, {}).get("horizontal_rmse") for s in ranked()}
    valid = [load(name.rpartition("-v")[0]).content_hash() == r.content for name, r in stored.items() if r is not None]
    yield "reference figures of ranked scenarios", f"{sum(valid)} of {len(stored)}", "all", sum(valid) == len(stored)
