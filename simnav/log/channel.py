"""From files to series in SI units: which recording, which columns, which sign, unit and clock."""

from __future__ import annotations

import json
import math
import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.rotation import dcm_from_quaternion, dcm_from_rpy, rpy_from_dcm, wrap_angle
from simnav.kinds import BODY_VELOCITY, Component, Kind, geodetic_components, speed_components
from simnav.log.files import Column, FileSpec
from simnav.log.reader import READERS
from simnav.log.row_filter import RowFilter
from simnav.log.same_time import settle
from simnav.log.spec import ChannelSpec, OriginSpec, RecordedSpec
from simnav.log.table import LogError, LogWarning, Table, check_ascending
from simnav.log.units import DIMENSIONS, dimension, factor
from simnav.log.variation import variation_along
from simnav.types import KINDS, Array

__all__ = [
    "Series",
    "check_cells",
    "geodetic_from_local",
    "list_recordings",
    "locate",
    "no_fix",
    "open_file",
    "read_channel",
    "skip_of",
    "turn_to_vessel",
]

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
#: A longitude is no larger [rad].
_TURN = 2.0 * math.pi
#: No angle in degrees is as large as this, taken as one in radians.
_DEGREES = 1e3
#: An angle that is larger is none in degrees.
_LARGEST_DEGREES = 361.0
#: No position is so far from its origin [m].
_FAR = 1e8
_APART = 3.0  # an impossible cell is larger than the largest possible one by this factor
#: A quaternion has the length 1, within this.
_UNIT_LENGTH = 0.1


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
    sigma : (n, d) array or None
        Standard deviations that the rows state, in the units of the error; NaN where a row states none. None: the
        channel has no columns of them.
    """

    source: str
    time: Array
    value: Array
    line: NDArray[np.int64]
    sigma: Array | None = None


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


def _of_recording(spec: RecordedSpec, value: float | tuple[float, ...], recording: str, what: str) -> float:
    """The value for a recording of a key that has one, or one for each."""
    if not isinstance(value, tuple):
        return value
    names = list_recordings(spec)
    if len(value) != len(names):
        raise LogError(
            f"{what} has {len(value)} values for {len(names)} recordings ({', '.join(names)}); "
            f"give one, or one for each"
        )
    return value[names.index(recording)]


def skip_of(spec: RecordedSpec, recording: str) -> float:
    """Time that is left out at the beginning of a recording [s].

    Raises
    ------
    LogError
        If the scenario has not one value for each recording.
    """
    return _of_recording(spec, spec.skip, recording, "skip_s of [log]")


def open_file(
    spec: RecordedSpec,
    key: str,
    recording: str,
    sentence: str | None = None,
    talker: str | None = None,
    where: str = "",
) -> tuple[Table, Array, NDArray[np.int64]]:
    """Open a file of a recording.

    Parameters
    ----------
    spec : RecordedSpec
        The ``[log]`` table.
    key : str
        The file, by its name in ``[log.files]``.
    recording : str
        Name of the recording.
    sentence, talker : str or None
        See `ChannelSpec`.
    where : str
        Condition on the rows that count.

    Returns
    -------
    Table, (n,) array, (m,) int array
        All rows, their times on the clock of the log [s], and the rows that count, with ascending times.

    Raises
    ------
    LogError
        If the file cannot be used, no row counts, or times do not ascend.
    """
    file = spec.files[key]
    reader = READERS.get(file.format)
    assert reader is not None  # `RecordedSpec`
    found = reader.read(locate(spec, file, recording), file, sentence, talker)
    table, time = found.table, found.time
    counts = np.arange(len(table)) if found.counts is None else found.counts
    if where:
        fits = RowFilter(where).rows(table)
        counts = counts[fits[counts]]
        if not len(counts):
            raise LogError(f"{table.source}: none of {len(table)} rows fulfils where = {where!r}")
    time, counts = settle(time, counts, table, file.same_time or ("first" if reader.sentences else "refuse"))
    check_ascending(time[counts], Table(table.source, {}, table.line[counts]), found.clock)
    if file.spacing is not None:
        stamps = np.arange(found.first, found.first + len(table)) * file.spacing
    else:
        stamps = time * file.scale
    offset = _of_recording(spec, file.offset, recording, f"offset_s of the file {file.path!r}")
    return table, np.asarray(stamps + offset, dtype=np.float64), counts


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
    table, time, rows = open_file(spec, channel.file, recording, channel.sentence, channel.talker, channel.where)
    time = time + channel.offset
    columns = _columns(channel, kind, table)
    quaternion = what == "attitude" and len(columns) == 4
    if len(columns) != len(names) and not quaternion:
        other = ", or the 4 of a quaternion (w, x, y, z)" if what == "attitude" else ""
        raise LogError(
            f"{table.source}: {what} needs {len(names)} columns ({', '.join(names)}){other}, but {len(columns)} are "
            "given"
        )
    if kind.geodetic and channel.frame == "geodetic":
        rows = _fixes(table, columns, rows, what)
    given_rows = len(rows)
    if channel.drop_repeated:  # before rows are chosen: else the reference has the fix of the estimator once more
        rows = _fresh(table, columns, rows)
    rows = rows[channel.first :: channel.every] if channel.hold_out is None else rows[:: channel.every]
    if channel.hold_out is not None:
        rows = np.delete(rows, np.s_[channel.first :: channel.hold_out])
    if given_rows and not len(rows):
        raise LogError(
            f"{table.source}: of its {given_rows} {'row' if given_rows == 1 else 'rows'} with {what} every = "
            f"{channel.every} and hold_out = {channel.hold_out} leave none; more rows are wanted"
        )
    units = (
        (channel.units,) * len(columns) if isinstance(channel.units, str) else channel.units or ("1",) * len(columns)
    )
    if not quaternion:
        _check_units(table.source, what, kind, columns, units, local=channel.frame != "geodetic")
    elif set(units) != {"1"}:
        raise LogError(f"{table.source}: units = {channel.units!r} of {what}: a quaternion has none; leave it out")
    value = np.empty((len(rows), len(columns)))
    given = np.ones(len(rows), dtype=bool)
    for i, (column, unit) in enumerate(zip(columns, units, strict=True)):
        sign, values = table.column(column)
        value[:, i] = sign * values[rows] * factor(unit)
        if not (isinstance(column, str) and column.startswith("=")):
            given &= np.isfinite(value[:, i])
    if not given.any() and kind.role == "heading" and "heading_magnetic" in table.columns:
        raise LogError(
            f"{table.source}: its heading is magnetic, and neither it nor another sentence of the file has a "
            "variation; give variation_deg, or variation_model = 'wmm'"
        )
    if not given.all():
        first = table.line[rows][~given][0]
        message = f"{table.source}: {np.sum(~given)} rows without {what} are left out, the first is line {first}"
        warnings.warn(message, LogWarning, 2)
        rows, value = rows[given], value[given]
    if len(rows) == 0:
        raise LogError(f"{table.source}: there is no {what} in it")
    if quaternion:
        value = _angles(value, columns, table, rows)
    if channel.frame != "geodetic" and kind.geodetic:
        if spec.origin is None:
            raise LogError(f"{table.source}: frame = {channel.frame!r} of {what} needs [log.origin]")
        for i, (column, unit) in enumerate(zip(columns, units, strict=True)):
            check_cells(value[:, i], _FAR, factor(unit), column, table, rows, "position")
        value = geodetic_from_local(value, spec.origin, channel.frame)[:, : len(names)]
    _check_range(value, kind, columns, units, table, rows)
    if channel.frame != "geodetic" and not kind.geodetic:
        value = _of_frame(value, kind, channel.frame, f"{table.source}: frame = {channel.frame!r}")
    if channel.variation is not None or channel.variation_model is not None:
        if kind.role != "heading":
            raise LogError(f"{table.source}: variation_deg and variation_model are for headings, and {what} is none")
        value = value + _variation(spec, channel, recording, time[rows])[:, None]
    if any(channel.mounting):
        value = _mounted(value, kind, channel.mounting, f"{table.source}: mounting_deg of {what}")
    for i, component in enumerate(kind.components):
        if component.cyclic and not (kind.geodetic and i < 2):
            value[:, i] = wrap_angle(value[:, i])
    sigma = _sigma(channel, kind, table, rows, what) if channel.sigma else None
    return Series(table.source, time[rows], value, table.line[rows], sigma)


def _angles(quaternion: Array, columns: Sequence[Column], table: Table, rows: NDArray[np.int64]) -> Array:
    """(n, 3) roll, pitch, yaw [rad] of (n, 4) quaternions, scalar first, that turn body axes to those of the frame."""
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.flatnonzero(~(np.abs(length - 1.0) < _UNIT_LENGTH))
    if bad.size:
        raise LogError(
            f"{table.source}, line {table.line[rows[bad[0]]]}: the quaternion in the columns "
            f"{', '.join(map(str, columns))} has the length {length[bad[0]]:.4g}, not 1; are these its columns "
            "(scalar, x, y, z)?"
        )
    return rpy_from_dcm(dcm_from_quaternion(quaternion / length[:, None]))


def no_fix(place: Array) -> NDArray[np.bool_]:
    """Which of (n, 2) latitudes and longitudes, in any unit, are no fixes.

    A receiver without a fix writes latitude 0 and longitude 0. A vessel that comes there also has fixes beside it.
    """
    zero = (place == 0.0).all(axis=1)
    away = np.abs(place[~zero]).sum(axis=1)
    away = away[np.isfinite(away)]
    return np.asarray(zero & bool(not len(away) or away.min() > 0.5 * np.median(away)), dtype=np.bool_)


def _fixes(table: Table, columns: Sequence[Column], rows: NDArray[np.int64], what: str) -> NDArray[np.int64]:
    """The rows that are fixes."""
    if any(isinstance(c, str) and c.startswith("=") for c in columns[:2]):
        return rows
    none = no_fix(np.stack([table.column(c)[1][rows] for c in columns[:2]], axis=-1))
    if not none.any():
        return rows
    if none.all():
        raise LogError(f"{table.source}: all {len(rows)} rows have latitude 0 and longitude 0: the receiver had no fix")
    warnings.warn(
        f"{table.source}: {none.sum()} of {len(rows)} rows of {what} have latitude 0 and longitude 0, so they are no "
        f"fixes and left out, the first is line {table.line[rows[none][0]]}",
        LogWarning,
        3,
    )
    return rows[~none]


def _fresh(table: Table, columns: Sequence[Column], rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """The rows whose values are not all those of the row before; rows without a value stay."""
    raw = np.stack([table.column(c)[1][rows] for c in columns], axis=-1)
    constant = [isinstance(c, str) and c.startswith("=") for c in columns]
    given = np.flatnonzero((np.isfinite(raw) | constant).all(axis=1))
    same = np.all(np.diff(raw[given], axis=0) == 0.0, axis=1, where=~np.array(constant))
    return np.delete(rows, given[1:][same])


def _sigma(channel: ChannelSpec, kind: Kind, table: Table, rows: NDArray[np.int64], what: str) -> Array:
    """(n, d) standard deviations that the rows state; NaN where they state none."""
    d = len(kind.components)
    if len(channel.sigma) not in (1, d):
        raise LogError(
            f"{table.source}: sigma of {what} has {len(channel.sigma)} columns; give one, or {d} "
            f"({', '.join(kind.errors)})"
        )
    units, times = channel.sigma_units or "1", channel.sigma_times
    found = np.empty((len(rows), d))
    for i, component in enumerate(kind.components):
        k = i if len(channel.sigma) > 1 else 0
        unit = units if isinstance(units, str) else units[k]
        wanted = dimension(component.error_unit)
        if unit.rpartition(" ")[2] != "1" and dimension(unit) != wanted:
            raise LogError(f"{table.source}, column {channel.sigma[k]!r}: sigma of {component.error} in {unit!r}; "
                           f"a unit of {wanted} is wanted")  # fmt: skip
        values = table.column(channel.sigma[k])[1][rows]
        found[:, i] = values * factor(unit) * (times[k] if isinstance(times, tuple) else times)
    none = ~(np.isfinite(found) & (found > 0.0)).all(axis=1)
    if none.all():
        raise LogError(f"{table.source}: no row of {what} has a standard deviation above 0 in {channel.sigma}")
    if none.any():
        message = (
            f"{table.source}: {none.sum()} of {len(rows)} rows of {what} state no standard deviation above 0 and have "
            f"that of the datasheet, the first is line {table.line[rows[none][0]]}"
        )
        warnings.warn(message, LogWarning, 3)
        found[none] = np.nan
    return found


def _columns(channel: ChannelSpec, kind: Kind, table: Table) -> tuple[Column, ...]:
    """The columns of a channel; where none are named those of the sentence, magnetic if a variation is added."""
    if channel.columns:
        return channel.columns
    magnetic = channel.variation is not None or channel.variation_model is not None
    if magnetic and kind.role == "heading" and "heading_magnetic" in table.columns:
        return ("heading_magnetic",)
    return kind.log_columns or kind.values


def _variation(spec: RecordedSpec, channel: ChannelSpec, recording: str, time: Array) -> Array:
    """(n,) magnetic variation at n times [rad], constant or along the reference by the model."""
    if channel.variation is not None:
        return np.full(len(time), channel.variation)
    track = read_channel(spec, spec.reference.position, "position", recording)
    return variation_along(track.time, track.value, time)


def turn_to_vessel(vectors: Array, mounting: Sequence[float]) -> Array:
    """(n, 3) vectors in the axes of the vessel, of vectors in the axes of an instrument.

    Parameters
    ----------
    vectors : (n, 3) array
        In the axes of the instrument.
    mounting : sequence of 3 floats
        Roll, pitch, yaw of the instrument relative to the vessel [rad].
    """
    return np.asarray(vectors @ dcm_from_rpy(np.asarray(mounting, dtype=np.float64)).T)


def _mounted(value: Array, kind: Kind, mounting: Sequence[float], label: str) -> Array:
    if kind.equation == BODY_VELOCITY:
        return turn_to_vessel(value, mounting)
    if kind.role == "heading" and value.shape[1] == 1 and not any(mounting[:2]):
        return value - mounting[2]
    raise LogError(
        f"{label}: it is for velocities in body axes, and for headings with roll and pitch 0; turn other values before"
    )


def _of_frame(value: Array, kind: Kind, frame: str, label: str) -> Array:
    """Headings, or roll, pitch and yaw, of axes forward, left, up in east, north, up: in those of simnav."""
    cyclic = [c.cyclic for c in kind.components]
    if frame != "enu" or not all(cyclic) or len(cyclic) not in (1, 3):
        raise LogError(f"{label} is for positions, headings and attitudes ('enu'); {kind.quantity} is none of them")
    turned = value.copy()
    turned[:, -1] = 0.5 * np.pi - value[:, -1]
    if len(cyclic) == 3:
        turned[:, 1] = -value[:, 1]
    return turned


def _check_units(
    source: str, what: str, kind: Kind, columns: tuple[int | str, ...], units: tuple[str, ...], *, local: bool
) -> None:
    """LogError where the unit of a column is of another dimension than what it holds; "1" is SI and always fits."""
    for component, column, unit in zip(kind.components, columns, units, strict=True):
        own = "m" if local and kind.geodetic else component.unit
        wanted = dimension(own)
        if unit.rpartition(" ")[2] != "1" and dimension(unit) != wanted:
            right = f"a unit of {wanted} is wanted ({', '.join(DIMENSIONS[wanted])})" if wanted else f"it is in {own!r}"
            raise LogError(f"{source}, column {column!r}: {component.name} of {what} in {unit!r}; {right}")


def check_cells(
    value: Array, limit: float, scale: float, column: Column, table: Table, rows: NDArray[np.int64], name: str
) -> None:
    """LogError where a few of n values are larger than possible, and far from the others: no wrong unit of all.

    Parameters
    ----------
    value : (n,) array
        In SI units.
    limit : float
        The largest possible one (SI).
    scale : float
        Factor of the unit of the cells to SI.
    column, table, rows, name
        For messages: the column, its table, which rows the values are of, and what they are.
    """
    size = np.abs(value)
    bad = np.flatnonzero(size > limit)
    if not 0 < 2 * bad.size <= len(value) or size[bad].min() < _APART * size[size <= limit].max():
        return
    plain, most = str(column).removeprefix("-"), abs(limit / scale)
    cell = value[bad[0]] / scale * (-1.0 if plain != str(column) else 1.0)
    more = f" and {bad.size - 1} more" if bad.size > 1 else ""
    raise LogError(
        f"{table.source}, line {table.line[rows[bad[0]]]}{more}, column {plain!r}: {cell:.6g} is no "
        f"possible {name}, the other rows have one; leave it out: where = '-{most:.6g} < `{plain}` < {most:.6g}'"
    )


def _check_range(
    value: Array,
    kind: Kind,
    columns: tuple[int | str, ...],
    units: tuple[str, ...],
    table: Table,
    rows: NDArray[np.int64],
) -> None:
    """LogError where an angle is larger than it can be in radians, or a cell than anything of its kind."""
    for i, component in enumerate(kind.components):
        cells = i < len(columns) == len(kind.components)
        scale = factor(units[i]) if cells else 1.0
        if component.unit != "deg":
            if cells:
                check_cells(value[:, i], component.limit, scale, columns[i], table, rows, component.name)
            continue
        limit = 2.0 * math.pi if component.cyclic else component.limit
        if cells:  # in no unit of angles
            none = _LARGEST_DEGREES if scale == 1.0 else math.radians(_LARGEST_DEGREES)
            check_cells(value[:, i], none, scale, columns[i], table, rows, component.name)
        bad = np.flatnonzero(np.abs(value[:, i]) > limit + 1e-9)
        if bad.size:
            huge = abs(value[bad[0], i]) > _DEGREES
            if kind.geodetic and i == 0 and _exchanged(value, limit):
                raise LogError(
                    f"{table.source}, line {table.line[rows[bad[0]]]}, column {columns[i]!r}: the latitude would be "
                    f"{math.degrees(value[bad[0], i]):.6g} deg, and the longitude could be one: they are exchanged; "
                    f"write columns = {json.dumps([columns[1], columns[0], *columns[2:]])}"
                )
            raise LogError(
                f"{table.source}, line {table.line[rows[bad[0]]]}, column {columns[i]!r}: {component.name} would be "
                f"{value[bad[0], i]:.6g} rad; "
                + (
                    "is its unit 'deg'" + (", or '1e-7 deg'?" if huge else "?")
                    if huge or scale == 1.0 or not kind.geodetic
                    else "it may be degrees and minutes, like 5412.5 for 54 deg 12.5': a table should have degrees"
                )
            )


def _exchanged(value: Array, limit: float) -> bool:
    """Whether most latitudes [rad] are none and could be longitudes, and all longitudes could be latitudes."""
    first, second = np.abs(value[:, 0]), np.abs(value[:, 1])
    return bool(np.median(first) > limit and first.max() <= _TURN and second.max() <= limit)


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
