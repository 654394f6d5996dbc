"""A request is the one place that says what a command takes: names, types, defaults, and what each option means.

A request is a frozen dataclass (`request`) whose fields are declared with `option`. The Python call (`call`) and the
command line (`simnav.leaderboard.cli.derived`) derive from it: signature, documentation, options, help.
"""

from __future__ import annotations

import inspect
import math
import operator
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from fractions import Fraction
from functools import cache, wraps
from typing import Any, ParamSpec, Protocol, TypeVar, cast, dataclass_transform

from simnav.leaderboard.results.errors import RequestError

__all__ = [
    "UNSET",
    "Call",
    "Option",
    "call",
    "finite_number",
    "numbers",
    "option",
    "option_of",
    "options_of",
    "request",
    "require_unused",
    "whole_number",
]

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
_R = TypeVar("_R", contravariant=True)
_T = TypeVar("_T", covariant=True)
_WIDTH = 116

#: Of an option whose default on the command line is that of the field.
UNSET: Any = object()


@dataclass(frozen=True)
class Option:
    """What an option means, and how it is written on the command line.

    Attributes
    ----------
    help : str
        A sentence or two for ``--help``; they also begin the documentation of the Python call.
    more : str
        Further sentences for the documentation of the Python call.
    flags : tuple of str
        Names on the command line, such as ``("--runs", "-n")``. Default: derived from the name of the field.
    argument : bool
        True: an argument of the command, without a flag.
    metavar : str
        Name of the value in the help. Default: its type.
    least : float, optional
        Smallest value.
    cli : type, optional
        Type on the command line. Default: derived from the annotation of the field.
    cli_default : object
        Default on the command line. Default: that of the field.
    read : callable, optional
        Converts what the command line gave to the value of the field.
    hidden : bool
        True: not on the command line.
    """

    help: str
    more: str = ""
    flags: tuple[str, ...] = ()
    argument: bool = False
    metavar: str | None = None
    least: float | None = None
    cli: Any = None
    cli_default: Any = UNSET
    read: Callable[[Any], Any] | None = None
    hidden: bool = False


def option(*flags: str, help: str, default: Any = MISSING, **how: Any) -> Any:
    """A field of a request; the arguments are the attributes of `Option`, and the default of the field."""
    return field(default=default, metadata={"option": Option(help, flags=flags, **how)})


def options_of(request: type[Any]) -> list[Field[Any]]:
    """The fields of a request as they are listed: those of classes that set ``_LAST``, such as limits, at the end."""
    last = {name for c in request.__mro__ if vars(c).get("_LAST", False) for name in vars(c).get("__annotations__", ())}
    return sorted(fields(request), key=lambda f: f.name in last)


def option_of(declared: Field[Any]) -> Option:
    """What a field of a request was declared with."""
    found = declared.metadata["option"]
    assert isinstance(found, Option)
    return found


def require_unused(request: Any, names: Sequence[str], why: str) -> None:
    """Refuse options that were given and cannot act.

    Parameters
    ----------
    request : object
        The request.
    names : sequence of str
        Options that cannot act; one that has its default was not given.
    why : str
        Why they cannot, and what would be right.

    Raises
    ------
    RequestError
        One sentence that names the options.
    """
    defaults = {f.name: f.default for f in fields(request)}
    given = [name for name in names if getattr(request, name) != defaults[name]]
    if given:
        raise RequestError(f"{', '.join(map(repr, given))} cannot act here: {why}")


@cache  # many requests share options
def _filled(text: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent="    ", subsequent_indent="    ")


@dataclass_transform(frozen_default=True, field_specifiers=(option,))
def request(cls: type[T]) -> type[T]:
    """Make a class a request: a frozen dataclass whose documentation lists the options.

    The docstring of the class says what the command does; its first paragraph is the help of the command line.
    """
    made = dataclass(frozen=True)(cls)
    lines = [inspect.cleandoc(cls.__doc__ or ""), "", "Parameters", "----------"]
    for f in options_of(made):
        told = option_of(f)
        lines.append(f"{f.name} : {f.type}{', optional' if f.default is None else ''}")
        lines.append(_filled(f"{told.help} {told.more}".strip()))
    made.__doc__ = "\n".join(lines)
    return made


class Call(Protocol[P, _R, _T]):
    """A Python call that was derived from a request."""

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> _T:
        """Call it with the options as arguments."""
        ...

    def of(self, request: _R) -> _T:
        """Call it with a request."""
        ...


def call(request: Callable[P, R]) -> Callable[[Callable[[R], T]], Call[P, R, T]]:
    """Make a function of a request a function of its options.

    Parameters
    ----------
    request : type
        The request. Its documentation and signature become those of the function. What follows the first paragraph of
        the function's own docstring is added: what is returned and raised.

    Returns
    -------
    callable
        A decorator. The function of the request is the attribute ``of`` of what it makes.
    """
    declared = inspect.signature(request)

    def decorate(function: Callable[[R], T]) -> Call[P, R, T]:
        @wraps(function)
        def called(*args: P.args, **kwargs: P.kwargs) -> T:
            try:
                declared.bind(*args, **kwargs)
            except TypeError as error:
                raise TypeError(f"{function.__name__}() {error}") from None
            return function(request(*args, **kwargs))

        result = inspect.signature(function).return_annotation
        vars(called)["__signature__"] = declared.replace(return_annotation=result)
        ends = inspect.cleandoc(function.__doc__ or "").partition("\n\n")[2]
        called.__doc__ = f"{request.__doc__}\n\n{ends}".strip()
        vars(called)["of"] = function
        del vars(called)["__wrapped__"]  # tools for documentation would show the function of the request
        return cast("Call[P, R, T]", called)

    return decorate


def whole_number(name: str, value: Any, least: int = 0) -> int:
    """An argument that should be a whole number, also of NumPy.

    >>> whole_number("runs", 3, 1)
    3
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise RequestError(f"{name} = {value!r}: a whole number is wanted") from None
    if isinstance(value, bool) or number < least:
        raise RequestError(f"{name} = {value!r}: a whole number from {least} up is wanted")
    return number


def finite_number(name: str, value: Any, least: float = 0.0) -> float:
    """An argument that should be a number, finite and not less than another.

    >>> finite_number("minutes", 1)
    1.0
    """
    try:
        number = float(value) if not isinstance(value, (str, bytes, bool)) else math.nan
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and number >= least):
        raise RequestError(f"{name} = {value!r}: a finite number from {least:g} up is wanted")
    return number


def numbers(name: str, text: str) -> tuple[float, ...]:
    """Numbers that are separated by commas, as they are typed; each may be a fraction.

    >>> numbers("--factors", "1/3, 3,10")
    (0.3333333333333333, 3.0, 10.0)
    """
    try:
        return tuple(float(Fraction(part.strip().replace(" ", ""))) for part in text.split(","))
    except (ValueError, ZeroDivisionError):
        raise RequestError(f"{name} {text}: numbers are wanted, separated by commas, like 1/3,3,10") from None
