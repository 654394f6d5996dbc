"""Are recordings and estimates the same, bit for bit, as those of another commit?

Run ``python -m tests.golden record --bits FILE`` at the commit to compare with, then ``compare --bits FILE`` after a
change that should alter no number. Both on one machine: a digest does not survive another processor.

A file holds a digest of every scenario of the catalogue that needs no data of its own (cut to `LONGEST` seconds,
seed 1): of all arrays of its recording, and for each registered estimator of all that it estimated, or why it failed.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import warnings
from collections.abc import Iterable, Sequence
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np

from simnav.estimator import find, make
from simnav.estimator import names as estimator_names
from simnav.log import LogError
from simnav.scenario import Scenario, load
from simnav.source import record
from simnav.trial import Trial, run_trial

LONGEST, LONGEST_OF_SLOW = 120.0, 30.0
SEED = 1
#: Of a trial, what does not depend on the clock of the machine.
_TRIAL = ("status", "reason", "time", "position", "velocity", "attitude", "estimated", "covariance", "diagnostics",
          "flagged", "smoothed")  # fmt: skip


def _parts(value: Any) -> Iterable[bytes]:
    """A value as bytes, containers and arrays with their shapes included."""
    if isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from _parts(getattr(value, field.name))
    elif isinstance(value, dict):
        for key in sorted(value):
            yield str(key).encode()
            yield from _parts(value[key])
    elif isinstance(value, (list, tuple)):
        yield f"{len(value)}".encode()
        for item in value:
            yield from _parts(item)
    else:
        yield repr(value).encode()


def digest(*values: Any) -> str:
    """Hexadecimal digest of arrays, dataclasses, containers and plain values."""
    h = hashlib.blake2b(digest_size=12)
    for value in values:
        for part in _parts(value):
            h.update(part)
    return h.hexdigest()


def cut(scenario: Scenario, longest: float) -> Scenario:
    """A scenario of at most so many seconds, a whole number of steps."""
    duration = min(scenario.duration, int(longest / scenario.step) * scenario.step)
    return scenario.model_copy(update={"duration": duration})


def of_trial(trial: Trial) -> str:
    """Digest of a trial; the place of a failure in the sources does not count."""
    values = [getattr(trial, name) for name in _TRIAL]
    values[1] = trial.reason.partition(" (")[0]
    return digest(*values)


def of_scenario(name: str) -> dict[str, Any]:
    """The entry of one scenario: its content, its recording, and every estimator on it; empty without its data."""
    warnings.simplefilter("ignore")
    scenario = load(name)
    try:
        long, short = (record(cut(scenario, limit), SEED) for limit in (LONGEST, LONGEST_OF_SLOW))
    except LogError:
        return {}
    data = [long.initial_truth, long.start, long.data, [dataclasses.astuple(f) for f in long.faults]]
    estimates = {}
    for estimator in estimator_names():
        recording = short if find(estimator).slow else long
        trial = run_trial(make(estimator), recording)
        estimates[estimator] = f"{trial.status} {of_trial(trial)}"
    return {"content": scenario.content_hash(), "recording": digest(*data), "estimates": estimates}


def run(what: str, file: Path, wanted: Sequence[str], workers: int) -> int:
    """Record or compare; 1 where something differs."""
    with Pool(workers) as pool:
        entries = dict(zip(wanted, pool.map(of_scenario, wanted, chunksize=1)))
    entries = {name: entry for name, entry in entries.items() if entry}
    if what == "record":
        file.write_text(json.dumps(entries, indent=1))
        print(f"{len(entries)} scenarios recorded")
        return 0
    before = json.loads(file.read_text())
    different = []
    for name, entry in entries.items():
        old = before.get(name, {})
        different += [f"{name}: {part}" for part in ("content", "recording") if entry[part] != old.get(part)]
        rows, earlier = entry["estimates"], old.get("estimates", {})
        different += [
            f"{name}: {row}: {earlier.get(row)} is now {rows.get(row)}"
            for row in sorted({*rows, *earlier})
            if rows.get(row) != earlier.get(row)
        ]
    print("\n".join(different) or f"{len(entries)} scenarios are the same, bit for bit")
    return bool(different)
