"""Estimators that are defined in a session: a cell of a notebook, a script, a prompt.

No file can be imported for them elsewhere. So a worker is sent the class itself (`carry`, by cloudpickle), and only the
isolated process of an attempt unpacks it. The key of its results is made of its source text and of all that it uses of
the session (`source_of`).
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import linecache
import os
import pickle
import sys
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any

from simnav.leaderboard.results.errors import RequestError, sentence
from simnav.plugins import code_text

__all__ = ["is_session", "pickle_class", "receive", "source_of"]


def is_session(module: str) -> bool:
    """Whether a module of this name cannot be imported by another process.

    >>> is_session("__main__"), is_session("simnav.trial")
    (True, False)
    """
    if module == "__main__":
        return True
    path, origin = None, None
    parts = module.split(".")
    for k in range(len(parts)):  # as another process would look for it, which has not imported it
        name = ".".join(parts[: k + 1])
        finders = (finder for finder in sys.meta_path if hasattr(finder, "find_spec"))
        spec = next((found for f in finders if (found := f.find_spec(name, path)) is not None), None)
        if spec is None:
            return True
        path, origin = spec.submodule_search_locations, spec.origin
    here = getattr(sys.modules.get(module), "__file__", None)
    if here is None or origin is None or not (os.path.isfile(here) and os.path.isfile(origin)):
        return False
    return not os.path.samefile(here, origin)  # another module of the same name


def pickle_class(cls: Any) -> bytes:
    """A class or a function as bytes; of its session everything that it uses goes with it.

    Raises
    ------
    RequestError
        If it uses something of the session that cannot be sent, like an open file.
    """
    import cloudpickle

    module = sys.modules.get(cls.__module__)
    by_value = module is not None and module.__name__ != "__main__" and is_session(cls.__module__)
    try:
        if by_value:
            cloudpickle.register_pickle_by_value(module)
        data: bytes = cloudpickle.dumps(cls)
    except Exception as error:
        raise RequestError(
            f"{cls.__name__} cannot be sent to a worker ({sentence(error)}); put it into a file"
        ) from error
    finally:
        if by_value:
            cloudpickle.unregister_pickle_by_value(module)
    return data


def receive(data: bytes) -> Any:
    """The class that `carry` packed."""
    return pickle.loads(data)


def source_of(cls: type) -> tuple[str, list[str]]:
    """What a class is made of.

    Returns
    -------
    text : str
        Its source text, without comments and docstrings, and that of all functions and classes of its session that it
        uses, with the values: of its attributes, of defaults, and of what its functions use. Where there is no text (a
        prompt that keeps none), the compiled code stands for it.
    modules : list of str
        Names of the modules outside the session that it uses.
    """
    parts, modules, seen, todo = [], set[str](), set[int](), list[Any]([cls])
    while todo:
        item = todo.pop(0)
        if id(item) in seen:
            continue
        seen.add(id(item))
        parts.append(_text(item))
        for name, value in [*_held(item), *(use for function in _functions(item) for use in _uses(function))]:
            if isinstance(value, ModuleType):
                modules.add(value.__name__)
                continue
            for definition in dict.fromkeys(_definitions(value)):
                if definition.__module__ != "builtins":
                    modules.add(definition.__module__)
                    todo += [definition] if is_session(definition.__module__) else []
            if not isinstance(value, (type, FunctionType)):
                parts.append(f"{name}: {_digest(value)}")
    return "\n".join(parts), sorted(name for name in modules if not is_session(name))


def _definitions(value: Any, depth: int = 3) -> Iterator[Any]:
    """A class or a function itself; of another value its class, and those of what it holds."""
    if isinstance(value, (type, FunctionType)):
        yield value
        return
    yield type(value)
    if depth and isinstance(value, (tuple, list, set, frozenset)):
        for item in value:
            yield from _definitions(item, depth - 1)
    elif depth and isinstance(value, dict):
        yield from _definitions(list(value.values()), depth - 1)


def _held(item: Any) -> Iterator[tuple[str, Any]]:
    """What a definition computed when it was run: attributes of a class, defaults of functions."""
    if isinstance(item, type):
        for name, value in vars(item).items():
            if not name.startswith("__") and name != "_abc_impl" and not any(_functions_in(value)):
                yield name, value
    for function in _functions(item):
        for value in (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()):
            yield function.__name__, value


def _functions(item: Any) -> Iterator[FunctionType]:
    """A function, or the methods of a class, whatever they are wrapped in."""
    for value in vars(item).values() if isinstance(item, type) else (item,):
        yield from _functions_in(value)


def _functions_in(value: Any) -> Iterator[FunctionType]:
    if isinstance(value, property):
        candidates: tuple[Any, ...] = (value.fget, value.fset)
    else:
        candidates = (getattr(value, "__func__", getattr(value, "func", value)),)
    for candidate in candidates:
        function = inspect.unwrap(candidate) if callable(candidate) and not isinstance(candidate, type) else candidate
        if isinstance(function, FunctionType):
            yield function


def _uses(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Global and enclosing names of a function that have a value now, in order."""
    for name in sorted({n for code in _codes(function.__code__) for n in code.co_names}):
        if name in function.__globals__:
            yield name, function.__globals__[name]
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # not bound yet
            continue


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _text(item: Any) -> str:
    """The definition as it was written; without it, the compiled code and the values of class attributes."""
    functions = list(_functions(item))
    for function in functions:
        code = function.__code__
        text = "".join(linecache.getlines(code.co_filename))
        try:
            nodes = list(ast.walk(ast.parse(text)))
        except (SyntaxError, ValueError):
            continue
        for node in nodes:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name == item.__name__:
                first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
                if first <= code.co_firstlineno <= (node.end_lineno or first):
                    return code_text(node)
    compiled = [(c.co_code, c.co_names, [k for k in c.co_consts if not isinstance(k, CodeType)])
                for f in functions for c in _codes(f.__code__)]  # fmt: skip
    return f"{item.__qualname__} {compiled!r}"


def _digest(value: Any) -> str:
    """Of a value of the session: its content where it can be packed, otherwise its type."""
    try:
        return hashlib.blake2b(pickle.dumps(value, protocol=4), digest_size=12).hexdigest()
    except Exception:
        return type(value).__qualname__
