"""The measurements of a recording as MCAP with messages in JSON (an extra: mcap).

A topic for each instrument, ``/NAME``, with ``timestamp`` and its components in SI units and radians; positions are
``foxglove.LocationFix`` in degrees, so that Foxglove shows them on a map. ``/imu`` has ``angular_velocity`` and
``linear_acceleration`` (the specific force) in forward, starboard, down. ``/truth`` is there where the recording has
it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.types import KINDS

from .files import complete_file
from .formats import writes
from .hidden import has_truth

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["write_mcap"]

_SCHEMAS = {
    "foxglove.LocationFix": ("timestamp", "frame_id", "latitude", "longitude", "altitude", "position_covariance"),
}


@writes("recording", "mcap")
def write_mcap(recording: Recording, path: Path) -> list[Path]:
    """One file, in the order of time.

    Raises
    ------
    ValueError
        If the library mcap is not installed.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise ValueError("an MCAP file needs the library mcap: pip install 'simnav[logs]'") from None
    messages = sorted(_messages(recording), key=lambda m: m[0])
    with complete_file(path) as part, open(part, "wb") as stream:
        writer = Writer(stream)
        writer.start(library="simnav")
        channels: dict[str, int] = {}
        for time, topic, kind, content in messages:
            if topic not in channels:
                properties: dict[str, Any] = {name: {} for name in _SCHEMAS.get(kind, content)}
                text = json.dumps({"title": kind, "type": "object", "properties": properties}).encode()
                schema = writer.register_schema(kind, "jsonschema", text)
                channels[topic] = writer.register_channel(topic, "json", schema)
            stamp = round(1e9 * time)
            stamped = {"timestamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9}, **content}
            writer.add_message(channels[topic], stamp, json.dumps(stamped).encode(), stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return [path]


def _messages(recording: Recording) -> Iterator[tuple[float, str, str, dict[str, Any]]]:
    """Time, topic, kind and content of every message."""
    imu = recording.data.imu
    if imu is not None:
        for t, w, f in zip(imu.time, imu.angular_rate, imu.specific_force, strict=True):
            yield float(t), "/imu", "simnav.Imu", {"angular_velocity": _axes(w), "linear_acceleration": _axes(f)}
    for each in recording.data.aids.values():
        s = each.as_delivered()
        kind = KINDS[s.kind]
        for k in range(len(s)):
            value = dict(zip(kind.values, s.value[k].tolist(), strict=True))
            if kind.geodetic:
                sigma = np.resize(recording.instruments[s.name].sigma, 3)
                place = {
                    "frame_id": s.name,
                    "latitude": float(np.degrees(value["latitude"])),
                    "longitude": float(np.degrees(value["longitude"])),
                    "altitude": value.get("height", 0.0),
                    "position_covariance": np.diag(sigma[[1, 0, 2]] ** 2).ravel().tolist(),
                    "position_covariance_type": 2,
                }
                yield float(s.time[k]), f"/{s.name}", "foxglove.LocationFix", place
                continue
            if s.channels:
                value |= {
                    "channel": s.channels[s.channel[k]],
                    **dict(zip(kind.side_names, s.side[k].tolist(), strict=True)),
                }
            yield float(s.time[k]), f"/{s.name}", f"simnav.{s.kind}", value
    if has_truth(recording):
        truth = recording.data.truth
        for k, t in enumerate(truth.time):
            if np.isfinite(truth.position[k]).all():
                state = {n: getattr(truth, n)[k].tolist() for n in ("position", "velocity", "attitude")}
                known = {n: v for n, v in state.items() if np.isfinite(v).all()}
                yield float(t), "/truth", "simnav.NavigationState", known


def _axes(vector: Any) -> dict[str, float]:
    return dict(zip("xyz", vector.tolist(), strict=True))
