"""Ranges to beacons on the sea floor: a long baseline (LBL), or one-way travel times by synchronised clocks.

With the place b of a beacon and p of the transducer of the vehicle a range is ::

    range = (1 + k) |b + e - p| + c o

with the relative error k of the speed of sound (block ``sound_speed``), the error e of the surveyed place (block
``beacons``, three states for each), the offset o of the vehicle's clock from those of the beacons (block ``clock``,
with its drift; one-way only) and c = 1500 m/s. A channel is a beacon.

A range by the two-way travel time is valid when the beacon answers, half way between the interrogation and the answer:
for a vehicle that keeps its velocity v this leaves an error below v^2 t^2 / (2 range), 1 cm. It arrives when the answer
has come, t later; the next interrogation waits for all answers. A one-way range is valid when it arrives.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import pi
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from simnav.blocks import StateBlock
from simnav.geometry.earth import displace
from simnav.kinds import Component, Datasheet, Kind, NavigationPoint
from simnav.recording import AidStream
from simnav.sensors.acoustics import AcousticInstrument, AcousticSpec, paths, separation
from simnav.sensors.instrument import ZERO, Instrument, register_instrument
from simnav.spec import NonNegative, Positive, Vector, quantity, register_unit
from simnav.types import Array, TapStates
from simnav.world.sound_speed import SOUND_SPEED
from simnav.world.water_column import Figures

__all__ = ["AcousticRange"]

register_unit("ppm_sqrt_s", 1e-6)


@lru_cache(maxsize=64)
def _places(
    latitude: float, longitude: float, north: tuple[float, ...], east: tuple[float, ...], depth: tuple[float, ...]
) -> Array:
    """(c, 3) positions of the beacons."""
    return displace(np.array([latitude, longitude, 0.0]), np.stack([north, east, depth], axis=1))


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]] | None:
    """The range to a beacon and its Jacobian by block (`simnav.kinds.Observation`)."""
    blocks, details, arm = point.blocks, sheet.details, point.dcm @ sheet.lever_arm
    i = sheet.channels.index(point.channel)
    place = _places(*(details[name] for name in ("latitude", "longitude", "north", "east", "depth")))[i]
    away = separation(displace(point.position, arm), place)
    if "beacons" in blocks:
        away = away + blocks["beacons"][3 * i : 3 * i + 3]
    distance = float(np.linalg.norm(away))
    if not distance:
        return None
    scale = 1.0 + (blocks["sound_speed"][0] if "sound_speed" in blocks else 0.0)
    towards = scale * away / distance
    navigation = np.zeros((1, 9))
    navigation[0, :3] = -towards
    navigation[0, 6:9] = -np.cross(arm, towards)
    jacobian, reading = {"navigation": navigation}, scale * distance
    if "sound_speed" in blocks:
        jacobian["sound_speed"] = np.array([[distance]])
    if "beacons" in blocks:
        jacobian["beacons"] = np.zeros((1, len(blocks["beacons"])))
        jacobian["beacons"][0, 3 * i : 3 * i + 3] = towards
    if "clock" in blocks:
        reading += SOUND_SPEED * blocks["clock"][0]
        jacobian["clock"] = np.array([[SOUND_SPEED, 0.0]])
    return np.array([reading]), jacobian


@register_instrument(
    Kind(
        "ranges to beacons on the sea floor, by the travel time of sound",
        role="range",
        components=(Component("range", "m", limit=50e3),),
        equation=observe,
        datasheet=("latitude", "longitude", "north", "east", "depth", "way"),
    ),
    example={
        "rate_hz": 0.2, "latitude_deg": 54.0, "longitude_deg": 7.9, "beacons": ["A", "B", "C"],
        "north_m": [300.0, -250.0, 100.0], "east_m": [100.0, 200.0, -400.0], "depth_m": [60.0, 65.0, 70.0],
        "sigma_m": 0.15, "sound_speed_percent": 0.1, "lever_arm_m": [0, 0, 3],
    },
)  # fmt: skip
class AcousticRange(AcousticSpec):
    """Ranges to beacons on the sea floor. Its channels are the beacons.

    Attributes
    ----------
    beacons : tuple of str
        Names of the beacons.
    latitude, longitude : float
        Origin of their places [rad].
    north, east, depth : tuple of float
        Surveyed place of each beacon [m].
    beacon_error : float
        One sigma of each component of the error of the survey [m].
    way : str
        ``two_way``: the vehicle asks and the beacon answers; ``one_way``: the beacon sends at times that are known.
    clock, clock_drift : float
        One sigma of the offset [s] and drift [-] of the vehicle's clock from those of the beacons; one-way only.
    clock_drift_noise : float
        Density of the random walk of the drift [1/sqrt(s)].

    Examples
    --------
    >>> spec = AcousticRange.from_toml(AcousticRange.example)
    >>> spec.channels(), [block.name for block in spec.blocks()]
    (('A', 'B', 'C'), ['sound_speed'])
    """

    errors: ClassVar[tuple[str, ...]] = (
        *AcousticSpec.errors, "beacon_error", "clock", "clock_drift", "clock_drift_noise",
    )  # fmt: skip

    kind: Literal["acoustic_range"] = "acoustic_range"
    beacons: tuple[str, ...]
    latitude: float = quantity("deg", ge=-pi / 2, le=pi / 2)
    longitude: float = quantity("deg")
    north: Figures = quantity("m", ())
    east: Figures = quantity("m", ())
    depth: Figures = quantity("m", ())
    beacon_error: NonNegative = quantity("m", 0.0)
    way: Literal["two_way", "one_way"] = "two_way"
    clock: NonNegative = quantity("s", 0.0)
    clock_drift: NonNegative = quantity("ppm", 0.0)
    clock_drift_noise: NonNegative = quantity("ppm_sqrt_s", 0.0)
    sigma: NonNegative = quantity("m")
    bias: NonNegative = quantity("m", 0.0)
    bias_instability: NonNegative = quantity("m", 0.0)
    reach: Positive = quantity("m", 3000.0)
    lever_arm: Vector = quantity("m", ZERO)
    fixed_bias: float = quantity("m", 0.0)

    @model_validator(mode="after")
    def _placed(self) -> Self:
        if not self.beacons:
            raise ValueError("beacons = []: there should be at least one")
        counts = [len(self.north), len(self.east), len(self.depth)]
        if any(count != len(self.beacons) for count in counts):
            short = min(counts)
            lacks = f"beacon {self.beacons[short]!r} has no place: " if short < len(self.beacons) else ""
            raise ValueError(
                f"{lacks}north_m, east_m and depth_m have {counts[0]}, {counts[1]} and {counts[2]} numbers; each of "
                f"the {len(self.beacons)} beacons has one of each"
            )
        for beacon, depth in zip(self.beacons, self.depth, strict=True):
            if depth < 0.0:
                raise ValueError(
                    f"depth_m of beacon {beacon!r} = {depth:g}: it is above the surface; the depth of a beacon is "
                    "positive"
                )
        if self.way == "two_way" and (self.clock or self.clock_drift or self.clock_drift_noise):
            raise ValueError("way = 'two_way': a two-way travel time is measured by one clock; give no error of clocks")
        return self

    def channels(self) -> tuple[str, ...]:
        """The beacons."""
        return self.beacons

    def blocks(self) -> tuple[StateBlock, ...]:
        """Speed of sound, places of the beacons and clock, as far as they have errors."""
        found = []
        if self.sound_speed:
            found.append(StateBlock("sound_speed", 1, "", self.sound_speed))
        if self.beacon_error:
            found.append(StateBlock("beacons", 3 * len(self.beacons), "m", self.beacon_error))
        if self.clock or self.clock_drift or self.clock_drift_noise:
            sigma, density = (self.clock, self.clock_drift), (0.0, self.clock_drift_noise)
            found.append(StateBlock("clock", 2, ("s", "ppm"), sigma, "clock", density))
        return tuple(found)

    def travels(self) -> int:
        """See `AcousticSpec.travels`."""
        return 1 if self.way == "two_way" else 0

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _AcousticRange(self, name, seed)


@dataclass(frozen=True)
class _Ranges:
    """What the beacons give at n times: (n, c) arrays."""

    there: NDArray[np.bool_]
    value: Array
    false: Array
    time: Array


class _AcousticRange(AcousticInstrument):
    """Parameters as of `ChannelInstrument`."""

    def __init__(self, spec: AcousticRange, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec
        self.places = _places(spec.latitude, spec.longitude, spec.north, spec.east, spec.depth)
        if spec.beacon_error:
            self.places = displace(self.places, self.block("beacons", np.zeros(1))[0].reshape(-1, 3))

    def observe(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.observe`."""
        ranges = self.heard(tap)
        return np.asarray((ranges.value + ranges.false)[:, :, None])

    def available(self, tap: TapStates) -> NDArray[np.bool_]:
        """See `ChannelInstrument.available`."""
        there: NDArray[np.bool_] = self.heard(tap).there
        return there

    def sense(self, tap: TapStates) -> AidStream:
        """See `ChannelInstrument.sense`."""
        ranges = self.heard(tap)
        return self.labelled(tap, super().sense(tap), ranges.false[:, :, None], self.spec.travels() * ranges.time)

    def _hear(self, tap: TapStates) -> _Ranges:
        spec, n, c = self.spec, len(tap.time), len(self.channels)
        own = displace(tap.position, self.lever_displacement(tap))
        # The beacon is the first position: what is heard is the same in both directions.
        path = paths(self.surroundings, np.tile(self.places, (n, 1)), np.repeat(own, c, axis=0))
        there = np.isfinite(path.time) & (path.distance <= spec.reach)
        if spec.way == "two_way":
            travel = np.where(there, path.time, np.nan).reshape(n, c)
            there = there & np.repeat(self.pinged(tap.time, travel), c)
        value = np.where(there, path.ranges(spec.correction, spec.assumed_speed), 0.0).reshape(n, c)
        value *= 1.0 + self.speed_error(tap.time)[:, None]
        if any(block.name == "clock" for block in self.sheet.blocks):
            value += SOUND_SPEED * self.block("clock", tap.time)[:, :1]
        detour, _ = self.echoes(tap)
        return _Ranges(there.reshape(n, c), value, detour, path.time.reshape(n, c))
