"""The code that a module stands on: found by following its imports, digested without comments and docstrings.

A module of simnav brings those modules of simnav that it imports, directly or not. Where it imports a name from a
package, only the module that the package has this name from counts, so that a package which imports everything (the
registered estimators) does not make everything count. A module of somebody else brings the files of the user that it
imports, too: those beside it, and those that this process has imported from elsewhere. What is installed is not
followed.
"""

from __future__ import annotations

import ast
import hashlib
import os
import re
import sys
import sysconfig
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import simnav
from simnav.plugins import code_text

__all__ = ["LIBRARY", "code_digest", "code_of", "digest", "files_digest", "followed", "is_installed"]

#: Folder of the library. The estimators and scenarios are in it, by symbolic links; so is the leaderboard.
LIBRARY = Path(simnav.__file__).parent

#: Modules that decide no number of a run: what is above the estimators.
_ABOVE = "simnav.leaderboard"


def digest(*parts: str) -> str:
    """Hexadecimal digest of texts (their boundaries count)."""
    h = hashlib.blake2b(digest_size=12)
    for part in parts:
        data = part.encode(errors="surrogatepass")
        h.update(f"{len(data)}:".encode() + data)
    return h.hexdigest()


def files_digest(files: Iterable[tuple[str, Path]]) -> str:
    """Digest of the names and contents of files; one that is absent counts as absent."""
    parts = []
    for name, path in files:
        try:
            with open(path, "rb") as file:
                content = hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
        except OSError:
            content = "absent"
        parts += [name, content]
    return digest(*parts)


@dataclass(frozen=True)
class Code:
    """What a Python file says, as far as numbers depend on it.

    Attributes
    ----------
    digest : str
        Of its syntax tree, without docstrings and positions. Of a file that is no Python: of its bytes.
    imports : tuple of (str, str)
        Absolute names of modules, each with the name that is taken from it; empty where the module itself is.
        Imports for type checking only are left out.
    origins : mapping of str to (str, str)
        Name -> the module, and the name in it, that it is imported from at the top of the file, for type checking too.
    data : tuple of str
        Patterns of the names of files that texts in it name, like ``weights_*.json`` for ``f"weights_{kind}.json"``.
    named : tuple of str
        Patterns of names of modules in its texts, like ``methods.*`` for ``f"methods.{kind}"``, where it uses
        `importlib` or ``__import__``.
    folders : tuple of str
        Texts in it that could name a folder.
    """

    digest: str
    imports: tuple[tuple[str, str], ...] = ()
    origins: Mapping[str, tuple[str, str]] = field(default_factory=lambda: MappingProxyType({}))
    data: tuple[str, ...] = ()
    named: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()


def code_of(path: Path, package: str) -> Code:
    """What a file says.

    Parameters
    ----------
    path : Path
        The file.
    package : str
        Package to which relative imports refer; empty for a file outside a package.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    status = path.stat()
    return _code_of(path, package, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=4096)
def _code_of(path: Path, package: str, modified: int, size: int) -> Code:
    source = path.read_bytes()
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return Code(hashlib.blake2b(source, digest_size=16).hexdigest())
    text = code_text(tree)
    imports, texts = tuple(dict.fromkeys(_imports(tree, package))), _texts(tree)
    by_text = any(module.partition(".")[0] == "importlib" for module, _ in imports) or any(
        isinstance(node, ast.Name) and node.id == "__import__" for node in ast.walk(tree)
    )
    return Code(
        hashlib.blake2b(text.encode(errors="surrogatepass"), digest_size=16).hexdigest(),
        imports,
        MappingProxyType({
            name: origin for statement in _top(tree) for name, origin in _taken(statement, package)
        }),
        tuple(sorted(t for t in texts if re.fullmatch(_FILE, t) and not t.startswith("*."))),
        tuple(sorted(t.lstrip(".") for t in texts if by_text and re.fullmatch(_MODULE, t))),
        tuple(sorted(t for t in texts if re.fullmatch(_FOLDER, t))),
    )  # fmt: skip


_FILE = r"[\w*-]+\.[A-Za-z]\w{0,7}|(?:[\w*-]+/)+[\w*-]+\.[A-Za-z]\w{0,7}"
_MODULE = r"\.*[A-Za-z_][\w*]*(?:\.[\w*]+)*"
_FOLDER = r"[\w-]+(?:/[\w-]+)*"


def _for_type_checking(node: ast.AST) -> bool:
    if not isinstance(node, ast.If):
        return False
    test = node.test
    return (isinstance(test, ast.Name) and test.id == "TYPE_CHECKING") or (
        isinstance(test, ast.Attribute) and test.attr == "TYPE_CHECKING"
    )


def _top(tree: ast.Module) -> Iterator[ast.stmt]:
    """The statements at the top of a file, and those under ``if TYPE_CHECKING``."""
    for statement in tree.body:
        yield from statement.body if isinstance(statement, ast.If) and _for_type_checking(statement) else [statement]


def _running(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those for type checking."""
    for child in ast.iter_child_nodes(node):
        if _for_type_checking(child):
            for other in child.orelse:  # type: ignore[attr-defined]
                yield other
                yield from _running(other)
            continue
        yield child
        yield from _running(child)


def _taken(node: ast.AST, package: str) -> Iterator[tuple[str, tuple[str, str]]]:
    """The names that ``from ... import ...`` binds, with the module and the name in it."""
    if isinstance(node, ast.ImportFrom):
        module = node.module or ""
        if node.level:
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            module = ".".join(filter(None, [*above, module]))
        for alias in node.names:
            yield alias.asname or alias.name, (module, alias.name)


def _imports(tree: ast.Module, package: str) -> Iterator[tuple[str, str]]:
    """What a file imports, anywhere in it, and what it uses of the modules that it imports."""
    bound: dict[str, str] = {}
    chains: list[str] = []
    for node in _running(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, ""
                bound[alias.asname or alias.name.partition(".")[0]] = (
                    alias.name if alias.asname else alias.name.partition(".")[0]
                )
        elif isinstance(node, ast.ImportFrom):
            for _, (module, name) in _taken(node, package):
                yield module, name
        elif isinstance(node, ast.Attribute):
            names = [node.attr]
            inner: ast.expr = node.value
            while isinstance(inner, ast.Attribute):
                names.append(inner.attr)
                inner = inner.value
            if isinstance(inner, ast.Name):
                chains.append(".".join([inner.id, *reversed(names)]))
    for chain in chains:  # "simnav.estimators.ekf.Ekf": each part but the first is taken from what is before it
        first, *names = chain.split(".")
        module = bound.get(first, "")
        if module.partition(".")[0] == "simnav":
            for name in names:
                yield module, name
                module = f"{module}.{name}"


def _texts(tree: ast.Module) -> set[str]:
    """All texts, with a star for each value: ``weights.json``, ``weights_*.json`` for ``f"weights_{kind}.json"``."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            found.add("".join(str(v.value) if isinstance(v, ast.Constant) else "*" for v in node.values))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.add(node.value)
    return found


def is_installed(path: Path) -> bool:
    """Whether a file belongs to Python or to an installed package, and not to the user's own work."""
    if {"site-packages", "dist-packages"} & set(path.parts):
        return True
    return any(path.is_relative_to(folder) for folder in _installation())


@lru_cache(maxsize=1)
def _installation() -> tuple[Path, ...]:
    wanted = ("stdlib", "platstdlib", "purelib", "platlib")
    return tuple({Path(sysconfig.get_path(name)).resolve() for name in wanted})


# --- following imports --------------------------------------------------------------------------------


def followed(
    modules: Iterable[str] = (), files: Iterable[Path] = (), *, without: Collection[str] = ()
) -> dict[str, str]:
    """Modules and files, and all that they import: name -> digest of the code.

    Parameters
    ----------
    modules : iterable of str
        Absolute names of modules of simnav.
    files : iterable of Path
        Python files of others; what they import of the user's own files counts, too.
    without : collection of str
        Packages of simnav that are not followed.

    Returns
    -------
    dict of str to str
        In the order of the names. A module of simnav goes by its absolute name, any other file by its path relative
        to the folder of the file that brought it, so that a folder may be moved.
    """
    walk = _Walk((_ABOVE, *without))
    for module in modules:
        walk.module(module)
    for path in files:
        walk.file(path, path.parent)
    walk.run()
    return dict(sorted(walk.found.items()))


def code_digest(code: Mapping[str, str]) -> str:
    """Digest of all that `followed` gave."""
    return digest(*(part for item in code.items() for part in item))


class _Walk:
    """Modules that were found, and those whose imports are still to be followed."""

    def __init__(self, without: Iterable[str]) -> None:
        self.without = tuple(without)
        self.found: dict[str, str] = {}
        self.todo: list[tuple[Code, Path | None, Path]] = []  # code, folder of a file of others, its own folder
        self.taken: set[tuple[str, str]] = set()

    def module(self, name: str) -> bool:
        """Take a module of simnav; returns whether there is such a module."""
        place = _place(name)
        if place is None or any(name == package or name.startswith(f"{package}.") for package in self.without):
            return False
        if name not in self.found:
            package = name if place.name == "__init__.py" else name.rpartition(".")[0]
            self._add(name, place, package, None)
        return True

    def file(self, path: Path, start: Path) -> None:
        """Take a file of others; ``start`` is the folder that its name is relative to."""
        name = f"file {Path(os.path.relpath(path, start)).as_posix()}"
        if name not in self.found:
            try:
                self._add(name, path, "", start)
            except OSError:
                self.found[name] = "absent"

    def _add(self, name: str, path: Path, package: str, start: Path | None) -> None:
        code = code_of(path, package)
        folders = [path.parent]
        if start is not None:  # of others, who keep their data where they like
            folders += [place for text in code.folders if (place := path.parent / text).is_dir()]
        beside = sorted({p for place in folders for pattern in code.data for p in place.glob(pattern) if p.is_file()})
        self.found[name] = digest(code.digest, files_digest((p.name, p) for p in beside)) if beside else code.digest
        self.todo.append((code, start, path.parent))

    def run(self) -> None:
        while self.todo:
            code, start, folder = self.todo.pop()
            for module, name in code.imports:
                if module == "simnav" or module.startswith("simnav."):
                    self.take(module, name)
                elif start is not None:
                    self.others(module or name, start, folder)
            if start is not None:
                for text in code.named:
                    self.others(text, start, folder)

    def take(self, module: str, name: str) -> None:
        """Take what ``from module import name`` needs, or ``import module`` where the name is empty."""
        if (module, name) in self.taken:
            return
        self.taken.add((module, name))
        if name and self.module(f"{module}.{name}"):
            return
        place = _place(module)
        if name and place is not None and place.name == "__init__.py":
            origin = code_of(place, module).origins.get(name)
            if origin is not None and origin != (module, name) and origin[0].partition(".")[0] == "simnav":
                self.take(*origin)
                return
        if module != "simnav":  # whose own code only says where its names are
            self.module(module)

    def others(self, name: str, start: Path, folder: Path) -> None:
        """Take a module that a file of others imports, if it is one of the user's own."""
        if not self.beside(name.partition(".")[0], start, folder) and "*" not in name:
            file = getattr(sys.modules.get(name), "__file__", None)
            path = None if file is None else Path(file).resolve()
            if path is not None and path.suffix == ".py" and path.is_file() and not is_installed(path):
                self.file(path, start)

    def beside(self, name: str, start: Path, folder: Path) -> bool:
        """Take a module or a package that is beside a file of others; returns whether there is one."""
        found: list[Path] = []
        for place in {start, folder}:
            modules = [p for p in place.glob(f"{name}.py") if p.is_file()]
            packages = place.glob(name) if name and not modules else []  # with or without an __init__.py
            found += modules + [p for package in packages if package.is_dir() for p in package.rglob("*.py")]
        for path in sorted(set(found)):
            self.file(path, start)
        return bool(found)


def _place(module: str) -> Path | None:
    """The file of a module of simnav; None where there is none."""
    first, *parts = module.split(".")
    if first != "simnav":
        return None
    path = LIBRARY.joinpath(*parts)
    if (path / "__init__.py").is_file():
        return path / "__init__.py"
    path = path.with_name(f"{path.name}.py")
    return path if parts and path.is_file() else None
