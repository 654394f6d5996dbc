"""The common part of the error processes of instruments: specification, units, registration.

The error of an instrument is the sum of its own figures (``sigma``, ``bias``, ...) and of the processes in its tables
``[[instruments.NAME.error]]``. Each process is a random process times factors that depend on the motion
(`simnav.sensors.error_processes.factors`). Its size is in the unit of the instrument's error: ``sigma_m``,
``sigma_m_s``, ``sigma_deg``.

`register_error_process` registers a kind of process, of simnav or of a third party.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import isinf
from typing import Annotated, Any, ClassVar, Literal, Protocol, Self, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator
from pydantic.fields import FieldInfo

from simnav.blocks import StateBlock
from simnav.declared_process import DeclaredProcess, Factor
from simnav.kinds import Kind
from simnav.plugins import PluginError, Registry, registered_kind
from simnav.sensors.error_processes.factors import FACTORS, named_factors
from simnav.spec import UNITS, NonNegative, Spec, SpecError, closest, toml_number
from simnav.types import Array

__all__ = [
    "ERROR_PROCESSES",
    "Act",
    "ErrorProcessSpec",
    "Figure",
    "Mask",
    "Sampled",
    "figure",
    "register_error_process",
]

Mask: TypeAlias = NDArray[np.bool_]

#: What a process does: it adds a coloured or a white error, rounds readings, or loses some of them.
Act = Literal["coloured", "white", "rounds", "loses"]

#: Units of the same quantity.
_TOGETHER = (("m", "mm", "cm", "km"), ("m_s", "mm_s", "cm_s", "kn"), ("deg", "arcsec", "mrad"))
#: Units of a size in proportion to its factor.
_SHARES = ("percent", "ppm")
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def _listed(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


#: One number for all components, or one for each.
Figure = Annotated[NonNegative | tuple[NonNegative, ...], BeforeValidator(_listed)]


def figure(description: str) -> Any:
    """Declare a field in the unit of the instrument's error: ``sigma`` is ``sigma_m`` or ``sigma_deg`` in TOML."""
    return Field(json_schema_extra={"own_unit": True}, description=description)


class Sampled(Protocol):
    """A random process in one run, for the d components of an instrument."""

    def sample(self, time: Array) -> Array:
        """The (n, d) values at the n ascending times of the next block [s]."""
        ...


class ErrorProcessSpec(Spec):
    """Base class of error processes: one table ``[[instruments.NAME.error]]``.

    Attributes
    ----------
    act : Act
        What the process does.
    name : str
        Name of the process within its instrument, in snake_case; its random stream is named after it. By default its
        kind, with a number if there are several.
    components : tuple of str
        The components of the error that the process affects, like ``["north", "east"]``; by default all.
    proportional_to : mapping of str to float
        Factors, each with the value at which it is 1. In TOML their keys have units: ``{ speed_m_s = 5.0 }``.
    stated : bool
        Whether the datasheet has the process. False: estimators do not know it, and only oracles do.
    unit : str
        Unit of the sizes, a key of `simnav.spec.UNITS`. In TOML it is the end of their keys.
    """

    act: ClassVar[Act] = "coloured"

    kind: str
    name: str = ""
    components: Annotated[tuple[str, ...], BeforeValidator(_listed)] = ()
    proportional_to: dict[str, float] = Field(default_factory=dict)
    stated: bool = True
    unit: str = ""

    # ------------------------------------------------------------------------------------------- TOML

    @classmethod
    def figures(cls) -> list[str]:
        """The fields whose unit is that of the instrument."""
        return [name for name, info in cls.model_fields.items() if _own_unit(info)]

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], *, source: str = "<toml>", path: str = "") -> Self:
        """See `Spec.from_toml`; the unit of the sizes is the end of their keys."""
        where = f"{path}." if path else ""
        plain, units = dict(table), {}
        for key in table:
            field, unit = cls._figure_of(key)
            if field:
                plain[field] = _in_si(plain.pop(key), UNITS[unit], f"{source}: {where}{key}")
                units[key] = unit
        for key in ("unit", *cls.figures()):
            if key in table:
                raise SpecError(
                    f"{source}: {where}{key} = {table[key]!r}: the unit is the end of the key of the size, like "
                    f"{(cls.figures() or ['sigma'])[0]}_m or {(cls.figures() or ['sigma'])[0]}_deg"
                )
        if len(set(units.values())) > 1:
            raise SpecError(f"{source}: {where}{' and '.join(units)} should have the same unit")
        for field in cls.figures():
            if field not in plain and cls.model_fields[field].is_required():
                raise SpecError(
                    f"{source}: required key '{where}{field}_…' is missing; it ends in the unit of the instrument's "
                    f"error: {field}_m, {field}_m_s or {field}_deg"
                )
        if units:
            plain["unit"] = next(iter(units.values()))
        if "proportional_to" in table:
            plain["proportional_to"] = _factors_in_si(table["proportional_to"], f"{source}: {where}proportional_to")
        return super().from_toml(plain, source=source, path=path)

    @classmethod
    def _figure_of(cls, key: str) -> tuple[str, str]:
        """The field and the unit of a key of a size; empty for another key."""
        for field in cls.figures():
            unit = key.removeprefix(f"{field}_")
            if unit != key and unit in UNITS:
                return field, unit
        return "", ""

    def to_toml(self) -> dict[str, Any]:
        """See `Spec.to_toml`."""
        table = super().to_toml()
        table.pop("unit", None)
        for field in self.figures():
            if field in table:
                value = table.pop(field)
                inside = value if isinstance(value, list) else [value]
                numbers = [toml_number(v, self.unit) for v in inside]
                table[f"{field}_{self.unit}"] = numbers if isinstance(value, list) else numbers[0]
        if self.proportional_to:
            table["proportional_to"] = {
                f"{name}_{unit}" if (unit := _unit(name)) else name: toml_number(value, unit) if unit else value
                for name, value in self.proportional_to.items()
            }
        else:
            table.pop("proportional_to", None)
        return table

    # ------------------------------------------------------------------------------------------- checks

    @model_validator(mode="after")
    def _proper(self) -> Self:
        if self.name and not _NAME.fullmatch(self.name):
            raise ValueError(f"name = {self.name!r} should be in snake_case, like 'slow_part'")
        for name, reference in self.proportional_to.items():
            if name not in FACTORS or FACTORS[name].parameters:
                raise ValueError(f"proportional_to: there is no factor {name!r}{closest(name, list(named_factors()))}")
            if reference == 0.0 or isinf(reference):
                raise ValueError(f"proportional_to.{name} = {reference:g} should not be 0, and finite")
        if self.figures() and self.unit not in UNITS:
            raise ValueError(f"unit = {self.unit!r} should be one of: {', '.join(UNITS)}")
        if self.unit in _SHARES and len(self._dimensional()) != 1:
            raise ValueError(
                f"a size in {self.unit} needs one factor with a unit in proportional_to, like "
                f"{{ speed_m_s = 5.0 }}; there are {len(self._dimensional())}"
            )
        return self

    def _dimensional(self) -> list[str]:
        return [name for name in self.proportional_to if FACTORS[name].units]

    def check(self, kind: Kind) -> None:
        """Check that the process fits a kind of instrument.

        Raises
        ------
        ValueError
            One sentence that names the key, its value, and what would be right.
        """
        for component in self.components:
            if component not in kind.errors:
                raise ValueError(
                    f"components: the error has no component {component!r}{closest(component, list(kind.errors))}"
                )
        places = self._places(kind)
        for field in self.figures():
            value = getattr(self, field)
            if isinstance(value, tuple) and len(value) != len(places):
                raise ValueError(
                    f"{field}_{self.unit} has {len(value)} numbers; it takes one, or {len(places)}: one for each of "
                    f"{', '.join(kind.errors[k] for k in places)}"
                )
        if not self.figures():
            return
        unit = _unit(self._dimensional()[0]) if self.unit in _SHARES else self.unit
        for k in places:
            right = kind.components[k].error_unit
            if unit != right and not any(unit in group and right in group for group in _TOGETHER):
                if self.unit in _SHARES:
                    raise ValueError(
                        f"a size in {self.unit} of {self._dimensional()[0]} is in {unit}; the error of "
                        f"{kind.errors[k]!r} is in {right}"
                    )
                raise ValueError(
                    f"{self.figures()[0]}_{self.unit}: the error of {kind.errors[k]!r} is in {right}; give "
                    f"{self.figures()[0]}_{right}, or name the components that are in {self.unit} by components"
                )

    def _places(self, kind: Kind) -> list[int]:
        return [k for k, name in enumerate(kind.errors) if not self.components or name in self.components]

    # ------------------------------------------------------------------------------------------- a run

    def sizes(self, field: str, kind: Kind) -> Array:
        """The (d,) size of a field for the components of a kind, SI units; 0 for components that are not affected."""
        size, places = np.zeros(len(kind.errors)), self._places(kind)
        size[places] = getattr(self, field)
        if self.unit in _SHARES:
            size *= abs(self.proportional_to[self._dimensional()[0]])
        return size

    def factors(self) -> tuple[Factor, ...]:
        """What the process is multiplied with."""
        return tuple(Factor(name, reference) for name, reference in self.proportional_to.items())

    def scaled(self, factor: float) -> Self:
        """The process with its sizes multiplied by a factor."""
        changes = {}
        for field in self.figures():
            value = getattr(self, field)
            changes[field] = tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
        return self.model_copy(update=changes)

    def sampled(self, kind: Kind, rng: np.random.Generator) -> Sampled | None:
        """The random process of one run; None if it adds nothing.

        Parameters
        ----------
        kind : Kind
            Properties of the instrument.
        rng : numpy.random.Generator
            Random stream of this process only.
        """
        raise NotImplementedError(f"{type(self).__qualname__} has no sampled()")

    def white(self, kind: Kind) -> Array:
        """The (d,) standard deviation of its white noise, with all factors equal to 1."""
        return np.zeros(len(kind.errors))

    def block(self, name: str, kind: Kind) -> StateBlock | None:
        """The first-order form of a coloured process; None for other processes."""
        return None

    def declared(self, name: str, kind: Kind) -> DeclaredProcess | None:
        """What a datasheet says of a coloured process; None for other processes."""
        block = self.block(name, kind)
        return None if block is None else DeclaredProcess(block, factors=self.factors())

    def rounded(self, value: Array, kind: Kind) -> Array:
        """The (n, d) readings as the instrument delivers them."""
        return value

    def lost(self, time: Array, factor: Array, rng: np.random.Generator, state: dict[str, float]) -> Mask:
        """An (n,) mask of the readings that are lost.

        Parameters
        ----------
        time : (n,) array
            Times of the next block [s].
        factor : (n,) array
            The product of the factors.
        rng : numpy.random.Generator
            Random stream of this process.
        state : dict
            What it keeps from block to block.
        """
        return np.zeros(len(time), dtype=np.bool_)


def in_units(kind: Kind) -> tuple[str, ...]:
    """The unit of each component of the error."""
    return tuple(component.error_unit for component in kind.components)


ERROR_PROCESSES: Registry[type[ErrorProcessSpec]] = Registry(
    "error process", "simnav.error_processes", "simnav.sensors"
)

P = TypeVar("P", bound=ErrorProcessSpec)


def register_error_process(cls: type[P]) -> type[P]:
    """Register a kind of error process (class decorator). Its name is the default of the field ``kind``.

    Raises
    ------
    PluginError
        If the class is not a subclass of `ErrorProcessSpec`, or another class has its name.
    """
    name = registered_kind(
        cls, ErrorProcessSpec, decorator="register_error_process", sort="error process", example="my_process"
    )
    if cls.act not in ("coloured", "white", "rounds", "loses"):
        raise PluginError(f"error process {name!r}: act = {cls.act!r} should be coloured, white, rounds or loses")
    ERROR_PROCESSES.add(name, cls)
    return cls


def _own_unit(info: FieldInfo) -> bool:
    extra = info.json_schema_extra
    return isinstance(extra, dict) and bool(extra.get("own_unit"))


def _unit(factor: str) -> str:
    """The first unit of a factor; empty for a pure number."""
    units: Sequence[str] = FACTORS[factor].units
    return units[0] if units else ""


def _in_si(raw: Any, factor: float, where: str) -> Any:
    if isinstance(raw, (list, tuple)):
        return [_in_si(value, factor, where) for value in raw]
    if isinstance(raw, bool) or not isinstance(raw, (int, float)):
        raise SpecError(f"{where} = {raw!r} should be a number")
    if not abs(raw) < 1e12:
        raise SpecError(f"{where} = {raw!r} should be a finite number")
    return float(raw) * factor


def _factors_in_si(table: Any, where: str) -> dict[str, float]:
    if not isinstance(table, Mapping):
        raise SpecError(f"{where} = {table!r} should be a table of factors, like {{ speed_m_s = 5.0 }}")
    keys, found = named_factors(), {}
    for key, raw in table.items():
        if key not in keys:
            raise SpecError(f"{where}: there is no factor {key!r}{closest(str(key), list(keys))}")
        name, unit = keys[key]
        found[name] = _in_si(raw, UNITS[unit] if unit else 1.0, f"{where}.{key}")
    return found
