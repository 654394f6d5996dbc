"""Kinds of aiding instruments, and their datasheets: what each kind measures, and all properties that depend on it.

A kind is declared once, beside the instrument of its name (``simnav/sensors/gnss.py`` and others, or a file of a third
party; see ``docs/how-to/add-an-instrument.md``). All other code reads these properties from `KINDS`: how an error is
added to a value, which values are plausible, which role the instrument has, and how a navigation filter predicts its
reading.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, nextafter, pi
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from simnav.array_units import in_arrays
from simnav.blocks import StateBlock
from simnav.compiled import Array, helper, kernel
from simnav.declared_process import DeclaredProcess
from simnav.geometry.earth import displace_scalar, relative_position
from simnav.geometry.rotation import wrap_angle, wrap_scalar
from simnav.kernel_types import Matrix
from simnav.plugins import PluginError, Registry
from simnav.timing import TimingSheet

__all__ = [
    "BODY_VELOCITY",
    "DEPTH",
    "EQUATIONS",
    "HEADING",
    "HORIZONTAL_POSITION",
    "INSTRUMENTS",
    "KINDS",
    "NO_SIDE",
    "POSITION",
    "VELOCITY",
    "WATER_SPEED",
    "Component",
    "Datasheet",
    "Kind",
    "MessageNoise",
    "NavigationPoint",
    "NavigationPoints",
    "Observation",
    "Observations",
    "Role",
    "add_error_scalar",
    "geodetic_components",
    "kinds_with",
    "speed_components",
]

#: The role of an instrument in navigation. "other": none of these.
Role = Literal["fix", "velocity", "heading", "range", "depth", "other"]

#: The compiled measurement equations; `Kind.equation` names one of them, or is a function.
POSITION, HORIZONTAL_POSITION, VELOCITY = "position", "horizontal_position", "velocity"
BODY_VELOCITY, WATER_SPEED, HEADING, DEPTH = "body_velocity", "water_speed", "heading", "depth"
#: The quantity that each equation predicts, for an instrument with the lever arm ``l`` in body axes.
EQUATIONS: Mapping[str, str] = {
    POSITION: "latitude, longitude and height of the instrument",
    HORIZONTAL_POSITION: "latitude and longitude of the instrument",
    VELOCITY: "velocity of the instrument over the ground, north-east-down",
    BODY_VELOCITY: "velocity of the instrument over the ground, body axes (forward, starboard, down)",
    WATER_SPEED: "forward component of the instrument's velocity through the water",
    HEADING: "true heading",
    DEPTH: "depth of the instrument below the ellipsoid, positive down",
}
_COMPONENTS_OF = {
    POSITION: 3, HORIZONTAL_POSITION: 2, VELOCITY: 3, BODY_VELOCITY: 3, WATER_SPEED: 1, HEADING: 1, DEPTH: 1,
}  # fmt: skip

#: Limits of plausible measurements: speed [m/s], height and depth [m].
LARGEST_SPEED, LARGEST_HEIGHT = 200.0, 20000.0
#: What the name of a component looks like: it is a column of files, and the end of a field of a specification.
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
#: Filters and graphs keep a reading in arrays of this many components. An instrument that reads more at one time has
#: channels, each with a reading of its own.
MOST_COMPONENTS = 3
#: The side information of a reading that has none.
NO_SIDE: Array = np.empty(0)
NO_SIDE.flags.writeable = False


class NavigationPoint(NamedTuple):
    """The state at which a reading is predicted.

    Attributes
    ----------
    time : float
        Time of validity of the measurement [s].
    position : (3,) array
        Latitude, longitude [rad], height [m].
    velocity : (3,) array
        North-east-down [m/s].
    dcm : (3, 3) array
        Direction cosine matrix from body axes to north-east-down.
    angular_rate : (3,) array
        Angular rate of the body relative to the Earth, body axes [rad/s].
    blocks : mapping of str to array
        Values of the states that the instrument brings along, by the name of their block (`simnav.blocks.StateBlock`).
    channel : str
        The channel whose reading is predicted; empty for an instrument without channels.
    side : (s,) array
        Side information of the reading, components as in `Kind.side`.
    acceleration : (3,) array or None
        Relative to the Earth, north-east-down [m/s^2]. None: it is not known, or no instrument needs it.
    """

    time: float
    position: Array
    velocity: Array
    dcm: Array
    angular_rate: Array
    blocks: Mapping[str, Array] = MappingProxyType({})
    channel: str = ""
    side: Array = NO_SIDE
    acceleration: Array | None = None


class NavigationPoints(NamedTuple):
    """The states at which n readings are predicted, an entry for each.

    Attributes
    ----------
    time : (n,) array
        Times of validity [s].
    position, velocity : (n, 3) array
        As of `NavigationPoint`.
    dcm : (n, 3, 3) array
        As of `NavigationPoint`.
    angular_rate : (n, 3) array
        As of `NavigationPoint`.
    blocks : mapping of str to array
        Values (n, k) of the states that the instrument brings along, by the name of their block.
    channel : (n,) int array
        Place of the channel in `Datasheet.channels`.
    side : (n, s) array
        Side information of the readings.
    """

    time: Array
    position: Array
    velocity: Array
    dcm: Array
    angular_rate: Array
    blocks: Mapping[str, Array]
    channel: NDArray[np.intp]
    side: Array


@helper
def add_error_scalar(positions: int, cyclic: int, value: Array, error: Array) -> None:
    """Add an error to one measurement, in place. This is the compiled form of `Kind.add_error`.

    Parameters
    ----------
    positions, cyclic : int
        The two numbers of `Kind.layout`: how many components are a geodetic position, and one bit for each cyclic
        component.
    value : (d,) array
        The measurement, updated: SI units and radians.
    error : (d,) array
        The error: for a geodetic position in metres north, east, down, otherwise in the units of ``value``.
    """
    if positions == 3:
        value[0], value[1], value[2] = displace_scalar(value[0], value[1], value[2], error[0], error[1], error[2])
    elif positions == 2:
        # The radii of curvature are those at the sea surface: at 100 m depth this changes the error by 2e-5 of itself.
        value[0], value[1], _ = displace_scalar(value[0], value[1], 0.0, error[0], error[1], 0.0)
    for i in range(positions, value.size):
        value[i] += error[i]
        if cyclic >> i & 1:
            value[i] = wrap_scalar(value[i])


@kernel
def _add_errors(positions: int, cyclic: int, values: Matrix, errors: Matrix) -> None:
    """Apply `add_error_scalar` to each of n measurements."""
    for i in range(values.shape[0]):
        add_error_scalar(positions, cyclic, values[i], errors[i])


#: An observation model. It returns the (d,) reading that an instrument with this datasheet should give at a state, in
#: SI units, and the (d, 9) Jacobian of the reading with respect to an error of the state: position north-east-down [m],
#: velocity [m/s] and attitude, the rotation vector about north-east-down [rad] (`simnav.types.COMPONENTS`). In place of
#: the Jacobian it may return one by block, ``{"navigation": (d, 9) array, "clock": (d, 2) array}``. A block that is not
#: in it is differentiated by differences; so is all if it returns the reading alone. It returns None if there is no
#: reading at the state.
Observation = Callable[[NavigationPoint, "Datasheet"], "tuple[Array, Array | Mapping[str, Array]] | Array | None"]


#: The same for n readings of channels at one time, which costs a window a small part of n calls: (n, d) readings, and
#: their whole Jacobian by block, arrays of the shapes (n, d, 9) and (n, d, k). Each state has a reading.
#: The `ReadingSigma` of such a kind also takes (n, s) side information, and returns (n, d).
Observations = Callable[[NavigationPoints, "Datasheet"], tuple[Array, Mapping[str, Array]]]

#: The standard deviation (d,) of the white noise of one reading, from its (s,) side information and the datasheet: for
#: an instrument whose noise differs from reading to reading in a way that it knows, like that of a satellite with its
#: elevation.
ReadingSigma = Callable[[Array, "Datasheet"], Array]

#: The (d, d) covariance that the error of another navigator adds to the noise of a reading at a state: the side
#: information says where the other one believes itself to be, and how sure it is. Such errors last from one message to
#: the next, and may be those of this vessel: see `simnav.estimators.adaptations.intersection`.
MessageNoise = Callable[[NavigationPoint, "Datasheet"], Array]


@dataclass(frozen=True)
class Component:
    """One component of a measurement.

    Attributes
    ----------
    name : str
        Name of the value, as in ``latitude``.
    unit : str
        Unit of the value in files and figures, a key of `simnav.spec.UNITS`. Arrays hold SI units and radians.
    error, error_unit : str
        Name and unit of the error, if they differ from those of the value. For example, the error of a latitude is
        ``north``, in metres.
    limit : float
        Values of this size (SI) or larger are not plausible.
    cyclic : bool
        True for an angle in which a full turn changes nothing: differences are brought into [-pi, pi), and values up to
        ``limit`` are plausible.
    """

    name: str
    unit: str
    error: str = ""
    error_unit: str = ""
    limit: float = inf
    cyclic: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "error", self.error or self.name)
        object.__setattr__(self, "error_unit", self.error_unit or self.unit)
        if self.cyclic and self.limit == inf:
            object.__setattr__(self, "limit", 4.0 * pi)

    def __repr__(self) -> str:
        return f"Component({self.words})"

    @property
    def words(self) -> str:
        """Name with the unit that arrays have, in which a reader of the code computes; then the error."""
        value = f"{self.name} [{in_arrays(self.unit)}]"
        if self.error == self.name:
            return value
        return f"{value} (error: {self.error} [{in_arrays(self.error_unit)}])"


def geodetic_components(*, height: bool) -> tuple[Component, ...]:
    """Components of a position: latitude, longitude and, with ``height``, height. Errors are north-east-down [m]."""
    horizontal = (
        Component("latitude", "deg", "north", "m", limit=0.5 * pi),
        Component("longitude", "deg", "east", "m", limit=2.0 * pi, cyclic=True),
    )
    return (*horizontal, Component("height", "m", "down", "m", limit=LARGEST_HEIGHT)) if height else horizontal


def speed_components(*names: str) -> tuple[Component, ...]:
    """Components of a velocity [m/s]."""
    return tuple(Component(name, "m_s", limit=LARGEST_SPEED) for name in names)


@dataclass(frozen=True, eq=False)
class Kind:
    """What one kind of aiding instrument measures.

    Attributes
    ----------
    quantity : str
        Name of the measured quantity, in words.
    role : Role
        Role in navigation: "fix" (a position), "velocity", "heading", "range" (to a known point), "depth" or "other".
    components : tuple of Component
        Components of a measurement's value, one to three.
    equation : str, callable or None
        How a navigation filter predicts a reading: a key of `EQUATIONS` (a compiled equation), or an `Observation`.
        None: filters do not use the kind.
    geodetic : bool
        True if the first components are latitude and longitude, and the third one, if its name is ``height``, the
        height: values in radians, errors in metres.
    datasheet : tuple of str
        Further fields of the instrument's specification that an estimator receives (`Datasheet.details`).
    log_columns : tuple of str
        Columns that are read from a log of NMEA sentences if its scenario names none. By default they are the names of
        the components.
    side : tuple of Component
        Components of the side information that each reading of a channel carries, with their units (empty for a number
        without a unit); names differ from those of ``components``.
    reading_sigma : callable or None
        The sigma of a reading from its side information (`ReadingSigma`). None: it is that of the datasheet.
    observations : callable or None
        The equation for many readings at one time (`Observations`), for a kind whose equation is a function.
    message_noise : callable or None
        What the errors of another navigator, whose estimate is in the side information, add to the noise of a reading
        (`MessageNoise`), for a kind whose equation is a function.

    Raises
    ------
    PluginError
        If the role or the equation is unknown, a component has no proper name or that of another one, or the components
        do not fit the equation.
    """

    quantity: str
    role: Role
    components: tuple[Component, ...]
    equation: str | Observation | None = None
    geodetic: bool = False
    datasheet: tuple[str, ...] = ()
    log_columns: tuple[str, ...] = ()
    side: tuple[Component, ...] = ()
    reading_sigma: ReadingSigma | None = None
    observations: Observations | None = None
    message_noise: MessageNoise | None = None
    _limits: tuple[float, ...] = field(init=False, repr=False)

    def __deepcopy__(self, memo: object) -> Kind:
        """Itself: there is one object for each registered kind, and it never changes."""
        return self

    def __post_init__(self) -> None:
        if self.role not in get_args(Role):
            raise PluginError(f"role = {self.role!r} of a kind should be one of: {', '.join(get_args(Role))}")
        for name, wanted in (("components", Component), ("side", Component), ("datasheet", str), ("log_columns", str)):
            given = getattr(self, name)
            if not isinstance(given, tuple) or not all(isinstance(item, wanted) for item in given):
                raise PluginError(f"{name} = {given!r} of a kind should be a tuple of {wanted.__name__}")
        if not 1 <= len(self.components) <= MOST_COMPONENTS:
            raise PluginError(f"a kind has one to {MOST_COMPONENTS} components, not {len(self.components)}")
        for names in ((*self.values, *self.side_names), self.errors):
            for name in names:
                if not isinstance(name, str) or not _NAME.fullmatch(name):
                    raise PluginError(f"the name of a component, {name!r}, should be in snake_case, like 'slant_range'")
                if names.count(name) > 1:
                    raise PluginError(f"two components of a kind have the name {name!r}")
        if self.equation is not None and not callable(self.equation):
            if self.equation not in EQUATIONS:
                raise PluginError(
                    f"equation = {self.equation!r} of a kind should be a function, or one of: {', '.join(EQUATIONS)}"
                )
            d = _COMPONENTS_OF[self.equation]
            if len(self.components) != d:
                raise PluginError(
                    f"the equation {self.equation!r} gives {EQUATIONS[self.equation]}: {d} components, "
                    f"not {len(self.components)}"
                )
        for name in ("reading_sigma", "observations", "message_noise"):
            if getattr(self, name) is not None and not callable(self.equation):
                raise PluginError(f"a kind with {name} has an equation of its own: a function, not a compiled one")
        if self.geodetic and self.values[:2] != ("latitude", "longitude"):
            raise PluginError("the first components of a geodetic kind are latitude and longitude")
        # An angle equal to its limit is still plausible; another quantity equal to its limit is not.
        limits = tuple(nextafter(c.limit, inf) if c.cyclic else c.limit for c in self.components)
        object.__setattr__(self, "_limits", limits)

    @cached_property
    def values(self) -> tuple[str, ...]:
        """Name of each component of a measurement's value."""
        return tuple(c.name for c in self.components)

    @cached_property
    def errors(self) -> tuple[str, ...]:
        """Name of each component of the error and of ``Datasheet.sigma``: that of the value, except for positions."""
        return tuple(c.error for c in self.components)

    @cached_property
    def side_names(self) -> tuple[str, ...]:
        """Name of each component of the side information of a reading."""
        return tuple(c.name for c in self.side)

    @cached_property
    def observation(self) -> Observation | None:
        """The Python function that predicts a reading; None for a compiled equation, or without any equation."""
        return self.equation if callable(self.equation) else None

    @cached_property
    def _positions(self) -> int:
        """The number of leading components that are a geodetic position."""
        return 0 if not self.geodetic else 3 if self.values[2:] == ("height",) else 2

    @cached_property
    def layout(self) -> tuple[int, int]:
        """First arguments of `add_error_scalar`: the number of position components, and a bit for each cyclic one."""
        n = self._positions
        return n, sum(1 << i for i, c in enumerate(self.components) if c.cyclic and i >= n)

    @property
    def limits(self) -> tuple[float, ...]:
        """The limit of each component: a value is plausible between the limit and its negative, both excluded."""
        return self._limits

    def plausible(self, value: Array) -> bool:
        """Whether a (d,) value can be a measurement at all: finite, and within the limits of the components."""
        x: list[float] = value.tolist()
        for component, limit in zip(x, self._limits, strict=True):  # noqa: SIM110 (a generator costs as much again)
            if not -limit < component < limit:
                return False
        return True

    def add_error(self, value: Array, error: Array) -> Array:
        """Values with an error added.

        Parameters
        ----------
        value, error : (..., d) array
            Components as in `values` and `errors`, SI units and radians.

        Returns
        -------
        (..., d) array
            Values with the error. Cyclic angles are in [-pi, pi).
        """
        total, error = (np.array(a, dtype=np.float64) for a in np.broadcast_arrays(value, error))
        d = len(self.components)
        _add_errors(*self.layout, total.reshape(-1, d), error.reshape(-1, d))
        return total

    def difference(self, value: Array, reference: Array) -> Array:
        """The error that turns ``reference`` into ``value``: the inverse of `add_error`.

        Parameters
        ----------
        value, reference : (..., d) array
            Measured values and reference values; components as in `values`.

        Returns
        -------
        (..., d) array
            The errors of ``value``; components as in `errors`.
        """
        n = self._positions
        if n == len(self.components) == 3:
            return relative_position(value, reference)
        rest: Array = value - reference
        if n:
            rest[..., :n] = relative_position(_three(value, n), _three(reference, n))[..., :n]
        return self._wrapped(rest)

    def _wrapped(self, array: Array) -> Array:
        for i, component in enumerate(self.components):
            if component.cyclic and i >= self._positions:
                array[..., i] = wrap_angle(array[..., i])
        return array


def _three(array: Array, given: int) -> Array:
    """Return the first ``given`` components of positions, or of their errors, with a height of zero if it is missing.

    The radii of curvature are then those at the sea surface. At 100 m depth this changes an error by a factor of 2e-5.
    """
    if given == 3:
        return array[..., :3]
    return np.concatenate([array[..., :2], np.zeros((*array.shape[:-1], 1))], axis=-1)


#: The specifications of all aiding instruments, by kind; `simnav.sensors.register_instrument` adds one.
INSTRUMENTS: Registry[Any] = Registry("instrument", "simnav.instruments", "simnav.sensors")


class _Kinds(Mapping[str, Kind]):
    """The kinds of the registered instruments, by name."""

    def __getitem__(self, name: str) -> Kind:
        cls = INSTRUMENTS.get(name)
        if cls is None:
            raise KeyError(name)
        kind: Kind = cls.definition
        return kind

    def __repr__(self) -> str:
        """A line a kind: what it measures, in the units that arrays have."""
        lines = (f"{name}: {', '.join(c.words for c in kind.components)}" for name, kind in self.items())
        return "<kinds of instruments, in the units of arrays>\n" + "\n".join(lines)

    def __iter__(self) -> Iterator[str]:
        return iter(INSTRUMENTS.items())

    def __len__(self) -> int:
        return len(INSTRUMENTS.items())


#: Every registered kind of aiding instrument. A scenario may have several instruments of one kind.
KINDS: Mapping[str, Kind] = _Kinds()


def _zeros3() -> Array:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class Datasheet:
    """Datasheet of one aiding instrument, as an estimator sees it.

    All error figures are one sigma, in the units of ``KINDS[kind].errors`` (d components).

    Attributes
    ----------
    name, kind : str
        ``name`` is unique in a scenario; ``kind`` is a key of `KINDS`.
    rate, phase : float
        Sample rate [Hz] and time of the first sample [s].
    sigma : (d,) array
        White noise of a measurement.
    bias : (d,) array
        Turn-on bias, constant in a run.
    bias_instability : (d,) array
        Stationary sigma of the in-run (first-order Gauss-Markov) bias.
    correlation_time : float
        Of the in-run bias [s]; where it is infinite, ``bias_instability`` is a random walk per
        sqrt(s).
    scale : float
        Scale-factor error [-].
    misalignment : (3,) array
        Mounting misalignment about the body axes [rad].
    lever_arm : (3,) array
        From the IMU (or the vessel's reference point) to the instrument, body axes [m].
    details : mapping
        What the datasheet of this kind holds beyond the above (``KINDS[kind].datasheet``), SI units and radians.
    blocks : tuple of StateBlock
        The states that the instrument brings along.
    channels : tuple of str
        Identifiers of its channels (satellites, beams, beacons), in a fixed order: it gives at most one reading of each
        at a time. Empty: it has no channels, and gives one reading at a time.
    processes : tuple of DeclaredProcess
        Further coloured processes of the error. White ones are in ``sigma``.
    timing : TimingSheet or None
        What is known of its time stamps, and of how late readings arrive. None: nothing, or that both are perfect.
    sources : tuple of str
        Names of the instruments whose readings it solves: its errors are theirs. Whoever uses both counts them twice.
    stated : bool
        Whether it has no channels and states with a reading the standard deviation of its white noise, as the (d,) side
        information. ``sigma`` is then that of readings that state none.
    """

    name: str
    kind: str
    rate: float
    sigma: Array
    phase: float = 0.0
    bias: Array = field(default_factory=lambda: np.zeros(1))
    bias_instability: Array = field(default_factory=lambda: np.zeros(1))
    correlation_time: float = inf
    scale: float = 0.0
    misalignment: Array = field(default_factory=_zeros3)
    lever_arm: Array = field(default_factory=_zeros3)
    details: Mapping[str, Any] = field(default_factory=dict)
    blocks: tuple[StateBlock, ...] = ()
    channels: tuple[str, ...] = ()
    processes: tuple[DeclaredProcess, ...] = ()
    timing: TimingSheet | None = None
    sources: tuple[str, ...] = ()
    stated: bool = False

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"unknown kind of instrument {self.kind!r}; there are: {', '.join(KINDS)}")
        d = len(KINDS[self.kind].errors)
        for name in ("sigma", "bias", "bias_instability"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != (d,):  # else it is left out: a copy of a datasheet is made often, and this takes long
                value = np.broadcast_to(value, (d,))
            object.__setattr__(self, name, value.copy())

    @property
    def role(self) -> Role:
        """What an instrument of this kind is to a navigator (`Kind`)."""
        return KINDS[self.kind].role

    @property
    def gives_position(self) -> bool:
        """Whether its readings tell the horizontal position: a fix, a range to a known point, a sounding over a chart.

        Satellites are known points, and so are beacons and other vessels.
        """
        return self.role in ("fix", "range") or "bottom" in self.details

    @property
    def equation(self) -> str:
        """The compiled measurement equation of this kind; empty where it has none, or one of its own."""
        equation = KINDS[self.kind].equation
        return equation if isinstance(equation, str) else ""


def kinds_with(*equations: str) -> list[str]:
    """The names of the kinds that one of the given compiled equations predicts, sorted."""
    return sorted(name for name, kind in KINDS.items() if kind.equation in equations)
