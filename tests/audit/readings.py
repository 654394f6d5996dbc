"""Logs that are right: 'simnav check' and 'simnav log inspect' find no other reading of them.

Simulated logs whose instruments have other errors than their datasheets say (`tests.identification.coverage`), and
voyages of the catalogue, are written as files and drafted by names and sizes, as 'simnav log inspect' does. The DVL of
the first is late by a fraction of a second, which is between the delays that are compared (0 and 0.5 s): to say 0.5 s
is no error there if it is late by `LATE` or more. Ships without an IMU have faults, too; hours of one have no file of
the truth, nor have logs of a minute or two.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.log_inspection import drafted
from simnav.leaderboard.results.formats import write
from simnav.log.inspection import inspect_log
from simnav.scenario import load
from simnav.source import record
from tests.identification.coverage import simulated

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["parts", "readings_of", "rows"]

#: Logs of a part, and parts.
LOGS, PARTS = 20, 10
#: A DVL that is late by so much may be called 0.5 s late [s].
LATE = 0.2
#: Voyages of the catalogue, and so much of each [s].
NAMES, LENGTH = ("coastal-voyage", "auv-survey", "gnss-outage", "harbour-multipath", "ship-straight"), 240.0
#: Voyages that are read whole and with their faults: of ships without an IMU, with lever arms of 20 m, in short waves.
WHOLE = ("fishing-vessel", "ship-dead-reckoning", "ferry-in-the-wind", "fluxgate-deviation", "coaster-compass",
         "survey-without-bottom-lock", "uuv-lake")  # fmt: skip
#: Voyages of which the first minute or two is read, and its lengths [s].
SHORT, LENGTHS = ("open-sea", "gnss-outage", "harbour-multipath", "rov-inspection", "mems-only"), (60.0, 90.0, 120.0)


def readings_of(seed: int) -> list[str]:
    """What is read otherwise in one log that is right; every second log is one of the catalogue."""
    right: set[str] = set()
    if seed % 2:
        _, recording, true = simulated(seed)
        if -true["log.instruments.dvl.offset_s", ""] >= LATE:
            right.add("'dvl' is 0.5 s late")
    else:
        scenario = load(NAMES[seed // 2 % len(NAMES)])
        short = {"duration": min(scenario.duration, LENGTH), "faults": ()}
        recording = record(scenario.model_copy(update=short), 5800 + seed)
    return [f"seed {seed}: {text}" for text in _told(recording, True) if text not in right]


def _told(recording: Recording, with_truth: bool) -> list[str]:
    """What is missing in the files of a recording, or read otherwise."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write("recording", "csv", recording, Path(folder) / "run")
        if not with_truth:
            (Path(folder) / "run" / "truth.csv").unlink()
        made = drafted(inspect_log([Path(folder) / "run"])[0], "right", "right.toml")
    return [text for text in (made.missing, *(r.what for r in made.readings)) if text]


def _hours_without_truth() -> list[str]:
    """Ships with a receiver, a compass and a log, whose fixes are the only reference."""
    scenario = load("ship-field")
    return [f"{scenario.name}, seed {k}: {text}" for k in range(4000, 4000 + LOGS)
            for text in _told(record(scenario, k), False)]  # fmt: skip


def _whole_voyages() -> list[str]:
    """Voyages of `WHOLE`, in turn."""
    return [f"{name}, seed {k}: {text}" for k in range(9100, 9100 + LOGS)
            for name in [WHOLE[k % len(WHOLE)]] for text in _told(record(load(name), k), True)]  # fmt: skip


def _minutes_without_truth() -> list[str]:
    """The beginnings of twenty voyages."""
    found = []
    for k in range(9250, 9250 + LOGS):
        scenario = load(SHORT[k % len(SHORT)])
        recording = record(scenario.model_copy(update={"duration": LENGTHS[k % len(LENGTHS)]}), k)
        found += [f"{scenario.name}, seed {k}: {text}" for text in _told(recording, False)]
    return found


def _part(number: int) -> list[str]:
    return [text for k in range(LOGS) for text in readings_of(LOGS * number + k)]


def parts() -> Mapping[str, Callable[[], Any]]:
    """Twenty logs each."""
    found: dict[str, Callable[[], Any]] = {
        f"logs {LOGS * k} to {LOGS * (k + 1) - 1}": partial(_part, k) for k in range(PARTS)
    }
    found["whole voyages"] = _whole_voyages
    found["minutes without a truth"] = _minutes_without_truth
    return found | {"hours of a ship without a truth": _hours_without_truth}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """A row for all logs."""
    wrong = [text for part in found.values() for text in part]
    figure = f"{len(wrong)} other readings in {LOGS * len(found)} logs"
    yield "logs that are right", "; ".join([figure, *wrong])[:300], "0 other readings", not wrong
