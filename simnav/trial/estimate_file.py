"""Estimates that were made elsewhere: a file (CSV or TUM) as the trial of a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from simnav.geometry.local import geodetic_of_local, turn_to_origin
from simnav.geometry.rotation import dcm_from_quaternion, rpy_from_dcm
from simnav.log.delimited import read_csv
from simnav.log.table import LogError, Table, check_ascending
from simnav.recording import Recording
from simnav.trial.log import TrialLog
from simnav.trial.session import FailureError, run_session
from simnav.trial.trial import Trial
from simnav.trial.wire import EstimateEncoder, PacketEncoder
from simnav.types import COMPONENTS, Array, Estimate, InitialState, NavigationStates

__all__ = ["ENDINGS", "read_estimates", "trial_of_file"]

#: Endings of files of estimates.
ENDINGS = (".csv", ".tum", ".txt")
_RADIAN = math.pi / 180.0
#: Columns of a CSV file, with their factors to SI.
_COLUMNS: Mapping[str, tuple[tuple[str, float], ...]] = {
    "position": (("latitude_deg", _RADIAN), ("longitude_deg", _RADIAN), ("height_m", 1.0)),
    "velocity": tuple((f"velocity_{axis}_m_s", 1.0) for axis in ("north", "east", "down")),
    "attitude": (("roll_deg", _RADIAN), ("pitch_deg", _RADIAN), ("yaw_deg", _RADIAN)),
}
_SIGMAS = [(f"sigma_{name}_{unit}", factor) for name, (unit, factor) in zip(
    COMPONENTS, [("m", 1.0)] * 3 + [("m_s", 1.0)] * 3 + [("deg", _RADIAN)] * 3, strict=True
)]  # fmt: skip
#: Columns that have limits, and the largest size.
_LARGEST = {"latitude_deg": 90.0, "longitude_deg": 360.0, "pitch_deg": 90.0}
_TOLERANCE = 1e-6
#: Forward-left-up to forward-starboard-down; its own inverse.
_FLIP = np.diag([1.0, -1.0, -1.0])
#: North-east-down to east-north-up; its own inverse.
_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


class _Read:
    """The estimates of a file: (n,) times and (n, 9) states and sigmas, NaN where one is missing."""

    def __init__(self, time: Array, states: Array, sigmas: Array | None):
        self.time, self.states, self.sigmas = time, states, sigmas

    def at(self, time: float, start: InitialState) -> Estimate:
        """The last estimate until a time; the start before the first one."""
        k = int(np.searchsorted(self.time, time + _TOLERANCE, side="right")) - 1
        if k < 0:
            return Estimate(time, start.position, start.velocity, start.attitude, start.covariance)
        state = self.states[k]
        given = np.isfinite(state)
        vectors: dict[str, Any] = {
            n: state[3 * i : 3 * i + 3] for i, n in enumerate(_COLUMNS) if given[3 * i : 3 * i + 3].any()
        }
        covariance = None
        if self.sigmas is not None:
            covariance = np.diag(np.nan_to_num(self.sigmas[k]) ** 2)
        level = bool(given[6] and given[7])
        return Estimate(
            time, **vectors, covariance=covariance, estimated=np.array([*given[:6], level, level, given[8]])
        )


def read_estimates(path: Path, start: InitialState) -> _Read:
    """Read a file of estimates.

    Parameters
    ----------
    path : Path
        CSV with a header, or TUM (time, position, quaternion, without a header); see
        ``docs/how-to/connect-a-program.md``.
    start : InitialState
        The start of the run; the positions of a TUM file are east, north, up of its position.

    Raises
    ------
    LogError
        If the file cannot be used: one sentence with file, line and column.
    """
    if path.suffix.lower() not in ENDINGS:
        raise LogError(f"{path}: a file of estimates ends in {' or '.join(ENDINGS)}")
    table = read_csv(path, "#")
    if table.names == tuple(str(k) for k in range(1, len(table.names) + 1)):
        return _tum(table, start)
    known = {name for columns in _COLUMNS.values() for name, _ in columns} | {name for name, _ in _SIGMAS} | {"time_s"}
    unknown = [name for name in table.names if name not in known]
    if "time_s" not in table.names or "latitude_deg" not in table.names or "longitude_deg" not in table.names:
        raise LogError(
            f"{path}: the columns are {', '.join(table.names)}; wanted are time_s, latitude_deg, longitude_deg and "
            f"what else was estimated of {', '.join(sorted(known - {'time_s', 'latitude_deg', 'longitude_deg'}))}"
        )
    if unknown:
        raise LogError(
            f"{path}: there is no meaning to the column {unknown[0]!r}; known are {', '.join(sorted(known))}"
        )
    columns = [pair for group in _COLUMNS.values() for pair in group]
    states = np.stack([_column(table, name, factor) for name, factor in columns], axis=-1)
    sigmas = None
    if any(name in table.names for name, _ in _SIGMAS):
        sigmas = np.stack([_column(table, name, factor) for name, factor in _SIGMAS], axis=-1)
    return _checked(table, "time_s", states, sigmas)


def _column(table: Table, name: str, factor: float) -> Array:
    if name not in table.names:
        return np.full(len(table), np.nan)
    value = table.column(name)[1]
    high = _LARGEST.get(name, np.inf)
    low = 0.0 if name.startswith("sigma_") else -high
    wrong = np.flatnonzero((value < low) | (value > high))
    if wrong.size:
        k = wrong[0]
        right = "0 or more" if high == np.inf else f"between {low:g} and {high:g}"
        raise LogError(f"{table.source}, line {table.line[k]}: {name} = {value[k]:g} must be {right}")
    return factor * value


def _checked(table: Table, name: str, states: Array, sigmas: Array | None) -> _Read:
    time = table.column(name)[1]
    check_ascending(time, table, name)
    return _Read(time, states, sigmas)


def _tum(table: Table, start: InitialState) -> _Read:
    if len(table.names) != 8:
        raise LogError(
            f"{table.source}: {len(table.names)} columns without a header; TUM has 8: time, x, y, z, and the "
            "quaternion x, y, z, w"
        )
    x = np.stack([table.column(name)[1] for name in table.names], axis=-1)
    bad = np.flatnonzero(~np.isfinite(x).all(axis=1) | (np.linalg.norm(x[:, 4:], axis=1) < 1e-6))
    if bad.size:
        raise LogError(f"{table.source}, line {table.line[bad[0]]}: a number is missing, or the quaternion is zero")
    position = geodetic_of_local(x[:, 1:4] @ _ENU, start.position)
    unit = x[:, 4:] / np.linalg.norm(x[:, 4:], axis=1, keepdims=True)
    back = np.swapaxes(turn_to_origin(position, start.position), -1, -2)
    dcm = back @ _ENU @ dcm_from_quaternion(unit[:, [3, 0, 1, 2]]) @ _FLIP
    nothing = np.full((len(x), 3), np.nan)
    return _checked(table, table.names[0], np.hstack([position, nothing, rpy_from_dcm(dcm)]), None)


class _FileSession:
    """A session whose answers come from a file."""

    needs = ()
    observed = None

    def __init__(self, name: str, read: _Read, recording: Recording):
        self.name, self._read, self._start = name, read, recording.start
        self._ends = recording.data.truth.time

    def begin(self, recording: Recording, packets: PacketEncoder) -> None:
        """Nothing has to be started."""

    def run(self, packets: PacketEncoder, log: TrialLog) -> None:
        """Log the estimate of each epoch."""
        encode = EstimateEncoder()
        step = float(self._ends[0]) if len(self._ends) == 1 else float(np.diff(self._ends).min())
        for end in self._ends:
            if end > self._read.time[-1] + step + _TOLERANCE:
                raise FailureError(
                    "error", f"the file ends at {self._read.time[-1]:g} s, the run at {self._ends[-1]:g} s"
                )
            log.add(encode(self._read.at(float(end), self._start)), math.nan)

    def smooth(self) -> NavigationStates | None:
        """A file has one trajectory."""
        return None

    def describe(self, error: BaseException) -> str:
        """What went wrong."""
        return str(error)


def trial_of_file(path: Path, recording: Recording, name: str = "") -> Trial:
    """The trial that a file of estimates is.

    Parameters
    ----------
    path : Path
        See `read_estimates`.
    recording : Recording
        The run that it is of.
    name : str
        Name of the estimator; default: that of the file.

    Returns
    -------
    Trial
        With the checks of any other; epochs before the first estimate have the start, others the last estimate before
        them. Its times of computation are not known: NaN.

    Raises
    ------
    LogError
        If the file cannot be read.
    """
    read = read_estimates(path, recording.start)
    session = _FileSession(name or path.stem, read, recording)
    trial = run_session(session, recording, TrialLog(recording.data.truth, keep_covariance=True))
    return replace(trial, reset_seconds=math.nan, smooth_seconds=math.nan)
