"""Stub files: the constructors of rows for type checkers and editors, which run no code.

A row has its constructor from its pieces, when the class is defined. A tool that only reads the source sees nothing of
it, and takes any parameters for right. A stub (``kalman.pyi`` beside ``kalman.py``) repeats the module without what
only runs, and with a constructor in each row::

    python -m simnav.estimators.stubs                             # of simnav's rows; a test asks for current ones
    python -m simnav.estimators.stubs my_rows.py my_package.rows  # of files and modules of your own
"""

from __future__ import annotations

import ast
import inspect
import json
import math
import sys
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, TypeAlias, TypeGuard

from simnav.estimator.parameters import parameters_of
from simnav.plugins import PluginError, import_file

from .composition import Row

__all__ = ["main", "own_modules", "stub_of"]

_HEAD = """\
# Of {name}, for type checkers and editors. Do not edit: "python -m {command}" writes it.
"""

#: Statements that a stub repeats as they are.
_KEPT = (ast.Import, ast.ImportFrom, ast.Assign, ast.AnnAssign, ast.AugAssign, ast.If, ast.Try)

_Definition: TypeAlias = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def own_modules() -> list[types.ModuleType]:
    """The modules of simnav that declare rows."""
    package = import_module("simnav.estimators.rows")
    modules = [import_module(f"{package.__name__}.{m.name}") for m in iter_modules(package.__path__)]
    return [module for module in modules if _rows(module)]


def stub_of(module: types.ModuleType) -> str:
    """The text of the stub of a module.

    Parameters
    ----------
    module : module
        An imported module with its source file.
    """
    path = Path(inspect.getfile(module))
    source = path.read_bytes()
    imports: set[str] = set()
    lines = list(_Stub(source.splitlines(keepends=True), imports).body(ast.parse(source).body, vars(module), ""))
    own = module.__name__.startswith("simnav.estimators.")
    command = "simnav.estimators.stubs" + ("" if own else f" {path.name}")
    head = _HEAD.format(name=path.name, command=command) + "".join(f"import {name}\n" for name in sorted(imports))
    return "\n".join([head, *lines]).rstrip() + "\n"


def _rows(module: types.ModuleType) -> list[type[Row]]:
    """The rows that a module declares, whose constructors come from their pieces."""
    return [cls for cls in vars(module).values() if _is_row(cls) and cls.__module__ == module.__name__]


def _is_relative(node: ast.stmt | None) -> bool:
    return isinstance(node, ast.ImportFrom) and node.level > 0


def _is_row(cls: Any) -> TypeGuard[type[Row]]:
    row = isinstance(cls, type) and issubclass(cls, Row)
    return row and hasattr(vars(cls).get("__init__"), "__signature__")


class _Stub:
    """Writes statements.

    Parameters
    ----------
    lines : list of bytes
        Lines of the source; `ast` counts columns in bytes.
    imports : set of str
        Modules that the types of parameters need; it grows.
    """

    def __init__(self, lines: list[bytes], imports: set[str]):
        self._lines, self._imports = lines, imports

    def body(self, statements: Sequence[ast.stmt], values: Mapping[str, Any], indent: str) -> Iterator[str]:
        """Statements of a module or a class; definitions are hollow, and rows have their constructors."""
        for before, node in zip([None, *statements], statements):
            if isinstance(before, (ast.Import, ast.ImportFrom)) and not isinstance(node, (ast.Import, ast.ImportFrom)):
                yield ""
            if _is_relative(node) and before is not None and not _is_relative(before):
                yield ""  # as the style has it: neighbours of the folder come last, apart
            if isinstance(node, _KEPT):
                yield indent + self._between(_start(node), (node.end_lineno or 0, node.end_col_offset or 0))
            elif isinstance(node, ast.ClassDef):
                cls = values.get(node.name)
                inner = list(self.body(node.body, vars(cls) if isinstance(cls, type) else {}, indent + "    "))
                if _is_row(cls):
                    inner += self._constructor(parameters_of(cls), indent + "    ")
                yield from ("", self._header(node, indent), *(inner or [f"{indent}    ..."]))
            elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                yield from (self._header(node, indent), f"{indent}    ...")

    def _header(self, node: _Definition, indent: str) -> str:
        """From the first decorator to the colon."""
        lines = self._between(_start(node), _start(node.body[0])).rstrip().splitlines()
        while lines[-1].lstrip().startswith("#"):
            lines.pop()
        return indent + "\n".join(lines)

    def _between(self, start: tuple[int, int], end: tuple[int, int]) -> str:
        lines = self._lines[start[0] - 1 : end[0]]
        lines[-1] = lines[-1][: end[1]]
        lines[0] = lines[0][start[1] :]
        return b"".join(lines).decode()

    def _constructor(self, parameters: Sequence[inspect.Parameter], indent: str) -> list[str]:
        """A constructor, a parameter a line."""
        if not parameters:
            return [f"{indent}def __init__(self) -> None: ..."]
        found = []
        for p in parameters:
            default = "" if p.default is p.empty else f" = {_value(p.default)}"
            found.append(f"{indent}    {p.name}: {self._type(p.annotation)}{default},")
        return [f"{indent}def __init__(", f"{indent}    self,", f"{indent}    *,", *found, f"{indent}) -> None: ..."]

    def _type(self, hint: Any) -> str:
        """A type as it is written; ``typing.Any`` where it is not known."""
        origin, inside = typing.get_origin(hint), typing.get_args(hint)
        if hint is None or hint is type(None):
            return "None"
        if hint is ...:
            return "..."
        if isinstance(hint, list):  # the parameters of a callable
            return f"[{', '.join(map(self._type, hint))}]"
        if origin in (typing.Union, types.UnionType):
            return " | ".join(map(self._type, inside))
        if origin is typing.Literal:
            self._imports.add("typing")
            return f"typing.Literal[{', '.join(map(_value, inside))}]"
        name = origin if inside else hint
        if not isinstance(name, type) or hint is inspect.Parameter.empty:
            self._imports.add("typing")
            return "typing.Any"
        text = name.__qualname__
        if name.__module__ != "builtins":
            self._imports.add(name.__module__)
            text = f"{name.__module__}.{text}"
        return f"{text}[{', '.join(map(self._type, inside))}]" if inside else text


def _start(node: ast.stmt) -> tuple[int, int]:
    """Line and column of a statement, decorators included."""
    decorators: list[ast.expr] = getattr(node, "decorator_list", [])
    return (decorators[0].lineno, decorators[0].col_offset - 1) if decorators else (node.lineno, node.col_offset)


def _value(value: Any) -> str:
    """A default or a literal as it is written; ``...`` where that would not be plain."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, tuple) and all(_value(v) != "..." for v in value):
        return f"({', '.join(map(_value, value))}{',' if len(value) == 1 else ''})"
    plain = value is None or isinstance(value, (bool, int)) or (isinstance(value, float) and math.isfinite(value))
    return repr(value) if plain and type(value).__module__ == "builtins" else "..."


def main(names: Sequence[str]) -> int:
    """The command; 1 where a module cannot be imported or has no row."""
    modules = [] if names else own_modules()
    for name in names:
        try:
            found = import_file(Path(name).resolve()) if name.endswith(".py") else import_module(name)
        except (PluginError, ImportError, OSError) as error:
            print(f"{name}: it cannot be imported: {error}", file=sys.stderr)
            return 1
        if not _rows(found):
            print(f"{name}: it declares no row, so that it needs no stub", file=sys.stderr)
            return 1
        modules.append(found)
    for module in modules:
        path = Path(inspect.getfile(module)).with_suffix(".pyi")
        path.write_text(stub_of(module), encoding="utf-8", newline="\n")
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
