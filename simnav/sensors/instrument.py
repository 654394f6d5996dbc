"""The common part of all aiding instruments: specification, errors of a run, and labels.

The model of a measurement is ::

    value = observe(truth) + b + g + w

``observe`` is the geometry of the instrument with its deterministic errors, b the turn-on bias, which is constant in a
run, g the in-run bias, a first-order Gauss-Markov process, and w white noise. Further processes are named in the tables
``[[instruments.NAME.error]]`` (`simnav.sensors.error_processes`). Errors of a position are in metres. The
turn-on values are drawn at the start of a run from the datasheet's one-sigma figures. ``fixed_*`` are constant errors
that are added; estimators do not receive them. Every process has its own random stream and draws at every sample,
delivered or not.

`register_instrument` registers a kind of instrument, of simnav or of a third party
(``docs/how-to/add-an-instrument.md``).
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import partial, wraps
from math import inf
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from simnav.blocks import LEVER_ARM, StateBlock
from simnav.kinds import INSTRUMENTS, Kind
from simnav.plugins import PluginError, registered_kind, with_named_errors
from simnav.recording import AidStream
from simnav.sensors.block_values import BlockValues, check_blocks
from simnav.sensors.error_processes import AnyErrorProcess, TotalError, declared_processes, labels_of, white_of
from simnav.sensors.errors import InstrumentError, label_of, raised
from simnav.sensors.figures import PROCESSES, ZERO, Pair, SigmaPair, SigmaTriple, Triple, figures_of, times_datasheet
from simnav.sensors.kind_check import check_kind
from simnav.sensors.processes import GaussMarkov
from simnav.sensors.rows import checked_reading, checked_rows
from simnav.sensors.timing import TimingSpec
from simnav.sensors.turning import turn_to_body, turn_to_ned
from simnav.spec import NonNegative, Positive, Spec, SpecError, closest, entries, quantity, without_later
from simnav.streams import stream
from simnav.types import Array, Datasheet, TapStates
from simnav.world.surroundings import Surroundings

__all__ = [
    "ZERO", "AidSpec", "Instrument", "InstrumentError", "Pair", "SigmaPair", "SigmaTriple", "Triple", "figures_of",
    "label_of", "raised", "register_instrument", "times_datasheet", "turn_to_body", "turn_to_ned",
]  # fmt: skip

#: Names with another meaning, which no instrument may have: parts of an environment's observation and of a reference.
_RESERVED = ("imu", "interval", "position", "velocity", "attitude")
#: Figures for which a specification may have a separate field for each component.
_BY_COMPONENT = ("sigma", "bias", "bias_instability", "fixed_bias")
#: What the identifier of a channel looks like (it stands in tables, in the TOML of faults, and after a colon), and the
#: largest number of channels of an instrument.
_CHANNEL, _MOST_CHANNELS = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]*"), 1000


class AidSpec(Spec):
    """Base class of the specifications of aiding instruments.

    Subclasses declare ``sigma`` and, as far as they apply, the fields from ``bias`` to ``lever_arm_sigma`` below and
    their ``fixed_`` forms, each with its unit. If the components of a measurement have different units, each has a
    field of its own: ``sigma_range``, ``sigma_bearing``.

    Attributes
    ----------
    definition : Kind
        Properties of the kind; set by `register_instrument`.
    example : mapping
        A table of a scenario file with an instrument of this kind; set by `register_instrument`.
    errors : tuple of str
        Names of the error fields; each may also exist with the prefix ``fixed_``. All are zero for an ideal instrument.
    beside : mapping
        Tables of the instruments that the example reads, by name, if there are any (`register_instrument`).
    charts : tuple of str
        Names of the parts of the surroundings whose chart (`simnav.world.SurroundingSpec.chart`) estimators receive, in
        ``Datasheet.details``.
    states_sigma : bool
        Whether each reading states its own sigma (`simnav.kinds.Datasheet.stated`). Only for a kind without channels,
        whose instrument puts the sigmas into the side information of its stream.
    unstated : tuple of str
        The error fields whose one-sigma figure is in no datasheet. Only the oracles know it, see
        `simnav.scenario.Scenario.actual_sheet`.
    rate, phase
        The readings are of the times phase, phase + 1/rate, and so on.
    sigma
        White noise of a reading, one sigma.
    bias
        Turn-on bias, one sigma: it is drawn for each run, and constant in it.
    bias_instability, correlation_time
        In-run bias, a first-order Gauss-Markov process: one sigma and correlation time (inf: a random walk).
    scale
        Scale-factor error, one sigma.
    misalignment
        Error of the mounting about each body axis, one sigma.
    lever_arm, lever_arm_sigma
        Vector from the IMU to the instrument (forward, starboard, down), and how well it was measured, one sigma.
    """

    definition: ClassVar[Kind]
    example: ClassVar[Mapping[str, Any]]
    beside: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    errors: ClassVar[tuple[str, ...]] = (
        "sigma", "bias", "bias_instability", "scale", "misalignment", "lever_arm_sigma",
    )  # fmt: skip
    charts: ClassVar[tuple[str, ...]] = ()
    states_sigma: ClassVar[bool] = False
    unstated: ClassVar[tuple[str, ...]] = ()
    #: See `simnav.spec.without_later`.
    later: ClassVar[Mapping[str, Any]] = {"processes": (), "lever_arm_sigma": ZERO, "timing": None}

    kind: str
    rate: Positive = quantity("hz", 1.0)
    phase: NonNegative = quantity("s", 0.0)
    correlation_time: Positive = quantity("s", inf)
    times_datasheet: dict[str, Positive] = Field(
        {}, description="figures that really are so many times what the datasheet says, like `sigma = 2.5`"
    )
    processes: tuple[AnyErrorProcess, ...] = entries("error", (), description="further processes of the error")
    timing: TimingSpec | None = Field(None, description="time stamps and latency; without it both are perfect")

    @model_validator(mode="after")
    def _correlated(self) -> Self:
        if np.any(np.asarray(self.figure("bias_instability"))) and "correlation_time" not in self.model_fields_set:
            raise ValueError("bias_instability needs a correlation_time_s (inf for a random walk)")
        return self

    @model_validator(mode="after")
    def _fitting_clock(self) -> Self:
        if self.timing is not None:
            self.timing.check(self.rate)
        return self

    def figure(self, name: str) -> Any:
        """A figure of this instrument, for each component if they have own fields; 0 if the kind has no such error."""
        if name in type(self).model_fields:
            return getattr(self, name)
        if name not in _BY_COMPONENT:
            return 0.0
        by_component = tuple(getattr(self, f"{name}_{error}", 0.0) for error in self.definition.errors)
        return by_component if any(by_component) else 0.0

    def ideal(self) -> Self:
        """The same instrument without errors."""
        names = {
            f"{name}{suffix}" for name in self.errors for suffix in ("", *(f"_{e}" for e in self.definition.errors))
        }
        changes = {}
        for name in type(self).model_fields:
            if name.removeprefix("fixed_") in names:
                value = getattr(self, name)
                changes[name] = (0.0,) * len(value) if isinstance(value, tuple) else 0.0
        return self.model_copy(update={**changes, "processes": (), "timing": None})

    @model_serializer(mode="wrap")
    def _without_later(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return without_later(serialize(self), self.later)

    @model_validator(mode="after")
    def _fitting_processes(self) -> Self:
        if not self.processes:
            return self
        if self.sources():
            raise ValueError(
                f"error: an instrument of kind {self.kind!r} has the errors of {' and '.join(self.sources())}, which "
                "it reads; name the processes there"
            )
        for name, process in zip(labels_of(self.processes), self.processes, strict=True):
            try:
                process.check(self.definition)
            except ValueError as error:
                raise ValueError(f"error {name!r}: {error}") from None
        return self

    @model_validator(mode="after")
    def _known_figures(self) -> Self:
        valid = [*figures_of(type(self), self.errors), *([PROCESSES] if self.processes else [])]
        for name in self.times_datasheet:
            if name not in valid:
                raise ValueError(f"times_datasheet.{name}: there is no such figure{closest(name, valid)}")
        return self

    def blocks(self) -> tuple[StateBlock, ...]:
        """The states that this instrument brings along, from its fields.

        These are three of its lever arm if a figure says how well that is known (``lever_arm_sigma``), and what a
        subclass adds.

        The figures of a block are fields of the specification that ``errors`` names, so that an ideal instrument has
        none of them, and ``times_datasheet`` may change them.
        """
        if not any(sigma := np.atleast_1d(self.figure("lever_arm_sigma")).tolist()):
            return ()
        return (StateBlock(LEVER_ARM, 3, "m", tuple(sigma)),)

    def channels(self) -> tuple[str, ...]:
        """Identifiers of the channels of this instrument (satellites, beams, beacons); none, unless a subclass says so.

        With channels `build` returns a `simnav.sensors.ChannelInstrument`, whose `observe` returns readings of the
        shape (n, c, d): for each of n times one of each of the c channels.
        """
        return ()

    def sources(self) -> Mapping[str, str | tuple[str, ...]]:
        """The kind of each instrument, or the kinds that it may have, by its name in the scenario, whose readings this
        one reads; none, unless a subclass says so.

        With sources `build` returns a `simnav.sensors.DerivedInstrument`. A source reads no other instrument itself.
        """
        return {}

    def solves(self) -> tuple[str, ...]:
        """Those of the `sources` whose readings an estimator uses in place of those of this instrument, or not at all;
        all of them, unless a subclass says otherwise.
        """
        return tuple(self.sources())

    def fits(self, chart: Callable[[str], Mapping[str, Any] | None]) -> None:
        """Check that the instrument fits the charts of its scenario; nothing, unless a subclass says otherwise.

        Parameters
        ----------
        chart : callable
            The chart of a part of the surroundings (`charts`), by its name; None where there is none.

        Raises
        ------
        ValueError
            One sentence that names the key, its value, and what would be right.
        """

    def latency_spread(self) -> float | None:
        """By how much the latencies of two readings may differ [s]; None: each reading arrives when it is valid."""
        return None if self.timing is None else self.timing.spread

    def origin(self) -> Mapping[str, str]:
        """What an export needs beyond the datasheet, such as the date (`Recording.origins`); nothing by default."""
        return {}

    @model_validator(mode="after")
    def _proper_channels(self) -> Self:
        channels = self.channels()
        if not isinstance(channels, tuple) or not all(isinstance(c, str) and _CHANNEL.fullmatch(c) for c in channels):
            raise ValueError(
                f"channels {channels!r}: should be a tuple of identifiers of letters, digits and the signs _ . + -"
            )
        if len(set(channels)) < len(channels):
            twice = next(c for c in channels if channels.count(c) > 1)
            raise ValueError(f"channel {twice!r} is there more than once; each channel has an identifier of its own")
        if len(channels) > _MOST_CHANNELS:
            raise ValueError(f"{len(channels)} channels are too many; there are at most {_MOST_CHANNELS}")
        return self

    def actual(self) -> Self:
        """The instrument with its true figures, those of the datasheet times ``times_datasheet``, and all processes."""
        actual = times_datasheet(self)
        if all(process.stated for process in self.processes):
            return actual
        stated = tuple(process.model_copy(update={"stated": True}) for process in actual.processes)
        return actual.model_copy(update={"processes": stated})

    def datasheet(self, name: str) -> Datasheet:
        """The datasheet that an estimator receives.

        Parameters
        ----------
        name : str
            Name of the instrument in its scenario.
        """
        sigma, definition = np.asarray(self.figure("sigma"), dtype=np.float64), self.definition
        if self.processes:
            sigma = np.sqrt(sigma**2 + white_of(self.processes, definition))
        return Datasheet(
            name,
            self.kind,
            self.rate,
            sigma,
            self.phase,
            np.asarray(self.figure("bias"), dtype=np.float64),
            np.asarray(self.figure("bias_instability"), dtype=np.float64),
            self.correlation_time,
            float(self.figure("scale")),
            np.broadcast_to(np.asarray(self.figure("misalignment"), dtype=np.float64), (3,)).copy(),
            np.broadcast_to(np.asarray(self.figure("lever_arm"), dtype=np.float64), (3,)).copy(),
            {detail: getattr(self, detail) for detail in definition.datasheet},
            self.blocks(),
            self.channels(),
            declared_processes(self.processes, definition),
            None if self.timing is None else self.timing.sheet(),
            self.solves(),
            self.states_sigma,
        )

    def build(self, name: str, seed: int) -> Instrument:
        """Make the instrument of one run.

        Parameters
        ----------
        name : str
            Name of the instrument in its scenario; its random streams are named after it.
        seed : int
            Seed of the run.
        """
        raise NotImplementedError(f"{type(self).__qualname__} has no build()")

    def install(self, name: str, seed: int, surroundings: Surroundings) -> Instrument:
        """Make the instrument of one run by `build`, and put it into the surroundings of the run.

        Raises
        ------
        InstrumentError
            If the instrument cannot be made, or the surroundings lack a part that it needs.
        """
        instrument = self.build(name, seed)
        try:
            instrument.enter(surroundings)
        except (InstrumentError, MemoryError):
            raise
        except Exception as error:
            raise raised(label_of(name, self.kind, type(self)), type(instrument), error) from error
        return instrument


S = TypeVar("S", bound=AidSpec)


def register_instrument(
    kind: Kind, *, example: Mapping[str, Any], beside: Mapping[str, Mapping[str, Any]] | None = None
) -> Callable[[type[S]], type[S]]:
    """Register a kind of instrument (class decorator). Its name is the default of the field ``kind``.

    Parameters
    ----------
    kind : Kind
        Properties of the kind: components, role, measurement equation.
    example : mapping
        A table of a scenario file, without ``kind``, with a typical instrument of this kind. The contract test of
        estimators (`simnav.check`) puts it on a vessel that sails from 54.0 N, 7.9 E.
    beside : mapping, optional
        Tables of further instruments by name, which the example reads, where no example of another kind will do.

    Raises
    ------
    PluginError
        If the class is not a subclass of `AidSpec` or does not fit its kind, if another class has its name, or if the
        example is not valid.

    Examples
    --------
    See ``docs/how-to/add-an-instrument.md``.
    """

    def wrap(cls: type[S]) -> type[S]:
        name = registered_kind(
            cls, AidSpec, decorator="register_instrument", sort="instrument", example="my_instrument"
        )
        if name in _RESERVED:
            raise PluginError(f"kind {name!r} of instrument {cls.__qualname__}: the name means something else")
        check_kind(cls, AidSpec, name, kind)
        cls.definition, cls.example, cls.beside = kind, dict(example), dict(beside or {})
        with INSTRUMENTS.adding(name, cls):
            source = f"the example of kind {name!r}"
            try:
                spec = cls.from_toml(example, source=source)
                check_blocks(spec, source)
                spec.datasheet("example")
            except SpecError as error:
                raise PluginError(str(error)) from None
            except ValueError as error:
                raise PluginError(
                    f"{source}: its figures do not fit its components ({', '.join(kind.errors)}): {error}"
                ) from None
            if (kind.side or kind.reading_sigma is not None) and not spec.channels():
                raise PluginError(
                    f"{source} has no channels, but its kind has side information or a sigma of a reading, which only "
                    "readings of channels have"
                )
        cls.build = _checked(cls.build)  # type: ignore[method-assign]
        return cls

    return wrap


def _checked(build: Callable[..., Any]) -> Callable[..., Instrument]:
    """Wrap ``build`` of a specification, so that its errors name the instrument, and that it gives what it should."""
    named = with_named_errors(build, InstrumentError, _label, (InstrumentError, MemoryError))

    @wraps(build)
    def checked(self: AidSpec, name: str, seed: int) -> Instrument:
        made = named(self, name, seed)
        label = partial(label_of, name, self.kind, type(self))  # late: it reads the source of the class
        if not isinstance(made, Instrument):
            raise InstrumentError(f"{label()}: build() returned {type(made).__name__}, where an Instrument is wanted")
        if made.channels != self.channels():
            raise InstrumentError(
                f"{label()}: build() returned an instrument with the channels {made.channels}, but the specification "
                f"has {self.channels()}; an instrument with channels is a simnav.sensors.ChannelInstrument"
            )
        return made

    return checked


def _label(spec: AidSpec, name: str, seed: int) -> str:
    return f"instrument {name!r} of kind {spec.kind!r}"


class Instrument(ABC):
    """An aiding instrument in one run. Its errors are drawn at the start and continue from block to block.

    Parameters
    ----------
    spec : AidSpec
        Rate, mounting and error parameters, from the scenario.
    name : str
        Name of the instrument in the scenario; its random streams are named after it.
    seed : int
        Seed of the run.

    Attributes
    ----------
    definition : Kind
        Properties of its kind.
    sigma, bias : (d,) array
        Standard deviation of the white noise, and turn-on bias of this run.
    total : TotalError or None
        The processes of the tables ``[[instruments.NAME.error]]``; None without any.
    scale : float
        Scale-factor error of this run [-].
    lever_arm : (3,) array
        Vector from the IMU to the instrument in body axes (forward, starboard, down) [m].
    has_lever_arm : bool
        True if the lever arm is not zero.
    surroundings : Surroundings
        Sea, current, bottom and other parts, which the instrument may ask at its places and times (`enter`).
    channels : tuple of str
        Identifiers of its channels (`simnav.sensors.ChannelInstrument`); empty for an instrument without channels.
    """

    surroundings: Surroundings = Surroundings()
    channels: tuple[str, ...] = ()

    def __init__(self, spec: AidSpec, name: str, seed: int):
        self.name, self.kind, self.definition = name, spec.kind, spec.definition
        self._seed = seed
        sheet = spec.datasheet(name)
        self.sigma = sheet.sigma
        self.total: TotalError | None = None
        if spec.processes:
            self.sigma = np.broadcast_to(np.asarray(spec.figure("sigma"), np.float64), self.sigma.shape).copy()
            if not spec.channels():
                self.total = TotalError(spec.processes, spec.definition, seed, name)
        self.lever_arm = sheet.lever_arm
        self.bias = self.drawn("bias", sheet.bias) + spec.figure("fixed_bias")
        self.scale = float(self.drawn("scale", np.array([sheet.scale]))[0] + spec.figure("fixed_scale"))
        self._noise = stream(seed, "instrument", name, "noise") if self.sigma.any() else None
        self._instability = None
        if sheet.bias_instability.any():
            rng = stream(seed, "instrument", name, "bias_instability")
            self._instability = GaussMarkov(sheet.bias_instability, sheet.correlation_time, rng)
        self._blocks = {block.name: BlockValues(block, block.label(name), seed) for block in sheet.blocks}
        if LEVER_ARM in self._blocks:
            self.lever_arm = sheet.lever_arm + self.block(LEVER_ARM, np.zeros(1))[0]
        self.has_lever_arm = bool(self.lever_arm.any())

    def block(self, name: str, time: Array) -> Array:
        """The true values of a block of states at n times.

        Parameters
        ----------
        name : str
            Name of one of the blocks of `AidSpec.blocks`.
        time : (n,) array
            Times [s].

        Returns
        -------
        (n, k) array
            SI units and radians.

        Raises
        ------
        KeyError
            If the instrument has no such block.
        """
        if name not in self._blocks:
            raise KeyError(f"there is no block of states {name!r}{closest(name, list(self._blocks))}")
        return self._blocks[name].at(time)

    def drawn(self, process: str, sigma: Array) -> Array:
        """Draw the values of this run from a random stream that is named after the process; ``sigma`` is one sigma."""
        if not sigma.any():
            return np.zeros(len(sigma))
        return sigma * stream(self._seed, "instrument", self.name, process).standard_normal(len(sigma))

    def enter(self, surroundings: Surroundings) -> None:
        """Enter the surroundings of the run, before the first measurement. An override calls this one first."""
        self.surroundings = surroundings

    @abstractmethod
    def observe(self, tap: TapStates) -> Array:
        """The (n, d) values without bias and noise."""

    def noise_sigma(self, observed: Array) -> Array:
        """The (n, d) standard deviation of the white noise of each measurement."""
        return self.sigma[None].repeat(len(observed), axis=0)

    def available(self, tap: TapStates) -> NDArray[np.bool_] | None:
        """An (n,) mask of the samples that are delivered; None: all."""
        return None

    def reading(self, tap: TapStates) -> tuple[Array, Array, NDArray[np.bool_] | None]:
        """The results of `observe`, `noise_sigma` and `available`."""
        value = checked_rows(self, "observe()", self.observe(tap), tap)
        return value, self.noise_sigma(value), self.available(tap)

    def lever_displacement(self, tap: TapStates) -> Array:
        """The (n, 3) north-east-down offset [m] of the instrument from the reference point."""
        return turn_to_ned(tap.attitude, self.lever_arm)

    def lever_velocity(self, tap: TapStates) -> Array:
        """The (n, 3) velocity [m/s] of the instrument relative to the reference point, body axes: omega x l."""
        w, (x, y, z) = tap.angular_rate, self.lever_arm
        velocity = np.empty((len(w), 3))
        velocity[:, 0] = w[:, 1] * z - w[:, 2] * y
        velocity[:, 1] = w[:, 2] * x - w[:, 0] * z
        velocity[:, 2] = w[:, 0] * y - w[:, 1] * x
        return velocity

    def ahead(self, time: Array) -> tuple[Array, Array]:
        """Draw the random numbers of `sense` for the next n samples. They depend on the times only.

        Parameters
        ----------
        time : (n,) array
            Sample times [s], delivered or not.

        Returns
        -------
        error : (n, d) array
            Sum of turn-on bias and in-run bias of each sample.
        variates : (n, d) array
            White noise of unit variance; zero if the instrument has no noise.
        """
        error = self.bias[None].repeat(len(time), axis=0)
        if self._instability is not None:
            error += self._instability.sample(time)
        shape = error.shape
        return error, np.zeros(shape) if self._noise is None else self._noise.standard_normal(shape)

    def sense(self, tap: TapStates) -> AidStream:
        """Measure the states of the next block.

        Parameters
        ----------
        tap : TapStates
            True states at the instrument's sample times.

        Returns
        -------
        AidStream
            The measurements without faults. ``dropped`` holds the times without a measurement.

        Raises
        ------
        InstrumentError
            If `observe`, `noise_sigma` or `available` raises, or returns an array of another shape than it should, or a
            number that is not finite or a negative sigma for a sample that is delivered.
        """
        value, sigma, there = checked_reading(self, tap)
        error, variates = self.ahead(tap.time)
        if self._noise is not None:
            error += sigma * variates
        if self.total is not None:
            more = self.total.at(tap, value, self.surroundings)
            error, sigma = error + more.error, np.sqrt(sigma**2 + more.variance)
            there = ~more.lost if there is None else there & ~more.lost
        value = self.definition.add_error(value, error)
        if self.total is not None:
            value = self.total.rounded(value)
        time, dropped = tap.time, np.empty(0)
        if there is not None and not there.all():
            time, dropped, value, sigma = time[there], time[~there], value[there], sigma[there]
        n = len(value)
        return AidStream(
            self.name, self.kind, time, value, np.zeros(n, np.uint32), np.zeros(value.shape), sigma, dropped
        )
