"""What acoustic instruments share: the path of the sound between two positions, and what a device makes of its time.

The part ``sound_speed_profile`` of the surroundings (`simnav.world.sound_speed`) bends the rays; without it the sound
has 1500 m/s everywhere. A device turns the time t and the angle of arrival into a range and a direction in one of three
ways (``correction``):

- ``profile``: it traces the ray through the profile, which it knows: range and direction are those of the straight line
- ``harmonic``: the range is t times the mean speed of a vertical ray between the two depths, and the direction is that
  of the ray where it arrives, so the bend is an error
- ``fixed``: the range is t times ``assumed_speed``, and an array, which measures the horizontal part of the direction
  by phases, scales it by ``assumed_speed`` over the speed at its place

An echo may be taken for the direct sound (``reflections``): such a reading has a label.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simnav.geometry.earth import relative_position
from simnav.labels import REFLECTION, FaultLabel
from simnav.recording import AidStream
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.instrument import AidSpec
from simnav.sensors.pings import Pings
from simnav.spec import NonNegative, Positive, quantity
from simnav.timing import TimingSheet
from simnav.types import Array, Datasheet, TapStates
from simnav.world.rays import trace
from simnav.world.sound_speed import SLOWEST, SOUND_SPEED, plausible_speed
from simnav.world.surroundings import Surroundings

__all__ = ["AcousticInstrument", "AcousticSpec", "Correction", "Paths", "paths", "separation"]

Correction = Literal["profile", "harmonic", "fixed"]


def separation(first: Array, second: Array) -> Array:
    """(n, 3) vectors north-east-down [m] between n pairs of positions, from either side the same but for the sign.

    They are those at the latitude and height in the middle. `simnav.geometry.earth.relative_position` has those at one
    end, whose length differs by north times east times the tangent of the latitude over 12 000 km: 0.2 m at 78 degrees
    over 1 km.
    """
    middle = 0.5 * (first + second)
    middle[..., 1] = first[..., 1]
    return np.asarray(relative_position(second, middle) - relative_position(first, middle))


@dataclass(frozen=True)
class Paths:
    """The sound between n pairs of positions.

    Attributes
    ----------
    vector : (n, 3) array
        Straight line from the first to the second position, north-east-down at the first [m].
    distance : (n,) array
        Distance between them [m].
    time : (n,) array
        Travel time of the sound [s]; NaN where none arrives, and where one of them is not in the water.
    depression : (n,) array
        Angle below the horizontal at the first position under which the sound arrives there [rad].
    local, mean : (n,) array
        Speed of sound at the first position, and mean of a vertical ray between both depths [m/s].
    """

    vector: Array
    distance: Array
    time: Array
    depression: Array
    local: Array
    mean: Array

    def ranges(self, correction: Correction, assumed: float) -> Array:
        """(n,) ranges [m] that a device makes of the times (see the module)."""
        if correction == "profile":
            return self.distance
        return np.asarray(self.time * (self.mean if correction == "harmonic" else assumed))

    def vectors(self, correction: Correction, assumed: float) -> Array:
        """(n, 3) vectors [m] that a device with an array at the first position makes of times and angles."""
        if correction == "profile":
            return self.vector
        level = np.cos(self.depression)
        if correction == "fixed":
            level = np.minimum(level * assumed / self.local, 1.0)
        sine = np.sign(self.depression) * np.sqrt(1.0 - level**2)
        azimuth = np.arctan2(self.vector[:, 1], self.vector[:, 0])
        direction = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), sine], axis=1)
        return np.asarray(self.ranges(correction, assumed)[:, None] * direction)


def paths(surroundings: Surroundings, first: Array, second: Array) -> Paths:
    """The sound from n first to n second positions (latitude, longitude [rad], height [m]), (n, 3) arrays."""
    vector, straight = relative_position(second, first), separation(first, second)
    distance, level = np.linalg.norm(straight, axis=1), np.hypot(straight[:, 0], straight[:, 1])
    profile = surroundings.get("sound_speed_profile")
    if profile is None:
        speed = np.full(len(distance), SOUND_SPEED)
        time, depression, mean = distance / SOUND_SPEED, np.arctan2(vector[:, 2], level), speed
    else:
        bottom = surroundings.get("bottom")
        deepest = inf if bottom is None else float(bottom.depth(first[:1], np.zeros(1)).max(initial=0.0))
        depths = np.maximum(-first[:, 2], 0.0), np.maximum(-second[:, 2], 0.0)
        rays = trace(profile, *depths, level, deepest or inf)
        time, depression = rays.time, rays.depression
        speed, mean = profile.at(depths[0]), profile.harmonic_mean(*depths)
    wet = (first[:, 2] <= 0.0) & (second[:, 2] <= 0.0)
    return Paths(vector, distance, np.where(wet, time, np.nan), depression, speed, mean)


class AcousticSpec(AidSpec):
    """Base class of the specifications of acoustic instruments.

    Attributes
    ----------
    correction : str
        What the device makes of times and angles: ``profile`` (it traces the ray), ``harmonic`` (mean speed between the
        depths) or ``fixed``.
    assumed_speed : float
        Speed of sound that a device with ``correction = "fixed"`` assumes [m/s].
    sound_speed : float
        One sigma of the relative error of the speeds of sound that the device has, constant in a run.
    fixed_sound_speed : float
        A relative error that is added; no datasheet has it.
    reach : float
        Largest range [m].
    reflections : float
        Probability that an echo is taken for the direct sound.
    detour : float
        Mean of what the echo travels further, exponentially distributed [m].
    """

    errors: ClassVar[tuple[str, ...]] = (*AidSpec.errors, "sound_speed")

    correction: Correction = "profile"
    assumed_speed: Positive = quantity("m_s", SOUND_SPEED)
    sound_speed: NonNegative = quantity("percent", 0.0)
    fixed_sound_speed: float = quantity("percent", 0.0)
    reach: Positive = quantity("m", 1000.0)
    reflections: float = Field(0.0, ge=0.0, le=1.0)
    detour: NonNegative = quantity("m", 10.0)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        plausible_speed("assumed_speed_m_s", self.assumed_speed)
        if not -0.2 < self.fixed_sound_speed < 0.2:
            raise ValueError(
                f"fixed_sound_speed_percent = {100.0 * self.fixed_sound_speed:g}: should be an error of some percent, "
                "between -20 and 20"
            )
        if not isfinite(self.reach):
            raise ValueError("reach_m = inf: should be finite; the farther the sound goes, the later a reading arrives")
        return self

    def ideal(self) -> Self:
        """See `AidSpec.ideal`: rays are traced."""
        return super().ideal().model_copy(update={"correction": "profile"})

    def travels(self) -> int:
        """How many times the range the sound goes from the time of validity until the reading is there."""
        return 1

    def latency_spread(self) -> float | None:
        """See `AidSpec.latency_spread`."""
        return (super().latency_spread() or 0.0) + self.travels() * self.reach / SLOWEST

    def datasheet(self, name: str) -> Datasheet:
        """See `AidSpec.datasheet`. What it says of the clock includes the travel time from the largest range."""
        sheet = super().datasheet(name)
        if not self.travels():
            return sheet
        timing = sheet.timing or TimingSheet()
        longest = timing.latency + self.travels() * self.reach / SLOWEST
        return replace(sheet, timing=replace(timing, latency=longest))


class AcousticInstrument(ChannelInstrument):
    """An acoustic instrument in one run. A subclass computes for a block of times what its channels hear (`_hear`)."""

    def __init__(self, spec: AcousticSpec, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.acoustics = spec
        self._chances = [self._stream(c, "reflections") for c in self.channels] if spec.reflections else []
        self._turns = [self._stream(c, "directions_of_reflections") for c in self.channels] if spec.reflections else []
        self._last: tuple[TapStates, Any] | None = None
        self._pace = Pings()

    def heard(self, tap: TapStates) -> Any:
        """What `_hear` computes for a block, once."""
        if self._last is None or self._last[0] is not tap:
            self._last = tap, self._hear(tap)
        return self._last[1]

    def _hear(self, tap: TapStates) -> Any:
        raise NotImplementedError

    def speed_error(self, time: Array) -> Array:
        """(n,) relative error of the speeds of sound."""
        error = np.full(len(time), self.acoustics.fixed_sound_speed)
        if self.acoustics.sound_speed:
            error += self.block("sound_speed", time)[:, 0]
        return error

    def pinged(self, time: Array, travel: Array) -> NDArray[np.bool_]:
        """(n,) mask of the times at which a ping begins: the answers to the one before have come, or are given up.

        Parameters
        ----------
        time : (n,) array
            Sample times [s].
        travel : (n, c) array
            Travel times of the sound to each transponder, one way; NaN: none answers [s].
        """
        longest = self.acoustics.reach / SOUND_SPEED
        return self._pace.begin(time, 2.0 * np.where(np.isfinite(travel), travel, longest).max(axis=1))

    def echoes(self, tap: TapStates) -> tuple[Array, Array]:
        """(n, c) detours of echoes [m], zero where the direct sound is heard, and (n, c, 2) variates of directions."""
        n, c = len(tap.time), len(self.channels)
        if not self._chances:
            return np.zeros((n, c)), np.zeros((n, c, 2))
        chance = np.stack([rng.random((n, 2)) for rng in self._chances], axis=1)
        turned = np.stack([rng.standard_normal((n, 2)) for rng in self._turns], axis=1)
        detour = -self.acoustics.detour * np.log1p(-chance[:, :, 1])
        return np.where(chance[:, :, 0] < self.acoustics.reflections, detour, 0.0), turned

    def own_label(self, duration: float) -> FaultLabel | None:
        """Of echoes."""
        return FaultLabel(REFLECTION, (self.name,), 0.0, duration) if self.acoustics.reflections else None

    def labelled(self, tap: TapStates, found: AidStream, error: Array, latency: Array) -> AidStream:
        """A stream with the labels of echoes and the times of arrival.

        Parameters
        ----------
        tap : TapStates
            The block.
        found : AidStream
            Its readings.
        error : (n, c, d) array
            Error by echoes; zero: none.
        latency : (n, c) array
            Time from validity to arrival [s].
        """
        where = np.searchsorted(tap.time, found.time), found.channel
        wrong = error[where]
        bit = np.where(wrong.any(axis=1), np.uint32(1 << self.bit), np.uint32(0))
        late: dict[str, Any] = {} if not self.acoustics.travels() else {"arrival": found.time + latency[where]}
        return replace(found, faults=bit, fault_error=wrong.copy(), **late)
