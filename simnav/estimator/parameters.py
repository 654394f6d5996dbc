"""The parameters of an estimator's constructor, and how the text of a command line becomes one of their values."""

from __future__ import annotations

import ast
import inspect
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from simnav.estimator.contract import Estimator, EstimatorError

__all__ = [
    "Parameter",
    "constructors_of",
    "converted",
    "former_names",
    "open_ended",
    "parameters_of",
    "under_present_names",
]


@dataclass(frozen=True)
class Parameter:
    """One parameter of an estimator's constructor.

    Attributes
    ----------
    name : str
        Name of the keyword argument.
    default : object
        `inspect.Parameter.empty` where it has none.
    annotation : str
        As written; empty where there is none.
    """

    name: str
    default: Any
    annotation: str

    @property
    def required(self) -> bool:
        """True if it has no default."""
        return self.default is inspect.Parameter.empty


def parameters_of(cls: type[Estimator]) -> list[inspect.Parameter]:
    """Of its constructor; where that takes ``**``, also those of its bases' that can be given by name only."""
    found: dict[str, inspect.Parameter] = {}
    kinds = [inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD]
    for constructor in constructors_of(cls):
        own = list(inspect.signature(constructor).parameters.values())[1:]
        found |= {p.name: p for p in own if p.kind in kinds and p.name not in found}
        kinds = kinds[:1]
    return list(found.values())


def former_names(cls: type[Estimator]) -> Mapping[str, str]:
    """Former names of parameters that are still read, and the present ones.

    What a class inherits of `Estimator.formerly` counts only where it has the parameter, and no other of the old name.
    """
    if not cls.formerly:
        return {}
    known = {p.name for p in parameters_of(cls)}
    return {old: new for old, new in cls.formerly.items() if new in known and old not in known}


def under_present_names(names: Mapping[str, str], parameters: Mapping[str, Any], what: str) -> dict[str, Any]:
    """Parameters with present names in place of former ones.

    Parameters
    ----------
    names : mapping of str to str
        As of `former_names`.
    parameters : mapping
        Values by name.
    what : str
        Whose parameters they are, for the message.

    Raises
    ------
    EstimatorError
        If a parameter is given under both names.

    Examples
    --------
    >>> under_present_names({"window": "innovations"}, {"window": 30, "scope": "all"}, "iae-fixed")
    {'innovations': 30, 'scope': 'all'}
    """
    for old in parameters:
        if names.get(old) in parameters:
            raise EstimatorError(f"{what}: {old!r} is the former name of {names[old]!r}; give one of them, not both")
    return {names.get(name, name): value for name, value in parameters.items()}


def constructors_of(cls: type[Estimator]) -> list[Callable[..., Any]]:
    """Its constructor, and that of the next base that has one for as long as it takes ``**``."""
    found = []
    for base in cls.__mro__[:-1]:
        if "__init__" in vars(base):
            found.append(vars(base)["__init__"])
            if not open_ended(found[-1]):
                break
    return found


def open_ended(constructor: Callable[..., Any]) -> bool:
    return any(p.kind is p.VAR_KEYWORD for p in inspect.signature(constructor).parameters.values())


_TRUE, _FALSE, _NONE = ("true", "yes", "on", "1"), ("false", "no", "off", "0"), ("none", "null", "")


def converted(value: Any, hint: Any, default: Any, what: str) -> Any:
    """Convert a parameter's value to the type of its annotation, or else of its default."""
    if isinstance(value, (float, np.floating)):
        return _whole(value, hint, default, what)
    if not isinstance(value, str):
        return value
    if hint is None or hint is Any:
        if default is None or default is inspect.Parameter.empty:
            try:
                return ast.literal_eval(value)
            except (ValueError, SyntaxError):
                return value
        hint = type(default)
    return _as(value, hint, default, what)


def _whole(value: Any, hint: Any, default: Any, what: str) -> Any:
    """A number as a whole one, where that is meant; EstimatorError if it is none."""
    kinds = typing.get_args(hint) or (type(default) if hint is None or hint is Any else hint,)
    if int not in kinds or float in kinds:
        return value
    if not value.is_integer():
        raise EstimatorError(f"{what} is a whole number, not {value:g}")
    return int(value)


def _as(text: str, hint: Any, default: Any, what: str) -> Any:
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        if type(None) in inside and text.lower() in _NONE:
            return None
        for i, option in enumerate(options := [a for a in inside if a is not type(None)]):
            try:
                return _as(text, option, default, what)
            except EstimatorError:
                if i == len(options) - 1:
                    raise
    if origin is typing.Literal:
        for choice in inside:
            if text == str(choice):
                return choice
        raise EstimatorError(f"{what} is one of {', '.join(map(str, inside))}, not {text!r}")
    if hint in (tuple, list) or origin in (tuple, list, Sequence):
        element = inside[0] if inside else (type(default[0]) if default else float)
        items = [_as(part.strip(), element, None, what) for part in text.strip("()[] ").split(",") if part.strip()]
        return items if hint is list or origin is list else tuple(items)
    if hint is bool:
        if text.lower() in _TRUE + _FALSE:
            return text.lower() in _TRUE
        raise EstimatorError(f"{what} is true or false, not {text!r}")
    if hint in (int, float):
        try:
            return hint(text)
        except ValueError:
            kind = "a whole number" if hint is int else "a number"
            raise EstimatorError(f"{what} is {kind}, not {text!r}") from None
    return text
