"""What the learned rows are worth beside other rows and the oracle, within and outside their training.

For each group of scenarios and each row, the geometric mean over runs of the horizontal RMSE over the plain row's.
The seeds begin at `FIRST`, beyond those of the board. Two families of the training, on voyages of their validation, are
there for comparison. Promised is: where a learned row has more than `WORSE` times the error of the plain row, its page
says so, by the title of the group.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

import tests.conftest  # noqa: F401 (it finds the logs beside the project)
from simnav.estimator import find, make, unsuitable
from simnav.estimators.training.voyages import FIRST_SEEDS
from simnav.log import LogError
from simnav.recording import Recording
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial

__all__ = ["FIRST", "GROUPS", "LEARNED", "WORSE", "error", "errors", "parts", "rows"]

LEARNED = ("net-ekf", "net-fgo", "beams-ekf", "policy-ekf")
OTHERS = ("iae", "gnc-fgo", "solution-separation", "oracle")
PLAIN = ("ekf", "ship-ekf")
FIRST, WORSE = 1000, 1.05
_SEVERAL, _FEW = 3, 2
#: Scenarios of each group, by its title. Long ones are left out, and those of single instruments.
GROUPS: dict[str, tuple[str, ...]] = {
    "Training": ("training-voyages", "training-ships"),
    "Nothing wrong": ("clean-voyages", "open-sea"),
    "Fixes noisy or jumping": ("gnss-jumps", "gnss-noise", "gnss-noise-step"),
    "Fixes that lie slowly": ("gnss-multipath", "gnss-spoofing", "lasting-bias"),
    "Outage": ("gnss-outage", "fishing-vessel"),
    "The DVL silent": ("lawnmower-beams", "survey-without-bottom-lock"),
    "Velocity aid wrong": ("auv-soft-mud", "dvl-in-bubbles", "ferry-in-the-wind"),
    "Start or heading wrong": ("poor-heading", "wrong-start"),
    "A datasheet wrong": ("one-wrong-datasheet", "wrong-datasheet"),
    "The IMU wrong": ("lone-dvl", "poor-imu", "sole-gnss"),
    "Several at once": ("two-faults", "harbour-multipath", "rov-inspection"),
    "Generalisation": ("random-voyages", "several-faults", "random-ships", "several-faults-ships"),
    "Recorded voyages": ("auv-akit", "car-kitti", "ship-nbp1406"),
}


def error(name: str, recording: Recording) -> float:
    """Horizontal RMSE of a row [m]; NaN where the scenario does not suit it, infinite where it fails."""
    estimator = make(name)
    if unsuitable(estimator, recording.instruments):
        return math.nan
    trial = run_trial(estimator, recording, keep_covariance=False)
    if trial.status not in ("ok", "inconsistent"):
        return math.inf
    return score(trial, recording, ["horizontal_rmse"])["horizontal_rmse"]


def recordings(scenario: str) -> Iterator[Recording]:
    """The runs of a scenario; none where its log is not here."""
    found = load(scenario)
    first = FIRST_SEEDS["validation"] + 500_000 if found.training else FIRST
    try:
        for k in range(_FEW if found.log is not None else _SEVERAL):
            yield record(found, first + k)
    except LogError:
        return


def errors(name: str, scenario: str) -> list[float]:
    """The errors of a row on the runs of a scenario; those of the plain row for ``plain``."""
    return [
        error(PLAIN[recording.instruments.imu is None] if name == "plain" else name, recording)
        for recording in recordings(scenario)
    ]


def parts() -> Mapping[str, Callable[[], Any]]:
    """One for each row and scenario, the learned rows last."""
    scenarios = [scenario for group in GROUPS.values() for scenario in group]
    return {f"{s}.{name}": partial(errors, name, s) for name in ("plain", *OTHERS, *LEARNED) for s in scenarios}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figures, what is promised, and whether that is kept."""
    for title, scenarios in GROUPS.items():
        means = {name: _mean([_logs(found, name, s) for s in scenarios]) for name in (*LEARNED, *OTHERS)}
        beside = ", ".join(f"{name} {means[name]:.2f}" for name in OTHERS if not math.isnan(means[name]))
        for name in LEARNED:
            if math.isnan(means[name]):
                continue
            worse = means[name] > WORSE
            said = title in " ".join((find(name).__doc__ or "").split())
            promised = "page says so" if worse else f"at most {WORSE:g}"
            yield f"{name}: {title}", f"{means[name]:.2f} ({beside})", promised, said or not worse


def _logs(found: Mapping[str, Any], name: str, scenario: str) -> list[float]:
    """Logarithms of the errors of a row over the plain row's; at most that of 20, also for a failure."""
    pairs = zip(found.get(f"{scenario}.{name}", []), found.get(f"{scenario}.plain", []))
    return [math.log(min(max(e / plain, 0.05), 20.0)) for e, plain in pairs if not math.isnan(e)]


def _mean(logs: list[list[float]]) -> float:
    """Geometric mean over scenarios, each counting the same; NaN without any."""
    each = [float(np.mean(x)) for x in logs if x]
    return math.exp(float(np.mean(each))) if each else math.nan
