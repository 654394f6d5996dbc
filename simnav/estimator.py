"""What an estimator is, and how it is registered, found and made.

An estimator is a class with two methods, `Estimator.reset` and `Estimator.update`. It becomes known
by the decorator `register`, through the entry-point group ``simnav.estimators`` of an installed
package, or by the path of its file (``my_filter.py`` or ``my_filter.py:MyFilter``).

Entry points are loaded when a name is first asked for; one that fails is named in a warning.
"""

from __future__ import annotations

import ast
import contextlib
import inspect
import re
import types
import typing
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from simnav.plugins import PluginError, import_file, place_of
from simnav.spec import closest
from simnav.types import Estimate, InitialState, Instruments, Measurements, NavigationStates

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = [
    "Description",
    "Estimator",
    "EstimatorError",
    "Parameter",
    "UnsuitableScenario",
    "describe",
    "find",
    "make",
    "names",
    "register",
]

GROUP = "simnav.estimators"


class Estimator(ABC):
    """Base class of all estimators.

    The constructor takes the parameters, all with defaults, as keyword arguments; ``--set name=value``
    on the command line sets them. One instance serves many runs, each begun by `reset`.

    Attributes
    ----------
    name : str
        Set by `register`.
    reference : bool
        True for rows that are told the truth (an oracle); they are marked and not ranked, and
        `reveal` is called before `reset`.
    slow : bool
        True for rows that take several milliseconds an epoch or more; a quick campaign leaves them out unless it is
        asked for them.
    """

    name: ClassVar[str] = ""
    reference: ClassVar[bool] = False
    slow: ClassVar[bool] = False

    @abstractmethod
    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run.

        Parameters
        ----------
        start : InitialState
            A state with errors drawn from its covariance.
        instruments : Instruments
            The datasheets, never the realised errors.

        Raises
        ------
        UnsuitableScenario
            If the estimator cannot work with these instruments; say what it needs.
        """

    @abstractmethod
    def update(self, measurements: Measurements) -> Estimate:
        """Take what the instruments delivered in one step; return the estimate at its end."""

    def smooth(self) -> NavigationStates | None:
        """After the last update: the whole trajectory, smoothed, at the ends of all steps; or None."""
        return None

    def reveal(self, recording: Recording) -> None:  # noqa: B027 (a hook: most estimators are told nothing)
        """Only for ``reference`` estimators: the recording with truth and labels, before `reset`."""


class UnsuitableScenario(Exception):  # noqa: N818 (not an error of the estimator's)
    """Raised by `Estimator.reset`: the instruments that this estimator needs are not there."""


class EstimatorError(PluginError):
    """An estimator that cannot be registered, found or made; the message is one sentence."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an estimator's constructor.

    Attributes
    ----------
    name : str
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


@dataclass(frozen=True)
class Description:
    """What `describe` tells of an estimator.

    Attributes
    ----------
    name : str
    aliases : tuple of str
    summary : str
        First line of the docstring.
    file : str
    line : int
        Where the class is defined.
    reference, slow : bool
    parameters : tuple of Parameter
    """

    name: str
    aliases: tuple[str, ...]
    summary: str
    file: str
    line: int
    reference: bool
    slow: bool
    parameters: tuple[Parameter, ...]


E = TypeVar("E", bound=type[Estimator])

_classes: dict[str, type[Estimator]] = {}  # by name
_aliases: dict[str, str] = {}  # alias -> name
_discovered = False


def register(name: str, aliases: Sequence[str] = ()) -> Callable[[E], E]:
    """Class decorator: make an estimator known under a name.

    Parameters
    ----------
    name : str
        Kebab-case: lower-case words joined by hyphens.
    aliases : sequence of str, optional
        Other names that find it.

    Raises
    ------
    EstimatorError
        If the class is not an `Estimator`, a name is not kebab-case, or a name is taken (the
        message says by whom and where). Defining the same class again replaces it, as in a notebook.
    """
    for n in (name, *aliases):
        if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", n):
            raise EstimatorError(f"estimator name {n!r} is not kebab-case; {_kebab(n)!r} would be")

    def wrap(cls: E) -> E:
        if not (isinstance(cls, type) and issubclass(cls, Estimator)):
            raise EstimatorError(f"@register({name!r}): {_label(cls)} is not a subclass of simnav.Estimator")
        for n in (name, *aliases):
            other = _classes.get(_aliases.get(n, n))
            if other is not None and (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):
                raise EstimatorError(
                    f"@register({n!r}) on {_label(cls)} ({_place(cls)}): the name is taken by "
                    f"{_label(other)} ({_place(other)})"
                )
        cls.name = name
        _classes[name] = cls
        _aliases.update(dict.fromkeys(aliases, name))
        return cls

    return wrap


def names() -> list[str]:
    """The names of all registered estimators, sorted."""
    _discover()
    return sorted(_classes)


def find(name_or_path: str) -> type[Estimator]:
    """The class of an estimator.

    Parameters
    ----------
    name_or_path : str
        A registered name or alias, ``my.py``, or ``my.py:MyFilter``. A class of a file that is
        not decorated is registered under its own name (``MyFilter``: ``my-filter``).

    Raises
    ------
    EstimatorError
        If there is none; the message names the nearest.
    """
    path = re.fullmatch(r"(.*\.py)(?::(\w+))?", name_or_path, flags=re.DOTALL)
    if path:
        return _from_file(Path(path[1]), path[2])
    _discover()
    name = _aliases.get(name_or_path, name_or_path)
    if name not in _classes:
        raise EstimatorError(f"unknown estimator {name_or_path!r}{closest(name_or_path, [*_classes, *_aliases])}")
    return _classes[name]


def describe(name_or_path: str) -> Description:
    """What an estimator is, where it is defined, and what parameters it takes."""
    cls = find(name_or_path)
    file, line = place_of(cls)
    lines = (inspect.getdoc(cls) or "").strip().splitlines() if cls.__doc__ else []
    return Description(
        name=cls.name,
        aliases=tuple(a for a, n in _aliases.items() if n == cls.name),
        summary=lines[0] if lines else "",
        file=file,
        line=line,
        reference=cls.reference,
        slow=cls.slow,
        parameters=tuple(
            Parameter(p.name, p.default, "" if p.annotation is p.empty else inspect.formatannotation(p.annotation))
            for p in _parameters(cls)
        ),
    )


def make(name_or_path: str, **parameters: Any) -> Estimator:
    """Make an estimator.

    Parameters
    ----------
    name_or_path : str
        As for `find`.
    **parameters
        Of its constructor. A string is converted to what the annotation, or else the default, asks
        for: numbers, ``true``/``false``, ``none``, a choice, or several values parted by commas.

    Raises
    ------
    EstimatorError
        On an unknown estimator or parameter, or a value that does not fit: one sentence.
    """
    cls = find(name_or_path)
    known = {p.name: p for p in _parameters(cls)}
    hints: dict[str, Any] = {}
    constructors = _constructors(cls)
    for constructor in reversed(constructors):
        with contextlib.suppress(Exception):  # an annotation that cannot be resolved: the defaults decide
            hints |= typing.get_type_hints(constructor)
    open_ended = bool(constructors) and _open(constructors[-1])
    values: dict[str, Any] = {}
    for key, value in parameters.items():
        if key not in known and not open_ended:
            hint = closest(key, list(known)) if known else "; it takes none"
            raise EstimatorError(f"estimator {cls.name!r} has no parameter {key!r}{hint}")
        default = known[key].default if key in known else None
        values[key] = _convert(value, hints.get(key), default, f"parameter {key!r} of estimator {cls.name!r}")
    missing = [p.name for p in known.values() if p.default is p.empty and p.name not in values]
    if missing:
        raise EstimatorError(f"estimator {cls.name!r} needs the parameter {missing[0]!r}, which has no default")
    try:
        return cls(**values)
    except (TypeError, ValueError) as error:
        raise EstimatorError(f"estimator {cls.name!r}: {error}") from error


def _parameters(cls: type[Estimator]) -> list[inspect.Parameter]:
    """Of its constructor; where that takes ``**``, also those of its bases' that can be given by name only."""
    found: dict[str, inspect.Parameter] = {}
    kinds = [inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD]
    for constructor in _constructors(cls):
        own = list(inspect.signature(constructor).parameters.values())[1:]
        found |= {p.name: p for p in own if p.kind in kinds and p.name not in found}
        kinds = kinds[:1]
    return list(found.values())


def _constructors(cls: type[Estimator]) -> list[Callable[..., Any]]:
    """Its constructor, and that of the next base that has one for as long as it takes ``**``."""
    found = []
    for base in cls.__mro__[:-1]:
        if "__init__" in vars(base):
            found.append(vars(base)["__init__"])
            if not _open(found[-1]):
                break
    return found


def _open(constructor: Callable[..., Any]) -> bool:
    return any(p.kind is p.VAR_KEYWORD for p in inspect.signature(constructor).parameters.values())


def _discover() -> None:
    """Load the entry points, once; our own first, so that a plug-in cannot take its names."""
    global _discovered
    if _discovered:
        return
    _discovered = True
    found = entry_points(group=GROUP)
    for point in sorted(found, key=lambda p: (p.dist is None or p.dist.name != "simnav", p.name)):
        before = dict(_classes), dict(_aliases)
        try:
            loaded = point.load()
            if isinstance(loaded, type) and "name" not in vars(loaded):
                register(point.name)(loaded)
        except (Exception, SystemExit) as error:
            _classes.clear()
            _aliases.clear()
            _classes.update(before[0]), _aliases.update(before[1])
            owner = f" of package {point.dist.name!r}" if point.dist is not None else ""
            warnings.warn(
                f"estimator plug-in {point.name!r} ({point.value}){owner} is left out: {type(error).__name__}: {error}",
                stacklevel=3,
            )


def _from_file(path: Path, wanted: str | None) -> type[Estimator]:
    if not path.is_file():
        raise EstimatorError(f"there is no estimator file {str(path)!r}")
    path = path.resolve()
    module = _load(path)
    inside = [
        c
        for c in vars(module).values()
        if isinstance(c, type) and issubclass(c, Estimator) and c.__module__ == module.__name__
    ]
    concrete = list(dict.fromkeys(c for c in inside if not inspect.isabstract(c)))
    choices = ", ".join(f"{path.name}:{c.__name__}" for c in concrete)
    if wanted is not None:
        for c in inside:
            if c.__name__ == wanted:
                if inspect.isabstract(c):
                    lacks = ", ".join(sorted(c.__abstractmethods__))
                    raise EstimatorError(f"{path.name}:{wanted} is no complete estimator: it lacks {lacks}")
                break
        else:
            hint = f"; there are: {choices}" if choices else "; it holds no subclass of simnav.Estimator"
            raise EstimatorError(f"{path.name} has no estimator class {wanted!r}{hint}")
        chosen = c
    elif len(concrete) == 1:
        chosen = concrete[0]
    elif not concrete:
        hint = f"; {inside[0].__name__} lacks {', '.join(sorted(inside[0].__abstractmethods__))}" if inside else ""
        raise EstimatorError(f"{path.name} holds no class that is a complete subclass of simnav.Estimator{hint}")
    else:
        decorated = [c for c in concrete if "name" in vars(c)]
        if len(decorated) != 1:
            raise EstimatorError(f"{path.name} holds several estimators; ask for one of them: {choices}")
        chosen = decorated[0]
    if "name" not in vars(chosen):
        _discover()  # so that a collision with an installed estimator is seen
        register(_kebab(chosen.__name__))(chosen)
    return chosen


def _load(path: Path) -> types.ModuleType:
    """Import a file by its path; modules beside it can be imported, but hide nothing."""
    _discover()
    return import_file(path, error=EstimatorError, before=_forget)


def _forget(path: Path) -> None:
    """An edited file takes the place of its older self: its old names must not stand in its way."""
    for n, c in list(_classes.items()):
        if place_of(c)[0] == str(path):
            del _classes[n]
            for alias in [a for a, m in _aliases.items() if m == n]:
                del _aliases[alias]


_TRUE, _FALSE, _NONE = ("true", "yes", "on", "1"), ("false", "no", "off", "0"), ("none", "null", "")


def _convert(value: Any, hint: Any, default: Any, what: str) -> Any:
    """A parameter's value as its annotation, or else its default, asks for."""
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


def _kebab(name: str) -> str:
    """``MyUKFilter2`` -> ``my-uk-filter2``."""
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "-", name)
    return re.sub(r"[^a-z0-9]+", "-", spaced.lower()).strip("-") or "unnamed"


def _label(cls: Any) -> str:
    return getattr(cls, "__qualname__", repr(cls))


def _place(cls: type) -> str:
    file, line = place_of(cls)
    return f"{file}, line {line}"
