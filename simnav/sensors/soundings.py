"""What instruments share that measure the distance to the bottom: rays, equation, noise, false and lost readings.

A beam with the direction u, from the transducer at the place p and the depth z, meets the bottom of the depth D at the
distance r where D(p + r u) = z + r u_down. The reading is ::

    range = (1 + k) r + c / q,    q = u_down - u . grad D

with the relative error k of the assumed speed of sound (block ``sound_speed``) and the error c of the chart there
(block ``chart``, one state for each beam: they meet the bottom at places of their own). With the axis ``body`` the beam
turns with the vehicle; with ``vertical`` it has gimbals, and turns with the heading only. A beam that has a width gives
the first echo: the least distance within its cone, of which nine rays are taken. With g = (grad D, -1) and the lever
arm a north-east-down the derivatives of r are g/q by the position, and (a + r u) x g / q by a small turn of the
vehicle.

An estimator has the chart of the bottom in the datasheet (``details["bottom"]``, `simnav.world.depth_grid.grid_of`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simnav.blocks import StateBlock
from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rpy
from simnav.kinds import Component, Datasheet, NavigationPoint, NavigationPoints
from simnav.labels import REFLECTION, FaultLabel
from simnav.recording import AidStream
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.errors import InstrumentError
from simnav.sensors.instrument import ZERO, AidSpec, Instrument
from simnav.sensors.pings import Pings
from simnav.sensors.single_reading import single_reading
from simnav.spec import NonNegative, Positive, Vector, quantity
from simnav.types import NO_SIDE, Array, TapStates
from simnav.world.bathymetry import Bottom
from simnav.world.depth_grid import DepthGrid, grid_of
from simnav.world.sound_speed import SOUND_SPEED
from simnav.world.surroundings import FlatBottom

__all__ = ["SIDE", "SoundingSpec", "Soundings", "beam_angles", "observe", "observe_all", "reading_sigma", "soundings"]

Axis = Literal["body", "vertical"]

#: The side information of a reading.
SIDE = (Component("noise_ratio", ""),)
#: What the rays at the edge of a beam are turned by about its middle [rad].
_AROUND = np.arange(8) * 0.25 * np.pi
#: A false reading is of something between these shares of the distance.
_FALSE_RANGE = (0.1, 0.9)
_RATIO_STEP = 0.01
_LEAST_CLOSING = 0.1


@dataclass(frozen=True)
class Soundings:
    """Where n beams meet the bottom.

    Attributes
    ----------
    distance : (n,) array
        Along the ray of the first echo [m].
    ray : (n, 3) array
        Its direction, north-east-down.
    gradient : (n, 2) array
        Of the depth of the bottom there.
    met : (n,) array of bool
        Whether the beam meets the bottom, on the grid.
    """

    distance: Array
    ray: Array
    gradient: Array
    met: NDArray[np.bool_]


def beam_angles(count: int, swath: float) -> Array:
    """(c,) angles of beams from straight down to starboard [rad]."""
    return np.linspace(-0.5 * swath, 0.5 * swath, count) if count > 1 else np.zeros(1)


def _frames(dcm: Array, axis: Axis) -> Array:
    """(n, 3, 3) matrices from the axes of the beams to north-east-down."""
    if axis == "body":
        return dcm
    heading = np.arctan2(dcm[:, 1, 0], dcm[:, 0, 0])
    level = np.zeros(dcm.shape)
    level[:, 0, 0] = level[:, 1, 1] = np.cos(heading)
    level[:, 1, 0] = np.sin(heading)
    level[:, 0, 1] = -level[:, 1, 0]
    level[:, 2, 2] = 1.0
    return level


def soundings(
    grid: DepthGrid, position: Array, dcm: Array, lever_arm: Array, angle: Array, axis: Axis, width: float
) -> Soundings:
    """Where beams meet the bottom.

    Parameters
    ----------
    grid : DepthGrid
        The bottom.
    position, dcm : (n, 3) array, (n, 3, 3) array
        Of the vehicle: latitude, longitude [rad], height [m]; body axes to north-east-down.
    lever_arm : (3,) array
        Body axes [m].
    angle : (n,) array
        Of each beam from straight down to starboard [rad].
    axis : str
        ``body`` or ``vertical``.
    width : float
        Of each beam, from edge to edge [rad].
    """
    arm = dcm @ lever_arm
    offset, depth = grid.offset(position) + arm[:, :2], arm[:, 2] - position[:, 2]
    n, level = len(offset), np.zeros((len(offset), 1, 3))
    if axis == "vertical" and not width and not angle.any():
        level[:, 0, 2] = 1.0
        rays = level
    else:
        sine, cosine = np.sin(angle), np.cos(angle)
        middle = np.stack([np.zeros(n), sine, cosine], axis=1)[:, None]
        if width:
            aside = np.stack([np.zeros(n), cosine, -sine], axis=1)[:, None]
            edge = np.cos(_AROUND)[None, :, None] * np.array([1.0, 0.0, 0.0])
            edge = edge + np.sin(_AROUND)[None, :, None] * aside
            edge = np.cos(0.5 * width) * middle + np.sin(0.5 * width) * edge
            middle = np.concatenate([middle, edge], axis=1)
        rays = np.einsum("nij,nkj->nki", _frames(dcm, axis), middle)
    k = rays.shape[1]
    flat = np.ascontiguousarray(rays.reshape(n * k, 3))
    places = np.repeat(offset, k, axis=0)
    distance, gradient, met = grid.distance(places, np.repeat(depth, k), flat)
    met &= grid.inside(places + distance[:, None] * flat[:, :2])
    at = np.arange(n) * k
    if k > 1:
        at = at + np.argmin(np.where(met, distance, np.inf).reshape(n, k), axis=1)
    return Soundings(distance[at], flat[at], gradient[at], met[at])


def observe_all(points: NavigationPoints, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """Ranges at n states, and their Jacobians by block (`simnav.kinds.Observations`)."""
    n, blocks, details = len(points.position), points.blocks, sheet.details
    navigation = np.zeros((n, 1, 9))
    given = {"navigation": navigation} | {
        name: np.zeros((n, 1, blocks[name].shape[1])) for name in ("sound_speed", "chart") if name in blocks
    }
    if "bottom" not in details:  # without a chart a range says nothing
        return np.zeros((n, 1)), given
    axis: Axis = details["axis"]
    angle = beam_angles(len(sheet.channels), details.get("swath", 0.0))[points.channel]
    grid = grid_of(details["bottom"])
    found = soundings(grid, points.position, points.dcm, sheet.lever_arm, angle, axis, details["beam_width"])
    distance, ray = found.distance, found.ray
    normal = np.concatenate([found.gradient, np.full((n, 1), -1.0)], axis=1)
    closing = np.maximum(-np.sum(normal * ray, axis=1), _LEAST_CLOSING)
    normal /= closing[:, None]
    arm, reach = points.dcm @ sheet.lever_arm, distance[:, None] * ray
    navigation[:, 0, :3] = normal
    if axis == "body":
        navigation[:, 0, 6:9] = np.cross(arm + reach, normal)
    else:
        navigation[:, 0, 6:9] = np.cross(arm, normal)
        navigation[:, 0, 8] += np.cross(reach, normal)[:, 2]
    reading = distance
    if "sound_speed" in blocks:
        scale = 1.0 + blocks["sound_speed"][:, 0]
        given["sound_speed"][:, 0, 0] = distance
        navigation *= scale[:, None, None]
        reading = scale * distance
    if "chart" in blocks:
        each = np.arange(n), points.channel  # of each beam the error of the chart where it meets the bottom
        given["chart"][each[0], 0, each[1]] = 1.0 / closing
        reading = reading + blocks["chart"][each] / closing
    return reading[:, None], given


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """The range at a state and its Jacobian by block (`simnav.kinds.Observation`)."""
    return single_reading(observe_all, point, sheet)


def reading_sigma(side: Array, sheet: Datasheet) -> Array:
    """The noise of readings, stated as a multiple of the least one (`simnav.kinds.ReadingSigma`)."""
    return np.asarray(sheet.sigma * side[..., 0:1])


class SoundingSpec(AidSpec):
    """Base class of the specifications of instruments that measure the distance to the bottom.

    Attributes
    ----------
    sigma, range_noise : float
        White noise of a reading: at the transducer [m], and its growth with the range.
    bias, bias_instability : float
        [m]
    sound_speed : float
        One sigma of the relative error of the assumed speed of sound, constant in a run.
    fixed_sound_speed : float
        A relative error that is added; no datasheet has it.
    axis : str
        ``body``: the beams turn with the vehicle; ``vertical``: they have gimbals, and turn with the heading only.
    beam_width : float
        Of a beam, from edge to edge: the first echo from it is taken [rad]. 0: a single ray.
    minimum_range, maximum_range : float
        Between these there are readings [m].
    lost : float
        Probability that a reading is lost.
    false_readings : float
        Probability that something above the bottom is taken for it.
    chart_error, chart_error_time : float
        What the datasheet says of the error of the chart: one sigma [m], and its correlation time as the vehicle moves,
        that is ``chart_error_scale`` of the bathymetry over the speed [s].
    """

    errors: ClassVar[tuple[str, ...]] = (*AidSpec.errors, "range_noise", "sound_speed", "chart_error")
    charts: ClassVar[tuple[str, ...]] = ("bottom",)

    sigma: NonNegative = quantity("m", 0.05)
    range_noise: NonNegative = quantity("percent", 0.001)
    bias: NonNegative = quantity("m", 0.0)
    bias_instability: NonNegative = quantity("m", 0.0)
    sound_speed: NonNegative = quantity("percent", 0.0)
    fixed_sound_speed: float = quantity("percent", 0.0)
    axis: Axis = "body"
    beam_width: float = quantity("deg", 0.0, ge=0.0, le=np.pi / 3.0)
    minimum_range: NonNegative = quantity("m", 0.3)
    maximum_range: Positive = quantity("m", 100.0)
    lost: float = Field(0.0, ge=0.0, le=1.0)
    false_readings: float = Field(0.0, ge=0.0, le=1.0)
    chart_error: NonNegative = quantity("m", 0.0)
    chart_error_time: Positive = quantity("s", 30.0)
    lever_arm: Vector = quantity("m", ZERO)
    fixed_bias: float = quantity("m", 0.0)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.minimum_range >= self.maximum_range:
            raise ValueError(
                f"minimum_range_m = {self.minimum_range:g}: should be below maximum_range_m = {self.maximum_range:g}"
            )
        if not -0.2 < self.fixed_sound_speed < 0.2:
            raise ValueError(
                f"fixed_sound_speed_percent = {100.0 * self.fixed_sound_speed:g}: should be an error of some percent, "
                "between -20 and 20"
            )
        return self

    def blocks(self) -> tuple[StateBlock, ...]:
        """Speed of sound and error of the chart, as far as there are."""
        found = []
        if self.sound_speed:
            found.append(StateBlock("sound_speed", 1, "", self.sound_speed))
        if self.chart_error:
            found.append(
                StateBlock.stationary("chart", len(self.channels()), "m", self.chart_error, self.chart_error_time)
            )
        return tuple(found)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Sounder(self, name, seed)


@dataclass(frozen=True)
class _Readings:
    """What the beams give at n times: (n, c) arrays."""

    there: NDArray[np.bool_]
    value: Array
    false: Array
    ratio: Array


class _Sounder(ChannelInstrument):
    """Parameters as of `ChannelInstrument`."""

    def __init__(self, spec: SoundingSpec, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec
        self.angles = beam_angles(len(self.channels), getattr(spec, "swath", 0.0))
        self._chances = [self._stream(c, "chances") for c in self.channels] if spec.lost or spec.false_readings else []
        self._pace = Pings()
        self._last: tuple[TapStates, _Readings] | None = None

    def observe(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.observe`."""
        found = self._readings_of(tap)
        return np.asarray((found.value + found.false)[:, :, None])

    def side_information(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.side_information`."""
        return np.asarray(self._readings_of(tap).ratio[:, :, None])

    def available(self, tap: TapStates) -> NDArray[np.bool_]:
        """See `ChannelInstrument.available`."""
        return self._readings_of(tap).there

    def noise_sigma(self, observed: Array, side: Array = NO_SIDE) -> Array:
        """See `ChannelInstrument.noise_sigma`."""
        return reading_sigma(np.where(np.isfinite(side), side, 1.0), self.sheet)

    def own_label(self, duration: float) -> FaultLabel | None:
        """Of false readings."""
        return FaultLabel(REFLECTION, (self.name,), 0.0, duration) if self.spec.false_readings else None

    def sense(self, tap: TapStates) -> AidStream:
        """See `ChannelInstrument.sense`. False readings are labelled, with their errors."""
        found = super().sense(tap)
        if not self.spec.false_readings:
            return found
        error = self._readings_of(tap).false[np.searchsorted(tap.time, found.time), found.channel]
        return replace(
            found,
            faults=np.where(error != 0.0, np.uint32(1 << self.bit), np.uint32(0)),
            fault_error=error[:, None].copy(),
        )

    def _readings_of(self, tap: TapStates) -> _Readings:
        if self._last is None or self._last[0] is not tap:
            self._last = tap, self._ping(tap)
        return self._last[1]

    def _ping(self, tap: TapStates) -> _Readings:
        n, c, spec = len(tap.time), len(self.channels), self.spec
        chance = (
            np.stack([rng.random((n, 3)) for rng in self._chances], axis=1) if self._chances else np.ones((n, c, 3))
        )
        grid = self._grid(tap)
        if grid is None or not n:
            return _Readings(np.zeros((n, c), np.bool_), np.zeros((n, c)), np.zeros((n, c)), np.ones((n, c)))
        position, dcm = np.repeat(tap.position, c, axis=0), np.repeat(dcm_from_rpy(tap.attitude), c, axis=0)
        angle = np.tile(self.angles, n)
        found = soundings(grid, position, dcm, self.lever_arm, angle, spec.axis, spec.beam_width)
        distance, met = found.distance.reshape(n, c), found.met.reshape(n, c)
        low = met & (distance < 0.0)
        if low.any():
            i = int(np.argmax(low.any(axis=1)))
            raise InstrumentError(
                f"instrument {self.name!r} of kind {self.kind!r}: at {tap.time[i]:g} s it is "
                f"{-distance[i].min():.1f} m below the bottom; the voyage should be above it"
            )
        met &= (distance >= spec.minimum_range) & (distance <= spec.maximum_range)
        takes = 2.0 / SOUND_SPEED * np.where(met, distance, spec.maximum_range).max(axis=1)
        there = met & self._pace.begin(tap.time, takes)[:, None] & (chance[:, :, 0] >= spec.lost)
        distance = np.where(met, distance, spec.minimum_range)
        ratio = np.ones((n, c))
        if spec.sigma:
            ratio = np.hypot(1.0, spec.range_noise * distance / spec.sigma)
            ratio = np.round(ratio / _RATIO_STEP) * _RATIO_STEP
        scale = np.full(n, 1.0 + spec.fixed_sound_speed)
        if spec.sound_speed:
            scale += self.block("sound_speed", tap.time)[:, 0]
        value = scale[:, None] * distance
        share = _FALSE_RANGE[0] + (_FALSE_RANGE[1] - _FALSE_RANGE[0]) * chance[:, :, 2]
        false = np.where(there & (chance[:, :, 1] < spec.false_readings), (share - 1.0) * value, 0.0)
        return _Readings(there, value, false, ratio)

    def _grid(self, tap: TapStates) -> DepthGrid | None:
        """The true bottom; None where nothing is known of it."""
        bottom = self.surroundings.get("bottom")
        if isinstance(bottom, FlatBottom):
            return DepthGrid.level(bottom.water_depth)
        if isinstance(bottom, Bottom):
            bottom.within(displace(tap.position, self.lever_displacement(tap)))
            return bottom.grid
        if bottom is not None:
            raise InstrumentError(
                f"instrument {self.name!r} of kind {self.kind!r}: it needs water_depth_m or [surroundings.bathymetry], "
                f"not a bottom that is a {type(bottom).__name__}"
            )
        return None
