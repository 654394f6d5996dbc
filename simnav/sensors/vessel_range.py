"""Range to another vessel with an acoustic modem, and the message of that vessel: where it believes itself to be.

The message has the position m of the transducer of the other vessel as that one believes it, its age a when the sound
leaves, its velocity u over the ground, and the covariance C of the position. With the place p of the own transducer a
range is ::

    range = (1 + k) |m + a u - e - p| + c o

with the error e of the message, the relative error k of the speed of sound (block ``sound_speed``), the offset o of the
own clock from that of the other vessel (block ``clock``, with its drift; one-way only) and c = 1500 m/s. The channel is
the other vessel.

The covariance of the message is noise of the range: its part along the line of sight (`Kind.message_noise`). But e is
not white (`simnav.sensors.other_vessel`): the slow error of a ship's GNSS and the drift of a second AUV are common to
many messages. A filter that takes them for white counts one error as many, and is too sure of itself. What can be done:

- the row ``ekf-ci`` assumes no more than the covariance (`simnav.estimators.adaptations.intersection`)
- with ``declared = true`` the datasheet describes the slow error of a ship as a process, so it has states (block
  ``vessel``) and the noise is only what is white. Oracles and the bound always know it.

``way = "one_way"``: the other vessel sends at times that are known, and the range is valid when the sound arrives.
``way = "two_way"``: the own vessel asks; the range is valid when the other one answers, half way between question and
answer (`simnav.sensors.acoustic_range`), and arrives one travel time later. A lost packet leaves no reading.

Figures of modems and clocks and their sources are in ``docs/how-to/use-messages-of-vessels.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simnav.blocks import StateBlock
from simnav.geometry.earth import displace
from simnav.kinds import Component, Datasheet, Kind, NavigationPoint
from simnav.recording import AidStream
from simnav.sensors.acoustics import AcousticInstrument, AcousticSpec, Paths, paths, separation
from simnav.sensors.instrument import ZERO, Instrument, SigmaPair, register_instrument
from simnav.sensors.other_vessel import DeadReckoning, Navigation, SatelliteNavigation
from simnav.sensors.planned_track import PlannedTrack, check_track
from simnav.spec import NonNegative, Positive, Vector, quantity, register_unit
from simnav.streams import stream
from simnav.types import Array, TapStates
from simnav.world.sound_speed import SOUND_SPEED
from simnav.world.water_column import Figures

__all__ = ["VesselRange"]

register_unit("ppm_sqrt_s", 1e-6)

#: Places in the side information.
_POSITION, _AGE, _VELOCITY, _SIGMA, _CORRELATION = slice(0, 3), 3, slice(4, 6), slice(6, 9), 9


def _sight(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, Array, float]:
    """The arm (3,) north-east-down [m], the unit vector (3,) from the own to the other transducer, and their distance
    [m]; the vector is zero where both are at one place."""
    arm, side = point.dcm @ sheet.lever_arm, point.side
    moved = np.array([side[_VELOCITY][0], side[_VELOCITY][1], 0.0]) * side[_AGE]
    away = separation(displace(point.position, arm), displace(side[_POSITION], moved))
    if "vessel" in point.blocks:
        away[:2] -= point.blocks["vessel"]
    distance = float(np.linalg.norm(away))
    return arm, away / distance if distance else away, distance


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]] | None:
    """The range to the other vessel and its Jacobian by block (`simnav.kinds.Observation`)."""
    blocks = point.blocks
    arm, sight, distance = _sight(point, sheet)
    if not distance:
        return None
    scale = 1.0 + (blocks["sound_speed"][0] if "sound_speed" in blocks else 0.0)
    towards = scale * sight
    navigation = np.zeros((1, 9))
    navigation[0, :3] = -towards
    navigation[0, 6:9] = -np.cross(arm, towards)
    jacobian, reading = {"navigation": navigation}, scale * distance
    if "sound_speed" in blocks:
        jacobian["sound_speed"] = np.array([[distance]])
    if "vessel" in blocks:
        jacobian["vessel"] = -towards[None, :2]
    if "clock" in blocks:
        reading += SOUND_SPEED * blocks["clock"][0]
        jacobian["clock"] = np.array([[SOUND_SPEED, 0.0]])
    return np.array([reading]), jacobian


def message_noise(point: NavigationPoint, sheet: Datasheet) -> Array:
    """What the error of the message adds to the noise of the range (`simnav.kinds.MessageNoise`)."""
    _, sight, _ = _sight(point, sheet)
    side = point.side
    sigma = side[_SIGMA] * sight
    variance = float(sigma @ sigma) + 2.0 * side[_CORRELATION] * float(sigma[0] * sigma[1])
    level = float(sight[:2] @ sight[:2])
    if "vessel" in point.blocks:  # the rest of the horizontal error is its own state
        variance = float(sigma[2] ** 2) + sheet.details["position_noise"] ** 2 * level
    return np.array([[max(variance, 0.0) + (side[_AGE] * sheet.details["velocity_noise"]) ** 2 * level]])


@register_instrument(
    Kind(
        "range to another vessel by an acoustic modem, with its message",
        role="range",
        components=(Component("range", "m", limit=50e3),),
        equation=observe,
        datasheet=("way", "navigation", "position_noise", "velocity_noise"),
        side=(
            Component("latitude", "deg"),
            Component("longitude", "deg"),
            Component("height", "m"),
            Component("age", "s"),
            Component("velocity_north", "m_s"),
            Component("velocity_east", "m_s"),
            Component("sigma_north", "m"),
            Component("sigma_east", "m"),
            Component("sigma_down", "m"),
            Component("correlation", ""),
        ),
        message_noise=message_noise,
    ),
    example={
        "rate_hz": 0.1, "latitude_deg": 54.0, "longitude_deg": 7.9, "vessel": "ship", "north_m": [200.0, -200.0],
        "east_m": [300.0, 300.0], "speed_m_s": 1.5, "repeats": True, "sigma_m": 0.1, "position_noise_m": 0.5,
        "wander_m": 1.0, "wander_time_s": 300.0, "sound_speed_percent": 0.1, "lever_arm_m": [0, 0, 3],
    },
)  # fmt: skip
class VesselRange(AcousticSpec):
    """Range to another vessel, with its message. Its channel is the other vessel.

    Attributes
    ----------
    vessel : str
        Name of the other vessel.
    latitude, longitude : float
        Origin of the points [rad].
    north, east : tuple of float
        Points of its way [m]; with one point it lies there.
    repeats : bool
        Whether it sails along the points again and again. Otherwise it stops at the last one.
    speed : float
        Its speed [m/s].
    depth : float
        Depth of its transducer [m].
    navigation : str
        How it navigates: ``gnss`` (a ship) or ``dead_reckoning`` (a second AUV).
    position_noise : float
        One sigma of each horizontal component of its fixes [m]: with ``gnss`` white noise of every message, with
        ``dead_reckoning`` constant until the next fix.
    wander, wander_time : float
        Slow error of each horizontal component with ``gnss``: one sigma [m] and correlation time [s].
    drift : tuple of float
        Drift of ``dead_reckoning``, as a share of the displacement since the last fix: one sigma along it and across.
    walk : float
        Random walk of ``dead_reckoning``: density of each horizontal component [m/sqrt(s)].
    fixes : tuple of float
        Times at which ``dead_reckoning`` gets a fix from what the vessel hears, or at the surface [s].
    depth_noise : float
        One sigma of its depth [m].
    velocity_noise : float
        One sigma of each component of its velocity [m/s].
    age : float
        Age of the position when the message leaves [s].
    stated_ratio : float
        The sigmas that the message states, over the true ones.
    declared : bool
        Whether the datasheet describes the slow error of a ship, so that estimators have states for it.
    losses : float
        Probability that a packet is lost.
    way : str
        ``two_way``: the own vessel asks and the other answers; ``one_way``: the other one sends at times that are
        known.
    clock, clock_drift : float
        One sigma of the offset [s] and drift [-] of the own clock from that of the other vessel; one-way only.
    clock_drift_noise : float
        Density of the random walk of the drift [1/sqrt(s)].

    Examples
    --------
    >>> spec = VesselRange.from_toml(VesselRange.example)
    >>> spec.channels(), [block.name for block in spec.blocks()], [block.name for block in spec.actual().blocks()]
    (('ship',), ['sound_speed'], ['sound_speed', 'vessel'])
    """

    errors: ClassVar[tuple[str, ...]] = (
        *AcousticSpec.errors, "position_noise", "wander", "drift", "walk", "depth_noise", "velocity_noise", "clock",
        "clock_drift", "clock_drift_noise",
    )  # fmt: skip

    kind: Literal["vessel_range"] = "vessel_range"
    vessel: str = "ship"
    latitude: float = quantity("deg", ge=-pi / 2, le=pi / 2)
    longitude: float = quantity("deg")
    north: Figures = quantity("m", (0.0,))
    east: Figures = quantity("m", (0.0,))
    repeats: bool = False
    speed: NonNegative = quantity("m_s", 0.0)
    depth: float = quantity("m", 5.0)
    navigation: Literal["gnss", "dead_reckoning"] = "gnss"
    position_noise: NonNegative = quantity("m", 1.0)
    wander: NonNegative = quantity("m", 0.0)
    wander_time: Positive = quantity("s", inf)
    drift: SigmaPair = quantity("percent", (0.0, 0.0))
    walk: NonNegative = quantity("m_sqrt_s", 0.0)
    fixes: Figures = quantity("s", ())
    depth_noise: NonNegative = quantity("m", 0.1)
    velocity_noise: NonNegative = quantity("m_s", 0.05)
    age: NonNegative = quantity("s", 0.0)
    stated_ratio: Positive = 1.0
    declared: bool = False
    losses: float = Field(0.0, ge=0.0, le=1.0)
    way: Literal["two_way", "one_way"] = "two_way"
    clock: NonNegative = quantity("s", 0.0)
    clock_drift: NonNegative = quantity("ppm", 0.0)
    clock_drift_noise: NonNegative = quantity("ppm_sqrt_s", 0.0)
    sigma: NonNegative = quantity("m")
    bias: NonNegative = quantity("m", 0.0)
    bias_instability: NonNegative = quantity("m", 0.0)
    reach: Positive = quantity("m", 2000.0)
    lever_arm: Vector = quantity("m", ZERO)
    fixed_bias: float = quantity("m", 0.0)

    @model_validator(mode="after")
    def _sails(self) -> Self:
        if not self.depth > 0.0:
            raise ValueError(
                f"depth_m = {self.depth:g}: the transducer of the other vessel should be below the surface, so the "
                "depth above 0"
            )
        check_track(self.north, self.east, self.speed)
        if self.repeats and len(self.north) < 2:
            raise ValueError("repeats = true: a way that is sailed again and again has two points or more")
        if self.way == "two_way" and (self.clock or self.clock_drift or self.clock_drift_noise):
            raise ValueError("way = 'two_way': a two-way travel time is measured by one clock; give no error of clocks")
        return self

    @model_validator(mode="after")
    def _navigates(self) -> Self:
        if self.navigation == "gnss":
            for key, given in (("drift_percent", any(self.drift)), ("walk", self.walk), ("fixes_s", self.fixes)):
                if given:
                    raise ValueError(f"{key}: a vessel with navigation = 'gnss' has none; it is for 'dead_reckoning'")
        elif self.wander or self.declared:
            key = "wander_m" if self.wander else "declared"
            raise ValueError(f"{key}: a vessel with navigation = 'dead_reckoning' has none; it is for 'gnss'")
        if (np.diff([0.0, *self.fixes]) <= 0.0).any():
            raise ValueError(f"fixes_s = {list(self.fixes)}: times of fixes are above 0 and ascending")
        return self

    def channels(self) -> tuple[str, ...]:
        """The other vessel."""
        return (self.vessel,)

    def slow_error(self) -> StateBlock:
        """The slow error of the position of a ship, as a block of states."""
        return StateBlock.stationary("vessel", 2, "m", self.wander, self.wander_time)

    def blocks(self) -> tuple[StateBlock, ...]:
        """Speed of sound, slow error of the other vessel if it is declared, and clock, as far as they have errors."""
        found = []
        if self.sound_speed:
            found.append(StateBlock("sound_speed", 1, "", self.sound_speed))
        if self.declared and self.wander:
            found.append(self.slow_error())
        if self.clock or self.clock_drift or self.clock_drift_noise:
            sigma, density = (self.clock, self.clock_drift), (0.0, self.clock_drift_noise)
            found.append(StateBlock("clock", 2, ("s", "ppm"), sigma, "clock", density))
        return tuple(found)

    def actual(self) -> Self:
        """See `AidSpec.actual`; the slow error of a ship is declared."""
        actual = super().actual()
        if actual.declared or not actual.wander:
            return actual
        return actual.model_copy(update={"declared": True})

    def travels(self) -> int:
        """See `AcousticSpec.travels`."""
        return 1 if self.way == "two_way" else 0

    def navigates(self, label: str, seed: int) -> Navigation:
        """The navigation of the other vessel in one run."""
        if self.navigation == "gnss":
            return SatelliteNavigation(self.position_noise, self.slow_error(), label, seed)
        track = PlannedTrack(self.north, self.east, self.speed, repeats=self.repeats)
        return DeadReckoning(track, self.fixes, self.position_noise, self.drift, self.walk, label, seed)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _VesselRange(self, name, seed)


@dataclass(frozen=True)
class _Exchange:
    """What n packets give: ranges (n, 1) with errors by echoes, side information (n, s), travel times (n,)."""

    there: NDArray[np.bool_]
    value: Array
    false: Array
    side: Array
    time: Array


class _VesselRange(AcousticInstrument):
    """Parameters as of `ChannelInstrument`."""

    def __init__(self, spec: VesselRange, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec
        self.origin = np.array([spec.latitude, spec.longitude, -spec.depth])
        self.track = PlannedTrack(spec.north, spec.east, spec.speed, repeats=spec.repeats)
        self.navigation = spec.navigates(f"{name}.vessel", seed)
        self._packets = stream(seed, "instrument", name, spec.vessel, "packets")
        self._messages = stream(seed, "instrument", name, spec.vessel, "messages")

    def place(self, time: Array) -> Array:
        """(n, 3) true positions of the other transducer at n times."""
        offset, _ = self.track.at(time)
        return displace(self.origin, np.column_stack([offset, np.zeros(len(time))]))

    def observe(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.observe`."""
        exchange = self.heard(tap)
        return np.asarray((exchange.value + exchange.false)[:, :, None])

    def side_information(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.side_information`: the message."""
        return np.asarray(self.heard(tap).side[:, None])

    def available(self, tap: TapStates) -> NDArray[np.bool_]:
        """See `ChannelInstrument.available`."""
        return np.asarray(self.heard(tap).there[:, None])

    def sense(self, tap: TapStates) -> AidStream:
        """See `ChannelInstrument.sense`."""
        exchange = self.heard(tap)
        latency = self.spec.travels() * exchange.time[:, None]
        return self.labelled(tap, super().sense(tap), exchange.false[:, :, None], latency)

    def _sound(self, tap: TapStates) -> tuple[Array, Paths]:
        """(n,) times at which the sound leaves the other vessel [s], and its paths."""
        own = displace(tap.position, self.lever_displacement(tap))
        left = tap.time
        path = paths(self.surroundings, self.place(left), own)
        # Each repetition leaves the speed of the vessel over that of sound, 0.002, of the error of the time.
        for _ in range(2 if self.spec.way == "one_way" else 0):
            travel = np.where(np.isfinite(path.time), path.time, path.distance / SOUND_SPEED)
            left = tap.time - travel
            path = paths(self.surroundings, self.place(left), own)
        return left, path

    def _hear(self, tap: TapStates) -> _Exchange:
        spec, n = self.spec, len(tap.time)
        lost = self._packets.random(n) < spec.losses
        left, path = self._sound(tap)
        there = np.isfinite(path.time) & (path.distance <= spec.reach) & ~lost
        if spec.way == "two_way":
            there &= self.pinged(tap.time, np.where(there, path.time, np.nan)[:, None])
        value = np.where(there, path.ranges(spec.correction, spec.assumed_speed), 0.0)
        value *= 1.0 + self.speed_error(tap.time)
        if any(block.name == "clock" for block in self.sheet.blocks):
            value += SOUND_SPEED * self.block("clock", tap.time)[:, 0]
        detour, _ = self.echoes(tap)
        return _Exchange(there, value[:, None], detour, self._message(left - spec.age), path.time)

    def _message(self, time: Array) -> Array:
        """(n, s) messages: the position that the other vessel believes to have had at n times."""
        spec, n = self.spec, len(time)
        drawn = self._messages.standard_normal((n, 5))
        wrong = self.navigation.error(time, drawn[:, :2])
        error = np.column_stack([wrong, spec.depth_noise * drawn[:, 2]])
        velocity = self.track.velocity(time) + spec.velocity_noise * drawn[:, 3:]
        covariance = self.navigation.covariance(time)
        level = np.sqrt(np.einsum("nii->ni", covariance))
        product = level[:, 0] * level[:, 1]
        correlation = np.divide(covariance[:, 0, 1], product, out=np.zeros(n), where=product > 0.0)
        sigma = spec.stated_ratio * np.column_stack([level, np.full(n, spec.depth_noise)])
        position = displace(self.place(time), error)
        return np.column_stack([position, np.full(n, spec.age), velocity, sigma, correlation])
