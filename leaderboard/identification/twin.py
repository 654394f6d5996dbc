"""A log's twin: a scenario of simulated voyages along the log's track, with the errors of its instruments.

- Motion: the reference of the log (of a simulated one the truth), as smooth as its own noise allows: a cubic smoothing
  spline, whose smoothness generalised cross-validation finds (P. Craven and G. Wahba, "Smoothing noisy data with spline
  functions", Numerische Mathematik 31, 1979). Angles that the reference lacks are those of the plain row.
- Errors of an instrument that was measured beside a reference: the processes that fit its readings less the reference
  (`simnav.leaderboard.realism.fit`). They take the place of all its other errors, which are in these differences. A
  part of the error of a speed that is fixed to the Earth is apart (`earth_fixed`), and its fast error is split by speed
  and turn rate (`motion_shares`). With several recordings each run draws sizes between those of the recordings.
- All other errors: as `simnav.leaderboard.identification.report.identify` found them.
- Faults that are laid over the log stay.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from simnav.estimator import make
from simnav.kinds import BODY_VELOCITY, WATER_SPEED
from simnav.leaderboard.realism.features import on_grid
from simnav.leaderboard.realism.fit import fitted_apart
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.scenario.residuals import ErrorSeries, residuals
from simnav.scenario.writing import toml_text
from simnav.sensors import AidSpec
from simnav.source import open_source
from simnav.spec import SpecError
from simnav.trial import run_trial
from simnav.types import Array

from .earth_fixed import earth_fixed
from .motion_shares import motion_shares
from .report import Identification

__all__ = ["Twin", "twin_of"]

#: Fewer poses are no track, and from so many recordings on sizes are drawn between theirs.
_LEAST, _SEVERAL = 8, 3
#: Readings are lost where at least this share is missing.
_LOST = 0.02
#: What a vessel on the track may do [m/s], [m/s^2], [deg/s]; the motion was real.
_LIMITS = {"max_speed_m_s": 100.0, "max_acceleration_m_s2": 30.0, "max_turn_rate_deg_s": 180.0}
#: What a table of an instrument says of its errors, beside the sizes that end in a unit.
_ERRORS = ("sigma", "bias", "bias_instability", "scale", "misalignment", "speed_noise", "fixed_bias", "fixed_scale",
           "fixed_misalignment", "correlation_time", "deviation", "fixed_deviation")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Twin:
    """The twin of a log.

    Attributes
    ----------
    table : mapping
        The scenario; its track is the file ``NAME.csv`` beside it.
    track : (n, 7) array
        Time [s], latitude, longitude [deg], height [m], roll, pitch, heading [deg].
    from_reference : list of str
        Instruments whose errors were fitted to the differences from the reference.
    files : tuple of Path
        The files that were written.
    """

    table: dict[str, Any]
    track: Array
    from_reference: list[str]
    files: tuple[Path, ...] = ()

    def save(self, path: Path) -> Twin:
        """Write the scenario, and the track beside it; the twin with its files.

        Raises
        ------
        SpecError
            If the scenario cannot be simulated.
        """
        track = path.with_suffix(".csv")
        rows = [
            ",".join(("time_s", "latitude_deg", "longitude_deg", "height_m", "roll_deg", "pitch_deg", "heading_deg"))
        ]
        rows += [f"{t:.6f},{a:.10f},{b:.10f},{h:.5f},{r:.6f},{p:.6f},{y:.6f}" for t, a, b, h, r, p, y in self.track]
        track.write_text("\n".join(rows) + "\n", encoding="utf-8")
        table = {**self.table, "vessel": {**self.table["vessel"], "file": track.name}}
        path.write_text(toml_text(table), encoding="utf-8")
        open_source(load(path), 0)
        return replace(self, files=(path, track))


def _smooth(time: Array, value: Array) -> Array:
    """(n, k) columns without their noise."""
    from scipy.interpolate import make_smoothing_spline

    middle, size = value.mean(axis=0), value.std(axis=0)
    columns = [
        make_smoothing_spline(time, (x - m) / s)(time) * s + m if s > 0.0 else x
        for x, m, s in zip(value.T, middle, size, strict=True)
    ]
    return np.stack(columns, axis=-1)


def _track(recording: Recording) -> Array:
    """The poses; see `Twin`.

    Raises
    ------
    SpecError
        If the reference has too few positions.
    """
    data, first = recording.data, recording.initial_truth
    time = np.append(0.0, data.truth.time)
    place = np.vstack([first.position[:1], data.truth.position])
    angles = np.vstack([first.attitude[:1], data.truth.attitude])
    if not np.isfinite(angles).all():
        trial = run_trial(make("ekf" if recording.instruments.imu is not None else "ship-ekf"), recording)
        own = np.vstack([recording.start.attitude, trial.attitude])
        angles = np.where(np.isfinite(angles).all(axis=0), angles, own)  # whole columns: two sources would jump
    known: Any = np.isfinite(place).all(axis=1) & np.isfinite(angles).all(axis=1)
    if known.sum() < _LEAST or not known[0]:
        raise SpecError(f"{recording.scenario}: the reference has {known.sum()} poses; a track needs {_LEAST} or more")
    time, place, angles = time[known], place[known], angles[known]
    place[:, 1] = np.unwrap(place[:, 1])
    whole = np.column_stack([place, np.unwrap(angles, axis=0)])
    if recording.note:  # a log, whose reference has noise
        whole = _smooth(time, whole)
    return np.column_stack([time, np.degrees(whole[:, :2]), whole[:, 2], np.degrees(whole[:, 3:])])


def _without_errors(table: dict[str, Any]) -> dict[str, Any]:
    """The table of an instrument without its errors."""
    return {k: v for k, v in table.items() if k != "error" and not any(_is(k, stem) for stem in _ERRORS)}


def _is(key: str, stem: str) -> bool:
    rest = key.removeprefix(stem)
    return rest != key and (not rest or rest in ("_m", "_m_s", "_deg", "_percent", "_s", "_nt"))


def _spread(series: Sequence[ErrorSeries]) -> tuple[float, float]:
    """The least and the largest size of the error in a recording, as parts of that of all."""
    size = np.array([np.sqrt(np.mean((s.error - s.error.mean(axis=0)) ** 2, axis=0)) for s in series])
    parts = size / np.sqrt(np.mean(size**2, axis=0))
    return float(np.mean(parts.min(axis=1))), float(np.mean(parts.max(axis=1)))


def _loss(series: Sequence[ErrorSeries]) -> dict[str, Any] | None:
    """The readings that are missing, as a process: their share, and the length of the bursts in which they are."""
    there = [on_grid(one)[1] for one in series]
    share = 1.0 - float(np.mean(np.concatenate(there)))
    if share < _LOST:
        return None
    bursts = sum(int(np.sum(one[:-1] & ~one[1:])) for one in there)
    length = sum(int(np.sum(~one)) for one in there) / max(bursts, 1)
    # Of the Markov chain: the chance that the next is missing too is share + (1 - share) exp(-dt / (mean (1 - share))).
    again = max((1.0 - 1.0 / length - share) / (1.0 - share), 1e-3)
    mean = -1.0 / (series[0].rate * (1.0 - share) * np.log(again))
    return {"kind": "loss", "probability": round(share, 4), "mean_s": float(f"{mean:.3g}")}


def _errors(table: dict[str, Any], name: str, scenario: Scenario) -> dict[str, Any] | None:
    """The table of an instrument with the processes that fit its differences from the reference; None without one."""
    log = scenario.log
    if log is None or log.instruments[name].source == "reference" or scenario.aids[name].channels():
        return None
    try:
        series = residuals(scenario, name)
    except SpecError:  # the reference lacks what predicts the reading
        return None
    if not series or min(len(s.time) for s in series) < 60:
        return None
    processes = _processes(series, name, scenario.aids[name])
    if len(series) >= _SEVERAL:
        processes["error"] = [_drawn(one, *_spread(series)) for one in processes.get("error", [])]
    if loss := _loss(series):
        processes.setdefault("error", []).append(loss)
    return {**_without_errors(table), "rate_hz": float(f"{series[0].rate:.4g}"), **processes}


def _processes(series: Sequence[ErrorSeries], name: str, spec: AidSpec) -> dict[str, Any]:
    """The keys of an instrument's errors; the fast error of a speed in parts that grow with the motion."""
    kind = spec.definition
    key, speed = f"sigma_{kind.components[0].error_unit}", kind.equation in (BODY_VELOCITY, WATER_SPEED)
    fixed = earth_fixed(series) if speed else None
    series, slow = (series, []) if fixed is None else (fixed.rest, fixed.processes(key, len(kind.components)))
    found: dict[str, Any] = tomllib.loads(fitted_apart(series).to_toml(name, kind))["instruments"][name]
    shares = motion_shares(series) if speed else None
    if shares is None:
        return {**found, "error": [*found.get("error", []), *slow]} if slow else found
    count = len(shares)
    sizes = np.atleast_1d(found[key])
    white = [{"kind": "white", key: (sizes * row).tolist() if count > 1 else float(sizes[0])} for row in np.eye(count)]
    whole = [table for table in (*white, *found.get("error", [])) if np.any(table[key])]
    component = [int(np.argmax(np.atleast_1d(table[key]))) for table in whole]
    split = [
        part
        for k, share in enumerate(shares)
        for part in share.split([table for table, own in zip(whole, component, strict=True) if own == k], key)
    ]
    return {**found, key: (0.0 * sizes).tolist() if count > 1 else 0.0, "error": [*split, *slow]}


def _drawn(process: dict[str, Any], low: float, high: float) -> dict[str, Any]:
    """A process whose sizes each run draws."""

    def size(value: Any) -> Any:
        if isinstance(value, dict):  # drawn already
            return value
        return {"log_uniform": [float(f"{k * value:.3g}") for k in (low, high)]} if value > 0.0 else value

    return {
        k: ([size(x) for x in v] if isinstance(v, list) else size(v)) if k.startswith("sigma_") else v
        for k, v in process.items()
    }


def twin_of(scenario: Scenario, recording: Recording, found: Identification) -> Twin:
    """The twin of a log.

    Parameters
    ----------
    scenario : Scenario
        Of the log.
    recording : Recording
        The run whose motion the twin has.
    found : Identification
        Its error model.

    Raises
    ------
    SpecError
        If the reference has too few positions.
    """
    kept = {
        k: v for k, v in found.table.items() if k not in ("log", "start", "manoeuvre", "vessel", "sea", "draw", "dial")
    }
    instruments, from_reference = {}, []
    for name, table in kept["instruments"].items():
        new = None if name == "imu" else _errors(table, name, scenario)
        instruments[name] = table if new is None else new
        from_reference += [] if new is None else [name]
    track = _track(recording)
    table = {
        **kept,
        "name": f"{scenario.name}-twin",
        "version": 1,
        "title": f"Twin of {scenario.name}: its track and the errors of its instruments",
        "description": f"Simulated voyages along the track of {recording.note or scenario.id}, by simnav log twin.",
        "duration_s": float(np.floor(track[-1, 0] / recording.instruments.step + 1e-9) * recording.instruments.step),
        "vessel": {"kind": "pose_track", "file": "", **_LIMITS},
        "instruments": instruments,
    }
    return Twin(table, track, from_reference)
