"""Raw observations of a GNSS receiver: pseudorange and rate of the pseudorange (Doppler) of each satellite.

For the satellite j, with the geometry of `simnav.satellites.sky`::

    pseudorange = range + b + (1 + f) I_j + T_j + m_j z + s_j x_j + noise
    rate        = rate of the range + d + noise

b and d are bias and drift of the receiver's clock, I_j and T_j the delays by Klobuchar's and Saastamoinen's models, f
the relative error of the first, z the error of the second at the zenith, m_j the wet mapping function, and s_j x_j the
errors of orbit, clock and multipath of the satellite: x_j is a Gauss-Markov process of unit variance and s_j its one
sigma at the elevation (`simnav.satellites.signal_errors`). b and d, f, z and all x_j are blocks of states, so every
estimator with an inertial model knows of them. The receiver has already corrected the pseudorange for the broadcast
error of the satellite's clock, and says where the satellite is. With two frequencies there is no I_j.

If the surroundings have ``obstacles`` (`simnav.world.obstacles`), a signal whose direct way is blocked arrives by a
reflection or not at all, and a signal with a reflection has the error of `simnav.satellites.multipath`. The vessel's
own structures block, too (`shadows`), and the sea reflects (`sea_reflection`). Estimators are told of none of them. An
error by a reflection has the label of kind ``reflection``.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from functools import lru_cache
from math import exp, radians, sqrt
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    StringConstraints,
    field_validator,
    model_serializer,
    model_validator,
)

from simnav.blocks import StateBlock
from simnav.geometry.earth import displace
from simnav.kinds import Component, Kind
from simnav.labels import CLOCK_JUMP, REFLECTION, FaultLabel
from simnav.recording import AidStream
from simnav.satellites.ephemeris import Ephemerides
from simnav.satellites.multipath import multipath_error, sea_reflection, strength_change
from simnav.satellites.orbit import SPEED_OF_LIGHT
from simnav.satellites.receiver_clock import Grade, clock_block
from simnav.satellites.rinex_navigation import read_navigation
from simnav.satellites.signal_errors import amplification, density_ratio, range_error
from simnav.satellites.sky import Sight, Sky
from simnav.satellites.time_scales import gps_time
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.gnss_observation import SIDE, observe, observe_all, reading_sigma
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, register_instrument, turn_to_body, turn_to_ned
from simnav.spec import NonNegative, Positive, SpecError, Vector, closest, quantity, without_later
from simnav.types import NO_SIDE, Array, TapStates
from simnav.world.obstacles import Paths

__all__ = ["SHIPPED", "SHIPPED_EPOCH", "SYSTEMS", "GnssRaw", "RawReceiver", "ephemerides_of"]

#: Letters of the systems in names of satellites, as RINEX has them.
SYSTEMS: Mapping[str, str] = {"gps": "G", "galileo": "E", "beidou": "C"}
#: The ephemerides that come with simnav, and a time at which they are valid.
SHIPPED = Path(__file__).parent.parent / "satellites" / "data" / "2023-03-12-noon.rnx"
SHIPPED_EPOCH = "2023-03-12T12:00:00"
#: Errors by reflections that are larger have a label: of ranges [m], and of rates [m/s].
_LABELLED = (0.1, 0.01)
#: Least step of a clock [s], 3 km: a smaller one could not be told from errors of the readings.
_LEAST_STEP = 1e-5
#: How often the sky is looked at when the satellites of a place are chosen [s].
_GLANCE = 60.0


def _epoch(text: str) -> datetime:
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is not None:
        raise ValueError("a GPS time has no time zone")
    return moment


@lru_cache(maxsize=8)
def _read(path: Path, modified: int, size: int) -> Ephemerides:
    """The file of a path; read again if it was changed."""
    return read_navigation(path)


def ephemerides_of(navigation: str) -> Ephemerides:
    """The ephemerides of a RINEX navigation file; of an empty name those that come with simnav.

    Raises
    ------
    SpecError
        If the file cannot be read.
    """
    path = Path(navigation).expanduser() if navigation else SHIPPED
    try:
        state = path.stat()
    except OSError as error:
        raise SpecError(f"navigation = {navigation!r}: cannot be read: {error.strerror}") from None
    return _read(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=64)
def _risen(
    ephemerides: Ephemerides, epoch: str, letters: str, latitude: float, longitude: float, span: float, mask: float
) -> tuple[str, ...]:
    """The satellites that rise above a mask at a place, at some time of a span."""
    moment = _epoch(epoch)
    sky = Sky(ephemerides, ephemerides.usable(gps_time(moment), span, letters), moment)
    time = np.append(np.arange(0.0, span, _GLANCE), span)
    position = np.repeat([[latitude, longitude, 0.0]], len(time), axis=0)
    highest = sky.sight(time, position, np.zeros_like(position)).elevation.max(axis=0)
    found = tuple(s for s, elevation in zip(sky.satellites, highest, strict=True) if elevation >= mask)
    if not found:
        raise ValueError(f"no satellite rises above mask_deg = {np.degrees(mask):g} there in span_s = {span:g}")
    return found


_Shadows = tuple[tuple[float, float, float], ...]
_Texts = tuple[Annotated[str, StringConstraints(min_length=1)], ...]


@register_instrument(
    Kind(
        "pseudorange and its rate, by satellite",
        role="range",
        components=(Component("pseudorange", "m", limit=1e8), Component("range_rate", "m_s", limit=1e5)),
        equation=observe,
        datasheet=("signal_error", "multipath", "frequencies", "clock_step"),
        side=SIDE,
        reading_sigma=reading_sigma,
        observations=observe_all,
    ),
    example={
        "satellites": ["G12", "G29", "E27", "E30", "E34"],
        "sigma_pseudorange_m": 0.2,
        "sigma_range_rate_m_s": 0.03,
        "lever_arm_m": [1.0, 0.0, -3.0],
    },
)
class GnssRaw(AidSpec):
    """Raw observations of a receiver. Its channels are the satellites, named as in RINEX (``G05``, ``E11``).

    Attributes
    ----------
    navigation : str
        RINEX navigation file with the ephemerides, relative to the working directory; by default those of 12 March 2023
        from 12 to 14 o'clock that come with simnav.
    epoch : str
        GPS time at which the run begins.
    satellites : tuple of str
        The satellites. By default they are chosen by `systems`, `latitude`, `longitude` and `span`.
    systems : tuple of str
        ``gps``, ``galileo``, ``beidou``.
    latitude, longitude : float or None
        Of the waters [rad]: taken are the satellites that rise above the mask there.
    span : float
        Time from the epoch in which they do so [s]: the length of the run.
    mask, lock : float
        Least elevation [rad], and least C/N0 [dB-Hz], at which a signal is tracked.
    frequencies : int
        1, or 2: the combination without ionosphere.
    shadows : tuple of (float, float, float)
        Sectors that the vessel's own structures block: from one azimuth clockwise to another, relative to the bow, and
        up to an elevation above the deck [rad].
    reflection : float
        Amplitude of a signal reflected by an obstacle, in units of the direct one.
    sea_reflection : float
        Amplitude of a signal reflected by a smooth sea, in units of the direct one, after the antenna's suppression;
        waves weaken it (`simnav.satellites.multipath.sea_reflection`).
    spacing : float
        Of early and late correlator [chips].
    signal_error : float
        One sigma of the error of orbit and clock of a satellite, along the line of sight [m].
    multipath : float
        Multipath in units of that in open surroundings.
    correlation_time : float
        Of errors of orbit, clock and multipath together [s].
    ionosphere_error, ionosphere_time : float
        One sigma of the relative error of Klobuchar's model, and its correlation time [s].
    troposphere_error, troposphere_time : float
        One sigma of the error of the delay at the zenith [m], and its correlation time [s].
    oscillator : str
        Grade of the receiver's clock: ``tcxo`` or ``ocxo``.
    oscillator_factor : float
        Its figures are so many times those of its grade.
    clock_bias : float
        One sigma of the clock's error at the begin of a run [m].
    noise_time : float
        Correlation time of the noise of the pseudoranges [s]: tracking loops, and receivers that smooth codes by their
        carriers, correlate it over ten seconds. Its standard deviation stays that of the datasheet, which does not
        tell. 0: white noise.
    galileo_noise : float
        Noise of Galileo's pseudoranges in units of that of GPS and BeiDou. Its signal E1 has a sharper correlation
        peak: 0.58 by theory for BOC(1,1) at one spacing of the correlators. The datasheet states the noise of GPS.
    clock_step : float
        The receiver steps its clock by so much whenever its error exceeds half of it [s]; many do so by a millisecond.
        The first readings after a step have a label. 0: the clock runs freely.

    Examples
    --------
    >>> raw = GnssRaw.from_toml({
    ...     "latitude_deg": 54.0, "longitude_deg": 7.9, "systems": ["gps"], "span_s": 600,
    ...     "sigma_pseudorange_m": 0.2, "sigma_range_rate_m_s": 0.03,
    ... })
    >>> raw.channels()
    ('G02', 'G06', 'G11', 'G12', 'G25', 'G26', 'G28', 'G29', 'G31', 'G32')
    """

    errors = (
        *AidSpec.errors, "signal_error", "multipath", "ionosphere_error", "troposphere_error", "oscillator_factor",
        "clock_bias",
    )  # fmt: skip

    later: ClassVar[Mapping[str, Any]] = {
        **AidSpec.later,
        "sea_reflection": 0.0,
        "clock_step": 0.0,
        "noise_time": 0.0,
        "galileo_noise": 1.0,
    }

    kind: Literal["gnss_raw"] = "gnss_raw"
    navigation: str = ""
    epoch: str = SHIPPED_EPOCH
    satellites: _Texts = ()
    systems: tuple[Literal["gps", "galileo", "beidou"], ...] = ("gps", "galileo")
    latitude: float | None = quantity("deg", None)
    longitude: float | None = quantity("deg", None)
    span: NonNegative = quantity("s", 3600.0)
    mask: float = quantity("deg", radians(10.0), ge=0.0, lt=radians(90.0))
    lock: float = 28.0
    frequencies: Literal[1, 2] = 1
    sigma_pseudorange: NonNegative = quantity("m")
    sigma_range_rate: NonNegative = quantity("m_s")
    shadows: _Shadows = quantity("deg", ())
    reflection: float = Field(0.5, ge=0.0, lt=1.0)
    sea_reflection: float = Field(0.0, ge=0.0, lt=1.0)
    spacing: float = Field(0.1, gt=0.0, le=1.0)
    signal_error: NonNegative = quantity("m", 0.5)
    multipath: NonNegative = 1.0
    correlation_time: Positive = quantity("s", 600.0)
    ionosphere_error: NonNegative = 0.5
    ionosphere_time: Positive = quantity("s", 3600.0)
    troposphere_error: NonNegative = quantity("m", 0.05)
    troposphere_time: Positive = quantity("s", 7200.0)
    oscillator: Grade = "tcxo"
    oscillator_factor: NonNegative = 1.0
    clock_bias: NonNegative = quantity("m", 300.0)
    clock_step: NonNegative = quantity("s", 0.0)
    noise_time: NonNegative = quantity("s", 0.0)
    galileo_noise: Positive = 1.0
    lever_arm: Vector = quantity("m", ZERO)

    @field_validator("epoch")
    @classmethod
    def _moment(cls, text: str) -> str:
        try:
            gps_time(_epoch(text))
        except ValueError:
            raise ValueError(f"epoch = {text!r} should be a GPS time from 1980 on, like '{SHIPPED_EPOCH}'") from None
        return text

    @field_validator("clock_step")
    @classmethod
    def _apart(cls, step: float) -> float:
        if 0.0 < step < _LEAST_STEP:
            raise ValueError(f"clock_step_s = {step:g} should be 0, or at least {_LEAST_STEP:g}; receivers have 0.001")
        return step

    @model_validator(mode="after")
    def _chosen(self) -> Self:
        for satellite in self.satellites:
            valid = self.ephemerides().satellites()
            if satellite not in valid:
                raise ValueError(
                    f"satellites: there is no ephemeris of {satellite!r} in {self.ephemerides().source}"
                    f"{closest(satellite, valid)}"
                )
        return self

    @model_serializer(mode="wrap")
    def _with_content(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The digest of a scenario changes with the content of its navigation file."""
        table = without_later(serialize(self), self.later)
        if self.navigation:
            ephemerides = self.ephemerides()
            content = repr(ephemerides.satellite).encode() + ephemerides.numbers.tobytes()
            table["ephemerides"] = hashlib.blake2b(content, digest_size=16).hexdigest()
        return table

    def ephemerides(self) -> Ephemerides:
        """The broadcast ephemerides."""
        return ephemerides_of(self.navigation)

    def origin(self) -> Mapping[str, str]:
        """See `AidSpec.origin`: the epoch, and the navigation file."""
        return {"epoch": self.epoch, "navigation": self.navigation}

    def channels(self) -> tuple[str, ...]:
        """The satellites."""
        if self.satellites:
            return self.satellites
        if self.latitude is None or self.longitude is None:
            raise ValueError(
                "latitude_deg and longitude_deg of the waters are missing, by which satellites are chosen; "
                "alternatively satellites = ['G05', ...] names them"
            )
        if not self.systems:
            raise ValueError(f"systems is empty; it should name some of: {', '.join(SYSTEMS)}")
        letters = "".join(SYSTEMS[name] for name in self.systems)
        return _risen(self.ephemerides(), self.epoch, letters, self.latitude, self.longitude, self.span, self.mask)

    def blocks(self) -> tuple[StateBlock, ...]:
        """Clock of the receiver, errors of the models of the atmosphere, and errors of each satellite."""
        lasting = 1.0 if self.signal_error or self.multipath else 0.0
        blocks = [
            clock_block(self.oscillator, self.clock_bias, self.oscillator_factor),
            StateBlock(
                "troposphere", 1, "m", self.troposphere_error, "gauss_markov", correlation_time=self.troposphere_time
            ),
            StateBlock(
                "signals", len(self.channels()), "", lasting, "gauss_markov", correlation_time=self.correlation_time
            ),
        ]
        if self.frequencies == 1:
            blocks.append(
                StateBlock(
                    "ionosphere", 1, "", self.ionosphere_error, "gauss_markov", correlation_time=self.ionosphere_time
                )
            )
        return tuple(blocks)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return RawReceiver(self, name, seed)


class RawReceiver(ChannelInstrument):
    """A receiver of raw observations in one run. Parameters as of `ChannelInstrument`."""

    def __init__(self, spec: GnssRaw, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec, self._sheet = spec, spec.datasheet(name)
        self.sky = Sky(spec.ephemerides(), self.channels, _epoch(spec.epoch))
        self._last: tuple[TapStates, Sight, Paths | None] | None = None
        #: Number of steps of the clock at the last reading.
        self._steps: float | None = None
        #: Of each satellite the last noise of the pseudorange, of unit variance; none before the first.
        self._correlated: Array | None = None

    def _seen(self, tap: TapStates) -> tuple[Sight, Paths | None]:
        """The satellites from the antenna at n times, and the ways of their signals; None: nothing is in the way."""
        if self._last is None or self._last[0] is not tap:
            position = displace(tap.position, self.lever_displacement(tap))
            velocity = tap.velocity + turn_to_ned(tap.attitude, self.lever_velocity(tap))
            seen, obstacles = self.sky.sight(tap.time, position, velocity), self.surroundings.get("obstacles")
            paths = None
            if obstacles is not None:
                paths = obstacles.paths(position, velocity, seen.elevation, seen.azimuth)
            self._last = tap, seen, paths
        return self._last[1:]

    def ahead(self, time: Array) -> tuple[Array, Array]:
        """See `ChannelInstrument.ahead`; with ``noise_time`` the noise of pseudoranges is a Gauss-Markov process."""
        error, variates = super().ahead(time)
        if self.spec.noise_time and self._noises and len(time):
            kept = exp(-1.0 / (self.spec.rate * self.spec.noise_time))
            for k, fresh in enumerate(variates[:, :, 0]):
                now = fresh if self._correlated is None else kept * self._correlated + sqrt(1.0 - kept * kept) * fresh
                variates[k, :, 0] = self._correlated = now
        return error, variates

    def sight(self, tap: TapStates) -> Sight:
        """What the satellites look like from the antenna, at n times."""
        return self._seen(tap)[0]

    def detour(self, tap: TapStates) -> tuple[Array, Array]:
        """(n, c) errors of ranges [m] and rates [m/s] by obstacles and the sea; zero for signals that are blocked."""
        seen, paths = self._seen(tap)
        sea = 0.0 if self.spec.sea_reflection == 0.0 else multipath_error(*self.from_sea(tap), self.spec.spacing)
        if paths is None:
            return np.zeros(seen.range.shape) + sea, np.zeros(seen.range.shape)
        alone = paths.blocked & np.isfinite(paths.excess)
        both = multipath_error(paths.excess, self.spec.reflection, self.spec.spacing)
        error = np.where(alone, paths.excess, np.where(paths.blocked, 0.0, both + sea))
        return error, np.where(alone, paths.excess_rate, 0.0)

    def own_label(self, duration: float) -> FaultLabel | None:
        """Of the errors by reflections, where there are obstacles or a sea that reflects."""
        if self.surroundings.get("obstacles") is None and not self.spec.sea_reflection:
            return None
        return FaultLabel(REFLECTION, (self.name,), 0.0, duration)

    def sense(self, tap: TapStates) -> AidStream:
        """See `ChannelInstrument.sense`. Reflections are labelled, with their errors."""
        stream = self._with_jumps(super().sense(tap), tap)
        if self.own_label(1.0) is None:
            return stream
        row = np.searchsorted(tap.time, stream.time)
        error = np.stack(self.detour(tap), axis=2)[row, stream.channel]
        touched: NDArray[np.bool_] = np.any(abs(error) > _LABELLED, axis=1)
        return replace(
            stream, faults=stream.faults | np.where(touched, np.uint32(1 << self.bit), np.uint32(0)),
            fault_error=np.where(touched[:, None], error, 0.0),
        )  # fmt: skip

    def own_labels(self, duration: float) -> tuple[FaultLabel, ...]:
        """See `ChannelInstrument.own_labels`: also that of the steps of the clock."""
        own = super().own_labels(duration)
        return (*own, FaultLabel(CLOCK_JUMP, (self.name,), 0.0, duration)) if self.spec.clock_step else own

    def _steps_at(self, time: Array) -> Array:
        """(n,) how many steps the clock was set back by."""
        step = SPEED_OF_LIGHT * self.spec.clock_step
        return np.asarray(np.round(self.block("clock", time)[:, 0] / step))

    def _with_jumps(self, stream: AidStream, tap: TapStates) -> AidStream:
        """The readings with a label on the first ones after each step of the clock; they have no error by it."""
        if not self.spec.clock_step or not len(tap.time):
            return stream
        steps = self._steps_at(tap.time)
        before = np.append(steps[0] if self._steps is None else self._steps, steps[:-1])
        self._steps = float(steps[-1])
        jumped = (steps != before)[np.searchsorted(tap.time, stream.time)]
        bit = self.bit + len(super().own_labels(1.0))
        return replace(stream, faults=stream.faults | np.where(jumped, np.uint32(1 << bit), np.uint32(0)))

    def from_sea(self, tap: TapStates) -> tuple[Array, Array]:
        """(n, c) excess paths [m] and amplitudes of the signals that the sea reflects."""
        seen, waves = self.sight(tap), self.surroundings.get("sea")
        height = displace(tap.position, self.lever_displacement(tap))[:, 2:]
        swell = 0.0 if waves is None else waves.sea.significant_height
        return sea_reflection(height, seen.elevation, self.spec.sea_reflection, swell)

    def ratio(self, tap: TapStates) -> Array:
        """(n, c) C/N0 [dB-Hz]; minus infinity for signals that are blocked altogether."""
        seen, paths = self._seen(tap)
        ratio = density_ratio(seen.elevation)
        if self.spec.sea_reflection:
            ratio = ratio + strength_change(*self.from_sea(tap))
        if paths is not None:
            weaker = 20.0 * np.log10(max(self.spec.reflection, 1e-9))
            alone = np.where(np.isfinite(paths.excess), weaker, -np.inf)
            ratio = ratio + np.where(paths.blocked, alone, strength_change(paths.excess, self.spec.reflection))
        for first, last, highest in self.spec.shadows:
            azimuth, elevation = self._from_deck(tap, seen)
            within = (azimuth - first) % (2.0 * np.pi) <= (last - first) % (2.0 * np.pi)
            ratio = np.where(within & (elevation <= highest), -np.inf, ratio)
        return ratio

    def _from_deck(self, tap: TapStates, seen: Sight) -> tuple[Array, Array]:
        """(n, c) azimuths relative to the bow, and elevations above the deck [rad]."""
        level = np.cos(seen.elevation)
        ned = (level * np.cos(seen.azimuth), level * np.sin(seen.azimuth), -np.sin(seen.elevation))
        body = np.empty((*seen.elevation.shape, 3))
        for j in range(body.shape[1]):
            body[:, j] = turn_to_body(tap.attitude, np.stack([part[:, j] for part in ned], axis=1))
        return np.arctan2(body[..., 1], body[..., 0]), np.arcsin(np.clip(-body[..., 2], -1.0, 1.0))

    def lasting(self, tap: TapStates) -> Array:
        """(n, c) errors of the ranges that last for minutes: of orbit, clock, multipath and atmosphere [m]."""
        spec, seen = self.spec, self.sight(tap)
        multipath = spec.multipath * amplification(spec.frequencies)
        error = range_error(seen.elevation, spec.signal_error, multipath) * self.block("signals", tap.time)
        error += seen.mapping * self.block("troposphere", tap.time)
        if spec.frequencies == 1:
            error += seen.ionosphere * self.block("ionosphere", tap.time)
        return np.asarray(error)

    def observe(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.observe`."""
        seen, clock = self.sight(tap), self.block("clock", tap.time)
        pseudorange = seen.range + clock[:, :1] + seen.troposphere + self.lasting(tap)
        if self.spec.clock_step:
            pseudorange -= SPEED_OF_LIGHT * self.spec.clock_step * self._steps_at(tap.time)[:, None]
        if self.spec.frequencies == 1:
            pseudorange += seen.ionosphere
        further, faster = self.detour(tap)
        return np.stack([pseudorange + further, seen.range_rate + clock[:, 1:] + faster], axis=2)

    def side_information(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.side_information`."""
        seen = self.sight(tap)
        rest = (
            seen.elevation, seen.azimuth, self.ratio(tap),
            seen.ionosphere, seen.troposphere, seen.mapping,
        )  # fmt: skip
        return np.concatenate([seen.position, seen.velocity, np.stack(rest, axis=2)], axis=2)

    def noise_sigma(self, observed: Array, side: Array = NO_SIDE) -> Array:
        """See `ChannelInstrument.noise_sigma`: `reading_sigma` of all readings at once."""
        sigma = reading_sigma(side, self._sheet)
        if self.spec.galileo_noise != 1.0:
            sigma = sigma.copy()
            sigma[:, [name[0] == SYSTEMS["galileo"] for name in self.channels], 0] *= self.spec.galileo_noise
        return sigma

    def available(self, tap: TapStates) -> NDArray[np.bool_]:
        """See `ChannelInstrument.available`: where the satellite is above the mask, and its signal strong enough."""
        elevation = self.sight(tap).elevation
        with np.errstate(invalid="ignore"):
            there: NDArray[np.bool_] = (elevation >= self.spec.mask) & (self.ratio(tap) >= self.spec.lock)
        return there
