"""Whether rows notice that they are lost: runs with a cause of each sort, and clean voyages for false alarms.

A run is *lost* if an error is beyond 100 times its stated sigma for more than a tenth of the epochs
(`simnav.scoring.ending`), whatever the row says. It is *found* if the diagnostic ``inconsistent`` alone makes the run
an inconsistent one. A false alarm is a voyage of a clean family on which this is so, and which is not lost.

Each cause is set so large that rows are lost by it. The seeds begin at `FIRST`. One of them (frozen GNSS, seed 9001)
led to the long sum of `simnav.estimators.solvers.innovation_consistency`, so give other seeds where that sum is judged.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import simnav
from simnav.estimator import UnsuitableScenario, make
from simnav.geometry.rotation import wrap_angle
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.scoring.ending import ending, outcome
from simnav.sensors.faults import FalseZero, Frozen

__all__ = ["CAUSES", "CLEAN", "FIRST", "ROWS", "Ran", "found", "parts", "ran", "rows", "voyage"]

#: Seed of the first run of a cause; the others count up.
FIRST = int(os.environ.get("SIMNAV_AUDIT_SELF_TEST_FIRST", "9000"))
RUNS = int(os.environ.get("SIMNAV_AUDIT_SELF_TEST_RUNS", "6"))
CLEAN_RUNS = int(os.environ.get("SIMNAV_AUDIT_SELF_TEST_CLEAN_RUNS", "40"))
ROWS = tuple(os.environ.get("SIMNAV_AUDIT_SELF_TEST_ROWS", "ekf,ukf,inekf,iae-fgo,huber-fgo,gnc-fgo").split(","))
#: Families on which nothing is wrong.
CLEAN = ("clean-voyages", "training-clean")
_SCENARIOS = Path(__file__).parent / "self_test_scenarios"
_LONGEST = 300.0
_PROMISED, _ALARMS = 0.95, 0.01


def _with(scenario: str | Scenario, seed: int, **values: float) -> Recording:
    """A run of a scenario with other values of its draws, no longer than `_LONGEST`."""
    loaded = load(scenario) if isinstance(scenario, str) else scenario
    drawn = loaded.with_values({f"draw.{key}": value for key, value in values.items()}).drawn(seed)
    return simnav.record(drawn.model_copy(update={"duration": min(drawn.duration, _LONGEST)}), seed)


def _wrong_start(seed: int) -> Recording:
    """A heading that is off by 60 to 170 degrees at the start, of which its sigma tells nothing."""
    run = _with("clean-voyages", seed, heading=1.0)
    attitude = run.start.attitude.copy()
    attitude[2] = wrap_angle(attitude[2] + np.radians(np.random.default_rng(seed).uniform(60.0, 170.0)))
    return replace(run, start=replace(run.start, attitude=attitude))


def _faulty(scenario: str, fault: Any, seed: int) -> Recording:
    """A run of a scenario with one fault in place of its own."""
    drawn = load(scenario).drawn(seed)
    return simnav.record(drawn.model_copy(update={"faults": (fault,), "duration": _LONGEST}), seed)


def _own(name: str, seed: int) -> Recording:
    """A run of a scenario of this audit."""
    return simnav.record(load(_SCENARIOS / f"{name}.toml").drawn(seed), seed)


#: What makes a recording of each cause, by its name.
CAUSES: Mapping[str, Callable[[int], Recording]] = {
    "gyroscopes saturate": partial(_with, "imu-clipping", limit=1.0),
    "the IMU drops out": partial(_with, "imu-dropouts", length=8.0),
    "a gyroscope's bias steps": partial(_with, "auv-gyroscope-bias-step", size=5000.0),
    "the IMU warms up": partial(_with, "imu-warm-up", gyroscope=3000.0, accelerometer=50000.0),
    "an axis is stuck": partial(_with, "imu-stuck-axis", length=100.0),
    "the IMU is shaken": partial(_with, "imu-vibration", level=10.0),
    "the start is wrong": _wrong_start,
    "one beacon": partial(_own, "one-beacon"),
    "a fix every 100 s": partial(_own, "rare-fixes"),
    "a datasheet is wrong by 10": partial(_with, "one-wrong-datasheet", factor=10.0),
    "GNSS is frozen": partial(_faulty, "imu-warm-up", Frozen(instruments=("gnss",), start=100.0)),
    "the DVL reads zero": partial(_faulty, "auv-imu-dropouts", FalseZero(instruments=("dvl",), start=100.0)),
}


class Ran(NamedTuple):
    """A run of a row: its seed, whether it is lost, and whether the self-test says so."""

    row: str
    seed: int
    lost: bool
    says: bool


def found(scores: Mapping[str, float]) -> bool:
    """Whether the self-test alone would call a run inconsistent."""
    return ending("ok", {k: v for k, v in scores.items() if k.startswith("inconsistent")}) == "inconsistent"


def voyage(family: str, seed: int) -> Recording:
    """A voyage of a clean family."""
    return _with(family, seed)


def ran(recording: Recording, row: str) -> Ran | None:
    """Run a row on a recording; None if it does not suit, or failed."""
    try:
        trial = simnav.run_trial(make(row), recording)
    except UnsuitableScenario:
        return None
    if trial.status != "ok":
        return None
    scores = simnav.score(trial, recording, ["beyond_sigma", "inconsistent", "inconsistent_end"])
    return Ran(row, recording.seed, outcome("ok", scores) == "lost", found(scores))


def _runs(make_recording: Callable[[int], Recording], count: int) -> list[Ran]:
    recordings = (make_recording(seed) for seed in range(FIRST, FIRST + count))
    return [r for recording in recordings for row in ROWS if (r := ran(recording, row)) is not None]


def parts() -> Mapping[str, Callable[[], Any]]:
    """A part for each cause, and for each clean family."""
    causes = {cause: partial(_runs, recording, RUNS) for cause, recording in CAUSES.items()}
    return causes | {family: partial(_runs, partial(voyage, family), CLEAN_RUNS) for family in CLEAN}


def rows(measured: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    lost = says = 0
    for cause in CAUSES:
        runs = [Ran(*r) for r in measured[cause]]
        its = [r for r in runs if r.lost]
        lost, says = lost + len(its), says + sum(r.says for r in its)
        silent = sorted({r.row for r in its if not r.says})
        what = f"{cause}{': silent ' + ', '.join(silent) if silent else ''}"
        yield what, f"{sum(r.says for r in its)} of {len(its)} lost, of {len(runs)}", "", True
    share = says / max(lost, 1)
    figure = f"{100.0 * share:.0f} % of {lost}"
    yield "lost runs that are found, all causes", figure, "at least 95 %", share >= _PROMISED
    runs = [Ran(*r) for family in CLEAN for r in measured[family]]
    alarms = [r for r in runs if r.says and not r.lost]
    share = len(alarms) / max(len(runs), 1)
    what = "false alarms on clean voyages" + "".join(f", {r.row} {r.seed}" for r in alarms[:3])
    yield what, f"{100.0 * share:.1f} % of {len(runs)}", "at most 1 %", share <= _ALARMS
