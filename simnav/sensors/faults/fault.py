"""The common properties of faults in a scenario: their instruments and times, their sizes and their labels.

Bits: for each interval in ``intervals`` a fault has one bit of the labels and one `FaultLabel`; the bits are
consecutive. A fault with a start and an end, or with random intervals, has one bit.

`register_fault` registers a kind of fault, of simnav or of a third party (``docs/how-to/add-an-instrument.md``).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, get_args

from pydantic import BeforeValidator, SerializerFunctionWrapHandler, model_serializer, model_validator
from pydantic.fields import FieldInfo

from simnav.labels import FaultLabel
from simnav.plugins import PluginError, Registry, registered_kind, with_named_errors
from simnav.sensors.faults.sizes import QUANTITIES, QUANTITY_OF, axes_of, size_by_component
from simnav.spec import NonNegative, Positive, Spec, SpecError, closest, quantity, unit_of
from simnav.types import KINDS, Array

__all__ = ["FAULTS", "Effect", "FaultError", "FaultSpec", "Names", "effect_of", "register_fault"]

#: Smallest mean length of random intervals [s]: shorter ones contain no measurement, and need memory.
_LEAST_MEAN = 1e-3


def _names(value: Any) -> Any:
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, (list, tuple)) or not all(isinstance(n, str) for n in names):
        raise ValueError("should be the name of an instrument, or a list of names")
    return tuple(names)


def _intervals(value: Any) -> Any:
    if not isinstance(value, (list, tuple)) or not all(isinstance(v, (list, tuple)) and len(v) == 2 for v in value):
        raise ValueError("should be a list of [start, end]")
    return tuple(value)


def _channels(value: Any) -> Any:
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, (list, tuple)) or names == [] or not all(isinstance(n, str) for n in names):
        raise ValueError("should be the identifier of a channel, in quotes, or a list of them")
    return tuple(names)


#: Names of instruments; TOML may have one name without a list.
Names = Annotated[tuple[str, ...], BeforeValidator(_names)]
_Channels = Annotated[tuple[str, ...], BeforeValidator(_channels)]
_Intervals = Annotated[tuple[tuple[float, float], ...], BeforeValidator(_intervals)]

#: The effect of a fault on measurements: they are missing; white noise is added; a lasting error is added, or one that
#: grows from the start of each interval; gross errors are added to single measurements; measurements are replaced by
#: other values; the IMU is disturbed; or something else.
Effect = Literal["missing", "noise", "lasting", "growing", "gross", "replaced", "imu", "other"]


class FaultError(SpecError):
    """A fault that cannot be built or laid over measurements; the message names it, its file, and what is wrong."""


class FaultSpec(Spec):
    """Base of all faults.

    A size is given in the unit of the instruments that the fault affects. So a size like ``offset`` has the fields
    ``offset_position`` (TOML ``offset_m``; also for depths), ``offset_velocity`` (``offset_m_s``) and
    ``offset_heading`` (``offset_deg``).

    Attributes
    ----------
    instruments : tuple of str
        Names or kinds of the affected instruments.
    channels : tuple of str
        Identifiers of the affected channels (satellites, beams, beacons), which each of the instruments has. Empty: the
        whole instrument, with all its channels.
    start, end : float
        Beginning and end of the fault [s]; by default the whole run.
    intervals : tuple of (float, float)
        Several intervals in which the fault acts [s], instead of start and end.
    mean_active, mean_gap : float
        The fault acts in random intervals within start and end: mean of their exponentially distributed lengths, and
        mean of the gaps between them [s].
    name : str
        Name of the random streams of the fault; by default its kind and instruments.
    stems : tuple of str
        Names of the sizes, without the quantity: ``offset`` in the example above.
    effect : Effect
        Effect on a measurement. The oracles, which know the faults, use it.
    """

    stems: ClassVar[tuple[str, ...]] = ()
    effect: ClassVar[Effect] = "other"

    kind: str
    instruments: Names
    channels: _Channels = ()
    start: NonNegative = quantity("s", 0.0)
    end: Positive = quantity("s", inf)
    intervals: _Intervals = quantity("s", ())
    mean_active: Positive | None = quantity("s", None)
    mean_gap: Positive | None = quantity("s", None)
    name: str = ""

    @classmethod
    def toml_keys(cls) -> dict[str, tuple[str, FieldInfo]]:
        """See `Spec.toml_keys`. The unit gives the quantity, so ``offset_position`` has the key ``offset_m``."""
        keys = {}
        for name, info in cls.model_fields.items():
            stem, _, last = name.rpartition("_")
            unit = unit_of(info)
            base = stem if last in QUANTITIES and stem in cls.stems else name
            keys[base if unit is None else f"{base}_{unit}"] = (name, info)
        return keys

    @model_validator(mode="after")
    def _times(self) -> Self:
        if not self.instruments:
            raise ValueError("a fault names at least one instrument")
        if not self.start < self.end:
            raise ValueError(f"the fault ends ({self.end} s) before it starts ({self.start} s)")
        if self.intervals and not {"start", "end", "mean_active", "mean_gap"}.isdisjoint(self.model_fields_set):
            raise ValueError("intervals_s and start_s, end_s, mean_active_s, mean_gap_s exclude each other")
        if self.mean_active is not None and self.mean_active < _LEAST_MEAN:
            raise ValueError(f"mean_active_s = {self.mean_active:g}: should be at least {_LEAST_MEAN:g}")
        if (self.mean_active is None) != (self.mean_gap is None):
            raise ValueError("mean_active_s and mean_gap_s belong together")
        edges = [t for interval in self.intervals for t in interval]
        if any(not a < b for a, b in zip(edges[::2], edges[1::2])) or any(
            not a <= b for a, b in zip(edges[1::2], edges[2::2])
        ):
            raise ValueError("each of intervals_s is [start, end], start before end, in order and without overlap")
        if edges and edges[0] < 0.0:
            raise ValueError("intervals_s begin at 0 or later")
        return self

    @model_serializer(mode="wrap")
    def _without_empty(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The digest of a scenario whose faults name no channels is what it was before there were any."""
        table: dict[str, Any] = serialize(self)
        if not self.channels:
            table.pop("channels", None)
        return table

    @property
    def bits(self) -> int:
        """Number of bits, and of labels, of the fault."""
        return max(1, len(self.intervals))

    @property
    def sizes_required(self) -> bool:
        """Whether every instrument needs its size."""
        return True

    def sizes(self, stem: str) -> dict[str, Any]:
        """The sizes of a stem, by the name of the field."""
        return {f"{stem}_{q}": getattr(self, f"{stem}_{q}") for q in QUANTITIES}

    def size(self, stem: str, kind: str) -> Array:
        """The (d,) sizes of a stem for the components of a kind of instrument (after `check`)."""
        size = size_by_component(self.sizes(stem), stem, kind)
        assert size is not None
        return size

    def key_of(self, field: str) -> str:
        """The TOML key of a field."""
        return next(key for key, (name, _) in self.toml_keys().items() if name == field)

    def touched(self, instruments: Mapping[str, str]) -> tuple[str, ...]:
        """Names of the affected instruments, from a mapping from name to kind."""
        return tuple(n for n, k in instruments.items() if n in self.instruments or k in self.instruments)

    def check(self, instruments: Mapping[str, str], *, imu: bool = True) -> None:
        """Check that the fault fits the instruments of a scenario.

        Parameters
        ----------
        instruments : mapping
            The kind of each instrument, by its name.
        imu : bool
            Whether the scenario has an IMU.

        Raises
        ------
        SpecError
            If an instrument does not exist, or the unit of a size does not fit an instrument.
        """
        for name in self.instruments:
            if name == "imu":
                own = ", ".join(repr(kind) for kind, cls in FAULTS.items().items() if cls.effect == "imu")
                raise SpecError(f"fault {self.kind!r}: on the IMU there is {own} only")
            if name not in instruments and name not in instruments.values():
                valid = sorted({*instruments, *instruments.values()})
                raise SpecError(f"fault {self.kind!r}: there is no instrument {name!r}{closest(name, valid)}")
        names = self.touched(instruments)
        for stem in self.stems:
            self._check_units(stem, {n: instruments[n] for n in names})
            for n in names:
                self._check_axes(stem, n, instruments[n])

    def check_channels(self, instruments: Mapping[str, str], channels: Mapping[str, tuple[str, ...]]) -> None:
        """Check that the instruments of the fault have its channels.

        Parameters
        ----------
        instruments : mapping
            The kind of each instrument, by its name.
        channels : mapping
            The channels of each instrument, by its name.

        Raises
        ------
        SpecError
            If an instrument does not have one of them.
        """
        for name in self.touched(instruments) if self.channels else ():
            valid = channels.get(name, ())
            if not valid:
                raise SpecError(
                    f"fault {self.kind!r}: channels = {list(self.channels)} is of no use to {name!r}, which has no "
                    "channels; leave it out"
                )
            for channel in self.channels:
                if channel not in valid:
                    shown = ", ".join(valid[:20]) + (", ..." if len(valid) > 20 else "")
                    raise SpecError(f"fault {self.kind!r}: {name!r} has no channel {channel!r}; it has: {shown}")

    def _check_units(self, stem: str, touched: Mapping[str, str]) -> None:
        needed = {q: name for name, kind in touched.items() for q in axes_of(kind)}
        if "" in needed and self.sizes_required:
            name = needed[""]
            unit = next(c.error_unit for c in KINDS[touched[name]].components if c.error_unit not in QUANTITY_OF)
            raise SpecError(f"fault {self.kind!r} on {name!r} ({touched[name]}): there is no {stem} in {unit}")
        needed.pop("", None)
        given = {q for q in QUANTITIES if getattr(self, f"{stem}_{q}") is not None}
        for q in sorted(given.difference(needed)):
            right = " and ".join(repr(self.key_of(f"{stem}_{r}")) for r in sorted(needed))
            kinds = ", ".join(f"{name} ({kind})" for name, kind in touched.items())
            raise SpecError(
                f"fault {self.kind!r}: {self.key_of(f'{stem}_{q}')!r} is of no use to {kinds}; that takes {right}"
            )
        for q in sorted(set(needed).difference(given)):
            if self.sizes_required:
                name = needed[q]
                where = f"fault {self.kind!r} on {name!r} ({touched[name]})"
                raise SpecError(f"{where}: required key {self.key_of(f'{stem}_{q}')!r} is missing")

    def _check_axes(self, stem: str, name: str, kind: str) -> None:
        for q, axes in axes_of(kind).items():
            size, d = getattr(self, f"{stem}_{q}", None), len(axes)
            if isinstance(size, tuple) and len(size) != d:
                key = self.key_of(f"{stem}_{q}")
                takes = f"{d}, or one" if d > 1 else "one"
                raise SpecError(
                    f"fault {self.kind!r} on {name!r} ({kind}): {key!r} has {len(size)} numbers; it takes {takes}"
                )

    def label(self, duration: float, instruments: Mapping[str, str]) -> list[FaultLabel]:
        """The labels of the fault: one for each bit.

        Parameters
        ----------
        duration : float
            Length of the run [s]; labels end there at the latest.
        instruments : mapping
            The kind of each instrument, by its name.
        """
        names = self.touched(instruments)
        intervals = self.intervals or ((self.start, self.end),)
        when = {"kind", "instruments", "channels", "start", "end", "intervals", "mean_active", "mean_gap", "name"}
        parameters = self.model_dump(exclude=when, exclude_none=True)
        return [
            FaultLabel(self.kind, names, min(a, duration), min(b, duration), parameters, self.channels)
            for a, b in intervals
        ]

    def build(self, index: int, seed: int, occurrence: int | None = None) -> object:
        """Make the layer of this fault for one run.

        Parameters
        ----------
        index : int
            First bit of the fault in the labels.
        seed : int
            Seed of the run.
        occurrence : int, optional
            Number that distinguishes faults of the same name (`build_layers` counts them); by default the index.

        Returns
        -------
        simnav.sensors.faults.FaultLayer
            The layer; `build_layers` checks that it is one.
        """
        raise NotImplementedError(f"{type(self).__qualname__} has no build()")

    @property
    def stream_name(self) -> str:
        """Name of the random streams of the fault, without its occurrence."""
        return self.name or f"{self.kind}:{','.join(self.instruments)}"

    def key_of_streams(self, index: int, occurrence: int | None) -> str:
        """The key of the random streams of a layer, from the arguments of `build`."""
        return f"{self.stream_name}#{index if occurrence is None else occurrence}"


FAULTS: Registry[type[FaultSpec]] = Registry("fault", "simnav.faults", "simnav.sensors")

F = TypeVar("F", bound=FaultSpec)


def register_fault(cls: type[F]) -> type[F]:
    """Register a kind of fault (class decorator). Its name is the default of the field ``kind`` of the specification.

    Raises
    ------
    PluginError
        If the class is not a subclass of `FaultSpec`, another class has its name, or its effect or one of its fields is
        not valid.
    """
    name = registered_kind(cls, FaultSpec, decorator="register_fault", sort="fault", example="my_fault")
    if cls.effect not in get_args(Effect):
        raise PluginError(f"fault {name!r}: effect = {cls.effect!r} should be one of: {', '.join(get_args(Effect))}")
    for stem in cls.stems:
        for q in QUANTITIES:
            if f"{stem}_{q}" not in cls.model_fields:
                raise PluginError(f"fault {name!r}: a stem needs a field for every quantity; there is no {stem}_{q}")
    FAULTS.add(name, cls)
    for method in ("build", "check"):
        named = with_named_errors(getattr(cls, method), FaultError, _label, (SpecError, MemoryError))
        setattr(cls, method, named)
    return cls


def _label(spec: FaultSpec, *_: Any, **__: Any) -> str:
    return f"fault {spec.kind!r}"


def effect_of(kind: str) -> Effect:
    """The effect of a kind of fault on measurements; "other" if the kind is not registered."""
    cls = FAULTS.get(kind)
    return "other" if cls is None else cls.effect
