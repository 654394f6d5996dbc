"""Trials kept with the results of a campaign: compact, so that any score can be computed again without an estimator.

One file a trial, ``trials/KEY.parquet`` in the folder of the results, a row an array. Estimates are kept as the
difference to the truth, in single precision: what is rounded then is the error, to seven digits, and not the position
on the Earth. The truth itself is not kept; the recording is computed again when a trial is read.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.trial import Trial
from simnav.types import Array, NavigationStates

from .errors import StoreError
from .folder import atomic

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["FOLDER", "discard", "is_kept", "read", "size", "write"]

#: Of the trials, inside the folder of the results.
FOLDER = "trials"
#: Version of the format.
_FORMAT = "1"

_TRIANGLE = np.tril_indices(9)
_VECTORS = ("position", "velocity", "attitude")
#: Components that are angles, of which a difference lies between -pi and pi.
_ANGLES = {"position": [1], "velocity": [], "attitude": [0, 2]}


def _path(folder: str | os.PathLike[str], key: str) -> Path:
    return Path(folder) / FOLDER / f"{key}.parquet"


def is_kept(folder: str | os.PathLike[str], key: str) -> bool:
    """Whether the trial of a result is there."""
    return _path(folder, key).is_file()


def discard(folder: str | os.PathLike[str], key: str) -> None:
    """Delete the trial of a result, if it is there."""
    _path(folder, key).unlink(missing_ok=True)


def size(folder: str | os.PathLike[str]) -> int:
    """Of all trials that are kept [bytes]."""
    return sum(path.stat().st_size for path in (Path(folder) / FOLDER).glob("*.parquet"))


def write(
    folder: str | os.PathLike[str], key: str, trial: Trial, recording: Recording, *, covariance_interval: float = 0.0
) -> None:
    """Keep a trial.

    Parameters
    ----------
    folder : path
        Folder of the results.
    key : str
        Key of the result of this trial.
    trial : Trial
        The trial to be kept.
    recording : Recording
        Recording on which the estimator ran.
    covariance_interval : float
        Least time between two covariances that are kept [s]; 0 keeps every one.

    Raises
    ------
    StoreError
        If it cannot be written; nothing is left behind.
    """
    path = _path(folder, key)
    path.parent.mkdir(exist_ok=True)
    arrays: dict[str, NDArray[Any]] = {
        "estimated": np.packbits(trial.estimated, axis=1),
        "update_seconds": trial.update_seconds.astype(np.float32),
    }
    arrays |= _differences("", trial, recording)
    if trial.smoothed is not None:
        arrays |= _differences("smoothed.", trial.smoothed, recording)
    if trial.covariance is not None:
        epochs = _thinned(trial.time, covariance_interval)
        arrays["covariance.epochs"] = epochs.astype(np.int32)
        arrays["covariance"] = trial.covariance[epochs][:, _TRIANGLE[0], _TRIANGLE[1]].astype(np.float32)
    for name, values in trial.diagnostics.items():
        arrays[f"diagnostics.{name}"] = values.astype(np.float32)
    names = sorted({name for name, _ in trial.flagged})
    if names:
        arrays["flagged.instrument"] = np.array([names.index(name) for name, _ in trial.flagged], dtype=np.int16)
        arrays["flagged.time"] = np.array([time for _, time in trial.flagged])
    facts = {
        "estimator": trial.estimator,
        "status": trial.status,
        "reason": trial.reason,
        "reset_seconds": trial.reset_seconds,
        "smooth_seconds": trial.smooth_seconds,
        "instruments": names,
        "thinned": covariance_interval > 0.0,
    }
    _write(path, arrays, facts)


def read(folder: str | os.PathLike[str], key: str, recording: Recording) -> tuple[Trial, bool]:
    """A trial that was kept.

    Parameters
    ----------
    folder : path
        Folder of the results.
    key : str
        Key of the result.
    recording : Recording
        Recording on which the estimator ran, simulated again.

    Returns
    -------
    trial : Trial
        Estimates, covariances and diagnostics are those of the run to single precision of their errors.
    thinned : bool
        Whether covariances of some epochs were left out; they are NaN.

    Raises
    ------
    StoreError
        If the file is not there, is damaged, or does not fit the recording.
    """
    path = _path(folder, key)
    try:
        arrays, facts = _read(path)
        estimated = np.unpackbits(arrays["estimated"], axis=1, count=9).astype(bool)
        n = len(estimated)
        if n > len(recording.data.truth):
            raise ValueError(f"it has {n} epochs, the recording {len(recording.data.truth)}")
        time = recording.data.truth.time[:n]
        covariance = None
        if "covariance" in arrays:
            covariance = np.full((n, 9, 9), np.nan)
            epochs, values = arrays["covariance.epochs"], arrays["covariance"].astype(np.float64)
            covariance[epochs[:, None], _TRIANGLE[0], _TRIANGLE[1]] = values
            covariance[epochs[:, None], _TRIANGLE[1], _TRIANGLE[0]] = values
        instruments = facts["instruments"]
        flagged = [
            (instruments[index], float(when))
            for index, when in zip(
                arrays.get("flagged.instrument", ()), arrays.get("flagged.time", ()), strict=True
            )
        ]  # fmt: skip
        smoothed = _vectors("smoothed.", arrays, recording, n)
        trial = Trial(
            estimator=facts["estimator"],
            status=facts["status"],
            reason=facts["reason"],
            time=time,
            **_vectors("", arrays, recording, n),
            estimated=estimated,
            covariance=covariance,
            diagnostics={
                name.partition(".")[2]: values.astype(np.float64)
                for name, values in arrays.items()
                if name.startswith("diagnostics.")
            },
            flagged=flagged,
            update_seconds=arrays["update_seconds"].astype(np.float64),
            smoothed=NavigationStates(time, **smoothed) if smoothed else None,
            reset_seconds=facts["reset_seconds"],
            smooth_seconds=facts["smooth_seconds"],
        )
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        raise StoreError(f"{path} holds no trial of this recording: {type(error).__name__}: {error}") from None
    return trial, bool(facts["thinned"])


def _thinned(time: Array, interval: float) -> NDArray[np.int64]:
    """Epochs that are at least an interval apart [s]."""
    if interval <= 0.0 or not len(time):
        return np.arange(len(time))
    step = np.floor((time - time[0] + 1e-6) / interval)
    return np.flatnonzero(np.diff(step, prepend=-1.0) > 0.0)


# --- estimates as differences to the truth ------------------------------------------------------------


def _base(name: str, recording: Recording, n: int) -> Array:
    """What a vector of the states is kept relative to: the truth, or the last one that is known."""
    first = np.nan_to_num(getattr(recording.initial_truth, name)[:1])
    values = np.concatenate([first, getattr(recording.data.truth, name)[:n]])
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(n + 1)[:, None], 0), axis=0)
    return np.take_along_axis(values, last, axis=0)[1:]


def _differences(prefix: str, states: Trial | NavigationStates, recording: Recording) -> dict[str, NDArray[Any]]:
    found = {}
    for name in _VECTORS:
        values = getattr(states, name)
        offset = values - _base(name, recording, len(values))
        for column in _ANGLES[name]:
            offset[:, column] -= 2.0 * np.pi * np.round(offset[:, column] / (2.0 * np.pi))
        found[f"{prefix}{name}"] = offset.astype(np.float32)
    return found


def _vectors(prefix: str, arrays: Mapping[str, NDArray[Any]], recording: Recording, n: int) -> dict[str, Array]:
    """The vectors of the states; empty where none were kept."""
    if f"{prefix}position" not in arrays:
        return {}
    return {name: _base(name, recording, n) + arrays[f"{prefix}{name}"] for name in _VECTORS}


# --- files --------------------------------------------------------------------------------------------


def _write(path: Path, arrays: Mapping[str, NDArray[Any]], facts: Mapping[str, Any]) -> None:
    """Arrays with their first bytes together, then their second ones, and so on: that packs floats better."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = []
    for name, array in arrays.items():
        values = np.ascontiguousarray(np.moveaxis(array, 0, -1))  # what follows in time is neighbours
        data = values.reshape(-1).view(np.uint8).reshape(-1, values.itemsize).T.tobytes()
        rows.append({"name": name, "type": values.dtype.str, "shape": list(values.shape), "data": data})
    columns = [("name", pa.string()), ("type", pa.string()), ("shape", pa.list_(pa.int64())), ("data", pa.binary())]
    schema = pa.schema(columns, metadata={"simnav_trial": _FORMAT, "facts": json.dumps(facts)})
    with atomic(path) as file:
        pq.write_table(
            pa.Table.from_pylist(rows, schema), file, compression="zstd", use_dictionary=False, write_page_checksum=True
        )


def _read(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with open(path, "rb") as source:
            table = pq.ParquetFile(source, page_checksum_verification=True).read()
    except pa.ArrowException as error:
        raise ValueError(str(error)) from None
    metadata = table.schema.metadata or {}
    if metadata.get(b"simnav_trial") != _FORMAT.encode():
        raise ValueError("it was not written by this version of simnav")
    arrays = {}
    for row in table.to_pylist():
        kind = np.dtype(row["type"])
        data = np.frombuffer(row["data"], dtype=np.uint8).reshape(kind.itemsize, -1).T
        values = np.ascontiguousarray(data).reshape(-1).view(kind).reshape(row["shape"])
        arrays[row["name"]] = np.moveaxis(values, -1, 0)
    return arrays, json.loads(metadata[b"facts"])
