"""Fingerprints: a few numbers of every recording and of every row, and what it means when they change.

A fingerprint is compared to one part in a million: above what another processor or another version of Numba makes, and
far below what a change of a method makes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from simnav.estimator import find, make, names
from simnav.kinds import KINDS
from simnav.leaderboard.results.provenance import BENCHMARK
from simnav.log import LogError
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.scoring import SCORES, errors, score
from simnav.scoring.navigation_error import state_errors
from simnav.simulation.version import SIMULATOR_VERSION
from simnav.source import record
from simnav.trial import Trial, run_trial
from tests.golden.cases import Case, table_of

FILE = Path(__file__).with_name("fingerprints.json")
RECORD = "python -m tests.golden record"
TOLERANCE = 1e-6

_SEED = 1
_STRETCH = 20.0  # of each scenario of the catalogue [s]
_SCORED = ("ekf-rts", "huber-fgo", "ship-ekf")  # rows whose scores are compared
_WORDS = {"name", "version", "title", "description", "source", "tags", "track", "group", "dial"}

#: Keys that came later. A file of before says by them what was the only choice then.
_LATER = {"spectrum_end"}

Numbers = list[Any]


@dataclass(frozen=True)
class Asked:
    """What a change of numbers asks for.

    Attributes
    ----------
    versions : tuple of str
        A sentence for each row, scenario or other thing that needs a new version.
    outdated : tuple of str
        What is stored as it was, although its version was raised, or is not stored: it is to be recorded.
    """

    versions: tuple[str, ...] = ()
    outdated: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.versions or self.outdated)

    def __add__(self, other: Asked) -> Asked:
        return Asked(self.versions + other.versions, self.outdated + other.outdated)

    def __str__(self) -> str:
        said = list(self.versions)
        if self.outdated:
            said.append(f"the stored fingerprints lack {', '.join(self.outdated)}: run '{RECORD}'")
        return "\n".join(said)


# --- numbers ------------------------------------------------------------------------------------------


def own(name: str) -> bool:
    """Whether a row comes with simnav."""
    return find(name).__module__.startswith("simnav.")


def said(table: Mapping[str, Any]) -> str:
    """Digest of the values in the file of a scenario, without its words, names of keys and comments."""

    def values(item: Any) -> Iterable[Any]:
        if isinstance(item, Mapping):
            for key in item:
                if key not in _LATER:
                    yield from values(item[key])
        elif isinstance(item, list):
            yield "["
            for each in item:
                yield from values(each)
        else:
            yield float(item) if isinstance(item, int) and not isinstance(item, bool) else item

    found = list(values({key: value for key, value in table.items() if key not in _WORDS}))
    return hashlib.blake2b(json.dumps(found, default=str).encode(), digest_size=6).hexdigest()


def of_recording(recording: Recording) -> dict[str, Numbers]:
    """By stream: how many samples, and mean and RMS of each component; of the start its values."""
    data, truth, start = recording.data, recording.data.truth, recording.start
    found: dict[str, Numbers] = {
        "truth": [len(truth), *_spread(truth.velocity), *_spread(truth.attitude),
                  *_spread(KINDS["gnss_position"].difference(truth.position, np.round(truth.position[:1], 2)))],
        "start": np.abs(np.concatenate([
            KINDS["gnss_position"].difference(start.position, np.round(start.position, 2)), start.velocity,
            start.attitude, np.sqrt(np.diag(start.covariance)),
        ])).tolist(),
    }  # fmt: skip
    if data.imu is not None:
        found["imu"] = [len(data.imu.time), *_spread(data.imu.angular_rate), *_spread(data.imu.specific_force)]
    for name, stream in data.aids.items():
        difference = KINDS[stream.kind].difference(stream.value, np.round(stream.value[:1], 2))
        touched = int(np.count_nonzero(stream.faults))
        found[name] = [len(stream), len(stream.dropped), touched, *_spread(difference), *_spread(stream.sigma)]
        if stream.has_clock:
            late = np.stack([stream.stamps - stream.time, stream.arrivals - stream.time], axis=1)
            found[name] += _spread(late)
    return found


def _spread(values: np.ndarray) -> Numbers:
    """Mean and RMS of each column."""
    if not len(values):
        return []
    return [*values.mean(axis=0).tolist(), *np.sqrt((values**2).mean(axis=0)).tolist()]


def of_trial(trial: Trial, recording: Recording) -> Numbers:
    """Status, and of a run that gave something: errors, what the row says of them, flags and the smoothed errors.

    The errors are horizontal [m], vertical [m], of velocity [m/s] and attitude [mrad], at the end and as RMS.
    """
    if not len(trial):
        return [trial.status]
    found = [trial.status, *_errors(errors(trial, recording))]
    if trial.covariance is not None and len(trial.covariance):
        sigma = np.sqrt(np.maximum(np.nan_to_num(np.diagonal(trial.covariance, axis1=1, axis2=2)), 0.0))
        found += np.linalg.norm(sigma.reshape(-1, 3, 3), axis=2).mean(axis=0).tolist()
    found.append(len(trial.flagged))
    if trial.smoothed is not None:
        found += _errors(state_errors(trial.smoothed, recording.data.truth, trial.estimated))
    return found


def _errors(e: np.ndarray) -> Numbers:
    e = np.nan_to_num(e)
    series = np.stack([
        np.hypot(e[:, 0], e[:, 1]), np.abs(e[:, 2]), np.linalg.norm(e[:, 3:6], axis=1),
        1e3 * np.linalg.norm(e[:, 6:9], axis=1),
    ])  # fmt: skip
    return [*series[:, -1].tolist(), *np.sqrt((series**2).mean(axis=1)).tolist()]


def of_scenario(name: str) -> dict[str, Any] | None:
    """The entry of a scenario of the catalogue; None where its files are not on this machine."""
    scenario = load(name)
    try:
        recording = record(_cut(scenario), _SEED)
    except LogError:
        return None
    return {"says": said(table_of(name)), "recording": _rounded(of_recording(recording))}


def _cut(scenario: Scenario) -> Scenario:
    """The beginning of a scenario, a whole number of steps."""
    duration = min(scenario.duration, int(_STRETCH / scenario.step) * scenario.step)
    return scenario.model_copy(update={"duration": duration})


def of_case(case: Case) -> dict[str, Any]:
    """The entry of a case: its recording, every row, and the scores of some."""
    scenario = case.scenario()
    recording = record(scenario, _SEED)
    rows, scores = dict[str, Numbers](), dict[str, Any]()
    for name in filter(own, names()):
        if find(name).slow and not case.slow:
            continue
        trial = run_trial(make(name), recording)
        rows[name] = of_trial(trial, recording)
        if name in _SCORED and trial.status == "ok":
            values = score(trial, recording, [n for n in SCORES if not n.startswith("update_")])
            scores[name] = {key: value for key, value in values.items() if np.isfinite(value)}
    content = [
        case.duration,
        list(case.faults),
        *(dict(table) for table in (case.instruments, case.initial_error) if table),
        said(table_of(case.base) | {"fault": [], "draw": {}}),
    ]
    says = hashlib.blake2b(json.dumps(content).encode(), digest_size=6).hexdigest()
    return {"says": says, "recording": _rounded(of_recording(recording)), "rows": _rounded(rows),
            "scores": _rounded(scores)}  # fmt: skip


def _rounded(value: Any) -> Any:
    """To eight digits, which are enough to compare, and no more bytes than needed."""
    if isinstance(value, Mapping):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.8g}")
    return value


def versions() -> dict[str, Any]:
    """The declared versions of today."""
    return {
        "benchmark": BENCHMARK,
        "simulator": SIMULATOR_VERSION,
        "rows": {name: find(name).version for name in filter(own, names())},
    }


# --- comparison ---------------------------------------------------------------------------------------


def same(before: Any, now: Any) -> bool:
    """Whether numbers are the same up to rounding, and all else is equal."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        return before.keys() == now.keys() and all(same(before[key], now[key]) for key in before)
    if isinstance(before, list) and isinstance(now, list):
        return len(before) == len(now) and all(same(a, b) for a, b in zip(before, now, strict=True))
    if isinstance(before, (int, float)) and isinstance(now, (int, float)):
        return bool(np.isclose(now, before, rtol=TOLERANCE, atol=1e-9, equal_nan=True))
    return bool(before == now)


def in_scenarios(stored: Mapping[str, Any], found: Mapping[str, Any], now: Mapping[str, Any]) -> Asked:
    """What changes of the scenarios and of their recordings ask for; ``found`` is by versioned id."""
    asked, moved = Asked(), []
    for name, entry in found.items():
        before = stored["scenarios"].get(name)
        if before is None:
            asked += Asked(outdated=(name,))
        elif before["says"] != entry["says"]:
            asked += Asked((
                f"{name}: the file of the scenario has other values: raise its `version`, then run '{RECORD}'",
            ))  # fmt: skip
        elif not same(before["recording"], entry["recording"]):
            moved.append(name)
    return asked + _in_simulator(stored, moved, now)


def _in_simulator(stored: Mapping[str, Any], moved: list[str], now: Mapping[str, Any]) -> Asked:
    if not moved:
        return Asked()
    if now["simulator"] > stored["versions"]["simulator"]:
        return Asked(outdated=tuple(moved))
    more = f" and {len(moved) - 1} more" if len(moved) > 1 else ""
    return Asked((
        f"the recording of {moved[0]}{more} has other numbers: undo the change, or raise SIMULATOR_VERSION in "
        f"simnav/simulation/version.py with a line on what changed, then run '{RECORD}'",
    ))  # fmt: skip


def in_case(stored: Mapping[str, Any], name: str, found: Mapping[str, Any], now: Mapping[str, Any]) -> Asked:
    """What changes in a case ask for. If its recording has changed, the rows have nothing to do with it."""
    before, known = stored["cases"].get(name), stored["versions"]
    if before is None or before["says"] != found["says"]:
        return Asked(outdated=(f"the case '{name}'",))
    if not same(before["recording"], found["recording"]):
        return _in_simulator(stored, [f"the case '{name}'"], now)
    asked = Asked()
    for row in sorted({*before["rows"], *found["rows"]}):
        old, new = before["rows"].get(row), found["rows"].get(row)
        if old is None or new is None or now["rows"][row] > known["rows"].get(row, 0):
            asked += Asked(outdated=(row,)) if not same(old, new) else Asked()
        elif not same(old, new):
            asked += Asked((
                f"{row} has other numbers in the case '{name}': undo the change, or raise `version` of the row with a "
                f"line under Versions in its docstring, then run '{RECORD}'",
            ))  # fmt: skip
        elif row in before["scores"] and not same(before["scores"][row], found["scores"].get(row)):
            asked += _in_scores(row, before["scores"][row], found["scores"].get(row, {}), stored, now)
    return asked


def _in_scores(
    row: str, before: Mapping[str, float], found: Mapping[str, float], stored: Mapping[str, Any], now: Mapping[str, Any]
) -> Asked:
    changed = [name for name in before if name not in found or not same(before[name], found[name])]
    if not changed or now["benchmark"] != stored["versions"]["benchmark"]:
        return Asked(outdated=tuple(f"the score {name} of {row}" for name in changed or found.keys() - before.keys()))
    return Asked((
        f"the same estimates of {row} have other scores ({', '.join(changed)}): undo the change, or raise BENCHMARK in "
        f"leaderboard/results/provenance.py, then run '{RECORD}'",
    ))  # fmt: skip


def read() -> dict[str, Any]:
    """The stored fingerprints."""
    content: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return content
