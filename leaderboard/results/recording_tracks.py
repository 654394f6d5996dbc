"""The track of a recording for maps: GPX 1.1 and KML 2.2.

It is the true track where the recording has one, otherwise that of the fixes. Times count from 1970-01-01, because a
simulated run has no date.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

import numpy as np

from simnav.types import KINDS, Array

from .files import write_whole
from .formats import writes
from .hidden import has_truth

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["track_of", "write_gpx", "write_kml"]


def track_of(recording: Recording) -> tuple[str, Array, Array]:
    """Name, (n,) times and (n, 3) positions [rad, rad, m] of the true track, or of the first positions measured.

    Raises
    ------
    ValueError
        If there are neither.
    """
    if has_truth(recording):
        known = np.isfinite(recording.data.truth.position).all(axis=1)
        return "truth", recording.data.truth.time[known], recording.data.truth.position[known]
    for each in recording.data.aids.values():
        stream = each.as_delivered()
        if KINDS[stream.kind].geodetic and len(stream.channels) <= 1 and len(stream):
            place = stream.value
            height = place[:, 2:3] if place.shape[1] == 3 else np.zeros((len(place), 1))
            return stream.name, stream.time, np.hstack([place[:, :2], height])
    raise ValueError("the recording has no positions: neither a truth (--truth) nor an instrument that measures them")


def _points(time: Array, position: Array) -> Iterator[tuple[str, str, str, str]]:
    """Latitude, longitude [deg], height [m] and date of each point, as text."""
    begin = datetime(1970, 1, 1, tzinfo=UTC)
    for t, (latitude, longitude, height) in zip(time, position, strict=True):
        date = (begin + timedelta(seconds=float(t))).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        yield f"{np.degrees(latitude):.11f}", f"{np.degrees(longitude):.11f}", f"{height:.6f}", date


@writes("recording", "gpx")
def write_gpx(recording: Recording, path: Path) -> list[Path]:
    """A GPX file with one track."""
    name, time, position = track_of(recording)
    points = "\n".join(
        f'<trkpt lat="{lat}" lon="{lon}"><ele>{height}</ele><time>{date}</time></trkpt>'
        for lat, lon, height, date in _points(time, position)
    )
    title = escape(f"{recording.scenario}: {name}")
    return [write_whole(path, (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<gpx version="1.1" creator="simnav" xmlns="http://www.topografix.com/GPX/1/1">\n'
        f"<trk><name>{title}</name><trkseg>\n{points}\n</trkseg></trk>\n</gpx>\n"
    ))]  # fmt: skip


@writes("recording", "kml")
def write_kml(recording: Recording, path: Path) -> list[Path]:
    """A KML file with one line."""
    name, time, position = track_of(recording)
    points = "\n".join(f"{lon},{lat},{height}" for lat, lon, height, _ in _points(time, position))
    title = escape(f"{recording.scenario}: {name}")
    return [write_whole(path, (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>\n'
        f"<Placemark><name>{title}</name><LineString><altitudeMode>absolute</altitudeMode><coordinates>\n{points}\n"
        "</coordinates></LineString></Placemark>\n</Document></kml>\n"
    ))]  # fmt: skip
