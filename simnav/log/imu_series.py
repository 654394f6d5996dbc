"""The IMU of a log: from the columns of a file, or of two files with two clocks, to means over intervals."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from simnav.log.channel import check_cells, open_file, turn_to_vessel
from simnav.log.files import Column
from simnav.log.spec import LogImuSpec, RecordedSpec
from simnav.log.table import LogError, LogWarning
from simnav.log.time_units import SLOWEST_IMU, unit_to_write
from simnav.log.units import dimension, factor
from simnav.types import Array

__all__ = ["ImuSeries", "read_imu"]

#: A hole is counted in a warning above this [s], and above twice the usual spacing.
_NOTICED = 0.1
#: The longest hole that is bridged by default: this [s], or so many times the usual spacing.
_LEAST_GAP, _SPACINGS = 1.0, 10.0
#: No IMU of a vessel measures more [rad/s, m/s^2].
_LARGEST = {"angular rate": 1e3, "specific force": 1e4}
#: Mean specific force of a vessel [m/s^2], within the errors of a poor IMU.
_PULL = (9.4, 10.2)


@dataclass(frozen=True, eq=False)
class ImuSeries:
    """n IMU samples as means over successive intervals.

    Attributes
    ----------
    source : str
        File (and sentence), for messages.
    edge : (n + 1,) array
        Ends of the intervals, on the clock of the log [s].
    mean : (n, 6) array
        Angular rate [rad/s], specific force [m/s^2]; forward, starboard, down.
    """

    source: str
    edge: Array
    mean: Array


def read_imu(spec: RecordedSpec, imu: LogImuSpec, recording: str) -> ImuSeries:
    """Read the IMU of a recording, converted to means over intervals, in the axes of the vessel.

    Raises
    ------
    LogError
        As `simnav.log.channel.read_channel`; or if there is a hole longer than ``max_gap``, or the mean specific force
        is nowhere near gravity, pointing up.
    """
    rate_columns, force_columns = imu.angular_rate, imu.specific_force
    units = (imu.angular_rate_unit,) * 3 + (imu.specific_force_unit,) * 3
    if imu.specific_force_file is None:
        whole = _means(spec, imu, imu.file, recording, (*rate_columns, *force_columns), units)
    else:
        rate = _means(spec, imu, imu.file, recording, rate_columns, units[:3])
        force = _means(spec, imu, imu.specific_force_file, recording, force_columns, units[3:])
        whole = _together(rate, force)
    force_mean = whole.mean[:, 3:].mean(axis=0)
    if not 8.0 < float(np.linalg.norm(force_mean)) < 12.0:
        raise LogError(
            f"{whole.source}: the mean specific force is {np.linalg.norm(force_mean):.4g} m/s^2 where gravity is 9.8; "
            + _right(float(np.linalg.norm(force_mean)), float(np.median(np.diff(whole.edge))), imu)
        )
    mean = whole.mean
    if any(imu.mounting):
        mean = np.hstack([turn_to_vessel(mean[:, :3], imu.mounting), turn_to_vessel(mean[:, 3:], imu.mounting)])
    down = float(mean[:, 5].mean())
    if down > 4.0:
        raise LogError(
            f"{whole.source}: the mean specific force points down ({down:.4g} m/s^2), but at rest it points up; "
            f"the third axis is down: put a minus before {imu.specific_force[2]!r} (and check the others), or give "
            "mounting_deg"
        )
    return ImuSeries(whole.source, whole.edge, mean)


def _right(size: float, spacing: float, imu: LogImuSpec) -> str:
    """What to write where a mean specific force is no gravity: the one unit, or increments, with which it is one."""
    raw = size / factor(imu.specific_force_unit) * (spacing if imu.samples == "increments" else 1.0)
    plain = "instantaneous" if imu.samples == "increments" else imu.samples
    tried = {(plain, unit): raw * factor(unit) for unit in ("m_s2", "g", "mg")} | {("increments", "m_s"): raw / spacing}
    fits = [key for key, value in tried.items() if _PULL[0] < value < _PULL[1]]
    if len(fits) != 1:
        return f"check specific_force_unit = {imu.specific_force_unit!r} and samples = {imu.samples!r}"
    samples, unit = fits[0]
    lines = [f"specific_force_unit = {unit!r}"]
    if samples != imu.samples:
        angle = {"rad_s": "rad", "deg_s": "deg"}
        other = {v: k for k, v in angle.items()} if imu.samples == "increments" else angle
        rate = other.get(imu.angular_rate_unit, imu.angular_rate_unit)
        lines = [f"samples = {samples!r}", *lines, f"angular_rate_unit = {rate!r}"]
    return f"it is with {', '.join(lines)} of [log.imu]: write that"


def _means(
    spec: RecordedSpec, imu: LogImuSpec, key: str, recording: str, columns: tuple[Column, ...], units: tuple[str, ...]
) -> ImuSeries:
    """The means of some columns of one file; ``mean`` has a column for each of them."""
    table, time, rows = open_file(spec, key, recording, where=imu.where)
    raw = np.empty((len(rows), len(columns)))
    for i, (column, unit) in enumerate(zip(columns, units, strict=True)):
        sign, values = table.column(column)
        raw[:, i] = sign * values[rows] * factor(unit)
        rate = dimension(unit) == "angular rate" or dimension(unit) == "angle"
        name = "angular rate" if rate else "specific force"
        check_cells(raw[:, i], _LARGEST[name], factor(unit), column, table, rows, name)
        bad = np.flatnonzero(~np.isfinite(raw[:, i]))
        if bad.size and (imu.samples == "increments" or bad.size == len(rows)):
            raise LogError(
                f"{table.source}, line {table.line[rows[bad[0]]]}, column {column!r}: the value is missing"
                + ("; an increment that is missing cannot be replaced" if bad.size < len(rows) else " in every row")
            )
    given = np.isfinite(raw).all(axis=1)
    if not given.all():
        warnings.warn(
            f"{table.source}: {np.sum(~given)} of {len(rows)} rows without a value of the IMU are left out, the first "
            f"is line {table.line[rows[~given][0]]}",
            LogWarning,
            4,
        )
        rows, raw = rows[given], raw[given]
    time = time[rows]
    if len(time) < 2:
        raise LogError(f"{table.source}: {len(time)} row is too short for an IMU")
    interval = np.diff(time)
    spacing = float(np.median(interval))
    if spacing > (1.0 + 1e-3) / SLOWEST_IMU:
        right = unit_to_write(spec.files[key], time, (), inertial=True)
        raise LogError(
            f"{table.source}: the IMU would have {1.0 / spacing:.4g} Hz, where {SLOWEST_IMU:g} Hz is the least; "
            + (f"its times are probably in a smaller unit: write {right} of its file" if right else "check its times")
        )
    longest = max(_LEAST_GAP, _SPACINGS * spacing) if imu.max_gap is None else imu.max_gap
    k = int(np.argmax(interval))
    if interval[k] > longest:
        raise LogError(
            f"{table.source}, line {table.line[rows[k + 1]]}: {interval[k]:.3f} s without the IMU, where {longest:g} s "
            f"are bridged; allow it (max_gap_s of [log.imu]) or leave out the part before (skip_rows of its file)"
        )
    holes = np.flatnonzero(interval > max(_NOTICED, 2.0 * spacing))
    if holes.size:
        warnings.warn(
            f"{table.source}: the IMU has {holes.size} holes, together {interval[holes].sum():.3g} s, the longest of "
            f"{interval[k]:.3g} s before line {table.line[rows[k + 1]]}; each is bridged with the value of the row "
            "after it (max_gap_s of [log.imu])",
            LogWarning,
            4,
        )
    if imu.samples == "instantaneous":
        return ImuSeries(table.source, time, 0.5 * (raw[1:] + raw[:-1]))
    interval = np.concatenate([[spacing], interval])
    edge = np.concatenate([[time[0] - spacing], time])
    return ImuSeries(table.source, edge, raw / interval[:, None] if imu.samples == "increments" else raw)


def _together(rate: ImuSeries, force: ImuSeries) -> ImuSeries:
    """Angular rate and specific force on the intervals of the former, where both are there.

    The integral of the specific force is interpolated, so that no increment is lost.
    """
    inside = (rate.edge >= force.edge[0] - 1e-9) & (rate.edge <= force.edge[-1] + 1e-9)
    edge = rate.edge[inside]
    if len(edge) < 3:
        raise LogError(
            f"{rate.source} ({rate.edge[0]:.3f} to {rate.edge[-1]:.3f} s) and {force.source} ({force.edge[0]:.3f} to "
            f"{force.edge[-1]:.3f} s) have no time in common; check time_unit, scale and offset_s of the two files"
        )
    first = int(np.flatnonzero(inside)[0])
    integral = np.zeros((len(force.edge), 3))
    np.cumsum(force.mean * np.diff(force.edge)[:, None], axis=0, out=integral[1:])
    moved = np.stack([np.interp(edge, force.edge, column) for column in integral.T], axis=-1)
    mean = np.hstack([rate.mean[first : first + len(edge) - 1], np.diff(moved, axis=0) / np.diff(edge)[:, None]])
    return ImuSeries(f"{rate.source} and {force.source}", edge, mean)
