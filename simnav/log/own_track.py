"""Vessels on a recorded track: poses from a table (CSV), and the positions of a ship from an AIS archive.

They are the truth of a simulated run; the instruments are simulated on them. The smooth trajectory is in
`simnav.world.smooth_track`. A recorded run, whose measurements come from files, has a ``[log]`` instead
(`simnav.log.spec`).
"""

from __future__ import annotations

import warnings
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simnav.log.channel import Series, read_channel
from simnav.log.delimited import read_csv
from simnav.log.files import Column, FileSpec
from simnav.log.spec import ChannelSpec, OriginSpec, RecordedSpec, ReferenceSpec
from simnav.log.table import LogError, LogWarning, Table, utc_seconds
from simnav.log.units import LOG_UNITS
from simnav.spec import NonNegative, quantity
from simnav.types import Array
from simnav.world.smooth_track import Poses, SmoothTrack
from simnav.world.trajectory import Voyage
from simnav.world.vessel import register_vessel
from simnav.world.waypoint_track import TrackVessel

__all__ = ["AisTrack", "PoseTrack"]

#: The columns that are looked for where a scenario names none; the unit ends the name.
_HEIGHT = ("height_m", "altitude_m", "depth_m")
_HEADING = ("heading_deg", "yaw_deg")


class _TrackFile(TrackVessel):
    """Base of the vessels whose track comes from a file.

    Attributes
    ----------
    file : str
        The file, relative to the folder of the scenario file.
    skip : float
        Time from the first pose to the start of the run [s].
    departure : float
        See `simnav.world.smooth_track.smooth_track`.
    """

    files: ClassVar[tuple[str, ...]] = ("file",)

    file: str = Field(description="the file, relative to the folder of this file")
    skip: NonNegative = quantity("s", 0.0, description="from the first pose to the start of the run")
    departure: NonNegative = quantity(
        "m", 0.0, description="how far the trajectory may depart from the poses, RMS along an axis; 0: not at all"
    )

    def trajectory(self, voyage: Voyage) -> SmoothTrack:
        """See `simnav.world.Vessel.trajectory`."""
        poses = self.poses()
        return SmoothTrack(poses, voyage, self.limits(), departure=self.departure, skip=self.skip)

    def poses(self) -> Poses:
        """The poses of the file.

        Raises
        ------
        SpecError
            If the file cannot be used: absent, a column or a value is missing, times do not ascend.
        """
        raise NotImplementedError

    def _table(self, comment: str = "") -> Table:
        path = Path(self.file)
        if not path.is_file():
            raise LogError(f"vessel.file = {self.file!r}: there is no such file")
        return read_csv(path, comment)


@register_vessel
class PoseTrack(_TrackFile):
    """A vessel on the poses of a table: times, positions, and attitudes if there are some.

    Where no columns are named, the table has ``time_s``, ``latitude_deg`` and ``longitude_deg``. It may also have
    ``height_m`` or ``depth_m``, ``heading_deg`` or ``yaw_deg``, and with it ``roll_deg`` and ``pitch_deg``. So it reads
    the ``truth.csv`` that ``simnav simulate --csv`` writes.

    Attributes
    ----------
    time, time_unit
        Column of the time, and its unit; ``iso`` for dates. See `simnav.log.files.FileSpec`.
    position, position_units, frame, origin
        Columns of latitude, longitude and height, or of local coordinates around the origin, and their units. Without
        units a name ends in its unit, as in ``height_m``. See `simnav.log.spec.ChannelSpec`.
    attitude, attitude_units
        Columns of roll, pitch, heading. An empty list: the bow points along the course.
    comment, skip_rows
        See `simnav.log.files.FileSpec`.
    """

    kind: Literal["pose_track"] = "pose_track"
    time: Column = Field("time_s", description="column of the time")
    time_unit: str = Field("s", description="its unit, or `iso` for dates")
    position: tuple[Column, ...] = Field((), description="columns of latitude, longitude and height")
    position_units: str | tuple[str, ...] = Field((), description="their units; without them a name ends in its unit")
    frame: Literal["geodetic", "enu", "ned"] = Field("geodetic", description="what the columns are")
    origin: OriginSpec | None = Field(None, description="of local coordinates")
    attitude: tuple[Column, ...] | None = Field(
        None, description="columns of roll, pitch, heading; []: from the course"
    )
    attitude_units: str | tuple[str, ...] = Field((), description="their units; without them a name ends in its unit")
    comment: str = Field("", description="lines that begin with it are left out")
    skip_rows: Annotated[int, Field(ge=0)] = Field(0, description="rows after the header to leave out")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.position and len(self.position) != 3:
            raise ValueError(f"position = {list(self.position)}: three columns are wanted; '=0' is a constant")
        if self.attitude and len(self.attitude) != 3:
            raise ValueError(f"attitude = {list(self.attitude)}: three columns are wanted; '=0' is a constant")
        if (self.frame == "geodetic") != (self.origin is None):
            raise ValueError(
                f"frame = {self.frame!r} needs a table [vessel.origin]"
                if self.origin is None
                else "[vessel.origin] is for the frames 'enu' and 'ned'"
            )
        if self.frame != "geodetic" and not self.position:
            raise ValueError(f"frame = {self.frame!r}: name the columns of the position")
        return self

    def poses(self) -> Poses:
        """See `_TrackFile.poses`."""
        table = self._table(self.comment)
        place, angles = self._columns(table)
        place_units = self.position_units or _units(table, place)
        channel = ChannelSpec(file="poses", columns=place, units=place_units, frame=self.frame)
        turned = None
        if angles:
            turned = ChannelSpec(file="poses", columns=angles, units=self.attitude_units or _units(table, angles))
        path = Path(self.file)
        file = FileSpec(
            path=path.name, time=self.time, time_unit=self.time_unit, comment=self.comment, skip_rows=self.skip_rows
        )
        log = RecordedSpec(
            folder=str(path.parent.resolve()),
            files={"poses": file},
            reference=ReferenceSpec(position=channel, attitude=turned),
            origin=self.origin,
        )
        where = read_channel(log, channel, "position", "")
        pointed = None if turned is None else _attitude(read_channel(log, turned, "attitude", ""), where)
        return Poses(where.source, where.time, where.value, pointed, [f"line {n}" for n in where.line])

    def _columns(self, table: Table) -> tuple[tuple[Column, ...], tuple[Column, ...]]:
        """The columns of the position, and of the attitude: empty for none."""
        names = set(table.names)
        place = self.position
        if not place:
            height = next((n for n in _HEIGHT if n in names), None)
            third = "=0" if height is None else f"-{height}" if height.startswith("depth") else height
            place = ("latitude_deg", "longitude_deg", third)
        angles = self.attitude
        if angles is None:
            heading = next((n for n in _HEADING if n in names), None)
            level = [n if n in names else "=0" for n in ("roll_deg", "pitch_deg")]
            angles = () if heading is None else (*level, heading)
        return place, angles


def _units(table: Table, columns: tuple[Column, ...]) -> tuple[str, ...]:
    """The units that the names of columns end in."""
    units = []
    for column in columns:
        if isinstance(column, str) and column.startswith("="):
            units.append("1")
            continue
        _, name = table.resolve(column)
        ends = [name.partition("_")[2]]
        while "_" in ends[-1]:
            ends.append(ends[-1].partition("_")[2])
        unit = next((e for e in ends if e in LOG_UNITS), None)
        if unit is None:
            raise LogError(
                f"{table.source}: the name of the column {name!r} ends in no unit, as 'height_m' does; say its unit "
                "(position_units or attitude_units)"
            )
        units.append(unit)
    return tuple(units)


def _attitude(angles: Series, where: Series) -> Array:
    missing = np.setdiff1d(where.line, angles.line)
    if missing.size or len(angles.line) != len(where.line):
        line = missing[0] if missing.size else np.setdiff1d(angles.line, where.line)[0]
        raise LogError(
            f"{where.source}, line {line}: a pose is a position and an attitude, and one of them is missing; leave the "
            "line out, or say attitude = []"
        )
    return angles.value


#: Names that archives give to the columns of an AIS report (compared in lower case, without blanks and underscores).
_AIS = {
    "time": ("basedatetime", "#timestamp", "timestamp", "datetime", "time"),
    "mmsi": ("mmsi", "sourcemmsi"),
    "latitude": ("lat", "latitude"),
    "longitude": ("lon", "longitude"),
}


@register_vessel
class AisTrack(_TrackFile):
    """A vessel on the positions of one ship in an archive of AIS reports (CSV).

    The archives of NOAA and BOEM (MarineCadastre) and of the Danish Maritime Authority are known by the names of their
    columns; others have these names. Reports without a position (latitude 91, longitude 181; Recommendation ITU-R
    M.1371-5, annex 8, table 48) and repeated times are left out. Reports need not be in order. The bow points along the
    course made good, and the height is 0. AIS positions have errors of some metres, so that the trajectory smooths them
    by ``departure``.

    Attributes
    ----------
    mmsi : int or None
        The ship, by its Maritime Mobile Service Identity. None: the file has a single ship.
    """

    kind: Literal["ais_track"] = "ais_track"
    mmsi: int | None = Field(None, ge=0, description="the ship; may be left out where the file has a single one")
    departure: NonNegative = quantity(
        "m", 5.0, description="how far the trajectory may depart from the reports, RMS along an axis; 0: not at all"
    )

    def poses(self) -> Poses:
        """See `_TrackFile.poses`."""
        table = self._table()
        column = {what: _ais_column(table, what) for what in _AIS if what != "mmsi" or self.mmsi is not None}
        rows = np.arange(len(table))
        if self.mmsi is not None:
            rows = rows[table.column(column["mmsi"])[1] == self.mmsi]
            if not rows.size:
                raise LogError(f"{table.source}: there is no report of mmsi = {self.mmsi}")
        else:
            self._check_single(table)
        place = np.stack([table.column(column[n])[1][rows] for n in ("latitude", "longitude")], axis=1)
        given = np.all(np.abs(place) <= (90.0, 180.0), axis=1)
        rows, place = rows[given], place[given]
        time = _moments(table, column["time"], rows)
        time, first = np.unique(time, return_index=True)
        if len(given) > len(time):
            warnings.warn(
                f"{table.source}: {len(given) - len(time)} of {len(given)} AIS reports have no position or a time that "
                "another one has; they are left out",
                LogWarning,
                2,
            )
        position = np.column_stack([np.radians(place[first]), np.zeros(len(first))])
        # From the first report on: seconds since 1970 have too few digits left for the times of an IMU.
        begin = time[0] if len(time) else 0.0
        return Poses(table.source, time - begin, position, None, [f"line {n}" for n in table.line[rows[first]]])

    def _check_single(self, table: Table) -> None:
        if not any(_plain(n) in _AIS["mmsi"] for n in table.names):
            return
        ships = np.unique(table.column(_ais_column(table, "mmsi"))[1])
        if len(ships) > 1:
            some = ", ".join(f"{s:.0f}" for s in ships[:5])
            raise LogError(f"{table.source}: there are {len(ships)} ships in it; name one by its mmsi ({some}, ...)")


def _plain(name: str) -> str:
    return name.lower().replace(" ", "").replace("_", "")


def _ais_column(table: Table, what: str) -> str:
    found = next((n for alias in _AIS[what] for n in table.names if _plain(n) == alias), None)
    if found is None:
        raise LogError(
            f"{table.source}: no column holds the {what} of AIS reports; one of these names is wanted: "
            f"{', '.join(_AIS[what])}; the file has {', '.join(table.names)}"
        )
    return found


def _moments(table: Table, column: str, rows: NDArray[np.int64]) -> Array:
    """Times of AIS reports [s], as numbers or dates."""
    values = table.columns[column]
    if values.dtype != object:
        return np.asarray(values[rows], dtype=np.float64)
    moment = np.empty(len(rows))
    for k, row in enumerate(rows):
        text = str(values[row])
        try:
            moment[k] = utc_seconds(text)
        except ValueError:
            try:
                moment[k] = datetime.strptime(text.strip(), "%d/%m/%Y %H:%M:%S").replace(tzinfo=UTC).timestamp()
            except ValueError:
                raise LogError(
                    f"{table.source}, line {table.line[row]}, column {column!r}: {text!r} is not a date like "
                    "2024-05-01T12:00:00 or 01/05/2024 12:00:00"
                ) from None
    return moment
