"""The registered estimators by name: the decorator `register`, and the entry points ``simnav.estimators``.

Entry points are loaded when a name is first asked for; one that fails is named in a warning.
"""

from __future__ import annotations

import ast
import contextlib
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, TypeVar

from simnav.estimator.contract import Estimator, EstimatorError
from simnav.plugins import entry_points, place_of
from simnav.spec import closest

__all__ = [
    "GROUP",
    "aliases_of",
    "discover",
    "discover_own",
    "discover_point",
    "forget",
    "is_own",
    "is_own_reference",
    "kebab",
    "names",
    "own_class",
    "point_of",
    "register",
    "registered",
    "registered_in",
    "restore",
    "snapshot",
]

GROUP = "simnav.estimators"

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")

E = TypeVar("E", bound=type[Estimator])

_classes: dict[str, type[Estimator]] = {}  # by name
_aliases: dict[str, str] = {}  # alias -> name
_points: dict[str, str] = {}  # entry points of other packages, by the names that they registered
_own = False  # simnav's own are loaded
_discovered = False  # those of all packages are
_partly = False  # some were left out


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
        if not _NAME.fullmatch(n):
            raise EstimatorError(f"estimator name {n!r} is not kebab-case; {kebab(n)!r} would be")

    def wrap(cls: E) -> E:
        if not (isinstance(cls, type) and issubclass(cls, Estimator)):
            raise EstimatorError(f"@register({name!r}): {_label(cls)} is not a subclass of simnav.Estimator")
        if not isinstance(cls.version, int) or cls.version < 1:
            raise EstimatorError(
                f"@register({name!r}) on {_label(cls)}: version = {cls.version!r} should be a whole number from 1"
            )
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
    discover()
    return sorted(_classes)


def registered(name: str) -> type[Estimator]:
    """The class of a registered name or alias.

    Raises
    ------
    EstimatorError
        If there is none; the message names the nearest.
    """
    global _discovered, _partly
    discover()
    known = _aliases.get(name, name)
    if known not in _classes and _partly:
        _discovered = _partly = False
        discover()
        known = _aliases.get(name, name)
    if known not in _classes:
        near = closest(name, [*_classes, *_aliases])
        hint = near if "did you mean" in near else "; 'simnav list estimators' shows those that are known here"
        if file := _file_here(name):
            hint = f"; give its file: {file}"
        raise EstimatorError(f"unknown estimator {name!r}{hint}")
    return _classes[known]


def registered_in(file: Path) -> dict[str, str]:
    """The names under which a file registers its classes, by class, as its text says: it is not run.

    Only a name that is written out in a decorator is found. A file that cannot be read registers none.
    """
    found: dict[str, str] = {}
    with contextlib.suppress(OSError, SyntaxError, ValueError, RecursionError, MemoryError), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # whoever runs the file says what is odd in it
        for item in ast.parse(file.read_bytes()).body:
            if isinstance(item, ast.ClassDef) and (name := next(filter(None, map(_name_in, item.decorator_list)), "")):
                found[item.name] = name
    return found


def _name_in(decorator: ast.expr) -> str:
    """The name in ``@register("name")``; empty where it is another decorator, or the name is not written out."""
    if isinstance(decorator, ast.Call) and ast.unparse(decorator.func).rpartition(".")[2] == register.__name__:
        for given in (*decorator.args[:1], *(k.value for k in decorator.keywords if k.arg == "name")):
            if isinstance(given, ast.Constant) and isinstance(given.value, str) and _NAME.fullmatch(given.value):
                return given.value
    return ""


def _file_here(name: str) -> str:
    """The file of the present folder that registers a name, or is called so, as it is asked for; empty without one."""
    with contextlib.suppress(OSError):
        for file in sorted(Path().glob("*.py")):
            if file.stem == name:
                return file.name
            there = registered_in(file) if name.encode() in file.read_bytes() else {}
            if cls := next((cls for cls, known in there.items() if known == name), ""):
                return file.name if len(there) == 1 else f"{file.name}:{cls}"
    return ""


def aliases_of(name: str) -> tuple[str, ...]:
    """The other names of a registered estimator."""
    return tuple(a for a, n in _aliases.items() if n == name)


def discover() -> None:
    """Load the entry points, once; our own first, so that a plug-in cannot take its names."""
    global _discovered
    if _discovered:
        return
    discover_own()
    _discovered = True
    for point in sorted(entry_points(GROUP), key=lambda p: p.name):
        if not _is_ours(point):
            _load(point)


def discover_own() -> None:
    """Load simnav's own estimators only: what another package registers is loaded when an unknown name is asked for."""
    global _own
    if _own:
        return
    _own = True
    for point in entry_points(GROUP):
        if _is_ours(point):
            _load(point)


def discover_point(value: str) -> None:
    """Load one entry point of another package, as `point_of` names it (or none), and no other until one is needed."""
    global _discovered, _partly
    discover_own()
    _discovered = _partly = True
    for point in entry_points(GROUP) if value else ():
        if point.value == value and not _is_ours(point):
            _load(point)


def point_of(name: str) -> str:
    """The entry point of another package that registered a name; empty where none did."""
    return _points.get(name, "")


def is_own_reference(name: str) -> bool:
    """Whether a name is that of a reference that comes with simnav: it alone is told the truth in a campaign."""
    discover_own()
    cls = _classes.get(_aliases.get(name, name))
    if cls is None or not cls.reference or not cls.__module__.startswith("simnav.estimators."):
        return False
    return getattr(sys.modules.get(cls.__module__), cls.__qualname__, None) is cls


def own_class(name: str) -> type[Estimator] | None:
    """The class of a name or alias of an estimator that comes with simnav; None for all others."""
    discover_own()
    cls = _classes.get(_aliases.get(name, name))
    return cls if cls is not None and cls.__module__.startswith("simnav.estimators.") else None


def is_own(name: str) -> bool:
    """Whether a name or alias is that of an estimator that comes with simnav."""
    return own_class(name) is not None


def _is_ours(point: EntryPoint) -> bool:
    return point.dist is not None and point.dist.name == "simnav"


def snapshot() -> tuple[dict[str, type[Estimator]], dict[str, str]]:
    """What is registered now: classes by name, names by alias; for `restore`."""
    return dict(_classes), dict(_aliases)


def restore(before: tuple[dict[str, type[Estimator]], dict[str, str]]) -> None:
    """Forget what has been registered since a `snapshot`."""
    _classes.clear()
    _aliases.clear()
    _classes.update(before[0])
    _aliases.update(before[1])


def _load(point: EntryPoint) -> None:
    before = snapshot()
    try:
        loaded = point.load()
        if isinstance(loaded, type) and "name" not in vars(loaded):
            register(point.name)(loaded)
    except (Exception, SystemExit) as error:
        restore(before)
        owner = f" of package {point.dist.name!r}" if point.dist is not None else ""
        warnings.warn(
            f"estimator plug-in {point.name!r} ({point.value}){owner} is left out: {type(error).__name__}: {error}",
            stacklevel=4,
        )
    _points.update(dict.fromkeys(set(_classes) - set(before[0]), "" if _is_ours(point) else point.value))


def forget(path: Path) -> None:
    """An edited file takes the place of its older self: its old names must not stand in its way."""
    for n, c in list(_classes.items()):
        if place_of(c)[0] == str(path):
            del _classes[n]
            for alias in [a for a, m in _aliases.items() if m == n]:
                del _aliases[alias]


def kebab(name: str) -> str:
    """``MyUKFilter2`` -> ``my-uk-filter2``."""
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "-", name)
    return re.sub(r"[^a-z0-9]+", "-", spaced.lower()).strip("-") or "unnamed"


def _label(cls: Any) -> str:
    return getattr(cls, "__qualname__", repr(cls))


def _place(cls: type) -> str:
    file, line = place_of(cls)
    return f"{file}, line {line}"
