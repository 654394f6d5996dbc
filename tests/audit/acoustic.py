"""Acoustic positioning: consistency of rows on clean runs with fixes of a ship and with ranges to beacons.

The voyages are those of `tests.cases.positioned_by_sound`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from simnav.estimator import make
from simnav.scenario import Scenario
from simnav.scoring.navigation_error import errors
from simnav.source import record
from simnav.trial import run_trial
from tests.cases.positioned_by_sound import positioned_by_sound

#: Runs of each row and instrument, and their length [s].
RUNS, DURATION = 150, 50.0
_ROWS, _INSTRUMENTS = ("ekf", "sw-fgo"), ("usbl", "lbl", "one-way")


def nees_at_the_end(row: str, scenario: Scenario, seed: int) -> float:
    """NEES of position and velocity at the end of a run, divided by the six degrees of freedom."""
    recording = record(scenario, seed)
    trial = run_trial(make(row), recording)
    assert trial.covariance is not None, trial.reason
    last = errors(trial, recording)[-1, :6]
    return float(last @ np.linalg.solve(trial.covariance[-1][:6, :6], last)) / 6.0


def _nees(row: str, instrument: str) -> float:
    scenario = positioned_by_sound(instrument, DURATION)
    return float(np.mean([nees_at_the_end(row, scenario, seed) for seed in range(5000, 5000 + RUNS)]))


def parts() -> Mapping[str, Callable[[], Any]]:
    """What is measured."""
    return {f"{instrument}.{row}": partial(_nees, row, instrument) for instrument in _INSTRUMENTS for row in _ROWS}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What was measured, and what is promised."""
    for part, nees in found.items():
        instrument, row = part.split(".")
        yield f"NEES of `{row}`, {instrument}, {RUNS} clean runs", f"{nees:.3f}", "0.9 to 1.1", 0.9 <= nees <= 1.1
