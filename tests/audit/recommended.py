"""Whether one row can be recommended: near the oracle, harmless where nothing is wrong, and honest.

The row is run beside the oracle, the plain row and the two best rows before it, on the tracks of `TRACKS`, with seeds
from `FIRST` on, on which no parameter was chosen. A scenario counts by the geometric mean of its runs, a group
by that of its scenarios. Promised is:

- on Aided INS at most `NEAR` times the oracle, at most `CLEAN` times where nothing is wrong, and on no scenario more
  than `BEYOND` times the better one of the two rows;
- at most `HARM` times the plain row where the IMU is wrong and on recorded voyages;
- under water and on Generalisation at most `BEYOND` times the best of these rows;
- that the 95 % region holds the truth in 85 to 99 % of the epochs in each group of troubles, recorded voyages among
  them, and in 90 to 98 % on the simulated voyages on which nothing is wrong;
- at most `SLOWER` times the time of the plain row.

``SIMNAV_AUDIT_RECOMMENDED_RUNS`` sets the number of runs of each scenario; of the recorded voyages there are few.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from simnav.estimator import make
from simnav.leaderboard.ranking.troubles import troubles
from simnav.log import LogError
from simnav.scenario import load, names
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial

__all__ = ["measured", "parts", "rows"]

ROW, PLAIN, ORACLE, RIVALS = "mh-ekf", "ekf", "oracle", ("iae-fgo", "vb-akf")
RUNS = int(os.environ.get("SIMNAV_AUDIT_RECOMMENDED_RUNS", "10"))
FIRST = 9000
TRACKS = ("aided-ins", "underwater", "generalisation", "recorded")
CLEAN_SCENARIOS = ("open-sea", "mems-only", "sea-state-6", "clean-voyages")
NEAR, CLEAN, BEYOND, HARM, SLOWER = 1.55, 1.03, 1.15, 1.1, 8.0
HONEST, HONEST_CLEAN = (0.85, 0.99), (0.90, 0.98)
_ERROR, _COVERAGE = "horizontal_rmse", "coverage_95"
#: Of each row: error [m], coverage and time of an update [s], run by run.
Scores = dict[str, dict[str, list[float]]]


def measured(name: str, runs: int) -> Scores:
    """The scores of all rows on the runs of a scenario; NaN where a row failed or does not suit.

    There are none where the recording of a voyage is not on this machine.
    """
    found: Scores = {row: {"error": [], "coverage": [], "time": []} for row in (ROW, PLAIN, ORACLE, *RIVALS)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for seed in range(FIRST, FIRST + runs):
            try:
                recording = record(load(name), seed)
            except LogError:
                break
            for row, scores in found.items():
                trial = run_trial(make(row), recording)
                ended = score(trial, recording, (_ERROR, _COVERAGE)) if trial.status == "ok" else {}
                scores["error"].append(float(ended.get(_ERROR, np.nan)))
                scores["coverage"].append(float(ended.get(_COVERAGE, np.nan)))
                scores["time"].append(float(np.median(trial.update_seconds)) if len(trial) else np.nan)
    return found


def _scenarios() -> dict[str, str]:
    """The track of each scenario that is measured."""
    found = {name: load(name).track for name in names()}
    found = {name: track for name, track in found.items() if track in TRACKS}
    return dict(sorted(found.items(), key=lambda item: TRACKS.index(item[1])))


def parts() -> dict[str, Callable[[], Any]]:
    """What is measured, by name: each scenario."""
    return {name: partial(measured, name, 1 if track == "recorded" else RUNS) for name, track in _scenarios().items()}


def _ratio(scores: Scores, over: Collection[str]) -> float:
    """Geometric mean of the errors over those of another row; of several rows, of the better one in the mean."""
    own = np.array(scores[ROW]["error"])
    means = []
    for other in over:
        ratio = own / np.array(scores[other]["error"])
        if np.isfinite(ratio).any():
            means.append(float(np.exp(np.nanmean(np.log(ratio)))))
    return max(means, default=np.nan)


def _mean(ratios: Collection[float]) -> float:
    known = [r for r in ratios if np.isfinite(r)]
    return float(np.exp(np.mean(np.log(known)))) if known else np.nan


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    track = {name: of for name, of in _scenarios().items() if name in found}

    def of(group: str) -> list[str]:
        return [name for name, one in track.items() if one == group]

    def line(what: str, scenarios: Collection[str], over: Collection[str], limit: float) -> tuple[str, str, str, bool]:
        value = _mean([_ratio(found[name], over) for name in scenarios if name in found])
        return what, f"{value:.2f}", f"at most {limit:g}", not value > limit

    yield line(f"{ROW}: Aided INS, times {ORACLE}", of("aided-ins"), [ORACLE], NEAR)
    yield line(f"{ROW}: nothing wrong, times {ORACLE}", CLEAN_SCENARIOS, [ORACLE], CLEAN)
    for name in of("aided-ins"):
        yield line(f"{ROW}: {name}, times the better of {' and '.join(RIVALS)}", [name], RIVALS, BEYOND)
    yield line(f"{ROW}: the IMU wrong, times {PLAIN}", troubles()["imu"].scenarios, [PLAIN], HARM)
    yield line(f"{ROW}: recorded, times {PLAIN}", of("recorded"), [PLAIN], HARM)
    for group in ("underwater", "generalisation"):
        yield line(f"{ROW}: {group}, times the best", of(group), [PLAIN, *RIVALS], BEYOND)
    groups = {trouble.title: (trouble.scenarios, HONEST) for trouble in troubles().values()}
    for title, (scenarios, (low, high)) in {
        **groups,
        "simulated, nothing wrong": (CLEAN_SCENARIOS, HONEST_CLEAN),
    }.items():
        held = [np.nanmean(found[n][ROW]["coverage"]) for n in scenarios if n in found and _usable(found[n])]
        if held:
            value = float(np.mean(held))
            what = f"{ROW}: 95 % region, {title}"
            yield what, f"{100.0 * value:.1f} %", f"{100.0 * low:.0f} to {100.0 * high:.0f} %", low <= value <= high
    times = [np.nanmedian(found[n][ROW]["time"]) / np.nanmedian(found[n][PLAIN]["time"]) for n in of("aided-ins")]
    slower = float(np.mean(times)) if times else np.nan
    yield f"{ROW}: time of an update, times {PLAIN}", f"{slower:.1f}", f"at most {SLOWER:g}", not slower > SLOWER


def _usable(scores: Scores) -> bool:
    return bool(np.isfinite(scores[ROW]["coverage"]).any())
