"""Declarative specifications: SI in memory, usual units in TOML, errors that name the key.

A `Spec` is a frozen pydantic model whose fields hold SI units. A field declared with a `unit` is
written in TOML under its name with the unit as suffix, so that nobody has to guess::

    class Gyroscope(Spec):
        random_walk: NonNegative = quantity("deg_sqrt_h", 0.0)     # rad/sqrt(s) in memory

    Gyroscope.from_toml({"random_walk_deg_sqrt_h": 0.01}, source="my.toml")

One definition thus serves the schema, its validation, its documentation and the simulation.
"""

from __future__ import annotations

import difflib
import math
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

__all__ = [
    "UNITS",
    "NonNegative",
    "Positive",
    "Spec",
    "SpecError",
    "Vector",
    "closest",
    "quantity",
]

_DEG = math.pi / 180.0
_G = 9.80665  # standard gravity, for "micro-g"

#: Factor to SI of every unit that may end a key.
UNITS: Mapping[str, float] = {
    "s": 1.0,
    "min": 60.0,
    "h": 3600.0,
    "hz": 1.0,
    "m": 1.0,
    "cm": 0.01,
    "m_s": 1.0,
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
    "arcsec": _DEG / 3600.0,
    "ug": _G * 1e-6,
    "mg": _G * 1e-3,
    "g": _G,
    "ug_sqrt_hz": _G * 1e-6,
    "ug_sqrt_s": _G * 1e-6,
    "m_s_sqrt_h": 1.0 / 60.0,
    "m_s_sqrt_s": 1.0,
    "m_sqrt_s": 1.0,
    "ppm": 1e-6,
    "percent": 1e-2,
    "1_s": 1.0,
    "per_s": 1.0,
}

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Vector = tuple[float, float, float]


class SpecError(ValueError):
    """A specification that is not valid; the message names file, key, value and what is right."""


def quantity(unit: str, default: Any = PydanticUndefined, **kwargs: Any) -> Any:
    """Declare a field that TOML writes in ``unit`` (a key of `UNITS`) and memory holds in SI.

    Parameters
    ----------
    unit : str
    default : float or tuple, optional
        In SI; a field without one is required.
    **kwargs
        Passed on to `pydantic.Field` (``description``, ``gt``, ...; bounds are in SI).
    """
    if unit not in UNITS:
        raise KeyError(f"unknown unit {unit!r}; there are: {', '.join(UNITS)}")
    return Field(default, json_schema_extra={"unit": unit}, **kwargs)


def closest(name: str, valid: Sequence[str]) -> str:
    """``"; did you mean 'x'?"``, or the list of valid names where none is near."""
    near = difflib.get_close_matches(name, valid, n=1, cutoff=0.6)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; valid here: {', '.join(sorted(valid))}" if valid else ""


def unit_of(info: FieldInfo) -> str | None:
    """The TOML unit of a field, or None."""
    extra = info.json_schema_extra
    return str(extra["unit"]) if isinstance(extra, dict) and "unit" in extra else None


class Spec(BaseModel):
    """Base of all specifications: immutable, strict about names, read from TOML by `from_toml`.

    A union of Specs is discriminated by their ``kind`` field (a ``Literal`` with a default).
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=True, validate_default=True)

    @classmethod
    def toml_keys(cls) -> dict[str, tuple[str, FieldInfo]]:
        """TOML key -> (field name, field), in the order of declaration."""
        keys = {}
        for name, info in cls.model_fields.items():
            unit = unit_of(info)
            keys[name if unit is None else f"{name}_{unit}"] = (name, info)
        return keys

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], *, source: str = "<toml>", path: str = "") -> Self:
        """Build from a TOML table.

        Parameters
        ----------
        table : mapping
            As `tomllib` returns it.
        source, path : str
            File, and key of the table in it: for error messages.

        Raises
        ------
        SpecError
            On an unknown, missing or invalid key: one sentence with file, key and value.
        """
        if not isinstance(table, Mapping):
            raise SpecError(f"{source}: {path or 'the file'} = {table!r} should be a table")
        keys = cls.toml_keys()
        values: dict[str, Any] = {}
        for key, raw in table.items():
            where = f"{path}.{key}" if path else key
            if key not in keys:
                raise SpecError(f"{source}: unknown key '{where}' (value {raw!r}){_hint(key, keys)}")
            name, info = keys[key]
            unit = unit_of(info)
            values[name] = (
                _convert(raw, UNITS[unit], source, where)
                if unit is not None
                else _descend(raw, info.annotation, source, where)
            )
        try:
            return cls(**values)
        except ValidationError as error:
            raise SpecError(_sentence(cls, error, table, source, path)) from None


def _hint(key: str, keys: Mapping[str, tuple[str, FieldInfo]]) -> str:
    """A unit mix-up is told apart from a typing slip."""
    for valid, (name, info) in keys.items():
        unit = unit_of(info)
        if unit is not None and (key == name or (key.startswith(name + "_") and key[len(name) + 1 :] in UNITS)):
            return f"; it is given in {unit}: '{valid}'"
    return closest(key, list(keys))


def _convert(raw: Any, factor: float, source: str, where: str) -> Any:
    if isinstance(raw, bool) or not isinstance(raw, (int, float, list, tuple)):
        raise SpecError(f"{source}: {where} = {raw!r} should be a number")
    if isinstance(raw, (list, tuple)):
        return tuple(_convert(r, factor, source, where) for r in raw)
    return float(raw) * factor


def _spec_types(annotation: Any) -> list[type[Spec]]:
    """The Spec classes inside an annotation (unions, lists, dicts and Annotated are looked through)."""
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, Spec) else []
    return [s for a in typing.get_args(annotation) for s in _spec_types(a)]


def _descend(raw: Any, annotation: Any, source: str, where: str) -> Any:
    specs = _spec_types(annotation)
    if not specs:
        return raw
    origin = typing.get_origin(annotation)
    while origin is Annotated:
        annotation = typing.get_args(annotation)[0]
        origin = typing.get_origin(annotation)
    if origin in (list, tuple):
        if not isinstance(raw, list):
            raise SpecError(f"{source}: {where} = {raw!r} should be an array of tables ([[{where}]])")
        return tuple(_one(item, specs, source, f"{where}[{i}]") for i, item in enumerate(raw))
    if origin is dict:
        if not isinstance(raw, Mapping):
            raise SpecError(f"{source}: {where} = {raw!r} should be a table of tables ([{where}.name])")
        # A table that does not say its kind is of the kind that its name says.
        return {k: _one(v, specs, source, f"{where}.{k}", default_kind=k) for k, v in raw.items()}
    return _one(raw, specs, source, where)


def _kind(spec: type[Spec]) -> str | None:
    info = spec.model_fields.get("kind")
    return None if info is None else str(typing.get_args(info.annotation)[0])


def _one(raw: Any, specs: list[type[Spec]], source: str, where: str, default_kind: str | None = None) -> Spec:
    if len(specs) == 1:
        return specs[0].from_toml(raw, source=source, path=where)
    if not isinstance(raw, Mapping):
        raise SpecError(f"{source}: {where} = {raw!r} should be a table")
    by_kind = {k: s for s in specs if (k := _kind(s)) is not None}
    kind = raw.get("kind", default_kind)
    if kind is None:
        raise SpecError(f"{source}: {where} has no key 'kind'; one of: {', '.join(by_kind)}")
    if kind not in by_kind:
        raise SpecError(f"{source}: {where}.kind = {kind!r} is unknown{closest(str(kind), list(by_kind))}")
    return by_kind[kind].from_toml({**raw, "kind": kind}, source=source, path=where)


def _sentence(cls: type[Spec], error: ValidationError, table: Mapping[str, Any], source: str, path: str) -> str:
    """The first problem of a ValidationError, in the words of the TOML file."""
    first = error.errors()[0]
    names = {name: key for key, (name, _) in cls.toml_keys().items()}
    location = [str(part) for part in first["loc"]]
    key = names.get(location[0], location[0]) if location else ""
    where = ".".join(part for part in (path, key) if part)
    if first["type"] == "missing":
        return f"{source}: required key '{where}' is missing"
    message = str(first["msg"]).removeprefix("Value error, ").removeprefix("Input ")
    if not location:
        return f"{source}: {path or 'the file'}: {message}"
    return f"{source}: {where} = {table.get(key, first['input'])!r}: {message}"
