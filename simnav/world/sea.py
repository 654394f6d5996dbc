"""The sea: a wave spectrum, and the motion of a vessel in the waves.

The surface is a sum of long-crested components, each with its own frequency and direction. The vessel responds to
the elevation (heave), the slope (roll, pitch) and the orbital motion (surge, sway) of each component by a second-order
response. The phase of a component always advances with the encounter frequency, which depends on the speed and course
of the vessel. The size of the response depends on ``Sea.response``:

- ``absolute``: it is that at the absolute frequency of the component, as in the first scenarios of simnav. There is no
  yaw, and waves are those of deep water.
- ``encounter``: heave, roll, pitch and yaw are oscillators that the waves at the vessel drive, so their size is that at
  the encounter frequency, also while the vessel turns. In water of a known depth h the wave number k follows from
  omega^2 = g k tanh(k h).

Sources: DNV-RP-C205 section 3.5 (spectra) and 3.2 (dispersion); T. I. Fossen, *Handbook of Marine Craft Hydrodynamics
and Motion Control*, Wiley 2011, chapters 8 and 10.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from simnav.geometry.earth import relative_position
from simnav.spec import NonNegative, Positive, Spec, quantity
from simnav.streams import stream
from simnav.types import Array

__all__ = ["Sea", "Waves", "components", "spectrum", "steady", "wave_number"]

_G = 9.81
#: Share of the energy that lies below the highest frequency of the components.
_SHARE = 0.999
#: Where the spectrum of the first scenarios ends, over the frequency of its peak. Their recordings stay as they are.
_FIRST_END = 4.0
#: Advance of a phase in one step up to which the series of `simnav.world.seaway` are exact to rounding [rad].
_LONGEST = 0.4


class Components(NamedTuple):
    """The wave components: the rows of the table of `components`, each an (n,) array.

    Attributes
    ----------
    frequency, wave_north, wave_east : array
        Angular frequency [rad/s], wave number [rad/m].
    north_cos, north_sin, east_cos, east_sin, down_cos, down_sin : array
        Gains of the displacements [m].
    roll_north_cos, roll_north_sin, roll_east_cos, roll_east_sin : array
        Gains of the slopes that roll follows from [rad].
    pitch_north_cos, pitch_north_sin, pitch_east_cos, pitch_east_sin : array
        Gains of the slopes that pitch follows from [rad].
    yaw_first, yaw_second : array
        With the heading psi, yaw is driven by cos(2 psi) times the sum of the first less sin(2 psi) times that of the
        second [rad].
    """

    frequency: Array
    wave_north: Array
    wave_east: Array
    north_cos: Array
    north_sin: Array
    east_cos: Array
    east_sin: Array
    down_cos: Array
    down_sin: Array
    roll_north_cos: Array
    roll_north_sin: Array
    roll_east_cos: Array
    roll_east_sin: Array
    pitch_north_cos: Array
    pitch_north_sin: Array
    pitch_east_cos: Array
    pitch_east_sin: Array
    yaw_first: Array
    yaw_second: Array


class Phases(NamedTuple):
    """The phases of the wave components, each an (n,) array: cosine, sine, encounter frequency [rad/s]."""

    cosine: Array
    sine: Array
    rate: Array


#: Rows of the two arrays of `components`.
PHASES, ROWS = len(Phases._fields), len(Components._fields)


class Sea(Spec):
    """A sea state and the vessel's response to it.

    Attributes
    ----------
    spectrum : str
        ``jonswap`` or ``pierson_moskowitz`` (which is JONSWAP with peakedness 1).
    significant_height, peak_period : float
        Significant height of the waves [m], and period of the spectral peak [s].
    peakedness : float
        Peak enhancement factor gamma of JONSWAP [-].
    direction : float
        Direction from which the waves come, clockwise from north [rad].
    spreading : float
        Standard deviation of the components' directions [rad].
    components : int
        Number of components, each of the same energy.
    spectrum_end : float or None
        Highest frequency of the components over that of the peak [-]. None: 99.9 % of the energy is below it (5.3 for
        JONSWAP with peakedness 3.3, 5.9 for Pierson-Moskowitz).
    heave_period, roll_period, pitch_period : float
        Natural periods of the responses [s].
    heave_damping, roll_damping, pitch_damping : float
        Damping ratios of the responses [-].
    roll_gain, pitch_gain, drift_gain : float
        Ratio of roll and pitch to the wave slope, and of surge and sway to the orbital motion, well below resonance
        [-]. A hull that is longer than a wavelength averages over it, so its gains are below 1.
    response : str
        ``absolute`` or ``encounter`` (see the module).
    yaw_period, yaw_damping, yaw_gain : float
        The same of yaw, for ``encounter``: period [s], damping ratio [-], and ratio of yaw to the wave slope times the
        sine and cosine of the angle between waves and bow [-]. Waves from ahead, abeam and astern cause no yaw.
    """

    spectrum: Literal["jonswap", "pierson_moskowitz"] = "jonswap"
    significant_height: NonNegative = quantity("m")
    peak_period: Annotated[float, Field(ge=1.0, le=30.0)] = quantity("s")
    peakedness: Annotated[float, Field(ge=1.0, le=10.0)] = 3.3
    direction: Annotated[float, Field(ge=-6.2832, le=6.2832)] = quantity("deg", 0.0)
    spreading: NonNegative = quantity("deg", 0.4363323129985824)
    components: Annotated[int, Field(ge=4, le=256)] = 24
    spectrum_end: Annotated[float, Field(ge=2.0, le=20.0)] | None = None
    heave_period: Positive = quantity("s", 6.0)
    roll_period: Positive = quantity("s", 9.0)
    pitch_period: Positive = quantity("s", 6.0)
    heave_damping: Annotated[float, Field(gt=0.02, le=2.0)] = 0.6
    roll_damping: Annotated[float, Field(gt=0.02, le=2.0)] = 0.15
    pitch_damping: Annotated[float, Field(gt=0.02, le=2.0)] = 0.5
    roll_gain: NonNegative = 0.6
    pitch_gain: NonNegative = 0.4
    drift_gain: NonNegative = 0.5
    response: Literal["absolute", "encounter"] = "absolute"
    yaw_period: Positive = quantity("s", 12.0)
    yaw_damping: Annotated[float, Field(gt=0.02, le=2.0)] = 0.8
    yaw_gain: NonNegative = 0.3

    @model_serializer(mode="wrap")
    def _as_it_was(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The digest of a scenario of the first kind is what it was before there was another one."""
        table: dict[str, Any] = serialize(self)
        if self.spectrum_end == _FIRST_END:
            table.pop("spectrum_end", None)
        if self.response == "absolute":
            for name in ("response", "yaw_period", "yaw_damping", "yaw_gain"):
                table.pop(name, None)
        return table

    @model_validator(mode="after")
    def _yaw_with_encounter(self) -> Self:
        for name in ("yaw_period", "yaw_damping", "yaw_gain"):
            if self.response == "absolute" and name in self.model_fields_set:
                key = "yaw_period_s" if name == "yaw_period" else name
                raise ValueError(f'{key} is of no use without response = "encounter"')
        return self

    @property
    def longest_step(self) -> float:
        """Largest advance of a phase in one step of the motion [rad]; 0: any, as in the first scenarios."""
        return 0.0 if self.spectrum_end == _FIRST_END else _LONGEST

    @property
    def oscillators(self) -> tuple[tuple[float, float], ...]:
        """Natural angular frequency [rad/s] and damping ratio of heave, roll, pitch and yaw."""
        periods = self.heave_period, self.roll_period, self.pitch_period, self.yaw_period
        dampings = self.heave_damping, self.roll_damping, self.pitch_damping, self.yaw_damping
        return tuple((2.0 * np.pi / period, damping) for period, damping in zip(periods, dampings, strict=True))


def spectrum(sea: Sea, omega: Array) -> Array:
    """Spectral density of the elevation.

    Parameters
    ----------
    sea : Sea
        Significant height, peak period and shape of the spectrum.
    omega : (n,) array
        Angular frequency [rad/s], positive.

    Returns
    -------
    (n,) array
        [m^2 s/rad]; its integral is ``significant_height**2 / 16`` (DNV-RP-C205 eqs. 3.5.5.1-3.5.5.3; JONSWAP is
        normalized numerically rather than by the approximate factor printed there).
    """
    peak = 2.0 * np.pi / sea.peak_period
    gamma = sea.peakedness if sea.spectrum == "jonswap" else 1.0

    def shape(w: Array) -> Array:
        width = np.where(w <= peak, 0.07, 0.09)
        ratio = peak / w
        return ratio**5 * np.exp(-1.25 * ratio**4) * gamma ** np.exp(-0.5 * ((w / peak - 1.0) / width) ** 2)

    grid = peak * np.geomspace(0.3, 40.0, 8000)
    values = shape(grid)
    area = float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(grid)))
    density: Array = shape(np.asarray(omega, dtype=np.float64)) * (sea.significant_height**2 / 16.0 / area)
    return density


def _highest(sea: Sea) -> float:
    """Highest frequency of the components over that of the peak."""
    if sea.spectrum_end is not None:
        return sea.spectrum_end
    ratio = np.geomspace(0.4, 40.0, 8000)
    below = _cumulative(sea, 2.0 * np.pi / sea.peak_period * ratio)
    return float(np.interp(_SHARE * below[-1], below, ratio))


def _cumulative(sea: Sea, grid: Array) -> Array:
    """Variance of the elevation between the first frequency of a grid [rad/s] and each of them [m^2]."""
    density = spectrum(sea, grid)
    return np.concatenate([[0.0], np.cumsum(np.diff(grid) * 0.5 * (density[1:] + density[:-1]))])


def wave_number(omega: Array, depth: float | None = None) -> Array:
    """Wave number of linear waves, from omega^2 = g k tanh(k h).

    Parameters
    ----------
    omega : (n,) array
        Angular frequency [rad/s], positive.
    depth : float, optional
        Depth of the water h [m]; None: deep water.

    Returns
    -------
    (n,) array
        [rad/m].
    """
    deep = np.asarray(omega, dtype=np.float64) ** 2 / _G
    if depth is None:
        return deep
    # Newton's method from the formula of Fenton and McKee (1990), which is within 1.5 %; six steps leave rounding only.
    number = deep / np.tanh((deep * depth) ** 0.75) ** (2.0 / 3.0)
    for _ in range(6):
        t = np.tanh(number * depth)
        number = number - (number * t - deep) / (t + number * depth * (1.0 - t * t))
    return np.asarray(number)


def components(sea: Sea | None, seed: int, depth: float | None = None) -> tuple[Array, Array]:
    """Draw the wave components of one run.

    Parameters
    ----------
    sea : Sea or None
        The sea state; None: a flat sea.
    seed : int
        Seed of the run: it fixes frequencies, directions and phases.
    depth : float, optional
        Depth of the water [m], which the response ``encounter`` knows.

    Returns
    -------
    phase : (3, n) array
        The `Phases` at time 0 at the start position.
    table : (19, n) array
        The `Components`. The roll of the vessel is the projection of (roll-north, roll-east) on its axes, and its pitch
        that of (pitch-north, pitch-east). With the response ``encounter`` the gains of heave, roll and pitch are those
        of the waves that drive them, and those of yaw are not zero.
    """
    if sea is None or sea.significant_height == 0.0:
        return np.zeros((PHASES, 0)), np.zeros((ROWS, 0))
    rng = stream(seed, "sea")
    n = sea.components
    peak = 2.0 * np.pi / sea.peak_period
    # Components of equal energy, with a random frequency within each quantile: the variance is exact in every run, and
    # the waves repeat neither from run to run nor from hour to hour.
    grid = peak * np.geomspace(0.4, _highest(sea), 4000)
    cumulative = _cumulative(sea, grid)
    quantile = (np.arange(n) + rng.random(n)) / n
    omega = np.interp(quantile * cumulative[-1], cumulative, grid)
    amplitude = np.sqrt(2.0 * sea.significant_height**2 / 16.0 / n)
    heading = sea.direction + np.pi + sea.spreading * rng.standard_normal(n)
    phase = 2.0 * np.pi * rng.random(n)
    encounter = sea.response == "encounter"
    number = wave_number(omega, depth) if encounter else omega**2 / _G
    north, east = np.cos(heading), np.sin(heading)

    def response(period: float, damping: float) -> Array:
        if encounter:
            return np.ones(n)
        natural = 2.0 * np.pi / period
        value: Array = natural**2 / (natural**2 - omega**2 - 2j * damping * natural * omega)
        return value

    # With the phase theta = omega t - k x and a complex gain G, a response is Re(G e^{-i theta}) =
    # Re(G) cos(theta) + Im(G) sin(theta): elevation has G = a, horizontal displacement i a, slope i a k.
    heave = amplitude * response(sea.heave_period, sea.heave_damping)
    orbit = 1j * amplitude * sea.drift_gain
    if encounter and depth is not None:
        orbit = orbit / np.tanh(number * depth)  # particles move further along than up and down
    roll = 1j * amplitude * number * sea.roll_gain * response(sea.roll_period, sea.roll_damping)
    pitch = 1j * amplitude * number * sea.pitch_gain * response(sea.pitch_period, sea.pitch_damping)
    gains = [orbit * north, orbit * east, -heave, roll * north, roll * east, pitch * north, pitch * east]
    rows = [omega, number * north, number * east]
    for g in gains:
        rows += [np.real(g), np.imag(g)]
    turning = 0.5 * amplitude * number * sea.yaw_gain if encounter else np.zeros(n)
    rows += [turning * np.sin(2.0 * heading), turning * np.cos(2.0 * heading)]
    return np.stack([np.cos(phase), np.sin(phase), omega]), np.ascontiguousarray(np.stack(rows))


def steady(sea: Sea, phase: Array, table: Array, north: float, east: float, heading: float) -> Array:
    """The oscillators of the response ``encounter`` on a straight course.

    Parameters
    ----------
    sea : Sea
        The sea state.
    phase, table : (3, n) and (19, n) arrays
        The waves at this time, as of `components`.
    north, east : float
        Velocity through the water [m/s].
    heading : float
        Heading [rad].

    Returns
    -------
    (4, 3) array
        For the down velocity [m/s], roll, pitch and yaw [rad]: value, rate, and what drives it.
    """
    w, at = Components(*table), Phases(*phase)
    rate = w.frequency - w.wave_north * north - w.wave_east * east
    turned = np.conj(at.cosine + 1j * at.sine)
    c, s = np.cos(heading), np.sin(heading)
    down = w.down_cos + 1j * w.down_sin
    roll_north, roll_east = w.roll_north_cos + 1j * w.roll_north_sin, w.roll_east_cos + 1j * w.roll_east_sin
    pitch_north, pitch_east = w.pitch_north_cos + 1j * w.pitch_north_sin, w.pitch_east_cos + 1j * w.pitch_east_sin
    driven = [
        -1j * rate * down,
        roll_north * s - roll_east * c,
        pitch_north * c + pitch_east * s,
        w.yaw_first * np.cos(2.0 * heading) - w.yaw_second * np.sin(2.0 * heading),
    ]
    out = np.empty((4, 3))
    for k, ((natural, damping), force) in enumerate(zip(sea.oscillators, driven, strict=True)):
        answer = force * natural**2 / (natural**2 - rate**2 - 2j * damping * natural * rate)
        out[k] = [np.sum(np.real(z * turned)) for z in (answer, -1j * rate * answer, force)]
    return out


class Waves:
    """The sea of one run, which can be asked at any place and time.

    Parameters
    ----------
    sea : Sea
        Its description.
    seed : int
        Seed of the world: it fixes the components.
    origin : (3,) array
        Geodetic position from which the phases count: that of the start, at the surface.
    depth : float, optional
        Depth of the water [m]; None: it is not known.
    """

    def __init__(self, sea: Sea, seed: int, origin: Array, depth: float | None = None):
        self.sea, self.depth, self._seed, self._origin = sea, depth, seed, origin

    @cached_property
    def _components(self) -> tuple[Array, Array]:
        return components(self.sea, self._seed, self.depth)

    def elevation(self, position: Array, time: Array, depth: Array | None = None) -> Array:
        """Elevation of the surface, or the water column that a pressure sensor below it takes for it.

        The waves travel through water at rest. A current does not carry them along here.

        Parameters
        ----------
        position : (n, 3) array
            Latitude, longitude [rad] and height [m]; the height does not matter.
        time : (n,) array
            Time since the start of the run [s].
        depth : (n,) array, optional
            Depth of the sensors [m], by which each component is less: times exp(-k z).

        Returns
        -------
        (n,) array
            Height of the surface above the mean sea surface [m].
        """
        start, w = Phases(*self._components[0]), Components(*self._components[1])
        north, east, _ = relative_position(position, self._origin).T
        amplitude = np.sqrt(2.0 * self.sea.significant_height**2 / 16.0 / max(w.frequency.size, 1))
        elevation = np.zeros(len(time))
        for k in range(w.frequency.size):
            phase = np.arctan2(start.sine[k], start.cosine[k])
            wave = np.cos(w.frequency[k] * time - w.wave_north[k] * north - w.wave_east[k] * east + phase)
            if depth is not None:
                wave *= np.exp(-np.hypot(w.wave_north[k], w.wave_east[k]) * depth)
            elevation += wave
        elevation *= amplitude
        return elevation
