"""What a receiver of raw observations saw in a run: its satellites, the obstacles, and the errors of its ranges."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import relative_position
from simnav.labels import REFLECTION
from simnav.satellites.sky import Sky
from simnav.sensors.gnss_observation import SIDE
from simnav.sensors.gnss_raw import GnssRaw
from simnav.world.obstacles import Obstacles

if TYPE_CHECKING:
    from simnav.recording import AidStream, Recording
    from simnav.scenario import Scenario

__all__ = ["Outline", "SkyView", "State", "sky_view"]

Array = NDArray[np.float64]

#: Epochs that are kept; more cannot be seen.
_EPOCHS = 240
_ELEVATION, _AZIMUTH = (next(k for k, c in enumerate(SIDE) if c.name == name) for name in ("elevation", "azimuth"))


class State(IntEnum):
    """How the signal of a satellite arrived."""

    MISSING = 0
    RECEIVED = 1
    REFLECTED = 2
    FAULTY = 3


@dataclass(frozen=True, eq=False)
class Outline:
    """An obstacle on the map: its corners [m] from the start of the run, and its height [m]."""

    name: str
    east: Array
    north: Array
    top: float


@dataclass(frozen=True, eq=False)
class SkyView:
    """The sky and the place of a run.

    Attributes
    ----------
    instrument : str
        Name of the receiver of raw observations.
    satellites : tuple of str
        Names of c satellites that were above the horizon.
    time : (n,) array
        Epochs [s].
    elevation, azimuth : (n, c) array
        Directions [rad]; NaN where they are not known, or below the horizon.
    state : (n, c) array of int
        A `State`.
    east, north : (n,) array
        Track of the vessel from its start [m].
    error : (n,) array
        The largest error that reflections and faults put on a range that was received [m].
    outlines : tuple of Outline
        Obstacles.
    """

    instrument: str
    satellites: tuple[str, ...]
    time: Array
    elevation: Array
    azimuth: Array
    state: NDArray[np.int8]
    east: Array
    north: Array
    error: Array
    outlines: tuple[Outline, ...] = ()


def sky_view(recording: Recording, scenario: Scenario | None = None) -> SkyView | None:
    """What the first receiver of raw observations of a run saw; None without one, or without a known track.

    Parameters
    ----------
    recording : Recording
        The run.
    scenario : Scenario or None
        Its scenario. It has the obstacles, and the ephemerides of satellites that the receiver did not hear; without
        it, or for a log, a satellite is shown between the first and the last time that it was heard.
    """
    stream = next((s for s in recording.data.aids.values() if s.kind == "gnss_raw" and len(s)), None)
    if stream is None:
        return None
    truth = recording.data.truth
    epochs = np.unique(stream.time)
    epochs = epochs[:: max(1, -(-len(epochs) // _EPOCHS))]
    position = np.column_stack([np.interp(epochs, truth.time, column) for column in truth.position.T])
    origin = recording.initial_truth.position[0]
    if not np.isfinite(position).all() or not np.isfinite(origin).all():
        return None
    drawn = None if scenario is None else scenario.drawn(recording.seed)
    spec = None if drawn is None else drawn.instruments.get(stream.name)
    elevation, azimuth = _heard(stream, epochs)
    if isinstance(spec, GnssRaw):
        sky = Sky(spec.ephemerides(), stream.channels, datetime.fromisoformat(spec.epoch))
        sight = sky.sight(epochs, position, np.zeros_like(position))
        elevation, azimuth = sight.elevation, sight.azimuth
    azimuth = np.where(elevation > 0.0, azimuth, np.nan)
    elevation = np.where(elevation > 0.0, elevation, np.nan)
    state, error = _received(recording, stream, epochs)
    up = np.flatnonzero(np.isfinite(elevation).any(axis=0))
    ned = relative_position(position, origin)
    return SkyView(
        stream.name, tuple(stream.channels[c] for c in up), epochs, elevation[:, up], azimuth[:, up], state[:, up],
        ned[:, 1], ned[:, 0], error, () if drawn is None else tuple(_outlines(drawn.surroundings.values(), origin)),
    )  # fmt: skip


def _heard(stream: AidStream, epochs: Array) -> tuple[Array, Array]:
    """(n, c) elevations and azimuths between the first and the last reading of each satellite."""
    shape = len(epochs), len(stream.channels)
    elevation, azimuth = np.full(shape, np.nan), np.full(shape, np.nan)
    for c in range(shape[1]):
        own = stream.channel == c
        if own.any():
            time, side = stream.time[own], stream.side[own]
            elevation[:, c] = np.interp(epochs, time, side[:, _ELEVATION], np.nan, np.nan)
            azimuth[:, c] = np.interp(epochs, time, np.unwrap(side[:, _AZIMUTH]), np.nan, np.nan)
    return elevation, azimuth


def _received(recording: Recording, stream: AidStream, epochs: Array) -> tuple[NDArray[np.int8], Array]:
    """(n, c) states, and (n,) the largest error of a range by reflections and faults [m]."""
    state = np.full((len(epochs), len(stream.channels)), State.MISSING, np.int8)
    error = np.zeros(len(epochs))
    row = np.minimum(np.searchsorted(epochs, stream.time), len(epochs) - 1)
    own = epochs[row] == stream.time
    row, channel, labels = row[own], stream.channel[own], stream.faults[own]
    wrong = np.abs(stream.fault_error[own, 0])
    np.maximum.at(error, row, wrong)
    state[row, channel] = State.RECEIVED
    by_reflection = np.uint32(sum(1 << j for j, fault in enumerate(recording.faults) if fault.kind == REFLECTION))
    reflected, faulty = (labels & by_reflection) != 0, (labels & ~by_reflection) != 0
    state[row[reflected], channel[reflected]] = State.REFLECTED
    state[row[faulty], channel[faulty]] = State.FAULTY
    return state, error


def _outlines(surroundings: Iterable[object], origin: Array) -> list[Outline]:
    """The obstacles of a run, on a map with its origin at the start."""
    found = []
    for one in surroundings:
        if isinstance(one, Obstacles):
            place, obstacles = one.every()
            offset = relative_position(np.array([[*place, origin[2]]]), origin)[0]
            for obstacle in obstacles:
                corners = obstacle.outline()
                found.append(Outline(obstacle.name, corners[:, 1] + offset[1], corners[:, 0] + offset[0], obstacle.top))
    return found
