"""What the files of a log hold: streams with their rates and gaps, and what their columns probably are."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from simnav.geometry.earth import relative_position
from simnav.log.binary import signature
from simnav.log.check import described
from simnav.log.delimited import lines_above, read_csv
from simnav.log.files import FileSpec
from simnav.log.formats.bags import topics_of
from simnav.log.formats.dataflash import read_dataflash
from simnav.log.formats.kf_gins import content_of
from simnav.log.formats.n2k import read_n2k
from simnav.log.formats.rinex import read_rinex
from simnav.log.formats.ubx import read_ubx
from simnav.log.formats.ulog import read_ulog
from simnav.log.nmea import read_nmea
from simnav.log.reader import READERS
from simnav.log.table import LogError, LogWarning, Table, utc_seconds
from simnav.log.text_forms import form_of_text
from simnav.log.time_units import MONTH, other_unit
from simnav.log.units import dimension, factor, spelt, units_row
from simnav.types import Array

__all__ = ["WITH_TOPICS", "Stream", "inspect_log", "is_number", "streams_of", "track_of"]

#: Ending of a file -> its format, where its content says nothing.
_ENDINGS = {
    ".pos": "rtklib", ".tum": "tum", ".nmea": "nmea", ".sbet": "sbet", ".out": "sbet", ".pd0": "pd0", ".mat": "mat",
    ".h5": "hdf5", ".hdf5": "hdf5", ".parquet": "parquet", ".mcap": "mcap", ".bag": "rosbag", ".db3": "rosbag",
    ".ubx": "ubx", ".ulg": "ulog",
}  # fmt: skip
_TIME = re.compile(r"^#?\s*(time|times|timestamp|stamp|t|utc|sec|secs|seconds|epoch|gpstime|datetime)(?![a-z])", re.I)
_DATE = re.compile(r"^\s*(date|day|%?\s*ymd)\b", re.I)
#: Times of this size are in this unit.
_LARGE = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
#: Where all streams have less than a row in this time [s], their times are in a smaller unit.
_RARE = 100.0
#: Columns of an IMU.
_INERTIAL = re.compile(
    r"(?:^|[./_ ])(a|g|w|acc|gyro?|accel|omega|angular_(rate|velocity)|specific_force|(linear_)?acceleration)[_ .]?"
    r"[xyz123](?![a-z0-9])", re.I)  # fmt: skip
_OF_IMU = re.compile(r"gyr|acc(?!urac)|imu", re.I)
#: Files of a folder that hold no streams: what 'simnav export' writes beside them, and texts.
_START, _TEXTS = "start.json", (".md", ".toml")
#: Formats whose files hold arrays or columns by name, with a time or several.
_OF_ARRAYS = ("mat", "hdf5", "parquet")
#: Formats whose files have several tables, besides NMEA and bags.
#: Formats whose files have topics, with a clock each.
WITH_TOPICS = ("mcap", "rosbag", "dataflash", "ulog")
#: Stamps of headers that are so near to the times of recording are taken [s].
_NEAR = 10.0
_OF_SENTENCES = {"n2k": read_n2k, "rinex": read_rinex, "ubx": read_ubx}


@dataclass(frozen=True, eq=False)
class Stream:
    """One table of a file.

    Attributes
    ----------
    path : Path
        The file.
    form : str
        Its format.
    sentence, talker : str or None
        Of NMEA; for bags and logs of autopilots the topic.
    table : Table
        Its columns.
    time : (n,) array
        Times of the rows [s].
    keys : dict
        Keys of `FileSpec` with which it is read.
    notes : tuple of str
        What was left out, or looks wrong.
    units : mapping of str to str
        Units that stand in a row below the header, by column.
    """

    path: Path
    form: str
    sentence: str | None
    talker: str | None
    table: Table
    time: Array
    keys: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """File, and sentence or topic."""
        inside = "" if self.sentence is None else f" {self.talker or ''}{self.sentence}"
        if self.form in _OF_ARRAYS:
            inside = f" {self.keys['time']}"
        return f"{self.path.name}{inside}"

    def to_dict(self) -> dict[str, Any]:
        """Plain: what ``simnav log inspect --json`` prints."""
        columns: dict[str, dict[str, Any]] = {}
        for name in self.table.names:
            values = self.table.columns[name]
            if values.dtype == object:
                columns[name] = {"text": str(next((v for v in values if v is not None), ""))[:40]}
                continue
            finite = values[np.isfinite(values.astype(np.float64))].astype(np.float64)
            columns[name] = {"missing": int(len(values) - len(finite))}
            if len(finite):
                columns[name] |= {
                    k: float(f(finite)) for k, f in (("least", np.min), ("median", np.median), ("most", np.max))
                }
        return {
            "file": str(self.path), "format": self.form, "sentence": self.sentence, "talker": self.talker,
            "rows": len(self.table), "times": described(self.time), "columns": columns, "notes": list(self.notes),
        }  # fmt: skip


def inspect_log(paths: Sequence[Path]) -> tuple[list[Stream], list[str]]:
    """The streams of files, and of the files in folders.

    Parameters
    ----------
    paths : sequence of Path
        Files, or folders whose files are taken.

    Returns
    -------
    list of Stream, list of str
        The streams, and a sentence for each file that cannot be read.

    Raises
    ------
    LogError
        If a path does not exist, or a folder has no file.
    """
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if not p.name.startswith("."))
            here = [p for p in inside if p.is_file() and p.name != _START and p.suffix.lower() not in _TEXTS]
            if not here:
                folders = ", ".join(p.name for p in inside)
                raise LogError(
                    f"{path}: there is no file in it" + (f"; name one of its folders: {folders}" if folders else "")
                )
            files += here
        elif path.exists():
            files.append(path)
        else:
            raise LogError(f"{path}: there is no such file or folder")
    found: list[Stream] = []
    failed: list[str] = []
    for path in files:
        try:
            found += streams_of(path)
        except LogError as error:
            failed.append(str(error))
    for k, stream in enumerate(found):
        found[k] = _timed(stream, [s.time for s in found if s is not stream])
    return found, failed


def streams_of(path: Path) -> list[Stream]:
    """The streams of one file.

    Raises
    ------
    LogError
        If it cannot be read.
    """
    form = _format(path)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = list(_streams(path, form))
    notes = tuple(dict.fromkeys(" ".join(str(w.message).split()).removeprefix(f"{path}: ") for w in said))
    if not found:
        raise LogError(f"{path}: " + ("; ".join(notes) or "there is nothing in it"))
    return [_timed(replace(s, notes=notes)) for s in found]


def _timed(stream: Stream, others: Sequence[Array] = ()) -> Stream:
    """The stream with its times in the unit in which they probably are."""
    unit = stream.keys.get("time_unit", "s" if stream.form in _OF_ARRAYS else "")
    every = [float(np.median(np.diff(t))) for t in (stream.time, *others) if len(t) > 1]
    longest = 0.0 if len(every) > 1 and min(every) > _RARE else MONTH
    found = other_unit(unit, stream.time, others, inertial=_is_inertial(stream), longest=longest)
    if found is None:
        return stream
    note = f"its times are taken for {found}: as {unit} they would be {described(stream.time)}"
    time = stream.time * (factor(found) / factor(unit))
    return replace(stream, time=time, keys={**stream.keys, "time_unit": found}, notes=(*stream.notes, note))


def _is_inertial(stream: Stream) -> bool:
    names = stream.table.names
    axes = sum(bool(re.fullmatch(r"(?:.*[./])?[xyz](?:\W.*)?", n, re.I)) for n in names)
    label = stream.path.stem if stream.sentence is None else stream.sentence
    return sum(bool(_INERTIAL.search(n)) for n in names) >= 3 or (axes >= 3 and bool(_OF_IMU.search(label)))


def _format(path: Path) -> str:
    found = signature(path)
    if found is not None and found[1]:
        return found[1]
    by_ending = _ENDINGS.get(path.suffix.lower())
    if found is not None:
        if by_ending in ("sbet", "pd0", "mat", "ubx"):
            return by_ending
        with open(path, "rb") as stream:
            if b"\xb5\x62\x01" in stream.read(1 << 16):  # a message of UBX after sentences of NMEA
                return "ubx"
        raise LogError(f"{path}: it is {found[0]}; say its format in a scenario: {', '.join(sorted(READERS.items()))}")
    by_content = form_of_text(path) or ("kf_gins" if content_of(path) else None)
    if by_content is not None:
        return by_content
    return by_ending if by_ending in ("tum", "rtklib", "nmea") else "csv"


def _streams(path: Path, form: str) -> Iterator[Stream]:
    if form == "nmea":
        tables = read_nmea(path).tables
        stamped = any(np.isfinite(t.column("logger")[1]).any() for t in tables.values())
        clock = "logger" if stamped else "sentence"
        for (talker, sentence), table in tables.items():
            own = None if talker == "P" else talker
            yield Stream(path, form, sentence, own, table, _known(table.column(clock)[1]), {"clock": clock})
        return
    if form in _OF_SENTENCES:
        for (talker, sentence), table in _OF_SENTENCES[form](path).tables.items():
            time = table.column("logger" if form == "n2k" else "time")[1]
            yield Stream(path, form, sentence, talker or None, table, _known(time))
        return
    if form in WITH_TOPICS:
        reader = READERS.get(form)
        assert reader is not None
        for topic in _topics(path, form):
            keys: dict[str, Any] = {"options": {"topic": topic}}
            try:
                rows = reader.read(path, FileSpec(path=path.name, format=form), topic)
            except LogError as error:  # such as images in an encoding of their own; the other topics are of use
                warnings.warn(str(error), LogWarning, 2)
                continue
            time = rows.time
            if "header" in rows.table.columns and _stamped(rows.table.column("header")[1], time):
                keys["clock"], time = "sentence", rows.table.column("header")[1]
            counts = np.arange(len(time)) if rows.counts is None else rows.counts
            yield Stream(path, form, topic, None, rows.table, _known(time[counts]), keys)
        return
    reader = READERS.get(form)
    assert reader is not None
    if form not in _OF_ARRAYS:
        keys, units = _table_keys(path) if form == "csv" else ({}, {})
        if form == "kf_gins" and content_of(path) == "gnss":
            keys = {"options": {"content": "gnss"}}
        rows = reader.read(path, FileSpec(path=path.name, format=form, **keys))
        yield Stream(path, form, None, None, rows.table, _known(rows.time), keys, units=units)
        return
    for name in _array_times(path, form):
        rows = reader.read(path, FileSpec(path=path.name, format=form, time=name))
        keys = {"time": name}
        if (unit := _time_unit(name, rows.time)) != "s":
            keys |= {"time_unit": unit}
        yield Stream(path, form, None, None, _beside(rows.table, name), _known(rows.time) * factor(unit), keys)


def _topics(path: Path, form: str) -> list[str]:
    if form in ("mcap", "rosbag"):
        return topics_of(path, form)
    return sorted(read_dataflash(path) if form == "dataflash" else read_ulog(path))


def _stamped(header: Array, recorded: Array) -> bool:
    """Whether the stamps in headers are times of the same clock, in order."""
    if len(header) < 2 or not np.isfinite(header).all():
        return False
    return bool((np.diff(header) > 0.0).all() and np.abs(header - recorded).max() < _NEAR)


def track_of(stream: Stream) -> Array | None:
    """(n, 2) east and north of the first position [m] of a stream that has latitudes and longitudes; None without."""
    found = []
    for names in (("latitude", "lat"), ("longitude", "lon", "lng", "long")):
        name = next((n for n in stream.table.names if re.split(r"[./]", n.lower())[-1] in names), None)
        if name is None or stream.table.columns[name].dtype == object:
            return None
        found.append(stream.table.columns[name].astype(np.float64))
    place = np.stack([*found, np.zeros(len(stream.table))], axis=-1)
    place = place[np.isfinite(place).all(axis=1)]
    if not len(place):
        return None
    if stream.form not in ("nmea", "n2k", "ubx", "sbet"):  # those are in radians already
        place[:, :2] = np.radians(place[:, :2])
    place = place[(np.abs(place[:, 0]) <= 0.5 * np.pi) & (np.abs(place[:, 1]) <= 2.0 * np.pi)]
    return relative_position(place, place[0])[:, [1, 0]] if len(place) else None


def _known(time: Array) -> Array:
    return time[np.isfinite(time)]


def _table_keys(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Where a table and its times probably are, as keys of `FileSpec`, and its units, if there is a row of them."""
    comment = "#" if path.read_bytes()[:1] == b"#" and not _header_in_comment(path) else ""
    keys: dict[str, Any] = {"comment": comment} if comment else {}
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            found = _time_keys(path, keys)
        for warning in said:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    except LogError as error:
        above = lines_above(path, comment)
        if not above:
            raise
        try:
            found = _time_keys(path, keys | {"skip_lines": above})
        except LogError:
            raise error from None
    return found


def _time_keys(path: Path, keys: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    table = read_csv(path, **keys)
    units: dict[str, str] = {}
    if all(c.dtype == object or np.isnan(c[0]) for c in table.columns.values()):
        told = units_row([str(c[0] or "") if c.dtype == object else "" for c in table.columns.values()])
        if told is not None:
            keys, units = {**keys, "skip_rows": 1}, dict(zip(table.names, told, strict=True))
            table = read_csv(path, **keys)
    return keys | _times(path, table, units), units


def _times(path: Path, table: Table, units: Mapping[str, str]) -> dict[str, Any]:
    """Where the times of a table probably are, as keys of `FileSpec`."""
    names = list(table.names)
    date = next((n for n in names if _DATE.match(n) and table.columns[n].dtype == object), None)
    named = next((n for n in names if _TIME.match(n)), None)
    if date is not None and named is not None and date != named:
        return {"time": (date, named)}
    if named is None:
        named = next((n for n in names if _ascends(table, n)), names[0])
    values = table.columns[named]
    if values.dtype == object:
        first = next((str(v) for v in values if v is not None), "")
        try:
            utc_seconds(first)
        except ValueError:
            if is_number(first):
                table.column(named)  # raises: it names the cell that is no number
            second = names[names.index(named) + 1] if names.index(named) + 1 < len(names) else None
            if second is None or not re.match(r"\d{4}[-/]", first):
                if (_TIME.match(named) or _DATE.match(named)) and re.search(r"\d", first):
                    raise LogError(
                        f"{path}, line {table.line[0]}, column {named!r}: {first!r} is no known form of a time; write "
                        "seconds, or year, month and day like 2024-05-01T10:00:00Z"
                    ) from None
                raise LogError(f"{path}: no column holds the times; there are: {', '.join(names)}") from None
            return {"time": (named, second)}
        return {"time": named, "time_unit": "iso"}
    told = f"{named} [{units[named]}]" if units.get(named) else named
    return {"time": named, "time_unit": _time_unit(told, np.asarray(values, dtype=np.float64))}


def is_number(text: str) -> bool:
    """Whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _header_in_comment(path: Path) -> bool:
    with open(path, encoding="latin-1") as text:
        first, second = text.readline(), text.readline()
    return not second.startswith("#") and first.count(",") == second.count(",") > 0


def _time_unit(name: str, values: Array) -> str:
    ending = re.search(r"(?:_|\[|\()([a-z]+)(?:\]|\))?$", name.strip())
    if ending and dimension(unit := spelt(ending[1])) == "time":
        return unit
    size = float(np.nanmedian(np.abs(values)))
    return next((unit for least, unit in _LARGE if size > least), "s")


def _ascends(table: Table, name: str) -> bool:
    values = table.columns[name]
    if values.dtype == object or len(values) < 2:
        return False
    with np.errstate(invalid="ignore"):
        return bool(np.all(np.diff(values.astype(np.float64)) > 0.0))


def _array_times(path: Path, form: str) -> list[str]:
    """The arrays or columns of times, by their names."""
    reader = READERS.get(form)
    assert reader is not None
    try:
        names = list(reader.read(path, FileSpec(path=path.name, format=form, time=1)).table.names)
    except LogError as error:
        names = re.findall(r"([^\s,]+) \d+(?:x\d+)*", str(error).partition("there are:")[2])
        if not names:
            raise
    chosen = [n for n in names if _TIME.match(re.split(r"[./]", n)[-1])]
    if not chosen:
        raise LogError(f"{path}: no name tells the times; say time = NAME in a scenario; there are: {', '.join(names)}")
    return chosen[:1] if form == "parquet" else chosen


def _beside(table: Table, name: str) -> Table:
    """The columns in the structure or group of a time, where it has one and others are in it."""
    group = re.match(r".*[./]", name)
    inside = {} if group is None else {n: c for n, c in table.columns.items() if n.startswith(group[0])}
    return Table(table.source, inside, table.line, table.numbered) if len(inside) > 1 else table
