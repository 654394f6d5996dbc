"""Tight coupling: satellites that are excluded, three and two satellites for a minute, and consistency on clean runs.

The voyages are those of `tests.cases.raw_gnss`: a coaster with a MEMS unit, eight satellites, a receiver that solves
them, and nothing else. A spoofed satellite begins after a minute, and its range runs away by 0.3 to 3 m/s.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import chi2

from simnav.estimator import make
from simnav.source import record
from simnav.trial import run_trial
from tests.cases.raw_gnss import raw_gnss
from tests.estimators.test_raw_gnss import RECEIVER, error

#: Runs of each row with a spoofed satellite, on clean voyages, and with few satellites.
RUNS, CLEAN, FEW = 100, 20, 12
#: Runs of a part.
_PART = 10
_SPOOFED = """
[[fault]]
kind = "spoofing"
instruments = "gnss"
channels = ["E30"]
start_s = 65.0
end_s = 200.0
clock_drift_m_s = {0}
"""
_EXCLUDING = ("gated-ekf", "gnc-fgo", "solution-separation")
_CONSISTENT = ("ekf", "ukf", "sw-fgo", "gnc-fgo", "oracle")
_LEFT = {"three": (("G11", "G12", "E27"), 0.5), "two": (("G12", "E27"), 1.0)}


def _excluded(name: str, seeds: range) -> int:
    """In how many runs the spoofed satellite, and no other, is left out of the last five epochs."""
    kept = 0
    for seed in seeds:
        drift = 0.3 * 10.0 ** np.random.default_rng(seed).random()
        trial = run_trial(make(name), record(raw_gnss(95.0, _SPOOFED.format(round(drift, 3))), seed))
        late = [source for source, time in trial.flagged if time > 90.5]
        kept += late.count("gnss:E30") == 5 and len(late) <= 6  # one false alarm among 35 readings is no exclusion
    return kept


def _nees(name: str) -> float:
    """Sum of the NEES of position and velocity at the end of clean runs."""
    total = 0.0
    for seed in range(3000, 3000 + CLEAN):
        recording = record(raw_gnss(40.0), seed)
        trial = run_trial(make(name), recording)
        last = error(trial, recording)[-1]
        total += float(last @ np.linalg.solve(trial.covariance[-1][:6, :6], last))
    return total


def _few(left: tuple[str, ...]) -> dict[str, float]:
    """Horizontal error after a minute with some satellites: root of the mean square over the runs, by row [m]."""
    gone = [s for s in raw_gnss().aids["gnss"].channels() if s not in left]
    found: dict[str, list[float]] = {"ekf": [], "ekf-loose": []}
    for seed in range(4000, 4000 + FEW):
        recording = record(raw_gnss(180.0, RECEIVER.format(gone)), seed)
        for name, errors in found.items():
            errors.append(float(np.linalg.norm(error(run_trial(make(name), recording), recording)[-1, :2])))
    return {name: float(np.sqrt(np.mean(np.square(errors)))) for name, errors in found.items()}


def parts() -> Mapping[str, Callable[[], Any]]:
    """What is measured."""
    found: dict[str, Callable[[], Any]] = {f"few.{word}": partial(_few, left) for word, (left, _) in _LEFT.items()}
    found |= {f"nees.{name}": partial(_nees, name) for name in _CONSISTENT}
    for name in _EXCLUDING:
        for k in range(0, RUNS, _PART):
            found[f"excluded.{name}.{k}"] = partial(_excluded, name, range(2000 + k, 2000 + k + _PART))
    return found


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What, figure, promised, kept."""
    for word, (_, most) in _LEFT.items():
        rms = found[f"few.{word}"]
        figure = f"{rms['ekf']:.1f} m, {rms['ekf-loose']:.1f} m"
        kept = rms["ekf"] <= most * rms["ekf-loose"]
        yield f"{word} satellites for 60 s: ekf, ekf-loose", figure, f"at most {most:g} times", kept
    low, high = chi2.ppf([0.005, 0.995], 6 * CLEAN) / (6 * CLEAN)
    for name in _CONSISTENT:
        value = found[f"nees.{name}"] / (6 * CLEAN)
        yield f"{name}: NEES of clean runs", f"{value:.2f}", f"{low:.2f} to {high:.2f}", bool(low <= value <= high)
    for name in _EXCLUDING:
        count = sum(found[f"excluded.{name}.{k}"] for k in range(0, RUNS, _PART))
        yield f"{name}: a spoofed satellite, and it alone, excluded", f"{count} of {RUNS}", "95", count >= 95
