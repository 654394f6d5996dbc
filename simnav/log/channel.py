"""From files to series in SI units: which recording, which columns, which sign, unit and clock."""

from __future__ import annotations

import math
import os
import re
import warnings
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.rotation import wrap_angle
from simnav.kinds import Component, Kind, geodetic_components, speed_components
from simnav.log.files import FileSpec
from simnav.log.reader import READERS
from simnav.log.spec import ChannelSpec, LogImuSpec, OriginSpec, RecordedSpec
from simnav.log.table import LogError, LogWarning, Table, check_ascending
from simnav.log.units import DIMENSIONS, LOG_UNITS, dimension
from simnav.types import KINDS, Array

__all__ = ["ImuSeries", "Series", "geodetic_from_local", "list_recordings", "locate", "read_channel", "read_imu"]

#: The parts of the reference; instruments are in `KINDS`.
_REFERENCE = {
    "position": Kind("position", "fix", geodetic_components(height=True), geodetic=True),
    "velocity": Kind(
        "velocity",
        "velocity",
        speed_components("velocity_north", "velocity_east", "velocity_down"),
        log_columns=("velocity_north", "velocity_east", "=nan"),
    ),
    "attitude": Kind(
        "attitude",
        "other",
        tuple(Component(angle, "deg", cyclic=True) for angle in ("roll", "pitch", "yaw")),
        log_columns=("roll", "pitch", "heading"),
    ),
}
_GTSAM = "gtsam:"


@dataclass(frozen=True, eq=False)
class Series:
    """n measurements of d components, in SI units and radians.

    Attributes
    ----------
    source : str
        File (and sentence), for messages.
    time : (n,) array
        On the clock of the log [s].
    value : (n, d) array
        The measurements.
    line : (n,) int array
        Line in the file.
    """

    source: str
    time: Array
    value: Array
    line: NDArray[np.int64]


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


def _root(folder: str) -> Path:
    """The folder of a log below the data root."""
    base = os.environ.get("SIMNAV_DATA")
    if base is not None:
        path = Path(base) / folder
        if not path.is_dir():
            raise LogError(f"{path}: there is no such folder (SIMNAV_DATA = {base!r})")
        return path
    path = Path("data") / folder
    if not path.is_dir():
        raise LogError(
            f"the folder {folder!r} of recordings is not in ./data; set the environment variable SIMNAV_DATA to the "
            f"folder that holds it"
        )
    return path


def locate(spec: RecordedSpec, file: FileSpec, recording: str) -> Path:
    name = file.path.replace("{recording}", recording)
    if not spec.folder.startswith(_GTSAM):
        return _root(spec.folder) / name
    return _gtsam_file(spec.folder.removeprefix(_GTSAM) + name)


@lru_cache(maxsize=64)
def _gtsam_file(name: str) -> Path:
    import gtsam

    try:
        return Path(gtsam.findExampleDataFile(name))  # type: ignore[no-untyped-call]
    except (RuntimeError, ValueError) as error:
        raise LogError(f"gtsam has no example data file {name!r}: {error}") from None


def list_recordings(spec: RecordedSpec) -> tuple[str, ...]:
    """Names of the recordings of a log; ``("",)`` where the paths have no ``{recording}``.

    Raises
    ------
    LogError
        If the folder is absent, or nothing in it fits.
    """
    if not isinstance(spec.recordings, str):
        return spec.recordings
    patterns = [f.path for f in spec.files.values() if "{recording}" in f.path]
    if not patterns:
        return ("",)
    if spec.folder.startswith(_GTSAM):
        raise LogError(f"[log] folder = {spec.folder!r}: name the recordings; a pattern needs a folder")
    root, pattern = _root(spec.folder), patterns[0]
    before, _, after = pattern.partition("{recording}")
    name = re.compile(re.escape(before) + "(.+)" + re.escape(after.replace("{recording}", "")))
    found = []
    for path in root.glob(before + spec.recordings + after.replace("{recording}", "*")):
        match = name.fullmatch(path.relative_to(root).as_posix())
        if match:
            found.append(match.group(1))
    if not found:
        raise LogError(f"{root}: no file fits {pattern!r} with recordings = {spec.recordings!r}")
    # Runs of digits in the order of the numbers: 2 before 10.
    return tuple(
        sorted(found, key=lambda n: [(not p.isdigit(), int(p) if p.isdigit() else 0, p) for p in re.split(r"(\d+)", n)])
    )


def _offset(spec: RecordedSpec, file: FileSpec, recording: str) -> float:
    if not isinstance(file.offset, tuple):
        return file.offset
    names = list_recordings(spec)
    if len(file.offset) != len(names):
        raise LogError(
            f"the file {file.path!r} has {len(file.offset)} offsets for {len(names)} recordings ({', '.join(names)}); "
            f"give one, or one for each"
        )
    return file.offset[names.index(recording)]


def _open(
    spec: RecordedSpec, key: str, recording: str, sentence: str | None = None, talker: str | None = None
) -> tuple[Table, Array, NDArray[np.int64]]:
    """Table, times of its rows on the clock of the log, and the rows that count."""
    file = spec.files[key]
    reader = READERS.get(file.format)
    assert reader is not None  # `RecordedSpec`
    found = reader.read(locate(spec, file, recording), file, sentence, talker)
    table = found.table
    counts = np.arange(len(table)) if found.counts is None else found.counts
    check_ascending(found.time[counts], Table(table.source, {}, table.line[counts]), found.clock)
    if file.spacing is not None:
        stamps = np.arange(found.first, found.first + len(table)) * file.spacing
    else:
        stamps = found.time * file.scale
    return table, np.asarray(stamps + _offset(spec, file, recording), dtype=np.float64), counts


def read_channel(spec: RecordedSpec, channel: ChannelSpec, what: str, recording: str) -> Series:
    """Read one channel of a recording.

    Parameters
    ----------
    spec : RecordedSpec
        The ``[log]`` table.
    channel : ChannelSpec
        Where in the files the values are, and in which units.
    what : str
        Key of `KINDS`, or ``position``, ``velocity`` or ``attitude`` of the reference.
    recording : str
        Name of the recording; it takes the place of ``{recording}`` in paths.

    Returns
    -------
    Series
        With the components of `KINDS`, or of the reference; angles of attitude in [-pi, pi).

    Raises
    ------
    LogError
        If a file, sentence or column is missing, a cell is not a number, times do not ascend, or a value is impossible
        (mostly a wrong unit).
    """
    kind = _REFERENCE.get(what) or KINDS[what]
    names = kind.values
    table, time, rows = _open(spec, channel.file, recording, channel.sentence, channel.talker)
    rows = rows[:: channel.every]
    if channel.hold_out is not None:
        rows = np.delete(rows, np.s_[:: channel.hold_out])
    columns = channel.columns or kind.log_columns or names
    if len(columns) != len(names):
        raise LogError(
            f"{table.source}: {what} needs {len(names)} columns ({', '.join(names)}), but {len(columns)} are given"
        )
    units = (
        (channel.units,) * len(columns) if isinstance(channel.units, str) else channel.units or ("1",) * len(columns)
    )
    _check_units(table.source, what, kind, columns, units, local=channel.frame != "geodetic")
    value = np.empty((len(rows), len(names)))
    given = np.ones(len(rows), dtype=bool)
    for i, (column, unit) in enumerate(zip(columns, units, strict=True)):
        sign, values = table.column(column)
        value[:, i] = sign * values[rows] * LOG_UNITS[unit]
        if not (isinstance(column, str) and column.startswith("=")):
            given &= np.isfinite(value[:, i])
    if not given.all():
        first = table.line[rows][~given][0]
        message = f"{table.source}: {np.sum(~given)} rows without {what} are left out, the first is line {first}"
        warnings.warn(message, LogWarning, 2)
        rows, value = rows[given], value[given]
    if len(rows) == 0:
        raise LogError(f"{table.source}: there is no {what} in it")
    if channel.frame != "geodetic":
        assert spec.origin is not None
        if not kind.geodetic:
            raise LogError(f"{table.source}: frame = {channel.frame!r} is for positions, and {what} is none")
        value = geodetic_from_local(value, spec.origin, channel.frame)[:, : len(names)]
    _check_range(value, kind, columns, table, rows)
    for i, component in enumerate(kind.components):
        if component.cyclic and not (kind.geodetic and i < 2):
            value[:, i] = wrap_angle(value[:, i])
    return Series(table.source, time[rows], value, table.line[rows])


def _check_units(
    source: str, what: str, kind: Kind, columns: tuple[int | str, ...], units: tuple[str, ...], *, local: bool
) -> None:
    """LogError where the unit of a column is of another dimension than what it holds; "1" is SI and always fits."""
    for component, column, unit in zip(kind.components, columns, units, strict=True):
        own = "m" if local and kind.geodetic else component.unit
        wanted = dimension(own)
        if unit != "1" and dimension(unit) != wanted:
            right = f"a unit of {wanted} is wanted ({', '.join(DIMENSIONS[wanted])})" if wanted else f"it is in {own!r}"
            raise LogError(f"{source}, column {column!r}: {component.name} of {what} in {unit!r}; {right}")


def _check_range(
    value: Array, kind: Kind, columns: tuple[int | str, ...], table: Table, rows: NDArray[np.int64]
) -> None:
    """LogError where an angle is larger than it can be in radians."""
    for i, component in enumerate(kind.components):
        if component.unit != "deg":
            continue
        limit = 2.0 * math.pi if component.cyclic else component.limit
        bad = np.flatnonzero(np.abs(value[:, i]) > limit + 1e-9)
        if bad.size:
            raise LogError(
                f"{table.source}, line {table.line[rows[bad[0]]]}, column {columns[i]!r}: {component.name} would be "
                f"{value[bad[0], i]:.6g} rad; is its unit 'deg'?"
            )


def read_imu(spec: RecordedSpec, imu: LogImuSpec, recording: str) -> ImuSeries:
    """Read the IMU of a recording, converted to means over intervals.

    Raises
    ------
    LogError
        As `read_channel`; or if there is a hole longer than ``max_gap``, or the mean specific force is nowhere near
        gravity, pointing up.
    """
    table, time, rows = _open(spec, imu.file, recording)
    raw = np.empty((len(rows), 6))
    columns = (*imu.angular_rate, *imu.specific_force)
    units = (imu.angular_rate_unit,) * 3 + (imu.specific_force_unit,) * 3
    for i, (column, unit) in enumerate(zip(columns, units, strict=True)):
        sign, values = table.column(column)
        raw[:, i] = sign * values[rows] * LOG_UNITS[unit]
        bad = np.flatnonzero(~np.isfinite(raw[:, i]))
        if bad.size:
            raise LogError(f"{table.source}, line {table.line[rows[bad[0]]]}, column {column!r}: the value is missing")
    time = time[rows]
    if len(time) < 2:
        raise LogError(f"{table.source}: {len(time)} row is too short for an IMU")
    interval = np.diff(time)
    holes = np.flatnonzero(interval > imu.max_gap)
    if holes.size:
        k = int(holes[0])
        raise LogError(
            f"{table.source}, line {table.line[rows[k + 1]]}: {interval[k]:.3f} s without the IMU; leave out the part "
            f"before (skip_rows of its file) or allow it (max_gap_s of [log.imu], now {imu.max_gap:g})"
        )
    if imu.samples == "instantaneous":
        edge, mean = time, 0.5 * (raw[1:] + raw[:-1])
    else:
        interval = np.concatenate([[np.median(interval)], interval])
        edge = np.concatenate([[time[0] - interval[0]], time])
        mean = raw / interval[:, None] if imu.samples == "increments" else raw
    force = mean[:, 3:].mean(axis=0)
    if not 8.0 < float(np.linalg.norm(force)) < 12.0:
        raise LogError(
            f"{table.source}: the mean specific force is {np.linalg.norm(force):.4g} m/s^2 where gravity is 9.8; check "
            f"specific_force_unit = {imu.specific_force_unit!r} and samples = {imu.samples!r}"
        )
    if force[2] > 4.0:
        raise LogError(
            f"{table.source}: the mean specific force points down ({force[2]:.4g} m/s^2), but at rest it points up; "
            f"the third axis is down: put a minus before {imu.specific_force[2]!r} (and check the others)"
        )
    return ImuSeries(table.source, edge, mean)


def geodetic_from_local(value: Array, origin: OriginSpec, frame: str) -> Array:
    """Geodetic positions of points in a Cartesian frame that is tangent to the ellipsoid's normal at its origin.

    Parameters
    ----------
    value : (n, 3) array
        East, north, up or north, east, down [m].
    origin : OriginSpec
        Geodetic position of the origin of the frame.
    frame : {"enu", "ned"}
        Order of the components of ``value``: east, north, up or north, east, down.

    Returns
    -------
    (n, 3) array
        Latitude, longitude [rad], height [m]. Through Earth-centred coordinates (Groves eqs. 2.112, 2.113), so without
        a flat-Earth error.
    """
    from simnav.geometry.earth import ECCENTRICITY_SQUARED, principal_radii

    north, east, down = (value[:, 1], value[:, 0], -value[:, 2]) if frame == "enu" else value.T
    sl, cl = math.sin(origin.latitude), math.cos(origin.latitude)
    so, co = math.sin(origin.longitude), math.cos(origin.longitude)
    radius = float(principal_radii(origin.latitude)[1])
    x = (radius + origin.height) * cl * co - sl * co * north - so * east - cl * co * down
    y = (radius + origin.height) * cl * so - sl * so * north + co * east - cl * so * down
    z = (radius * (1.0 - ECCENTRICITY_SQUARED) + origin.height) * sl + cl * north - sl * down
    rho = np.hypot(x, y)
    latitude = np.full_like(rho, origin.latitude)
    for _ in range(10):  # contracts by e^2 = 0.007 a pass
        n = principal_radii(latitude)[1]
        latitude = np.arctan2(z + ECCENTRICITY_SQUARED * n * np.sin(latitude), rho)
    n = principal_radii(latitude)[1]
    s, c = np.sin(latitude), np.cos(latitude)
    height = rho * c + z * s - n * (1.0 - ECCENTRICITY_SQUARED * s * s)
    return np.stack([latitude, np.arctan2(y, x), height], axis=-1)
