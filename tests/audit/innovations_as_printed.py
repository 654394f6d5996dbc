"""What each change of eq. 17 of Mao, Wang and Fu (2025) gains: the estimate of the noise, and the position.

From the rows as printed (``iae-paper``, ``iae-fgo-paper``) to those of today (``iae``, ``iae-fgo``), one change after
the other, on the simulation of the paper and on a drive with its IMU. The seeds are those of no table and no claim.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from simnav.estimator import make
from simnav.leaderboard.papers.reading import paper_of
from simnav.leaderboard.ranking.statistics import mean_ratio
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial

__all__ = ["parts", "rows"]

SEEDS = range(6000, 6010)
#: Scenario of the paper, and the scores that are compared.
COMPARED = {"gnss-noise-step": ("sigma_east_rmse", "horizontal_rmse"), "mao-drive": ("east_rmse", "horizontal_rmse")}
#: What is changed, one after the other.
CHANGES: Mapping[str, Mapping[str, Any]] = {
    "as printed": {},
    "+ H P H' of the own epoch": {"newest": False},
    "+ gate of 1 %": {"significance": 0.01},
    "+ floor at the datasheet": {"lowest": 1.0},
    "+ variances only": {"full": False},
    "+ tests of the prediction, all instruments (today)": {"always": False, "scope": "all", "highest": 30.0},
}
ROWS = {"filter": "iae-paper", "graph": "iae-fgo-paper"}


def _measured(scenario: str, row: str) -> dict[str, dict[str, list[float]]]:
    """Scores of each step on each seed."""
    found: dict[str, dict[str, list[float]]] = {change: {s: [] for s in COMPARED[scenario]} for change in CHANGES}
    drive = paper_of("mao-2025").scenario(scenario)
    for seed in SEEDS:
        recording, given = record(drive, seed), dict[str, Any]()
        for change, parameters in CHANGES.items():
            given |= parameters
            scores = score(run_trial(make(row, **given), recording), recording)
            for name, values in found[change].items():
                values.append(scores[name])
    return found


def parts() -> Mapping[str, Callable[[], Any]]:
    """What is measured."""
    return {f"{scenario}.{kind}": partial(_measured, scenario, row)
            for scenario in COMPARED for kind, row in ROWS.items()}  # fmt: skip


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """Means of the scores of each step, and the ratio to the step before with its interval."""
    for part, steps in found.items():
        scenario, kind = part.split(".")
        for name in COMPARED[scenario]:
            before: dict[int, float] = {}
            for change, scores in steps.items():
                now = dict(enumerate(scores[name]))
                text = f"{sum(now.values()) / len(now):.2f} m"
                if before:
                    ratio = mean_ratio(now, before)
                    text += f", x {ratio.value:.2f} [{ratio.low:.2f}, {ratio.high:.2f}]"
                yield f"{scenario}, {kind}, {name}: {change}", text, "", True
                before = now
