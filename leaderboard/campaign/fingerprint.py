"""Digests of all that decides a result: scenario, data, simulator, estimator.

A result's key is ``VARIANT-SEED``. The variant hashes the recording's digest (scenario, log files,
sources of simnav) and the estimator's (name, label, parameters, sources).
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import inspect
import json
import os
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import simnav
from simnav.leaderboard.campaign.session_class import is_session, source_of

if TYPE_CHECKING:
    from simnav.estimator import Estimator
    from simnav.scenario import Scenario

__all__ = ["digest", "estimator_source", "recording_digest", "simulator_version", "variant"]


#: The library, and the folders in it that are packages of the floors above: they do not decide a recording.
LIBRARY = Path(simnav.__file__).parent
UPPER_FLOORS = ("estimators", "scenarios", "leaderboard")

OUR_ESTIMATORS = "simnav.estimators"


def digest(*parts: str) -> str:
    """Hexadecimal digest of texts (their boundaries count)."""
    h = hashlib.blake2b(digest_size=12)
    for part in parts:
        data = part.encode(errors="surrogatepass")
        h.update(f"{len(data)}:".encode() + data)
    return h.hexdigest()


def _files_digest(files: Iterable[tuple[str, Path]]) -> str:
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


def _package_digest(folder: Path) -> str:
    """Digest of all files of a package, but for what Python makes of them; of simnav, the library alone."""
    found = []
    for place, folders, names in os.walk(folder):
        folders[:] = [f for f in folders if f != "__pycache__" and not f.startswith(".")]
        if folder == LIBRARY and place == str(folder):
            folders[:] = [f for f in folders if f not in UPPER_FLOORS]
        found += [Path(place, n) for n in names if not n.startswith(".") and not n.endswith((".pyc", "~"))]
    return _files_digest(sorted((p.relative_to(folder).as_posix(), p) for p in found))


def _installed_digest(package: str) -> str:
    """Digest of an importable package or module, by its top-level name."""
    module = sys.modules.get(package)
    origin = getattr(module, "__file__", None)
    if origin is None:
        spec = importlib.util.find_spec(package)
        origin = None if spec is None else spec.origin
    if origin is None:
        return digest(package, "no file")
    path = Path(origin)
    return _package_digest(path.parent) if path.name == "__init__.py" else _files_digest([(package, path)])


def simulator_version() -> str:
    """Version of simnav with a digest of its sources."""
    from importlib.metadata import version

    return f"{version('simnav')}+{_installed_digest('simnav')[:12]}"


def recording_digest(scenario: Scenario, simulator: str) -> str:
    """Digest of all that decides the recordings of a scenario, but the seed."""
    return digest(scenario.id, scenario.content_hash(), simulator, _log_digest(scenario))


def _log_digest(scenario: Scenario) -> str:
    if scenario.log is None:
        return ""
    from simnav.log import channel

    files = []
    try:
        for recording in channel.list_recordings(scenario.log):
            for file in scenario.log.files.values():
                path = channel.locate(scenario.log, file, recording)
                files.append((f"{recording}/{file.path}", path))
    except (ValueError, OSError):  # absent data: every run says so
        return "absent"
    return _files_digest(files)


def estimator_source(cls: type[Estimator]) -> str:
    """Digest of the sources of an estimator.

    Of a class in an installed package: all files of the package. Of a class in a file: this file and those
    beside it that it imports, directly or not. Of a class in a session: its text, what it uses of the session,
    and the files of the user's own that it uses. Base classes count likewise.
    """
    parts = []
    for base in cls.__mro__:
        if is_session(base.__module__) and not base.__module__.startswith("simnav_file_"):
            text, modules = source_of(base)
            parts += [digest(text), *filter(None, map(_used_digest, modules))]
            continue
        package = base.__module__.partition(".")[0]
        if _is_ours(base.__module__):
            package = OUR_ESTIMATORS
        elif package in sys.stdlib_module_names or package in ("simnav", "numpy"):
            continue  # the simulator's version has simnav
        module = sys.modules.get(base.__module__)
        path = Path(inspect.getfile(base)).resolve()
        if "." not in base.__module__ and not hasattr(module, "__path__") and path.name != "__init__.py":
            parts.append(_closure_digest(path))
        else:
            parts.append(_installed_digest(package))
    return digest(*dict.fromkeys(parts))  # a package counts once, however many bases it has


def _closure_digest(start: Path) -> str:
    """Digest of a file and of the files beside it that it imports; our estimators, if it builds on them."""
    folder, todo, found, ours = start.parent, [start], dict[Path, None](), False
    while todo:
        path = todo.pop()
        if path in found:
            continue
        found[path] = None
        for name in _imports(path):
            first = name.partition(".")[0]
            ours = ours or _is_ours(name)
            for place in {folder, path.parent}:
                beside = place / f"{first}.py"
                if beside.is_file():
                    todo.append(beside)
                elif (place / first / "__init__.py").is_file() and first != "simnav":
                    todo += sorted((place / first).rglob("*.py"))
    files = sorted((os.path.relpath(p, folder), p) for p in found)
    return digest(_files_digest(files), _installed_digest(OUR_ESTIMATORS) if ours else "")


def _used_digest(module: str) -> str:
    """Digest of a module that a class of a session uses; empty for one that is installed or in the simulator."""
    if _is_ours(module):
        return _installed_digest(OUR_ESTIMATORS)
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or module.partition(".")[0] == "simnav":
        return ""
    path, installed = Path(file).resolve(), map(Path, sysconfig.get_paths().values())
    return "" if any(path.is_relative_to(folder.resolve()) for folder in installed) else _closure_digest(path)


def _is_ours(module: str) -> bool:
    return module == OUR_ESTIMATORS or module.startswith(f"{OUR_ESTIMATORS}.")


def _imports(path: Path) -> Iterator[str]:
    """Names of the modules that a file imports, anywhere in it."""
    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""
            if node.module and not node.level:  # "from simnav import estimators"
                yield from (f"{node.module}.{alias.name}" for alias in node.names)
            if node.level:  # "from . import x"
                yield from (alias.name for alias in node.names)


def variant(recording: str, label: str, name: str, parameters: Mapping[str, Any], source: str) -> str:
    """Digest of all that decides the results of an estimator on a scenario, but the seed."""
    return digest(recording, label, name, json.dumps(dict(parameters), sort_keys=True, default=str), source)
