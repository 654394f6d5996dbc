"""The registration of plug-ins: by a decorator, from entry points of packages, or from single files.

A `Registry` holds the classes or functions of one sort, by name. Entry points are loaded when they are first needed. If
one of them fails, a warning names it, and the others are not affected. simnav's own classes are registered first, by
the same decorators, so that a plug-in cannot take their names.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import importlib.metadata
import importlib.util
import inspect
import os
import re
import sys
import traceback
import types
import warnings
from collections.abc import Callable, Iterator
from functools import wraps
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, Generic, TypeVar

__all__ = [
    "PluginError",
    "Registry",
    "code_digest",
    "code_text",
    "declared_in",
    "entry_points",
    "exception_of",
    "import_file",
    "is_file_module",
    "load_plugin",
    "place_of",
    "registered_kind",
    "source_digest",
    "with_named_errors",
]

C = TypeVar("C")

#: Prefix of the names of modules that were imported from single files.
_PREFIX = "simnav_file_"


class PluginError(ValueError):
    """A class or file cannot be registered, found or loaded. The message is one sentence."""


def import_file(
    path: Path, *, error: type[PluginError] = PluginError, before: Callable[[Path], None] | None = None
) -> types.ModuleType:
    """Import a Python file by its path, once for each content.

    The file can import modules of its own folder. They do not replace installed modules of the same name.

    Parameters
    ----------
    path : Path
        Absolute path of the file.
    error : type
        Class of the exception that is raised.
    before : callable, optional
        Called with the path before the code of the file runs.

    Raises
    ------
    PluginError
        If the file cannot be imported: one sentence with its name and the line.
    """
    source = path.read_bytes()
    digest = hashlib.blake2b(f"{path}\0".encode() + source, digest_size=6).hexdigest()
    name = f"{_PREFIX}{re.sub(r'[^0-9a-zA-Z]', '_', path.stem)}_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise error(f"{path.name} cannot be imported as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    _sources[name] = code_digest(source)
    if before is not None:
        before(path)
    try:
        spec.loader.exec_module(module)
    except PluginError:
        del sys.modules[name]
        raise
    except (Exception, SystemExit) as cause:
        del sys.modules[name]
        if isinstance(cause, SyntaxError) and cause.lineno is not None:
            line, text = cause.lineno, cause.msg
        else:
            frames = [f for f in traceback.extract_tb(cause.__traceback__) if f.filename == str(path)]
            line, text = (frames[-1].lineno or 0) if frames else 0, str(cause)
        place = f"{path.name}, line {line}" if line else path.name
        raise error(f"{place}: it cannot be imported: {type(cause).__name__}: {text}") from cause
    return module


def is_file_module(name: str) -> bool:
    """Whether a module of this name was imported from a single file by `import_file`."""
    return name.startswith(_PREFIX)


def load_plugin(path: str | Path) -> None:
    """Load a Python file that registers instruments, faults, scores or estimators; once for each content.

    A scenario names such files itself (``plugins = ["beacon.py"]``); packages have entry points instead.

    Parameters
    ----------
    path : str or Path
        The Python file; ``~`` is the home directory.

    Raises
    ------
    PluginError
        If there is no such file, or it cannot be imported: one sentence with its name and the line.
    """
    file = Path(path).expanduser().resolve()
    if not file.is_file():
        raise PluginError(f"there is no plug-in file {str(path)!r}")
    import_file(file)


def source_digest(module: str) -> str:
    """`code_digest` of the source of a module, as it was when it was imported from a single file."""
    if module in _sources:
        return _sources[module]
    file = getattr(sys.modules.get(module), "__file__", None)
    return code_digest(Path(file).read_bytes()) if file is not None and Path(file).is_file() else ""


_sources: dict[str, str] = {}  # by the name of the module


def code_text(tree: ast.AST) -> str:
    """A syntax tree as a text without comments, docstrings and line numbers; its docstrings are taken out of it."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [s for s in body if not _is_text(s)]  # type: ignore[attr-defined]
    return ast.dump(tree)


def _is_text(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def code_digest(source: bytes) -> str:
    """Hexadecimal digest of the `code_text` of a Python file; of a text that is not Python, of its bytes."""
    with contextlib.suppress(SyntaxError, ValueError):
        source = code_text(ast.parse(source)).encode(errors="surrogatepass")
    return hashlib.blake2b(source, digest_size=16).hexdigest()


def declared_in(cls: type[Any]) -> str:
    """Name and file of a class, for messages."""
    return f"{cls.__qualname__} in {Path(place_of(cls)[0]).name}"


def registered_kind(cls: Any, base: type[Any], *, decorator: str, sort: str, example: str) -> str:
    """The kind that a specification declares: the default of its field ``kind``.

    Parameters
    ----------
    cls : object
        What was decorated.
    base : type
        Class that it should be derived from.
    decorator : str
        Name of the decorator, for messages.
    sort : str
        What is registered, such as ``vessel``, for messages.
    example : str
        A kind, for messages.

    Raises
    ------
    PluginError
        If it is not derived from ``base``, declares no kind, or one of its fields hides an attribute of ``base``.
    """
    from simnav.spec import hidden_attribute  # late: pydantic takes long to import

    if not (isinstance(cls, type) and issubclass(cls, base)):
        home = base.__module__.rpartition(".")[0]
        raise PluginError(f"@{decorator}: {cls!r} is not a subclass of {home}.{base.__qualname__}")
    name = cls.model_fields["kind"].default  # type: ignore[attr-defined]
    if not isinstance(name, str):
        raise PluginError(f"{cls.__qualname__}: declare its kind, like kind: Literal[{example!r}] = {example!r}")
    hidden = hidden_attribute(cls, base)
    if hidden is not None:
        raise PluginError(f"{sort} {name!r}: the field {hidden!r} of {cls.__qualname__} hides {base.__name__}.{hidden}")
    return name


def with_named_errors(
    method: Callable[..., Any],
    error: type[Exception],
    label: Callable[..., str],
    passed: tuple[type[Exception], ...] = (MemoryError,),
) -> Callable[..., Any]:
    """Wrap a method of a specification, so that its errors name the kind and the place of its code.

    Parameters
    ----------
    method : callable
        The method.
    error : type
        Class of the exception that is raised.
    label : callable
        Gives the begin of the message; called with the arguments of the method.
    passed : tuple of type
        Exceptions that are raised as they are.
    """

    @wraps(method)
    def named(self: Any, *args: Any, **rest: Any) -> Any:
        try:
            return method(self, *args, **rest)
        except passed:
            raise
        except Exception as cause:
            cls = type(self)
            raise error(f"{label(self, *args, **rest)} ({declared_in(cls)}): {exception_of(cls, cause)}") from cause

    return named


def place_of(cls: Any) -> tuple[str, int]:
    """File and line of the definition of a class or a function; ``"?"`` and 0 if they are not known."""
    cls = inspect.unwrap(cls)
    try:
        file = inspect.getsourcefile(cls) or "?"
    except TypeError:  # defined in an interactive session
        return "?", 0
    try:
        return file, inspect.getsourcelines(cls)[1]
    except (OSError, TypeError):
        return file, 0


def exception_of(cls: Any, error: BaseException) -> str:
    """What was raised in the code of a class, in a few words; the place is the innermost in the file of the class."""
    file = place_of(cls)[0]
    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
    where = f" in {frames[-1].name}(), line {frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}{where}: {error}"


#: The entry points of each group, and the state of the import path in which they were read.
_installed: dict[str, tuple[tuple[tuple[str, int], ...], tuple[EntryPoint, ...]]] = {}


def entry_points(group: str) -> tuple[EntryPoint, ...]:
    """The installed entry points of a group.

    The metadata of all packages are read once, and again when the import path or a folder on it changes.
    """
    state = tuple((folder, _changed(folder)) for folder in sys.path)
    if group not in _installed or _installed[group][0] != state:
        _installed[group] = state, tuple(importlib.metadata.entry_points(group=group))
    return _installed[group][1]


def _changed(folder: str) -> int:
    """Time of the last change of a folder [ns]; 0 if there is none."""
    try:
        return os.stat(folder or ".").st_mtime_ns
    except OSError:
        return 0


class Registry(Generic[C]):
    """The classes or functions of one sort, by name.

    Parameters
    ----------
    what : str
        The sort, for messages: "instrument".
    group : str
        Entry-point group of other packages.
    home : str
        Module whose import registers the classes of simnav itself.
    term : str
        The word for a name in messages: "kind".
    """

    def __init__(self, what: str, group: str, home: str, *, term: str = "kind"):
        self.what, self.group, self.home, self.term = what, group, home, term
        self._classes: dict[str, C] = {}
        self._discovered = False

    def add(self, name: str, cls: C) -> None:
        """Register a class. A new version of a class, from a notebook or an edited file, replaces the old one.

        Raises
        ------
        PluginError
            If the name is not in snake_case, or another class has it: the message names that class, its file and line.
        """
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name):
            raise PluginError(
                f"{self.term} {name!r} of {self.what} {_label(cls)}: a {self.term} is in snake_case, like "
                f"'my_{self.term}'"
            )
        other = self._classes.get(name)
        if other is not None and not _same(other, cls):
            file, line = place_of(other)
            raise PluginError(
                f"{self.term} {name!r} of {self.what} {_label(cls)}: the name is taken by {_label(other)} "
                f"({file}, line {line})"
            )
        self._classes[name] = cls

    @contextlib.contextmanager
    def adding(self, name: str, cls: C) -> Iterator[None]:
        """Register a class by `add`, and remove it if the body of the ``with`` statement raises."""
        before = dict(self._classes)
        self.add(name, cls)
        try:
            yield
        except BaseException:
            self._classes = before
            raise

    def get(self, name: str) -> C | None:
        """The class of a name, or None."""
        if name not in self._classes:
            self.discover()
        return self._classes.get(name)

    def items(self) -> dict[str, C]:
        """All classes by name: those of simnav, then others, each in the order of registration."""
        self.discover()
        return dict(self._classes)

    def discover(self) -> None:
        """Load our own module and all entry points, once."""
        if self._discovered:
            return
        self._discovered = True
        import_module(self.home)
        for point in sorted(entry_points(self.group), key=lambda p: p.name):
            before = dict(self._classes)
            try:
                point.load()
            except (Exception, SystemExit) as error:
                self._classes = before
                owner = f" of package {point.dist.name!r}" if point.dist is not None else ""
                warnings.warn(
                    f"{self.what} plug-in {point.name!r} ({point.value}){owner} is left out: "
                    f"{type(error).__name__}: {error}",
                    stacklevel=4,
                )


def _label(item: Any) -> str:
    return str(item.__qualname__)


def _same(old: Any, new: Any) -> bool:
    """Whether two classes are versions of one class: the same name, in the same module or file or in a copy of it."""
    if old.__qualname__ != new.__qualname__:
        return False
    if old.__module__ == new.__module__:
        return True
    before, after = (Path(place_of(cls)[0]) for cls in (old, new))
    return after.is_file() and (before == after or (before.is_file() and before.read_bytes() == after.read_bytes()))
