"""Digests of all that decides a result of a local campaign: scenario, data, simulator, estimator.

A result's key is ``VARIANT-SEED``. The variant hashes the recording's digest (scenario, log files, the code of the
simulator) and the estimator's (name, label, parameters, the files that they name, code). The digests are coarse: all
code of simnav that can decide a number counts, but no comment and no docstring. Of the user's own files those count
that `simnav.leaderboard.campaign.sources` finds by following imports. The scores are not in the key: each result says
with which code it was scored. The versions of the numerical libraries and the kind of the processor are in its
provenance, which a campaign compares.

What ships with simnav is known by declared versions instead (`simnav.leaderboard.results.versions`).
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any

from simnav.estimator.parameters import parameters_of
from simnav.log import channel

from . import sources
from .session_class import is_session, source_of
from .sources import digest, files_digest, folder_code, followed, is_installed

if TYPE_CHECKING:
    from simnav.estimator import Estimator
    from simnav.scenario import Scenario

__all__ = [
    "digest",
    "estimator_source",
    "has_recordings",
    "named_files",
    "own_code",
    "recording_digest",
    "simulator_version",
    "variant",
    "with_library",
]

#: Of simnav, what decides no recording and no estimate. What a scenario says is in the scenario's own digest.
_NEVER = ("leaderboard", "scenarios", "scoring", "testing", "__init__.py", "__main__.py", "warmup.py")
#: What decides no recording: that of the estimators, and what shows a run to them.
_ESTIMATION = ("estimator", "estimators", "trial", "environment")
#: What reads the files of real voyages. It decides the recordings of recorded scenarios, and of no other.
_LOGS = "log"

_ABSENT = "absent"


def _files_code(files: Iterable[Path]) -> str:
    """Digest of files of the user, and of the user's own files that they import."""
    return digest(*(part for item in followed(files).items() for part in item))


def _package_code(folder: Path) -> str:
    """Digest of all files of a package, but for what Python makes of them."""
    found = []
    for place, folders, names in os.walk(folder):
        folders[:] = [f for f in folders if f != "__pycache__" and not f.startswith(".")]
        found += [Path(place, n) for n in names if not n.startswith(".") and not n.endswith((".pyc", "~"))]
    return files_digest(sorted((p.relative_to(folder).as_posix(), p) for p in found))


def _installed_code(package: str) -> str:
    """Digest of an importable package or module, by its top-level name."""
    module = sys.modules.get(package)
    origin = getattr(module, "__file__", None)
    if origin is None:
        spec = importlib.util.find_spec(package)
        origin = None if spec is None else spec.origin
    if origin is None:
        return digest(package, "no file")
    path = Path(origin)
    return _package_code(path.parent) if path.name == "__init__.py" else _files_code([path])


def simulator_version() -> str:
    """Version of simnav with a digest of the code that makes recordings; what reads log files is not in it."""
    return f"{version('simnav')}+{folder_code(sources.LIBRARY, (*_NEVER, *_ESTIMATION, _LOGS))[:12]}"


def recording_digest(scenario: Scenario, simulator: str) -> str:
    """Digest of all that decides the recordings of a scenario, but the seed.

    Of a recorded scenario the log files and the code that reads them count, too; of instruments and faults of others,
    what their code imports.

    Parameters
    ----------
    scenario : Scenario
        The scenario of the recording.
    simulator : str
        As from `simulator_version`; of it only the digest of the code counts, not the number of the version.
    """
    code = simulator.rpartition("+")[2]
    return digest(scenario.id, scenario.content_hash(), code, _log_digest(scenario), *_plugin_digests(scenario))


def _plugin_digests(scenario: Scenario) -> list[str]:
    """Digests of the code of instruments and faults that do not come with simnav; none where all do."""
    found = []
    for module in sorted({type(spec).__module__ for spec in (*scenario.instruments.values(), *scenario.faults)}):
        file = getattr(sys.modules.get(module), "__file__", None)
        if _in_simnav(module) or file is None:  # of a session there is no file
            continue
        path = Path(file).resolve()
        if is_installed(path):
            found.append(_installed_code(module.partition(".")[0]))
        else:
            found.append(_files_code([path]))
    return found


def _log_digest(scenario: Scenario) -> str:
    if scenario.log is None:
        return ""
    files = []
    try:
        for recording in channel.list_recordings(scenario.log):
            for file in scenario.log.files.values():
                path = channel.locate(scenario.log, file, recording)
                files.append((f"{recording}/{file.path}", path))
    except (ValueError, OSError):  # every run says so
        return _ABSENT
    return digest(files_digest(files), folder_code(sources.LIBRARY / _LOGS))


def has_recordings(scenario: Scenario) -> bool:
    """Whether the files of a recorded scenario are on this machine; True for one that is simulated."""
    return _log_digest(scenario) != _ABSENT


def estimator_source(cls: type[Estimator]) -> str:
    """Digest of the code of an estimator, and of all code of simnav that could decide what it estimates."""
    return with_library(own_code(cls))


def with_library(own: str) -> str:
    """Digest of the user's own code of an estimator (`own_code`), together with that of simnav.

    They are apart because the process that imports a file of the user should not read all of simnav.
    """
    return digest(folder_code(sources.LIBRARY, _NEVER), own)


def own_code(cls: type[Estimator]) -> str:
    """Digest of the user's own code of an estimator; the same for all that come with simnav.

    Of a class in a file: its file, those of its bases and of the pieces that it is made of, and the files beside them
    that these import. Of a class in an installed package: all files of the package. Of a class in a session: its text,
    what it uses of the session, and the files of the user's own that it uses. The content of a file that a default of
    its parameters names counts, too.
    """
    parts = list[str]()
    for module in dict.fromkeys(_homes(cls)):
        package = module.partition(".")[0]
        if _in_simnav(module) or package in sys.stdlib_module_names or package == "numpy":
            continue
        if is_session(module) and not module.startswith("simnav_file_"):
            continue  # below
        loaded = sys.modules.get(module)
        file = getattr(loaded, "__file__", None)
        if file is not None and "." not in module and not hasattr(loaded, "__path__"):
            parts.append(_files_code([Path(file).resolve()]))
        elif module in {base.__module__ for base in cls.__mro__}:
            parts.append(_installed_code(package))
    for base in cls.__mro__:
        if is_session(base.__module__) and not base.__module__.startswith("simnav_file_"):
            text, modules = source_of(base)
            parts += [digest(text), *filter(None, map(_used_digest, modules))]
    parts += [content for _, content in named_files(p.default for p in parameters_of(cls))]
    return digest(*dict.fromkeys(parts))


def _homes(item: Any, depth: int = 3) -> Iterator[str]:
    """Names of the modules that hold a class, its bases, and what their attributes are made of."""
    if isinstance(item, type):
        for base in item.__mro__:
            yield base.__module__
            if depth and base.__module__.partition(".")[0] not in sys.stdlib_module_names:
                for value in vars(base).values():
                    yield from _homes(value, depth - 1)
    elif isinstance(item, (FunctionType, staticmethod, classmethod)):
        module = getattr(item, "__module__", None)
        if module:  # functions that the interpreter makes have none
            yield module
    elif isinstance(item, partial):
        yield from _homes((item.func, item.args, item.keywords), depth)
    elif isinstance(item, (tuple, list, set, frozenset)):
        for value in item:
            yield from _homes(value, depth)
    elif isinstance(item, Mapping):
        for value in item.values():
            yield from _homes(value, depth)
    elif is_dataclass(item) and depth:
        yield type(item).__module__
        for entry in fields(item):
            yield from _homes(getattr(item, entry.name, None), depth - 1)
    elif _in_simnav(type(item).__module__):
        yield type(item).__module__


def _used_digest(module: str) -> str:
    """Digest of a file of the user's own that a class of a session uses; empty for what is installed or of simnav."""
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or _in_simnav(module):
        return ""
    path = Path(file).resolve()
    return "" if is_installed(path) else _files_code([path])


def _in_simnav(module: str) -> bool:
    return module == "simnav" or module.startswith("simnav.")


def named_files(values: Iterable[Any]) -> list[tuple[str, str]]:
    """The files among the values of parameters, and what is in them.

    Parameters
    ----------
    values : iterable
        A text or a path that names an existing file counts, also inside a list, a tuple or a mapping.

    Returns
    -------
    list of (str, str)
        What named the file, and the digest of its content.
    """
    found = []
    for value in values:
        if isinstance(value, (str, os.PathLike)):
            try:
                path = Path(value).expanduser()
                there = path.is_file()
            except (OSError, ValueError, RuntimeError, TypeError):  # too long for a path, a zero byte, bytes
                continue
            if there:
                found.append((str(value), files_digest([("", path)])))
        elif isinstance(value, Mapping):
            found += named_files(value.values())
        elif isinstance(value, (list, tuple)):
            found += named_files(value)
    return found


def variant(recording: str, label: str, name: str, parameters: Mapping[str, Any], source: str) -> str:
    """Digest of all that decides the results of an estimator on a scenario, but the seed.

    Parameters
    ----------
    recording : str
        Digest of the recording, from `recording_digest`.
    label, name : str
        Label and name of the estimator.
    parameters : mapping
        That were set. Where one names a file, its content counts.
    source : str
        Digest of the source, from `estimator_source`.
    """
    values = json.dumps(dict(parameters), sort_keys=True, default=str)
    files = [text for pair in named_files(parameters.values()) for text in pair]
    return digest(recording, label, name, values, source, *files)
