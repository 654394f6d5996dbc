"""What all faults share: where and when they act, their labels, and how they are laid over a stream.

A fault is a layer over whatever delivered the measurements, a simulator or a real log. It acts at the measurement times
within its intervals [start, end); elsewhere it neither changes nor draws anything. Within them it draws a fixed number
of variates per measurement, those counted that something else has dropped, so that faults never change one another.

Bits: a fault takes one bit of the labels, and one `FaultLabel`, per interval in ``intervals``, consecutive; a fault
with a start and an end, or with random intervals, takes one.

`register_fault` makes a kind of fault known, ours and others' alike (``docs/how-to/add-an-instrument.md``).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, model_validator
from pydantic.fields import FieldInfo

from simnav.plugins import PluginError, Registry
from simnav.recording import AidStream, FaultLabel, ImuLabels
from simnav.spec import NonNegative, Positive, Spec, SpecError, closest, quantity, unit_of
from simnav.streams import stream as random_stream
from simnav.types import KINDS, Array, ImuSamples

__all__ = [
    "ADDS",
    "DISTURBS_IMU",
    "DROPS",
    "FAULTS",
    "HOLDS",
    "STEPS_NOISE",
    "TOLERANCE",
    "ZEROES",
    "Activity",
    "Effect",
    "FaultLayer",
    "FaultSpec",
    "Names",
    "Size",
    "effect_of",
    "register_fault",
    "size_by_component",
    "size_range",
]

#: Least mean length of random intervals: shorter ones touch no measurement, and cost memory [s].
_LEAST_MEAN = 1e-3
#: Times are multiples of the sample interval up to rounding: half a microsecond decides [s].
TOLERANCE = 0.5e-6

#: A number for all axes, or one per axis.
Size = float | tuple[float, ...] | None


def _names(value: Any) -> Any:
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, (list, tuple)) or not all(isinstance(n, str) for n in names):
        raise ValueError("should be the name of an instrument, or a list of names")
    return tuple(names)


def _intervals(value: Any) -> Any:
    if not isinstance(value, (list, tuple)) or not all(isinstance(v, (list, tuple)) and len(v) == 2 for v in value):
        raise ValueError("should be a list of [start, end]")
    return tuple(value)


#: Names of instruments; TOML may give one alone.
Names = Annotated[tuple[str, ...], BeforeValidator(_names)]
_Intervals = Annotated[tuple[tuple[float, float], ...], BeforeValidator(_intervals)]

#: What a fault does to a measurement: it takes it away; adds white noise; adds an error that lasts, or one that grows
#: from the start of each interval; adds gross errors to single measurements; puts another value in its place; disturbs
#: the IMU; or something else.
Effect = Literal["missing", "noise", "lasting", "growing", "gross", "replaced", "imu", "other"]

#: Sizes are given for errors of these: the end of a field's name, and the units of the components that it is for.
_QUANTITIES = {
    "position": ("m", "mm", "cm", "km"),
    "velocity": ("m_s", "mm_s", "cm_s", "kn"),
    "heading": ("deg", "arcsec"),
}
_QUANTITY_OF = {unit: name for name, units in _QUANTITIES.items() for unit in units}


def _axes(kind: str) -> dict[str, list[int]]:
    """The components of a kind of instrument whose errors are of each quantity; "" for those of none."""
    axes: dict[str, list[int]] = {}
    for i, component in enumerate(KINDS[kind].components):
        axes.setdefault(_QUANTITY_OF.get(component.error_unit, ""), []).append(i)
    return axes


def size_by_component(sizes: Mapping[str, Any], stem: str, kind: str) -> Array | None:
    """The size of a fault for each of the d components of a kind of instrument.

    Parameters
    ----------
    sizes : mapping
        Fields of the fault's specification, or of its label, SI units.
    stem : str
        As in ``FaultSpec.stems``.
    kind : str
        Kind of the instrument.

    Returns
    -------
    (d,) array or None
        None where a size is not given.
    """
    result = np.empty(len(KINDS[kind].components))
    for name, axes in _axes(kind).items():
        size = sizes.get(f"{stem}_{name}")
        if size is None:
            return None
        result[axes] = size
    return result


def size_range(sizes: Mapping[str, Any], stem: str, kind: str) -> tuple[Array, Array]:
    """Likewise the (d,) smallest and largest size, where a size is [minimum, maximum]."""
    low, high = np.empty((2, len(KINDS[kind].components)))
    for name, axes in _axes(kind).items():
        low[axes], high[axes] = sizes[f"{stem}_{name}"]
    return low, high


class FaultSpec(Spec):
    """Base of all faults.

    A size is given in the unit of the instruments that it touches: a field like ``offset`` exists as
    ``offset_position`` (TOML ``offset_m``; also for depths), ``offset_velocity`` (``offset_m_s``) and
    ``offset_heading`` (``offset_deg``).

    Attributes
    ----------
    instruments : tuple of str
        Names, or kinds, of the instruments that it touches.
    start, end : float
        When it acts [s]; by default the whole run.
    intervals : tuple of (float, float)
        Instead of start and end: several intervals [s].
    mean_active, mean_gap : float
        Random intervals within start and end: the mean of their exponentially distributed lengths and of the gaps
        between them [s].
    name : str
        Of the fault's random streams; by default its kind and instruments.
    stems : tuple of str
        Stems of the fields that exist per quantity.
    effect : Effect
        What it does to a measurement; estimators that are told of the faults (oracles) go by it.
    """

    stems: ClassVar[tuple[str, ...]] = ()
    effect: ClassVar[Effect] = "other"

    kind: str
    instruments: Names
    start: NonNegative = quantity("s", 0.0)
    end: Positive = quantity("s", inf)
    intervals: _Intervals = quantity("s", ())
    mean_active: Positive | None = quantity("s", None)
    mean_gap: Positive | None = quantity("s", None)
    name: str = ""

    @classmethod
    def toml_keys(cls) -> dict[str, tuple[str, FieldInfo]]:
        """As `Spec.toml_keys`; the unit tells the quantity, so ``offset_position`` is ``offset_m``."""
        keys = {}
        for name, info in cls.model_fields.items():
            stem, _, last = name.rpartition("_")
            unit = unit_of(info)
            base = stem if last in _QUANTITIES and stem in cls.stems else name
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

    @property
    def bits(self) -> int:
        """How many bits, and labels, the fault takes."""
        return max(1, len(self.intervals))

    @property
    def sizes_required(self) -> bool:
        """Whether every instrument needs its size."""
        return True

    def sizes(self, stem: str) -> dict[str, Any]:
        """The fields of a stem, by name."""
        return {f"{stem}_{q}": getattr(self, f"{stem}_{q}") for q in _QUANTITIES}

    def size(self, stem: str, kind: str) -> Array:
        """The (d,) sizes of a stem for the components of a kind of instrument (after `check`)."""
        size = size_by_component(self.sizes(stem), stem, kind)
        assert size is not None
        return size

    def key_of(self, field: str) -> str:
        """The TOML key of a field."""
        return next(key for key, (name, _) in self.toml_keys().items() if name == field)

    def touched(self, instruments: Mapping[str, str]) -> tuple[str, ...]:
        """Names of the instruments that it touches, of a mapping from name to kind."""
        return tuple(n for n, k in instruments.items() if n in self.instruments or k in self.instruments)

    def check(self, instruments: Mapping[str, str], *, imu: bool = True) -> None:
        """Check that the fault fits the instruments of a scenario.

        Parameters
        ----------
        instruments : mapping
            Name to kind.
        imu : bool
            Whether there is an IMU.

        Raises
        ------
        SpecError
            On an instrument that is not there, or a size in a unit that does not fit one.
        """
        for name in self.instruments:
            if name == "imu":
                raise SpecError(f"fault {self.kind!r}: on the IMU there is 'imu_disturbance' only")
            if name not in instruments and name not in instruments.values():
                valid = sorted({*instruments, *instruments.values()})
                raise SpecError(f"fault {self.kind!r}: there is no instrument {name!r}{closest(name, valid)}")
        names = self.touched(instruments)
        for stem in self.stems:
            self._check_units(stem, {n: instruments[n] for n in names})
            for n in names:
                self._check_axes(stem, n, instruments[n])

    def _check_units(self, stem: str, touched: Mapping[str, str]) -> None:
        needed = {q: name for name, kind in touched.items() for q in _axes(kind)}
        if "" in needed and self.sizes_required:
            name = needed[""]
            unit = next(c.error_unit for c in KINDS[touched[name]].components if c.error_unit not in _QUANTITY_OF)
            raise SpecError(f"fault {self.kind!r} on {name!r} ({touched[name]}): there is no {stem} in {unit}")
        needed.pop("", None)
        given = {q for q in _QUANTITIES if getattr(self, f"{stem}_{q}") is not None}
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
        for q, axes in _axes(kind).items():
            size, d = getattr(self, f"{stem}_{q}", None), len(axes)
            if isinstance(size, tuple) and len(size) != d:
                key = self.key_of(f"{stem}_{q}")
                takes = f"{d}, or one" if d > 1 else "one"
                raise SpecError(
                    f"fault {self.kind!r} on {name!r} ({kind}): {key!r} has {len(size)} numbers; it takes {takes}"
                )

    def label(self, duration: float, instruments: Mapping[str, str]) -> list[FaultLabel]:
        """The truth about the fault: one label per bit.

        Parameters
        ----------
        duration : float
            Length of the run [s]; labels are cut off there.
        instruments : mapping
            Name to kind.
        """
        names = self.touched(instruments)
        intervals = self.intervals or ((self.start, self.end),)
        when = {"kind", "instruments", "start", "end", "intervals", "mean_active", "mean_gap", "name"}
        parameters = self.model_dump(exclude=when, exclude_none=True)
        return [FaultLabel(self.kind, names, min(a, duration), min(b, duration), parameters) for a, b in intervals]

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """The fault of one run.

        Parameters
        ----------
        index : int
            Its first bit.
        seed : int
            Seed of the run.
        occurrence : int, optional
            Tells faults of the same name apart (`build_layers` counts them); by default the index.
        """
        raise NotImplementedError

    @property
    def stream_name(self) -> str:
        """What the fault's random streams are named after, besides its occurrence."""
        return self.name or f"{self.kind}:{','.join(self.instruments)}"

    def key_of_streams(self, index: int, occurrence: int | None) -> str:
        """The key of the random streams of one run's layer, from what `build` is given."""
        return f"{self.stream_name}#{index if occurrence is None else occurrence}"


FAULTS: Registry[type[FaultSpec]] = Registry("fault", "simnav.faults", "simnav.sensors")

F = TypeVar("F", bound=FaultSpec)


def register_fault(cls: type[F]) -> type[F]:
    """Class decorator: make a kind of fault known, by the default of the field ``kind`` of its specification.

    Raises
    ------
    PluginError
        If the class is no `FaultSpec`, or its name is taken.
    """
    if not (isinstance(cls, type) and issubclass(cls, FaultSpec)):
        raise PluginError(f"@register_fault: {cls!r} is not a subclass of simnav.sensors.faults.FaultSpec")
    name = cls.model_fields["kind"].default
    if not isinstance(name, str):
        raise PluginError(f"{cls.__qualname__}: declare its kind, like kind: Literal['my_fault'] = 'my_fault'")
    for stem in cls.stems:
        for q in _QUANTITIES:
            if f"{stem}_{q}" not in cls.model_fields:
                raise PluginError(f"fault {name!r}: a stem needs a field for every quantity; there is no {stem}_{q}")
    FAULTS.add(name, cls)
    return cls


def effect_of(kind: str) -> Effect:
    """What a kind of fault does to a measurement; "other" if it is not known."""
    cls = FAULTS.get(kind)
    return "other" if cls is None else cls.effect


class Activity:
    """When a fault acts.

    Parameters
    ----------
    spec : FaultSpec
        The fault, with its intervals or how they are drawn.
    rng : numpy.random.Generator
        For random intervals.
    """

    def __init__(self, spec: FaultSpec, rng: np.random.Generator):
        self.spec, self._rng = spec, rng
        self._random = spec.mean_active is not None
        intervals = spec.intervals or (() if self._random else ((spec.start, spec.end),))
        self.starts = np.array([a for a, _ in intervals])
        self.ends = np.array([b for _, b in intervals])

    def _extend(self, until: float) -> None:
        spec = self.spec
        assert spec.mean_active is not None
        assert spec.mean_gap is not None
        end = float(self.ends[-1]) if len(self.ends) else spec.start
        starts, ends = [], []
        while end < min(until + 1.0, spec.end):
            start = end + self._rng.exponential(spec.mean_gap)
            end = min(start + self._rng.exponential(spec.mean_active), spec.end)
            if start >= spec.end:
                start = end = spec.end
            starts.append(start)
            ends.append(end)
        self.starts, self.ends = np.append(self.starts, starts), np.append(self.ends, ends)

    def locate(self, time: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
        """Which of the n times lie in an interval.

        Parameters
        ----------
        time : (n,) array
            Ascending [s].

        Returns
        -------
        rows, interval : (m,) int array
            The times that do, and the number of the interval of each; None for none.
        """
        if len(time) == 0:
            return None
        if self._random:
            self._extend(float(time[-1]))
        if len(self.starts) == 0 or time[-1] < self.starts[0] - TOLERANCE or time[0] >= self.ends[-1] - TOLERANCE:
            return None
        number = np.searchsorted(self.starts - TOLERANCE, time, side="right") - 1
        rows = np.flatnonzero((number >= 0) & (time < (self.ends - TOLERANCE)[number]))
        return (rows, number[rows]) if len(rows) else None


#: What a layer does to a measurement, as far as it is known from the times alone (`FaultLayer.ahead`): it adds an
#: error; adds noise up to a new sigma; takes it away; repeats an earlier one; says zero; disturbs the IMU.
ADDS, STEPS_NOISE, DROPS, HOLDS, ZEROES, DISTURBS_IMU = range(6)


class FaultLayer:
    """A fault in one run, laid over the streams of its instruments block by block.

    Parameters
    ----------
    spec : FaultSpec
        What the scenario says of the fault.
    index : int
        First bit of the fault in the labels of measurements.
    seed : int
        Seed of the run.
    key : str
        Name of its random streams.

    Attributes
    ----------
    spec : FaultSpec
        What the scenario says of the fault.
    activity : Activity
        When it acts.
    """

    #: One of `ADDS`, ..., for runs that go step by step (`simnav.simulation.steps`); None: `apply` alone knows what it
    #: does.
    operation: ClassVar[int | None] = None

    def __init__(self, spec: FaultSpec, index: int, seed: int, key: str):
        self.spec, self._index, self._seed, self._key = spec, index, seed, key
        self._generators: dict[tuple[str, ...], np.random.Generator] = {}
        self.activity = Activity(spec, self.rng("intervals"))

    def rng(self, *names: str) -> np.random.Generator:
        """A random stream of this fault's own, the same generator for the same names: "gnss", "noise"."""
        if names not in self._generators:
            self._generators[names] = random_stream(self._seed, "fault", self._key, *names)
        return self._generators[names]

    def touches(self, stream: AidStream) -> bool:
        """Whether the fault is one of this instrument's."""
        return self.touches_kind(stream.name, stream.kind)

    def touches_kind(self, name: str, kind: str) -> bool:
        """Whether the fault is one of the instrument of this name and kind."""
        return name in self.spec.instruments or kind in self.spec.instruments

    def bits(self, interval: NDArray[np.intp]) -> NDArray[np.uint32]:
        """The label of measurements in intervals of the given numbers."""
        number = interval if self.spec.intervals else np.zeros_like(interval)
        return np.left_shift(np.uint32(1), (self._index + number).astype(np.uint32))

    @property
    def index(self) -> int:
        """First bit of the fault in the labels of measurements."""
        return self._index

    def ahead(self, name: str, kind: str, time: Array) -> tuple[NDArray[np.int64], Array]:
        """What `apply` finds and draws for the next n samples of an instrument, delivered or not.

        Parameters
        ----------
        name, kind : str
            Of one of its instruments.
        time : (n,) array
            Sample times [s].

        Returns
        -------
        interval : (n,) int array
            Number of the interval that each sample lies in; -1 for none.
        error : (n, d) array
            What is drawn for it; zero where there is nothing to draw.
        """
        interval, error = np.full(len(time), -1, np.int64), np.zeros((len(time), len(KINDS[kind].components)))
        found = self.activity.locate(time)
        if found is not None:
            interval[found[0]] = found[1]
        return interval, error

    def ahead_imu(self, time: Array) -> tuple[NDArray[np.bool_], Array]:
        """Likewise of the IMU: the n samples that are disturbed, and the (n, 6) errors of rate and force."""
        raise NotImplementedError(f"{type(self).__name__} does not disturb an IMU")

    def apply(self, stream: AidStream) -> AidStream:
        """Lay the fault over the next block of a stream.

        Parameters
        ----------
        stream : AidStream
            Measurements of one of the fault's instruments, with what earlier faults did to them.

        Returns
        -------
        AidStream
            The same one where the fault does nothing to it; the argument is never changed.
        """
        return stream

    def apply_imu(self, samples: ImuSamples, labels: ImuLabels | None) -> tuple[ImuSamples, ImuLabels | None]:
        """Lay the fault over the next block of IMU samples.

        Parameters
        ----------
        samples : ImuSamples
            Samples, with what earlier faults did to them.
        labels : ImuLabels or None
            Labels of these samples; None where no fault of the scenario touches the IMU.

        Returns
        -------
        samples, labels
            As given where the fault is none of the IMU's.
        """
        return samples, labels
