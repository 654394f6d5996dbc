"""How far the rows of the board are from ``ekf`` where the IMU fails, where an aid is the only one, and on recordings.

The figure of a run is the horizontal RMSE of a row over that of ``ekf`` on the same recording (without an IMU, of
``ship-ekf``); a failed run counts as infinitely bad. Three sets of runs are judged:

- the scenarios of the group *The IMU is wrong*: at most `MOST` of the runs of a row above `WORSE`;
- ``lone-dvl`` and ``sole-gnss``: no run above `WORSE` in the geometric mean over the seeds;
- recordings, and the scenarios of this audit on which ``solution-separation`` was worse than what it protects: the
  geometric mean of that row at most `GUARDED` in each.

``SIMNAV_AUDIT_BESIDE_FIRST`` is the first seed, ``SIMNAV_AUDIT_BESIDE_RUNS`` the number of runs of a simulated
scenario, ``SIMNAV_AUDIT_BESIDE_ROWS`` the rows, separated by commas.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from simnav.estimator import make
from simnav.log.table import LogError
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial

__all__ = ["GUARDED", "MOST", "WORSE", "parts", "ratios", "rows"]

FIRST = int(os.environ.get("SIMNAV_AUDIT_BESIDE_FIRST", "700"))
RUNS = int(os.environ.get("SIMNAV_AUDIT_BESIDE_RUNS", "7"))
#: Rows that are no references, not slow, and for vessels with an IMU; those of papers and with few states are left out.
ROWS = tuple(
    os.environ.get(
        "SIMNAV_AUDIT_BESIDE_ROWS",
        "adkf,cauchy-fgo,ckf,dcs-fgo,fading-ekf,federated,ga-fgo,gated-ekf,gm-ekf,gm-fgo,gnc-fgo,heading-bank,huber-fgo,"
        "huber-kf,iae,iae-fgo,iae-fgo-fixed,iae-fixed,iekf,igg3,imm,inekf,max-mixture-fgo,mckf,mh-ekf,mid-value,rae,"
        "sage-husa,solution-separation,student-t,sw-fgo,switchable-fgo,tukey-fgo,ukf,vb-akf",
    ).split(",")
)
WORSE, MOST, GUARDED = 1.5, 0.05, 1.2
IMU = (
    "imu-clipping", "imu-dropouts", "gyroscope-bias-step", "imu-warm-up", "imu-vibration", "imu-stuck-axis",
    "auv-gyroscope-bias-step", "auv-imu-dropouts", "rov-stuck-axis",
)  # fmt: skip
SOLE = ("lone-dvl", "sole-gnss")
#: Runs of each recording: pieces of it, or other draws of what is simulated.
RECORDED = {
    "car-kitti": 1, "auv-akit": 6, "ship-nbp1406": 3, "boat-furuno": 3, "sail-irene": 4, "sail-psaros33": 4,
    "sail-aava": 1, "ship-gould": 2, "ship-sikuliaq": 2,
}  # fmt: skip
OWN = ("storm-clipping", "storm-dropout", "second-dvl-frozen")
_SCENARIOS = Path(__file__).parent / "beside_scenarios"
_RECORDINGS = Path(__file__).parents[2] / "scenarios" / "recordings"
_GUARD = "solution-separation"


def _path(scenario: str) -> Path | str:
    """The file of a scenario that is not in the catalogue, or its name."""
    files = (folder / f"{scenario}.toml" for folder in (_SCENARIOS, _RECORDINGS))
    return next((file for file in files if file.exists()), scenario)


def ratios(scenario: str, seeds: Sequence[int], names: Sequence[str]) -> dict[str, dict[int, float]]:
    """The horizontal RMSE of rows over that of the plain row, by row and seed; without rows that do not suit.

    Parameters
    ----------
    scenario : str
        A name of the catalogue, or of a scenario of this audit.
    seeds : sequence of int
        Seeds of the runs.
    names : sequence of str
        The rows.
    """
    loaded = load(str(_path(scenario)))
    found: dict[str, dict[int, float]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for seed in seeds:
            recording = record(loaded, seed)
            plain = "ekf" if recording.instruments.imu is not None else "ship-ekf"
            error: dict[str, float] = {}
            for name in (plain, *names):
                trial = run_trial(make(name), recording)
                if trial.status != "unsuitable":
                    scores = score(trial, recording, ["horizontal_rmse"]) if trial.status == "ok" else {}
                    error[name] = float(scores.get("horizontal_rmse", np.inf))
            for name in error.keys() - {plain}:
                found.setdefault(name, {})[seed] = error[name] / error[plain]
    return found


def _recorded(scenario: str, count: int) -> dict[str, dict[int, float]]:
    try:
        return ratios(scenario, range(count), [_GUARD])
    except LogError:  # its files are elsewhere
        return {}


def parts() -> Mapping[str, Callable[[], Any]]:
    """A part for each scenario."""
    seeds = range(FIRST, FIRST + RUNS)
    found: dict[str, Callable[[], Any]] = {name: partial(ratios, name, seeds, ROWS) for name in (*IMU, *SOLE)}
    found |= {name: partial(ratios, name, seeds, [_GUARD]) for name in OWN}
    return found | {name: partial(_recorded, name, count) for name, count in RECORDED.items()}


def _mean(values: Sequence[float]) -> float:
    return float(np.exp(np.mean(np.log(values))))


def rows(measured: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    for name in ROWS:
        runs = [(v, f"{s} {k}") for s in IMU for k, v in measured[s].get(name, {}).items()]
        if runs:
            share = sum(v > WORSE for v, _ in runs) / len(runs)
            worst, where = max(runs)
            what = f"{name}: runs with a wrong IMU above {WORSE:g} times ekf, of {len(runs)}; mean; largest"
            figure = f"{100.0 * share:.1f} %; {_mean([v for v, _ in runs]):.2f}; {worst:.1f} ({where})"
            yield what, figure, f"at most {100.0 * MOST:g} %", share <= MOST
    for scenario in SOLE:
        for name in ROWS:
            if its := measured[scenario].get(name):
                mean, worst = _mean(list(its.values())), max(its.values())
                yield f"{name} on {scenario}: mean; largest", f"{mean:.2f}; {worst:.2f}", f"{WORSE:g}", mean <= WORSE
    for scenario in (*OWN, *RECORDED):
        if its := measured[scenario].get(_GUARD):
            mean, worst = _mean(list(its.values())), max(its.values())
            figure = f"{mean:.2f}; {worst:.2f}"
            yield f"{_GUARD} on {scenario}, of {len(its)}: mean; largest", figure, f"{GUARDED:g}", mean <= GUARDED
