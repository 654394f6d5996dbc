"""A check of a recorded scenario: every file and channel of every recording, with all that stops or disturbs a run."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from simnav.log.channel import Series, list_recordings, read_channel
from simnav.log.imu_series import read_imu
from simnav.log.readings import probable_readings
from simnav.log.source import LogSource
from simnav.log.table import LogError
from simnav.log.time_units import unit_to_write
from simnav.spec import SpecError
from simnav.types import Array

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["LogCheck", "LogFinding", "check_log", "described"]

#: From this share of repeated values on it is said.
_MANY = 0.3
#: A gap is said from so many times the usual spacing on.
_GAP = 5.0


@dataclass(frozen=True)
class LogFinding:
    """What was found about one part of a recording.

    Attributes
    ----------
    recording, part : str
        Name of the recording (empty for the only one), and what was read: ``imu``, an instrument,
        ``reference.position``, ``run``.
    level : {"ok", "note", "error"}
        ``note``: something was left out or looks wrong, and the run is possible. ``error``: no run is possible, or the
        other streams say that this one is read wrongly (`simnav.log.readings`).
    sentence : str
        What it is, with file, field and value, and what would be right.
    """

    recording: str
    part: str
    level: Literal["ok", "note", "error"]
    sentence: str


@dataclass(frozen=True)
class LogCheck:
    """All findings about a recorded scenario.

    Attributes
    ----------
    scenario : str
        Its id.
    findings : tuple of LogFinding
        In the order of the recordings.
    """

    scenario: str
    findings: tuple[LogFinding, ...]

    @property
    def passed(self) -> bool:
        """Whether every recording can be run, and its streams agree."""
        return not any(f.level == "error" for f in self.findings)

    def to_dict(self) -> dict[str, Any]:
        """Plain: what ``simnav check --json`` prints."""
        return {"scenario": self.scenario, "passed": self.passed, "findings": [vars(f) for f in self.findings]}


def check_log(scenario: Scenario) -> LogCheck:
    """Read all parts of all recordings of a scenario.

    Parameters
    ----------
    scenario : Scenario
        With a ``[log]``.

    Returns
    -------
    LogCheck
        Nothing is raised for what is wrong with the log.
    """
    log = scenario.log
    assert log is not None
    try:
        names = list_recordings(log)
    except (LogError, OSError) as error:
        return LogCheck(scenario.id, (LogFinding("", "recordings", "error", str(error)),))
    found: list[LogFinding] = []
    for seed, recording in enumerate(names):
        before, made = len(found), dict[str, Any]()
        for part, read in _parts(scenario, recording):
            found += _read(recording, part, read, made)
        found += _of_clocks(scenario, recording, made)
        if not any(f.level == "error" for f in found[before:]):
            known = {f.sentence for f in found}
            run = _read(recording, "run", lambda seed=seed: LogSource(scenario, seed), {})  # type: ignore[misc]
            found += [f for f in run if f.sentence not in known]
            if not any(f.level == "error" for f in found if f.recording == recording):
                found += [
                    LogFinding(recording, r.stream, "error", r.sentence())
                    for r in probable_readings(scenario, recording)
                ]
    return LogCheck(scenario.id, tuple(found))


def _parts(scenario: Scenario, recording: str) -> Iterator[tuple[str, Callable[[], Any]]]:
    log = scenario.log
    assert log is not None
    imu = log.imu
    if imu is not None:
        yield "imu", lambda: read_imu(log, imu, recording)
    for name, spec in scenario.aids.items():
        where = log.instruments.get(name)
        if where is not None and where.source == "file":
            yield name, lambda where=where, kind=spec.kind: read_channel(log, where.channel(), kind, recording)  # type: ignore[misc]
    for name in ("position", "velocity", "attitude"):
        channel = getattr(log.reference, name)
        if channel is not None:
            yield (
                f"reference.{name}",
                lambda channel=channel, name=name: read_channel(log, channel, name, recording),  # type: ignore[misc]
            )


def _of_clocks(scenario: Scenario, recording: str, parts: Mapping[str, Any]) -> Iterator[LogFinding]:
    """A finding for each file whose times would be those of the other parts in another unit."""
    log = scenario.log
    assert log is not None
    times = {name: p.time if isinstance(p, Series) else p.edge for name, p in parts.items()}
    said: set[str] = set()
    for name, time in times.items():
        channel = log.imu if name == "imu" else log.instruments.get(name)
        if name.startswith("reference."):
            channel = getattr(log.reference, name.partition(".")[2])
        assert channel is not None
        key = str(channel.file)
        others = [t for n, t in times.items() if n != name]
        right = "" if key in said else unit_to_write(log.files[key], time, others, inertial=name == "imu")
        if right:
            said.add(key)
            yield LogFinding(
                recording, name, "error",
                f"{parts[name].source}: its times, {time[0]:.3f} to {time[-1]:.3f} s, are not those of the other "
                f"instruments, but would be with {right} of its file: write that",
            )  # fmt: skip


def _read(recording: str, part: str, read: Callable[[], Any], parts: dict[str, Any]) -> Iterator[LogFinding]:
    """The findings about one part: what it holds or why it cannot be read, and all warnings; what it holds by name."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            made = read()
        except (SpecError, ValueError, OSError) as error:
            yield LogFinding(recording, part, "error", " ".join(str(error).split()))
            made = None
    for warning in said:
        yield LogFinding(recording, part, "note", " ".join(str(warning.message).split()))
    if made is None:
        return
    parts[part] = made
    if isinstance(made, LogSource):
        yield LogFinding(recording, part, "ok", f"{made.duration:g} s; {made.note}".rstrip("; "))
    elif isinstance(made, Series):
        yield LogFinding(recording, part, "ok", f"{made.source}: {described(made.time)}")
        if (same := _repeated(made.value)) > _MANY:
            yield LogFinding(
                recording, part, "note",
                f"{made.source}: {100.0 * same:.0f} % of the values are those of the row before; if the logger repeats "
                "old values, say drop_repeated = true",
            )  # fmt: skip
    else:
        yield LogFinding(recording, part, "ok", f"{made.source}: {described(made.edge[1:])}")
        if (same := _repeated(made.mean)) > _MANY:
            yield LogFinding(
                recording, part, "note",
                f"{made.source}: {100.0 * same:.0f} % of the samples are those of the row before: the IMU did not "
                "measure there, or its logger repeats old values",
            )  # fmt: skip


def _repeated(value: Array) -> float:
    """Share of the rows that repeat the row before."""
    return float(np.mean(np.all(np.diff(value, axis=0) == 0.0, axis=1))) if len(value) > 1 else 0.0


def described(time: Array) -> str:
    """Number, span, rate and longest gap of n times, as text."""
    if len(time) < 2:
        return f"{len(time)} row at {time[0]:.3f} s" if len(time) else "no rows"
    spacing = np.diff(time)
    usual, longest = float(np.median(spacing)), float(spacing.max())
    rate = f"{1.0 / usual:.4g} Hz" if usual > 0.0 else "most rows are not later than the one before"
    text = f"{len(time)} rows from {time[0]:.3f} to {time[-1]:.3f} s, {rate}"
    if longest > _GAP * usual > 0.0:
        k = int(np.argmax(spacing))
        text += f", longest gap {longest:.3g} s after {time[k]:.3f} s"
    return text
