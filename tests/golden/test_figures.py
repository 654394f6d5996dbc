"""Regression: the rows of the leaderboard estimate what they did, on half a minute of two scenarios.

Final errors and RMSE are compared with ``figures.json`` to one part in a million, far below what an intended change of
a method makes, and above what another processor does. After an intended change write them anew:
``python tests/golden/test_figures.py``. (``python -m tests.golden`` compares two commits bit for bit.)
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import find, make, names
from simnav.scenario import load
from simnav.scoring import errors
from simnav.source import record
from simnav.trial import run_trial

FILE = Path(__file__).parent / "figures.json"
#: One with an IMU, GNSS outages and a DVL; one of a ship without an IMU.
SCENARIOS = {"harbour-multipath": 30.0, "ship-dead-reckoning": 30.0}


def figures(scenario: str) -> dict[str, list[float] | str]:
    """By row: final error and RMSE, horizontal [m], of the velocity [m/s] and of the heading [mrad]; or its status."""
    recording = record(load(scenario).model_copy(update={"duration": SCENARIOS[scenario], "faults": ()}), 1)
    found: dict[str, list[float] | str] = {}
    for name in names():
        cls = find(name)
        if cls.slow or not cls.__module__.startswith("simnav."):
            continue
        trial = run_trial(make(name), recording)
        if trial.status != "ok":
            found[name] = trial.status
            continue
        e = np.nan_to_num(errors(trial, recording))
        series = np.stack([np.hypot(e[:, 0], e[:, 1]), np.hypot(e[:, 3], e[:, 4]), 1e3 * np.abs(e[:, 8])])
        found[name] = [*series[:, -1].tolist(), *np.sqrt((series**2).mean(axis=1)).tolist()]
    return found


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_figures_are_as_they_were(scenario):
    before = json.loads(FILE.read_text())[scenario]
    now = figures(scenario)
    assert set(now) == set(before)
    changed = {
        name: (before[name], value)
        for name, value in now.items()
        if (isinstance(value, str) and value != before[name])
        or (not isinstance(value, str) and not np.allclose(value, np.array(before[name], float), rtol=1e-6, atol=1e-9))
    }
    assert not changed


if __name__ == "__main__":
    rounded = {
        s: {k: v if isinstance(v, str) else [float(f"{x:.9g}") for x in v] for k, v in figures(s).items()}
        for s in SCENARIOS
    }
    FILE.write_text(json.dumps(rounded, indent=1) + "\n")
