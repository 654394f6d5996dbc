"""A Doppler velocity log beam by beam: four beams to the bottom (bottom track) or into the water (water track).

The reading of a beam with the direction d, at the velocity u of the transducer in the axes of the instrument, is ::

    u      = R(eta)' (C' (v - w) + omega x l)
    radial = (1 + k) d' u                                         (a piston for each beam)
    radial = s' u + sqrt((1 + k)^2 - |s|^2) u_down                (a phased array; s are the level components of d)

with the mounting error eta (block ``mounting``) and the relative error k of the assumed speed of sound (block
``sound_speed``), which all beams share. A phased array steers its beams by the speed of sound: its level velocity does
not depend on k, only the vertical one does (Teledyne RD Instruments, *Pathfinder DVL guide*, April 2018, "Correction
for vertical speed of sound for phased arrays"). w is zero for bottom track. For water track it is the velocity of the
water in a layer from 20 to 80 % of the range (the same guide, "Water tracking"), and estimators have a block
``current`` for it.

A ping takes the time of the farthest echo; the next one begins after it (``overhead``), so the rate falls with the
altitude. A beam is heard while the ratio of signal to noise, with its fading, is above 0 dB: that is the reach over a
bottom as the range of the datasheet has it; ``bottom_loss`` is what a softer bottom takes away, and ``aeration`` what
bubbles do. Without three pings the lock is lost, and regained when beams were heard for the time ``search``. A false
beam hears something that drifts with the water: such a reading has a label.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, inf, radians, sin
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simnav.blocks import StateBlock
from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rotation_vector, skew
from simnav.kinds import Component, Datasheet, Kind, NavigationPoint, NavigationPoints, speed_components
from simnav.labels import REFLECTION, FaultLabel
from simnav.recording import AidStream
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.instrument import (
    ZERO,
    AidSpec,
    Instrument,
    SigmaTriple,
    register_instrument,
    turn_to_body,
    turn_to_ned,
)
from simnav.sensors.janus import absorption, beam_axes, noise_by_range, signal_margin
from simnav.sensors.pings import Pings
from simnav.sensors.processes import GaussMarkov
from simnav.sensors.single_reading import single_reading
from simnav.spec import NonNegative, Positive, Vector, quantity
from simnav.streams import stream
from simnav.types import NO_SIDE, Array, TapStates
from simnav.world.surroundings import FlatBottom

__all__ = ["CLASSES", "DvlBeams", "FrequencyClass"]

#: Speed of sound that times of pings are computed with [m/s].
_SOUND = 1500.0
#: Water track: the layer begins and ends at these shares of the range, and is at least so thick [m].
_LAYER, _THINNEST = (0.2, 0.8), 2.0
#: Missed pings after which the lock is lost.
_MISSES = 3
#: Velocity of what a false beam hears, relative to the water, one sigma of each component [m/s], and where it is, as
#: shares of the range.
_DRIFTING, _FALSE_RANGE = 0.2, (0.2, 0.9)
#: Noise of a slant range as a share of it, and steps in which ranges [m] and noise ratios are told.
_RANGE_NOISE, _RANGE_STEP, _RATIO_STEP = 0.002, 0.01, 0.01
#: Correlation time of the bubbles under a hull [s].
_BUBBLES = 5.0
#: A beam that comes closer to the horizon than this hears no bottom (the cosine of its angle from straight down).
_LEVEL = 0.1
#: Ratio of signal to noise where the bottom is not known, and of water track [dB].
_STRONG = 40.0
#: The largest noise is that at this ratio [dB].
_WEAKEST = -6.0
#: Keys of the figures of a class.
_FIGURES = {
    "sigma": "sigma_m_s", "slant": "slant_deg", "minimum_altitude": "minimum_altitude_m",
    "maximum_altitude": "maximum_altitude_m", "bias": "bias_m_s", "sound_speed": "sound_speed_percent",
}  # fmt: skip


@dataclass(frozen=True)
class FrequencyClass:
    """Figures of a class of instruments. They are defaults; every one is a key of its own.

    Attributes
    ----------
    sigma : float
        Noise of a beam in one ping [m/s].
    slant : float
        Angle of the beams from straight down [rad].
    minimum_altitude, maximum_altitude : float
        [m]
    bias, sound_speed : float
        Long-term accuracy: of each beam [m/s], and relative.
    """

    sigma: float
    slant: float
    minimum_altitude: float
    maximum_altitude: float
    bias: float
    sound_speed: float


#: By frequency [kHz]. Their sources are in ``docs/how-to/use-dvl-beams.md``.
CLASSES: Mapping[float, FrequencyClass] = {
    500.0: FrequencyClass(0.003, radians(25.0), 0.3, 200.0, 0.001, 0.001),
    600.0: FrequencyClass(0.0035, radians(30.0), 0.7, 90.0, 0.001, 0.002),
    1000.0: FrequencyClass(0.003, radians(25.0), 0.2, 75.0, 0.001, 0.001),
}


def _directions(side: Array, array: str, scale: Array) -> tuple[Array, Array]:
    """(n, 3) vectors whose products with a velocity are the readings, and their derivatives by the scale (n, 3)."""
    azimuth, slant = side[:, 0], side[:, 1]
    axes = beam_axes(azimuth, slant)
    if array == "piston":
        return (1.0 + scale)[:, None] * axes, axes
    steered = np.sqrt((1.0 + scale) ** 2 - np.sin(slant) ** 2)
    change = np.zeros_like(axes)
    change[:, 2] = (1.0 + scale) / steered
    return np.column_stack([axes[:, :2], steered]), change


def observe_all(points: NavigationPoints, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """The velocities along a beam at n states, and their Jacobians by block (`simnav.kinds.Observations`)."""
    n, blocks, velocity = len(points.velocity), points.blocks, points.velocity
    scale = blocks["sound_speed"][:, 0] if "sound_speed" in blocks else np.zeros(n)
    along, change = _directions(points.side, sheet.details["array"], scale)
    if "current" in blocks:
        velocity = velocity.copy()
        velocity[:, :2] -= blocks["current"]
    own = (velocity[:, None] @ points.dcm)[:, 0] + points.angular_rate @ skew(sheet.lever_arm)
    body = along  # in body axes
    if "mounting" in blocks:
        turn = dcm_from_rotation_vector(blocks["mounting"])
        own, body = (own[:, None] @ turn)[:, 0], (turn @ along[:, :, None])[:, :, 0]
    level = points.dcm @ body[:, :, None]
    navigation = np.zeros((n, 1, 9))
    navigation[:, 0, 3:6] = level[:, :, 0]
    navigation[:, :, 6:9] = velocity[:, None] @ skew(level[:, :, 0]).swapaxes(1, 2)
    jacobian = {"navigation": navigation}
    if "sound_speed" in blocks:
        jacobian["sound_speed"] = np.sum(change * own, axis=1)[:, None, None]
    if "mounting" in blocks:
        jacobian["mounting"] = own[:, None] @ skew(along).swapaxes(1, 2)
    if "current" in blocks:
        jacobian["current"] = -navigation[:, :, 3:5]
    return np.sum(along * own, axis=1)[:, None], jacobian


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """The velocity along a beam and its Jacobian by block (`simnav.kinds.Observation`)."""
    return single_reading(observe_all, point, sheet)


def reading_sigma(side: Array, sheet: Datasheet) -> Array:
    """The noise of readings, from what the instrument says of each ping (`simnav.kinds.ReadingSigma`)."""
    return np.asarray(sheet.sigma * side[..., 3:4])


@register_instrument(
    Kind(
        "velocity along each acoustic beam",
        role="velocity",
        components=speed_components("radial"),
        equation=observe,
        observations=observe_all,
        datasheet=("array", "track", "frequency_khz"),
        side=(
            Component("azimuth", "deg"),
            Component("slant", "deg"),
            Component("range", "m"),
            Component("noise_ratio", ""),
        ),
        reading_sigma=reading_sigma,
    ),
    example={"frequency_khz": 600, "sigma_m_s": 0.002, "sound_speed_percent": 0.2},
)
class DvlBeams(AidSpec):
    """Velocities along the four beams of a Doppler velocity log. Its channels are ``1`` to ``4``, clockwise.

    Attributes
    ----------
    frequency_khz : float
        Frequency, for the absorption of sound. At 500, 600 and 1000 `CLASSES` has the figures that are not given; at
        another one all of them are to be given.
    array : str
        ``piston``: a transducer for each beam; ``phased``: one array that steers the beams.
    track : str
        ``bottom`` or ``water``.
    sigma, speed_noise : float
        Noise of a beam in one ping with a strong echo: at rest [m/s], and its growth with the speed [-].
    bias : float
        Of each beam, constant in a run [m/s].
    sound_speed : float
        One sigma of the relative error of the assumed speed of sound.
    mounting : tuple of float
        One sigma of the mounting angles about the body axes [rad].
    slant, azimuth : float
        Angle of the beams from straight down; azimuth of the first beam from forward to starboard [rad].
    minimum_altitude, maximum_altitude : float
        Between these a beam over the bottom of the datasheet is heard on level keel [m].
    bottom_loss : float
        What a softer bottom takes from the echo [dB].
    fading : float
        One sigma of the strength of an echo from ping to ping [dB].
    aeration : float
        What bubbles take from all echoes, one sigma for each metre of significant wave height [dB].
    false_beams : float
        Probability that a beam hears something else in a ping.
    overhead : float
        Time of a ping beyond that of the farthest echo [s].
    search : float
        Time in which beams are heard before the lock is regained [s].
    current, current_time : float
        Of water track: one sigma of each component of the velocity of the layer [m/s], and its correlation time [s].

    Examples
    --------
    >>> spec = DvlBeams.from_toml({"frequency_khz": 500})
    >>> spec.maximum_altitude, spec.channels(), [block.name for block in spec.blocks()]
    (200.0, ('1', '2', '3', '4'), ['sound_speed'])
    """

    errors: ClassVar[tuple[str, ...]] = (*AidSpec.errors, "speed_noise", "sound_speed", "mounting")

    kind: Literal["dvl_beams"] = "dvl_beams"
    frequency_khz: float = Field(600.0, ge=20.0, le=5000.0, description="kHz")
    array: Literal["piston", "phased"] = "piston"
    track: Literal["bottom", "water"] = "bottom"
    sigma: NonNegative = quantity("m_s", CLASSES[600.0].sigma)
    speed_noise: NonNegative = quantity("percent", 0.0)
    bias: NonNegative = quantity("m_s", CLASSES[600.0].bias)
    sound_speed: NonNegative = quantity("percent", CLASSES[600.0].sound_speed)
    mounting: SigmaTriple = quantity("deg", ZERO)
    slant: float = quantity("deg", CLASSES[600.0].slant, gt=0.0, le=radians(60.0))
    azimuth: float = quantity("deg", radians(45.0))
    minimum_altitude: NonNegative = quantity("m", CLASSES[600.0].minimum_altitude)
    maximum_altitude: Positive = quantity("m", CLASSES[600.0].maximum_altitude)
    bottom_loss: NonNegative = Field(0.0, description="dB", lt=100.0)
    fading: NonNegative = Field(2.0, description="dB", lt=100.0)
    aeration: NonNegative = Field(0.0, description="dB for each metre of significant wave height", lt=100.0)
    false_beams: float = Field(0.0, ge=0.0, le=1.0)
    overhead: NonNegative = quantity("s", 0.03)
    search: NonNegative = quantity("s", 2.0)
    current: Positive = quantity("m_s", 0.5)
    current_time: Positive = quantity("s", 1800.0)
    lever_arm: Vector = quantity("m", ZERO)
    fixed_sound_speed: float = quantity("percent", 0.0)

    @model_validator(mode="before")
    @classmethod
    def _figures_of_the_class(cls, given: Any) -> Any:
        """What is not given is that of the class."""
        if not isinstance(given, Mapping):
            return given
        frequency = given.get("frequency_khz", 600.0)
        if isinstance(frequency, bool) or not isinstance(frequency, int | float):
            return given  # a message of its own
        figures = CLASSES.get(float(frequency))
        if figures is not None:
            return {**vars(figures), **given}
        missing = [name for name in _FIGURES if name not in given]
        if missing:
            raise ValueError(
                f"frequency_khz = {frequency:g}: figures are known at {', '.join(f'{f:g}' for f in CLASSES)} kHz; at "
                f"another frequency give {', '.join(_FIGURES[name] for name in missing)} too"
            )
        return given

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.minimum_altitude >= self.maximum_altitude:
            raise ValueError(
                f"minimum_altitude_m = {self.minimum_altitude:g}: should be below maximum_altitude_m = "
                f"{self.maximum_altitude:g}"
            )
        if 1.0 + self.fixed_sound_speed <= sin(self.slant):
            raise ValueError(
                f"fixed_sound_speed_percent = {100.0 * self.fixed_sound_speed:g}: the assumed speed of sound is so low "
                "that no beam leaves the instrument; an error is a few percent"
            )
        if self.maximum_altitude == inf:
            raise ValueError("maximum_altitude_m = inf: an echo is weaker the farther it comes; give a finite altitude")
        return self

    def channels(self) -> tuple[str, ...]:
        """The beams."""
        return ("1", "2", "3", "4")

    def blocks(self) -> tuple[StateBlock, ...]:
        """Speed of sound and mounting as far as they have errors; for water track the velocity of the water."""
        found = []
        if self.sound_speed:
            found.append(StateBlock("sound_speed", 1, "", self.sound_speed))
        if any(self.mounting):
            found.append(StateBlock("mounting", 3, "deg", self.mounting))
        if self.track == "water":
            found.append(
                StateBlock("current", 2, "m_s", self.current, "gauss_markov", correlation_time=self.current_time)
            )
        return tuple(found)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _DvlBeams(self, name, seed)


@dataclass(frozen=True)
class _Pings:
    """What the beams of n pings meet: all arrays are (n, 4) but the last one."""

    there: NDArray[np.bool_]
    value: Array
    false: Array
    side: Array


class _DvlBeams(ChannelInstrument):
    """Parameters as of `ChannelInstrument`."""

    def __init__(self, spec: DvlBeams, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec
        self.azimuths = spec.azimuth + np.radians([0.0, 90.0, 180.0, 270.0])
        self.axes = beam_axes(self.azimuths, spec.slant)
        self.reach = spec.maximum_altitude / cos(spec.slant)
        self.damping = absorption(float(spec.frequency_khz))
        self._echoes = [self._stream(c, "echo") for c in self.channels]
        self._chances = [self._stream(c, "false_beams") for c in self.channels]
        self._bubbles = (
            GaussMarkov(1.0, _BUBBLES, stream(seed, "instrument", name, "bubbles")) if spec.aeration else None
        )
        self._last: tuple[TapStates, _Pings] | None = None
        # The state from block to block: pings, missed ones, since when beams are heard while there is no lock.
        self._pace, self._missed, self._heard_since = Pings(), 0, inf

    def observe(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.observe`."""
        pings = self._pings(tap)
        return (pings.value + pings.false)[:, :, None]

    def side_information(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.side_information`."""
        return self._pings(tap).side

    def available(self, tap: TapStates) -> NDArray[np.bool_]:
        """See `ChannelInstrument.available`."""
        return self._pings(tap).there

    def noise_sigma(self, observed: Array, side: Array = NO_SIDE) -> Array:
        """See `ChannelInstrument.noise_sigma`."""
        return reading_sigma(side, self.sheet)

    def own_label(self, duration: float) -> FaultLabel | None:
        """Of false beams."""
        return FaultLabel(REFLECTION, (self.name,), 0.0, duration) if self.spec.false_beams else None

    def sense(self, tap: TapStates) -> AidStream:
        """See `ChannelInstrument.sense`. False beams are labelled, with their errors."""
        found = super().sense(tap)
        if not self.spec.false_beams:
            return found
        error = self._pings(tap).false[np.searchsorted(tap.time, found.time), found.channel]
        return replace(
            found,
            faults=np.where(error != 0.0, np.uint32(1 << self.bit), np.uint32(0)),
            fault_error=error[:, None].copy(),
        )

    def _pings(self, tap: TapStates) -> _Pings:
        if self._last is None or self._last[0] is not tap:
            self._last = tap, self._ping(tap)
        return self._last[1]

    def _ping(self, tap: TapStates) -> _Pings:
        n, spec = len(tap.time), self.spec
        drawn = np.stack([rng.standard_normal((n, 5)) for rng in self._echoes], axis=1)
        place = displace(tap.position, self.lever_displacement(tap))
        distance = self._ranges(tap, place)
        known = self.surroundings.get("bottom") is not None
        margin = (
            signal_margin(distance, self.reach, self.damping) - spec.bottom_loss if known else np.full((n, 4), _STRONG)
        )
        if self._bubbles is not None:
            waves = self.surroundings.get("sea")
            height = 0.0 if waves is None else waves.sea.significant_height
            margin = margin - spec.aeration * height * np.maximum(self._bubbles.sample(tap.time), 0.0)
        heard = np.ones((n, 4), np.bool_)
        if known:
            heard = (margin + spec.fading * drawn[:, :, 0] >= 0.0) & (
                distance >= spec.minimum_altitude / cos(spec.slant)
            )
        echo = np.where(heard, distance, self.reach)
        water = self._water(tap, place, distance)
        if spec.track == "water":
            nearest = echo.min(axis=1)
            thick = (_LAYER[1] - _LAYER[0]) * nearest * cos(spec.slant) >= _THINNEST
            takes, margin = 2.0 / _SOUND * nearest + spec.overhead, np.full((n, 4), _STRONG)
            there = np.repeat((self._pace.begin(tap.time, takes) & thick)[:, None], 4, axis=1)
        else:
            takes = 2.0 / _SOUND * echo.max(axis=1) + spec.overhead if known else np.zeros(n)
            there = heard & self._locked(tap.time, self._pace.begin(tap.time, takes), heard)[:, None]
        value, speed = self._along(tap, water if spec.track == "water" else np.zeros((n, 3)))
        relative = 1.0 if not spec.sigma else np.hypot(1.0, spec.speed_noise * speed / spec.sigma)[:, None]
        ratio = noise_by_range(np.maximum(margin, _WEAKEST)) * relative
        ratio = np.maximum(np.round(ratio / _RATIO_STEP), 1.0) * _RATIO_STEP
        false = np.zeros((n, 4))
        told = np.where(np.isfinite(distance), distance, 0.0) if known else np.zeros((n, 4))
        if spec.false_beams:
            chance = np.stack([rng.random((n, 2)) for rng in self._chances], axis=1)
            wrong = there & (chance[:, :, 0] < spec.false_beams)
            drifting, _ = self._along(tap, water)
            swims = _DRIFTING * np.einsum("nci,ci->nc", drawn[:, :, 1:4], self.axes)
            false = np.where(wrong, drifting + swims - value, 0.0)
            share = _FALSE_RANGE[0] + (_FALSE_RANGE[1] - _FALSE_RANGE[0]) * chance[:, :, 1]
            told = np.where(wrong, share * told, told)
        told = np.round(told * (1.0 + _RANGE_NOISE * drawn[:, :, 4]) / _RANGE_STEP) * _RANGE_STEP
        side = np.empty((n, 4, 4))
        side[:, :, 0], side[:, :, 1], side[:, :, 2], side[:, :, 3] = self.azimuths, spec.slant, told, ratio
        return _Pings(there, value, false, side)

    def _ranges(self, tap: TapStates, place: Array) -> Array:
        """(n, 4) slant ranges to the bottom [m]; infinite for beams that do not meet it. The bottom may slope."""
        n, bottom = len(tap.time), self.surroundings.get("bottom")
        if bottom is None:
            return np.full((n, 4), np.inf)
        ways = np.stack([turn_to_ned(tap.attitude, axis) for axis in self.axes], axis=1)
        down = ways[:, :, 2]
        met = down > _LEVEL
        altitude = place[:, 2] + bottom.depth(place, tap.time)
        distance = np.where(met, altitude[:, None] / np.where(met, down, 1.0), np.inf)
        if isinstance(bottom, FlatBottom):
            return np.maximum(distance, 0.0)
        for _ in range(3):
            for j in range(4):
                r = np.where(met[:, j], distance[:, j], 0.0)
                foot = displace(place, r[:, None] * ways[:, j])
                depth = place[:, 2] + bottom.depth(foot, tap.time)
                distance[:, j] = np.where(met[:, j], depth / np.where(met[:, j], down[:, j], 1.0), np.inf)
        return np.maximum(distance, 0.0)

    def _water(self, tap: TapStates, place: Array, distance: Array) -> Array:
        """(n, 3) velocity of the water in the middle of the layer, north-east-down [m/s]."""
        flow = self.surroundings.get("current")
        if flow is None:
            return np.zeros((len(tap.time), 3))
        extent = np.minimum(distance.min(axis=1), self.reach) * cos(self.spec.slant)
        middle = displace(place, np.outer(0.5 * sum(_LAYER) * extent, [0.0, 0.0, 1.0]))
        return np.asarray(flow.velocity(middle, tap.time))

    def _along(self, tap: TapStates, water: Array) -> tuple[Array, Array]:
        """(n, 4) velocities along the beams relative to what moves with ``water``, and the (n,) speed."""
        own = turn_to_body(tap.attitude, tap.velocity - water) + self.lever_velocity(tap)
        if any(self.spec.mounting):
            own = own @ dcm_from_rotation_vector(self.block("mounting", np.zeros(1))[0])
        scale = np.full(len(own), self.spec.fixed_sound_speed)
        if self.spec.sound_speed:
            scale += self.block("sound_speed", tap.time)[:, 0]
        value = np.empty((len(own), 4))
        for j in range(4):
            beam = np.broadcast_to([self.azimuths[j], self.spec.slant], (len(own), 2))
            value[:, j] = np.sum(_directions(beam, self.spec.array, scale)[0] * own, axis=1)
        return value, np.linalg.norm(own, axis=1)

    def _locked(self, time: Array, begins: NDArray[np.bool_], heard: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(n,) mask of the pings that are delivered: while there is a lock of the bottom."""
        locked = begins.copy()
        any_heard: NDArray[np.bool_] = np.any(heard, axis=1)
        for i in np.flatnonzero(begins).tolist():
            t = float(time[i])
            if not any_heard[i]:
                self._missed, self._heard_since = self._missed + 1, inf
            elif self._missed >= _MISSES:
                self._heard_since = min(self._heard_since, t)
                if t - self._heard_since < self.spec.search:
                    locked[i] = False
                else:
                    self._missed = 0
            else:
                self._missed = 0
        return locked
