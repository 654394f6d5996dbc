"""Declarative specifications: SI in memory, usual units in TOML, errors that name the key.

A `Spec` is a frozen pydantic model whose fields hold SI units. A field declared with a `unit` is
written in TOML under its name with the unit as suffix, so that the unit is always clear::

    class Gyroscope(Spec):
        random_walk: NonNegative = quantity("deg_sqrt_h", 0.0)     # rad/sqrt(s) in memory

    Gyroscope.from_toml({"random_walk_deg_sqrt_h": 0.01}, source="my.toml")

So one definition gives the schema, its validation, its documentation and the values of the simulation.
`Spec.to_toml` is the inverse of `Spec.from_toml`. NaN is refused everywhere. Infinity is accepted for times, and for
fields whose default is infinite.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticUndefined, core_schema

__all__ = [
    "UNITS",
    "NonNegative",
    "OneOf",
    "Positive",
    "Spec",
    "SpecError",
    "Vector",
    "closest",
    "entries",
    "hidden_attribute",
    "quantity",
    "register_unit",
    "spec_types",
    "toml_number",
    "unit_of",
    "without_later",
]

_DEG = math.pi / 180.0
_G = 9.80665  # standard gravity, for "micro-g"
_BEYOND = 1e12  # no unit needs larger numbers, and squares of very large numbers overflow

#: Factor from each unit at the end of a key to SI; `register_unit` adds one.
UNITS: dict[str, float] = {
    "s": 1.0,
    "min": 60.0,
    "h": 3600.0,
    "hz": 1.0,
    "m": 1.0,
    "mm": 0.001,
    "cm": 0.01,
    "km": 1000.0,
    "m_s": 1.0,
    "mm_s": 0.001,
    "cm_s": 0.01,
    "kn": 1852.0 / 3600.0,
    "m_s2": 1.0,
    "deg": _DEG,
    "deg_s": _DEG,
    "deg_min": _DEG / 60.0,
    "deg_h": _DEG / 3600.0,
    "deg_sqrt_h": _DEG / 60.0,
    "deg_h_sqrt_h": _DEG / 3600.0 / 60.0,
    "deg_h_sqrt_s": _DEG / 3600.0,
    "deg_sqrt_s": _DEG,
    "arcsec": _DEG / 3600.0,
    "ug": _G * 1e-6,
    "mg": _G * 1e-3,
    "g": _G,
    "ug_sqrt_hz": _G * 1e-6,
    "ug_sqrt_s": _G * 1e-6,
    "mg_sqrt_hz": _G * 1e-3,
    "mm_s2": 0.001,
    "mm_s_sqrt_h": 0.001 / 60.0,
    "ft_s_sqrt_h": 0.3048 / 60.0,
    "deg_s_sqrt_hz": _DEG,
    "mrad": 0.001,
    "k": 1.0,
    "deg_h_k": _DEG / 3600.0,
    "ug_k": _G * 1e-6,
    "deg_h_g": _DEG / 3600.0 / _G,
    "deg_s_g": _DEG / _G,
    "deg_h_g2": _DEG / 3600.0 / _G**2,
    "ug_g2": 1e-6 / _G,
    "m_s_sqrt_h": 1.0 / 60.0,
    "m_s_sqrt_s": 1.0,
    "m_sqrt_s": 1.0,
    "s2_m": 1.0,
    "ppm": 1e-6,
    "percent": 1e-2,
    "1_s": 1.0,
    "per_s": 1.0,
}

_UNIT_NAME = re.compile(r"[a-z0-9]+(_[a-z0-9]+)*")

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Vector = tuple[float, float, float]


class SpecError(ValueError):
    """A specification is not valid. The message names the file, the key, the value and what would be right."""


def register_unit(name: str, factor: float) -> None:
    """Make a unit known, for the keys of scenario files, the components of instruments and the columns of logs.

    Parameters
    ----------
    name : str
        As it ends a key, in lower case: "kpa", "m_s".
    factor : float
        Of one such unit in SI: 1000 for a kilopascal.

    Raises
    ------
    SpecError
        If the name cannot end a key, the factor is no positive number, or the unit is known with another factor.

    Examples
    --------
    >>> register_unit("fathom", 1.8288)
    >>> register_unit("m", 0.3048)
    Traceback (most recent call last):
    simnav.spec.SpecError: the unit 'm' is known: it is 1 in SI, not 0.3048
    """
    if not isinstance(name, str) or not _UNIT_NAME.fullmatch(name):
        raise SpecError(f"the name of a unit, {name!r}, should be in lower case, like 'kpa' or 'm_s'")
    if isinstance(factor, bool) or not isinstance(factor, (int, float)) or not 0.0 < factor < math.inf:
        raise SpecError(f"the factor of the unit {name!r}, {factor!r}, should be a number greater than 0")
    if UNITS.setdefault(name, float(factor)) != factor:
        raise SpecError(f"the unit {name!r} is known: it is {UNITS[name]:g} in SI, not {factor:g}")


def quantity(unit: str, default: Any = PydanticUndefined, *, also: Sequence[str] = (), **kwargs: Any) -> Any:
    """Declare a field that has the unit ``unit`` in TOML and the SI unit in memory.

    Parameters
    ----------
    unit : str
        Unit in TOML, a key of `UNITS`. It is also the end of the TOML key: ``rate_hz``.
    default : float or tuple, optional
        Default value in SI. A field without a default is required.
    also : sequence of str
        Further units in which the field is read, each with a key of its own: those of datasheets.
    **kwargs
        Arguments of `pydantic.Field` (``description``, ``gt``, ...). Bounds are in SI.
    """
    for name in (unit, *also):
        if name not in UNITS:
            raise SpecError(f"unknown unit {name!r}; register_unit adds one; there are: {', '.join(UNITS)}")
    extra: dict[str, Any] = {"unit": unit, "also": list(also)} if also else {"unit": unit}
    return Field(default, json_schema_extra=extra, **kwargs)


def entries(key: str, default: Any = PydanticUndefined, **kwargs: Any) -> Any:
    """Declare a field with a plural name whose TOML tables have the name ``key``: ``[[fault]]`` for ``faults``."""
    return Field(default, json_schema_extra={"key": key}, **kwargs)


def closest(name: str, valid: Sequence[str]) -> str:
    """The end of a message on an unknown name: ``"; did you mean 'x'?"``, or the list of valid names."""
    near = difflib.get_close_matches(name, valid, n=1, cutoff=0.6)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; valid here: {', '.join(sorted(valid))}" if valid else ""


def unit_of(info: FieldInfo) -> str | None:
    """The unit of a field in TOML; None if it has none."""
    extra = info.json_schema_extra
    return str(extra["unit"]) if isinstance(extra, dict) and "unit" in extra else None


def hidden_attribute(cls: type[BaseModel], base: type[BaseModel]) -> str | None:
    """A field of a class that has the name of something else in one of its bases, such as a method; None for none."""
    taken = (n for n in cls.model_fields if n not in base.model_fields)
    return next((n for n in taken if hasattr(base, n) or n in base.__class_vars__), None)


def _key(name: str, info: FieldInfo) -> str:
    extra = info.json_schema_extra
    unit = unit_of(info)
    if unit is not None:
        return f"{name}_{unit}"
    return str(extra["key"]) if isinstance(extra, dict) and "key" in extra else name


def toml_number(value: float, unit: str) -> float:
    """The shortest number that, read in ``unit``, is exactly ``value`` in SI.

    >>> toml_number(math.radians(0.1), "deg")
    0.1
    """
    factor = UNITS[unit]
    near = value / factor
    for candidate in (
        *(float(f"{near:.{digits}g}") for digits in range(6, 18)),
        math.nextafter(near, math.inf),
        math.nextafter(near, -math.inf),
    ):
        if candidate * factor == value:
            return candidate
    return near


def without_later(table: dict[str, Any], later: Mapping[str, Any]) -> dict[str, Any]:
    """A dumped specification without the fields that were added later and that have their default.

    Digests of scenarios count what is there: so a new field changes no digest of a scenario that does not use it.
    """
    return {k: v for k, v in table.items() if k not in later or v != later[k]}


class Spec(BaseModel):
    """Base class of all specifications. They are immutable, refuse unknown names, and are read by `from_toml`.

    In a union of Specs the field ``kind`` (a ``Literal`` with a default) decides the class.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=True, validate_default=True)

    @classmethod
    def toml_keys(cls) -> dict[str, tuple[str, FieldInfo]]:
        """A mapping from TOML key to (field name, field), in the order of declaration."""
        return {_key(name, info): (name, info) for name, info in cls.model_fields.items()}

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], *, source: str = "<toml>", path: str = "") -> Self:
        """Build a specification from a TOML table.

        Parameters
        ----------
        table : mapping
            Table as `tomllib` returns it.
        source, path : str
            Name of the file, and key of the table in it, for error messages.

        Raises
        ------
        SpecError
            If a key is unknown, missing or invalid. The message is one sentence with file, key and value.
        """
        if not isinstance(table, Mapping):
            raise SpecError(f"{source}: {path or 'the file'} = {table!r} should be a table")
        keys = _keys_of(cls)
        values: dict[str, Any] = {}
        for key, raw in table.items():
            where = f"{path}.{key}" if path else key
            if key not in keys:
                raise SpecError(f"{source}: unknown key '{where}' (value {raw!r}){_hint(key, cls.toml_keys())}")
            found = keys[key]
            if found.name in values:
                raise SpecError(f"{source}: '{where}' says the same as another key, in another unit; give one of them")
            if found.unit is not None:
                values[found.name] = _convert(raw, UNITS[found.unit], found.infinite, source, where)
            else:
                values[found.name] = _descend(raw, found, source, where)
        try:
            return cls(**values)
        except ValidationError as error:
            raise SpecError(_sentence(cls, error, table, source, path)) from None

    @classmethod
    def _keys_in_other_units(cls) -> dict[str, tuple[str, FieldInfo, str]]:
        """Keys of fields in their further units: name and description of the field, and the unit."""
        found: dict[str, tuple[str, FieldInfo, str]] = {}
        for name, info in cls.model_fields.items():
            extra = info.json_schema_extra
            also = extra.get("also", ()) if isinstance(extra, dict) else ()
            if isinstance(also, list):
                found |= {f"{name}_{unit}": (name, info, str(unit)) for unit in also}
        return found

    @classmethod
    def replaced(cls, table: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
        """A table of TOML keys, with the given keys in place of those of the same fields, in whatever unit."""
        said = set(cls.fields_of(given))
        fields = cls.fields_of(table)
        return {**{k: v for (k, v), name in zip(table.items(), fields, strict=True) if name not in said}, **given}

    @classmethod
    def fields_of(cls, keys: Iterable[str]) -> list[str]:
        """The field of each TOML key, in whatever unit; an unknown key stands for itself."""
        names = {key: name for key, (name, _) in cls.toml_keys().items()}
        names |= {key: name for key, (name, _, _) in cls._keys_in_other_units().items()}
        return [names.get(key, key) for key in keys]

    def to_toml(self) -> dict[str, Any]:
        """The TOML table from which `from_toml` makes an equal specification: the given fields, and the kind."""
        table = {}
        others = self._keys_in_other_units()
        for key, (name, info) in self.toml_keys().items():
            value = getattr(self, name)
            if value is not None and (name in self.model_fields_set or name == "kind"):
                unit = unit_of(info)
                table[key] = _plain(value, unit)
                if unit is None or not isinstance(value, float) or table[key] * UNITS[unit] == value:
                    continue
                for other, (field, _, another) in others.items():  # a unit in which no digit is lost
                    if field == name and _plain(value, another) * UNITS[another] == value:
                        del table[key]
                        table[other] = _plain(value, another)
                        break
        return table


def _plain(value: Any, unit: str | None) -> Any:
    if isinstance(value, Spec):
        return value.to_toml()
    if isinstance(value, (list, tuple)):
        return [_plain(v, unit) for v in value]
    if isinstance(value, Mapping):
        return {k: _plain(v, unit) for k, v in value.items()}
    return value if unit is None else toml_number(value, unit)


def _hint(key: str, keys: Mapping[str, tuple[str, FieldInfo]]) -> str:
    """The hint for an unknown key: the right unit for a known name, otherwise the most similar keys."""
    for valid, (name, info) in keys.items():
        unit = unit_of(info)
        if unit is not None and (key == name or (key.startswith(name + "_") and key[len(name) + 1 :] in UNITS)):
            return f"; it is given in {unit}: '{valid}'"
    for valid, (name, _) in keys.items():
        if key in (name, valid + "s"):
            return f"; did you mean {valid!r}?"
    return closest(key, list(keys))


def _may_be_infinite(info: FieldInfo) -> bool:
    """Whether infinity is accepted: for times (a correlation time, the end of a fault) and for infinite defaults."""
    defaults = info.default if isinstance(info.default, tuple) else (info.default,)
    return unit_of(info) in ("s", "min", "h") or any(isinstance(d, float) and math.isinf(d) for d in defaults)


def _convert(raw: Any, factor: float, infinite: bool, source: str, where: str) -> Any:
    if isinstance(raw, (list, tuple)):
        return tuple(_convert(r, factor, infinite, source, where) for r in raw)
    if isinstance(raw, bool) or not isinstance(raw, (int, float)):
        other = ", or a distribution like { uniform = [1, 2] }" if isinstance(raw, Mapping) else ""
        raise SpecError(f"{source}: {where} = {raw!r} should be a number{other}")
    if math.isnan(raw) or (math.isinf(raw) and not infinite):
        raise SpecError(f"{source}: {where} = {raw!r} should be a finite number")
    if _BEYOND <= abs(raw) < math.inf:
        raise SpecError(f"{source}: {where} = {raw!r} is beyond all measure")
    return float(raw) * factor


class OneOf:
    """Annotation of a field that holds a Spec of one of several classes; its ``kind`` decides the class.

    Unlike a union it is open: the list of classes is read each time that a value is validated::

        instruments: dict[str, Annotated[AidSpec, OneOf(instrument_specs)]]

    Parameters
    ----------
    classes : callable
        Function without arguments that returns the classes that are registered at this time.
    default : str, optional
        The ``kind`` of a table that has none.
    """

    def __init__(self, classes: Callable[[], Sequence[type[Spec]]], default: str | None = None):
        self.classes, self.default = classes, default

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """The pydantic schema: `validate` validates, and each value is serialised by its own class."""
        return core_schema.no_info_after_validator_function(self.validate, core_schema.any_schema())

    def validate(self, value: Any) -> Spec:
        """Return a Spec unchanged; convert a mapping (SI units) to the class that its ``kind`` names."""
        by_kind = {_kind(cls): cls for cls in self.classes()}
        if isinstance(value, Spec) and isinstance(value, tuple(by_kind.values())):
            return value
        kind = value.get("kind", self.default) if isinstance(value, Mapping) else None
        if kind in by_kind:
            return by_kind[kind].model_validate(value)
        valid = [k for k in by_kind if k is not None]
        if kind is None:
            raise ValueError(f"should be a specification, or a mapping with a kind that is one of: {', '.join(valid)}")
        raise ValueError(f"kind {kind!r} is unknown{closest(str(kind), valid)}")


def spec_types(annotation: Any) -> list[type[Spec]]:
    """The Spec classes inside an annotation, also inside unions, lists, dicts, Annotated and `OneOf`."""
    if typing.get_origin(annotation) is Annotated:
        for metadata in annotation.__metadata__:
            if isinstance(metadata, OneOf):
                return list(metadata.classes())
    if not typing.get_args(annotation):
        return [annotation] if isinstance(annotation, type) and issubclass(annotation, Spec) else []
    return [s for a in typing.get_args(annotation) for s in spec_types(a)]


def _one_of(annotation: Any) -> OneOf | None:
    """The `OneOf` inside an annotation."""
    for metadata in getattr(annotation, "__metadata__", ()):
        if isinstance(metadata, OneOf):
            return metadata
    return next(filter(None, map(_one_of, typing.get_args(annotation))), None)


def _containers(annotation: Any) -> set[Any]:
    """The outermost types that the annotation allows, without None."""
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        return _containers(typing.get_args(annotation)[0])
    if origin in (typing.Union, types.UnionType):
        return {c for a in typing.get_args(annotation) for c in _containers(a)}
    return {origin or annotation}


@dataclass(frozen=True, eq=False, slots=True)
class _Key:
    """What reading a key of a class needs. It is found once, since runs with drawn values read many tables."""

    name: str
    unit: str | None
    infinite: bool
    annotation: Any
    containers: set[Any]
    leaves: set[Any]
    specs: list[type[Spec]]  # without those of an open list, which may grow
    opened: OneOf | None

    @classmethod
    def of(cls, name: str, info: FieldInfo, unit: str | None) -> _Key:
        annotation = info.annotation
        opened = _one_of(annotation)
        containers, leaves = _containers(annotation), _leaves(annotation)
        specs = [] if opened else spec_types(annotation)
        return cls(name, unit, _may_be_infinite(info), annotation, containers, leaves, specs, opened)


@functools.cache
def _keys_of(cls: type[Spec]) -> dict[str, _Key]:
    """All keys of a class, also those in further units."""
    others = cls._keys_in_other_units()
    keys = {key: _Key.of(name, info, unit) for key, (name, info, unit) in others.items()}
    return keys | {key: _Key.of(name, info, unit_of(info)) for key, (name, info) in cls.toml_keys().items()}


def _descend(raw: Any, key: _Key, source: str, where: str) -> Any:
    top, opened = key.containers, key.opened
    specs = key.specs if opened is None else spec_types(key.annotation)
    if not specs and opened is None:
        _check_plain(raw, key.leaves, key.infinite, source, where)
        return raw
    if top & {list, tuple}:
        if not isinstance(raw, list):
            raise SpecError(f"{source}: {where} = {raw!r} should be an array of tables ([[{where}]])")
        return tuple(_one(item, specs, source, f"{where}[{i}]") for i, item in enumerate(raw))
    if dict in top:
        if not isinstance(raw, Mapping):
            raise SpecError(f"{source}: {where} = {raw!r} should be a table of tables ([{where}.name])")
        # Without the key "kind", the name of the table is its kind.
        read = _one if opened is None else _by_kind
        return {k: read(v, specs, source, f"{where}.{k}", k) for k, v in raw.items()}
    if opened is not None:
        return _by_kind(raw, specs, source, where, opened.default)
    return _one(raw, specs, source, where)


def _leaves(annotation: Any) -> set[Any]:
    """The types of the values that the annotation allows, also inside arrays and tables; of a table not its keys."""
    origin, inside = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Literal:
        return {type(value) for value in inside}
    if origin is Annotated:
        return _leaves(inside[0])
    if origin in (dict, Mapping):
        return _leaves(inside[1])
    return {leaf for part in inside for leaf in _leaves(part)} if inside else {annotation}


def _check_plain(raw: Any, leaves: set[Any], infinite: bool, source: str, where: str) -> None:
    """Refuse NaN, infinity, and text or truth values in the place of numbers, also inside arrays and tables."""
    if isinstance(raw, Mapping):
        for key, inner in raw.items():
            _check_plain(inner, leaves, infinite, source, f"{where}.{key}")
    elif isinstance(raw, (list, tuple)):
        for inner in raw:
            _check_plain(inner, leaves, infinite, source, where)
    elif isinstance(raw, float) and (math.isnan(raw) or (math.isinf(raw) and not infinite)):
        raise SpecError(f"{source}: {where} = {raw!r} should be a finite number")
    elif isinstance(raw, (str, bool)) and leaves & {int, float} and not leaves & {str, bool}:
        # pydantic would read the text "3" as a number, and true as 1.
        raise SpecError(f"{source}: {where} = {raw!r} should be a number")


@functools.cache
def _kind(spec: type[Spec]) -> str | None:
    """The ``kind`` of a class, which is a ``Literal`` with a default."""
    info = spec.model_fields.get("kind")
    return None if info is None or not isinstance(info.default, str) else info.default


def _one(raw: Any, specs: list[type[Spec]], source: str, where: str, default_kind: str | None = None) -> Spec:
    if len(specs) == 1:
        return specs[0].from_toml(raw, source=source, path=where)
    return _by_kind(raw, specs, source, where, default_kind)


def _by_kind(raw: Any, specs: list[type[Spec]], source: str, where: str, default_kind: str | None) -> Spec:
    """The specification of the class that the key ``kind`` of a table names."""
    if not isinstance(raw, Mapping):
        raise SpecError(f"{source}: {where} = {raw!r} should be a table")
    by_kind = {k: s for s in specs if (k := _kind(s)) is not None}
    kind = raw.get("kind", default_kind if default_kind in by_kind else None)
    if not isinstance(kind, (str, types.NoneType)):
        raise SpecError(f"{source}: {where}.kind = {kind!r} should be one of: {', '.join(by_kind)}")
    if kind is None:
        raise SpecError(f"{source}: {where} has no key 'kind'; one of: {', '.join(by_kind) or 'none is registered'}")
    if kind not in by_kind:
        raise SpecError(f"{source}: {where}.kind = {kind!r} is unknown{closest(str(kind), list(by_kind))}")
    return by_kind[kind].from_toml({**raw, "kind": kind}, source=source, path=where)


_BOUNDS = {
    "greater_than": ("gt", "should be greater than"),
    "greater_than_equal": ("ge", "should be at least"),
    "less_than": ("lt", "should be less than"),
    "less_than_equal": ("le", "should be at most"),
}


def _sentence(cls: type[Spec], error: ValidationError, table: Mapping[str, Any], source: str, path: str) -> str:
    """The first problem of a ValidationError, or all missing keys, with the names and units of the TOML file."""
    first = error.errors()[0]
    location, context = first["loc"], first.get("ctx", {})
    message = str(first["msg"]).removeprefix("Value error, ").removeprefix("Input ")
    if not location:
        return f"{source}: {path}: {message}" if path else f"{source}: {message}"
    keys = {name: (key, info) for key, (name, info) in cls.toml_keys().items()}
    key, info = keys.get(str(location[0]), (str(location[0]), None))
    where = f"{path}.{key}" if path else key
    if first["type"] == "missing" and len(location) == 1:
        absent = [str(e["loc"][0]) for e in error.errors() if e["type"] == "missing" and len(e["loc"]) == 1]
        named = [keys.get(name, (name, None))[0] for name in absent]
        *others, last = [f"'{path}.{name}'" if path else f"'{name}'" for name in named]
        if others:
            return f"{source}: required keys {', '.join(others)} and {last} are missing"
        return f"{source}: required key {last} is missing"
    if first["type"] in _BOUNDS:
        name, words = _BOUNDS[first["type"]]
        unit = unit_of(info) if info is not None else None
        bound = float(context[name]) if unit is None else toml_number(float(context[name]), unit)
        message = f"{words} {bound:.4g}" if abs(bound) < 1e4 else f"{words} {bound:g}"
    elif first["type"] == "literal_error" and info is not None:
        # In "expected" the values are quoted: 'a', 'b' or 'c'.
        valid = str(context["expected"]).replace("'", "").replace(" or ", ", ").split(", ")
        near = closest(str(first["input"]), valid)
        message += near if "did you mean" in near else ""
    elif first["type"] in ("missing", "too_long") and info is not None:
        message = f"should have {_length(info.annotation)} numbers"
    elif first["type"] == "tuple_type" and info is not None:
        length = _length(info.annotation)
        message = f"should be an array of {length} numbers" if length else "should be an array"
    message = message.replace("Tuple should", "should").replace(" items after validation", "")
    message = message.replace(" item after validation", "")
    return f"{source}: {where} = {table.get(key, first['input'])!r}: {message}"


def _length(annotation: Any) -> str:
    """The length of the tuple inside an annotation, as text."""
    parts = typing.get_args(annotation)
    if typing.get_origin(annotation) is tuple and Ellipsis not in parts:
        return str(len(parts))
    inside = (_length(a) for a in parts)
    return next((n for n in inside if n), "")
