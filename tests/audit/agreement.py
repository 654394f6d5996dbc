"""Do estimators of the same states agree on clean voyages, and does a wrong one say so? A sample.

All of it: ``python -m tests.agreement.voyages run RESULTS.jsonl --family clean-voyages`` (docs/explanation/windows.md).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

import simnav
from simnav.estimator import make
from simnav.scoring.consistency import GROUPS, nees
from simnav.scoring.registry import ScoringInput
from tests.agreement.voyages import LARGEST_NEES, run, turned, voyage_of

__all__ = ["rows"]

FAMILY = "clean-voyages"
#: Clean voyages with MEMS units and without a compass.
POOR_IMUS = "training-mems"
SAME = ("iekf", "ukf", "ckf", "inekf", "sw-fgo")
#: Robust and adaptive rows, which may cost something on a clean day.
ROBUST = ("gated-ekf", "huber-kf", "iae", "vb-akf", "student-t", "imm", "huber-fgo", "gnc-fgo", "iae-fgo")
VOYAGES, TURNED = 12, 4


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield from _clean()
        yield from _poor_imus()
        yield from _batch()
        yield from _turned()


def _clean() -> Iterator[tuple[str, str, str, bool]]:
    errors: dict[str, list[float]] = {row: [] for row in (*SAME, *ROBUST)}
    for number in range(VOYAGES):
        recording, _ = voyage_of(FAMILY, number)
        for row, found in errors.items():
            found.append(run(recording, row)["horizontal_rmse"])
    same = np.array([errors[row] for row in SAME])
    for row, ratios in zip(SAME, same / same.min(axis=0), strict=True):
        p90 = float(np.percentile(ratios, 90))
        yield f"{row}: error over the best of its kind, p90 of {VOYAGES}", f"{p90:.3f}", "at most 1.05", p90 <= 1.05
    for row in ROBUST:
        plain = "sw-fgo" if row.endswith("fgo") else "iekf"
        p90 = float(np.percentile(np.array(errors[row]) / np.array(errors[plain]), 90))
        yield f"{row}: error over {plain}'s, p90 of {VOYAGES}", f"{p90:.3f}", "at most 1.2", p90 <= 1.2


def _poor_imus() -> Iterator[tuple[str, str, str, bool]]:
    """The filter without the fixes does not know its heading there; fixes must not be excluded for what it says."""
    lost = []
    for number in range(VOYAGES):
        recording, _ = voyage_of(POOR_IMUS, number)
        separated, plain = (run(recording, row)["horizontal_rmse"] for row in ("solution-separation", "ekf"))
        if separated > 1.5 * plain:
            lost.append(number)
    figure = f"{len(lost)} of {VOYAGES}"
    yield "solution-separation: MEMS and no compass, above 1.5 of ekf's", figure, "none", not lost


def _batch() -> Iterator[tuple[str, str, str, bool]]:
    """GTSAM has 15 states, so it is compared with the graph without calibration."""
    ratios = []
    for number in range(3):
        recording, _ = voyage_of(FAMILY, number, duration=60.0)
        ours, theirs = (run(recording, row)["smoothed_horizontal_rmse"] for row in _BATCHES)
        ratios.append(theirs / ours)
    far = max(max(ratios), 1.0 / min(ratios))
    yield "GTSAM's batch over ours of 15 states, smoothed", f"{far:.3f}", "within 1.05", far <= 1.05


_BATCHES = ("fgo-full:calibrate=false", "gtsam-batch")


def _turned() -> Iterator[tuple[str, str, str, bool]]:
    """The initial heading is 170 degrees off, and its sigma tells so; who is wrong in the second minute?"""
    wrong = silent = 0
    for number in range(TURNED):
        recording, _ = voyage_of(FAMILY, number, (1.0, 1.0001), 120.0)
        for row in ("ekf", "ukf", "inekf", "sw-fgo"):
            given = turned(recording, 170.0)
            trial = simnav.run_trial(make(row), given)
            if trial.status != "ok" or trial.covariance is None:
                continue
            values, degrees = nees(ScoringInput(trial, given).error, trial.covariance, GROUPS["horizontal"])
            if values[60:].sum() > LARGEST_NEES * degrees[60:].sum():
                wrong += 1
                silent += not trial.diagnostics["inconsistent"].any()
    yield "wrong by NEES, heading 170 deg off, that say nothing", f"{silent} of {wrong}", "none", silent == 0
