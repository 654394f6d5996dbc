"""Digests of code, without comments and docstrings: of all of simnav that can decide a number, and of the user's files.

Of simnav whole folders count, so that no edit is missed; a campaign takes minutes to run again. A file of the user
brings the other files of the user that it imports: those beside it, and those that this process has imported from
elsewhere. What is installed is not followed.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import inspect
import json
import os
import re
import sys
import sysconfig
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from simnav.leaderboard.results.user_cache import keep, user_cache
from simnav.plugins import code_text

__all__ = [
    "LIBRARY",
    "code_of",
    "digest",
    "files_digest",
    "folder_code",
    "followed",
    "is_installed",
    "kernel_modules",
]

#: Folder of the library. The estimators and scenarios are in it, by symbolic links; so is the leaderboard.
LIBRARY = Path(sys.modules["simnav"].__file__ or "").parent


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


def folder_code(folder: Path, without: Collection[str] = ()) -> str:
    """Digest of the code in a folder, and of the data that it reads; scenarios and templates are not in it.

    Parameters
    ----------
    folder : Path
        The folder, with all folders in it.
    without : collection of str
        Names of its own files and folders that do not count.
    """
    found = []
    for place, folders, names in os.walk(folder, followlinks=True):
        if Path(place) == folder:
            folders[:] = [name for name in folders if name not in without]
            names = [name for name in names if name not in without]
        folders[:] = [name for name in folders if name != "__pycache__" and not name.startswith(".")]
        found += [Path(place, name) for name in names if not name.startswith(".")]
    parts = []
    for path in sorted(found):
        if path.suffix == ".py":
            parts += [path.relative_to(folder).as_posix(), code_of(path).digest]
        elif path.suffix in (".json", ".npz"):
            parts.append(files_digest([(path.relative_to(folder).as_posix(), path)]))
    _keep_known()
    return digest(*parts)


@dataclass(frozen=True)
class Code:
    """What a Python file says, as far as numbers depend on it.

    Attributes
    ----------
    digest : str
        Of its syntax tree, without docstrings and positions. Of a file that is no Python: of its bytes.
    imports : tuple of str
        Names of the modules that it imports anywhere; of ``from . import name`` the name, and of ``from simnav import
        name`` ``simnav.name``. Imports for type checking only are left out.
    data : tuple of str
        Patterns of the names of files that texts in it name, like ``weights_*.json`` for ``f"weights_{kind}.json"``.
    named : tuple of str
        Patterns of names of modules in its texts, like ``methods.*`` for ``f"methods.{kind}"``, where it uses
        `importlib` or ``__import__``.
    folders : tuple of str
        Texts in it that could name a folder.
    """

    digest: str
    imports: tuple[str, ...] = ()
    data: tuple[str, ...] = ()
    named: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()


def code_of(path: Path) -> Code:
    """What a file says.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    status = path.stat()
    return _code_of(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=4096)
def _code_of(path: Path, modified: int, size: int) -> Code:
    source = path.read_bytes()
    ours = path.is_relative_to(LIBRARY)  # it is not followed
    content = hashlib.blake2b(source, digest_size=16).hexdigest()
    if ours and content in _known():
        return Code(_known()[content])
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return Code(content)
    text = code_text(tree)
    found = hashlib.blake2b(text.encode(errors="surrogatepass"), digest_size=16).hexdigest()
    if ours:
        _known()[content] = found
        _new.add(content)
        return Code(found)
    imports, texts = tuple(dict.fromkeys(_imports(tree))), _texts(tree)
    by_text = any(module.partition(".")[0] == "importlib" for module in imports) or any(
        isinstance(node, ast.Name) and node.id == "__import__" for node in ast.walk(tree)
    )
    return Code(
        found,
        imports,
        tuple(sorted(t for t in texts if re.fullmatch(_FILE, t) and not t.startswith("*."))),
        tuple(sorted(t.lstrip(".") for t in texts if by_text and re.fullmatch(_MODULE, t))),
        tuple(sorted(t for t in texts if re.fullmatch(_FOLDER, t))),
    )


#: Digests of the code of files of simnav that are kept from one process to the next.
_MOST_KNOWN = 10_000
_new: set[str] = set()  # of these, what is not kept yet


@lru_cache(maxsize=1)
def _known_file() -> Path:
    """Where they are kept: by the version of Python, and by how they are made."""
    how = digest(sys.version, inspect.getsource(code_text))
    return user_cache() / f"code-{how}.json"


@lru_cache(maxsize=1)
def _known() -> dict[str, str]:
    """Digest of the code for the digest of the bytes of a file; to parse all of simnav takes two seconds."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        found = json.loads(_known_file().read_bytes())
        if isinstance(found, dict) and all(isinstance(v, str) and len(v) == 32 for v in found.values()):
            return found
    return {}


def _keep_known() -> None:
    """Keep what is new."""
    if _new:
        _new.clear()
        keep(_known_file(), json.dumps(dict(list(_known().items())[-_MOST_KNOWN:])))


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


def _imports(tree: ast.Module) -> Iterator[str]:
    """The modules that a file imports, anywhere in it."""
    for node in _running(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.module == "simnav":
                yield from (f"simnav.{alias.name}" for alias in node.names)
            else:
                yield from [node.module] if node.module else [alias.name for alias in node.names]


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


def followed(files: Iterable[Path]) -> dict[str, str]:
    """Files of the user, and all files of the user's own that they import: path -> digest of the code.

    The paths are relative to the folder of the file that brought them, so that a folder may be moved. They are in the
    order of the paths.
    """
    walk = _Walk()
    for path in files:
        walk.file(path, path.parent)
    walk.run()
    return dict(sorted(walk.found.items()))


#: Of simnav: what has no kernels. And modules of others that do not import simnav.
_WITHOUT_KERNELS = {"simnav.types"} | {
    f"simnav.{name}" for name in ("Estimate", "Estimator", "Instruments", "InitialState", "Measurements", "register")
}
_ALSO_WITHOUT = {*sys.stdlib_module_names, "numpy", "scipy", "filterpy"} - {"importlib", "runpy"}


def kernel_modules(file: str) -> list[str]:
    """Modules of simnav whose kernels an estimator may call: those that its files import.

    Parameters
    ----------
    file : str
        The file of the estimator; empty for one that is not in a file.

    Returns
    -------
    list of str
        ``simnav`` alone where that is not known; empty if its files import only what surely has no kernels.
    """
    if not file:
        return ["simnav"]
    walk = _Walk()
    walk.file(Path(file), Path(file).parent)
    walk.run()
    found = {m for m in walk.foreign if m not in _WITHOUT_KERNELS and m.partition(".")[0] not in _ALSO_WITHOUT}
    return sorted(found) if all(m.startswith("simnav.") for m in found) else ["simnav"]


class _Walk:
    """Files that were found, and those whose imports are still to be followed."""

    def __init__(self) -> None:
        self.foreign: set[str] = set()  # modules that are not files of the user
        self.found: dict[str, str] = {}
        self.todo: list[tuple[Code, Path, Path]] = []  # code, folder that its name is relative to, its own folder

    def file(self, path: Path, start: Path) -> None:
        """Take a file; ``start`` is the folder that its name is relative to."""
        name = Path(os.path.relpath(path, start)).as_posix()
        if name in self.found:
            return
        try:
            code = code_of(path)
        except OSError:
            self.found[name] = "absent"
            return
        folders = [path.parent, *(place for text in code.folders if (place := path.parent / text).is_dir())]
        beside = sorted({p for place in folders for pattern in code.data for p in place.glob(pattern) if p.is_file()})
        self.found[name] = digest(code.digest, files_digest((p.name, p) for p in beside)) if beside else code.digest
        self.todo.append((code, start, path.parent))

    def run(self) -> None:
        while self.todo:
            code, start, folder = self.todo.pop()
            for module in (*code.imports, *code.named):
                if module.partition(".")[0] == "simnav" or not self.take(module, start, folder):
                    self.foreign.add(module)

    def take(self, name: str, start: Path, folder: Path) -> bool:
        """Take a module that a file imports, if it is one of the user's own; returns whether it is."""
        if self.beside(name.partition(".")[0], start, folder):
            return True
        if "*" not in name:
            file = getattr(sys.modules.get(name), "__file__", None)
            path = None if file is None else Path(file).resolve()
            if path is not None and path.suffix == ".py" and path.is_file() and not is_installed(path):
                self.file(path, start)
                return True
        return False

    def beside(self, name: str, start: Path, folder: Path) -> bool:
        """Take a module or a package that is beside a file; returns whether there is one."""
        found: list[Path] = []
        for place in {start, folder}:
            modules = [p for p in place.glob(f"{name}.py") if p.is_file()]
            packages = place.glob(name) if name and not modules else []  # with or without an __init__.py
            found += modules + [p for package in packages if package.is_dir() for p in package.rglob("*.py")]
        for path in sorted(set(found)):
            self.file(path, start)
        return bool(found)
