"""Digests of all that decides a result: scenario, data, simulator, estimator. Nothing else counts.

A result's key is ``VARIANT-SEED``. The variant hashes the recording's digest (scenario, log files, the code of the
simulator) and the estimator's (name, label, parameters, the files that they name, code). Code is what
`simnav.leaderboard.campaign.sources` finds by following imports; comments and docstrings are not in it. The scores are
not in the key: each result says with which code it was scored.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.session_class import is_session, source_of
from simnav.leaderboard.campaign.sources import code_digest, digest, files_digest, followed, is_installed

if TYPE_CHECKING:
    from simnav.estimator import Estimator
    from simnav.scenario import Scenario

__all__ = [
    "digest",
    "estimator_source",
    "has_recordings",
    "named_files",
    "recording_digest",
    "simulator_version",
    "variant",
]

#: What makes recordings, and what runs an estimator over them: the imports are followed from here.
SIMULATOR = ("simnav.source", "simnav.simulation.simulator", "simnav.sensors")
RUNNER = ("simnav.trial",)

#: What reads the files of real voyages. It decides the recordings of recorded scenarios, and of no other.
_LOGS = "simnav.log"

_ABSENT = "absent"


def _package_code(folder: Path) -> str:
    """Digest of all files of a package, but for what Python makes of them, and of what it imports of simnav."""
    found = []
    for place, folders, names in os.walk(folder):
        folders[:] = [f for f in folders if f != "__pycache__" and not f.startswith(".")]
        found += [Path(place, n) for n in names if not n.startswith(".") and not n.endswith((".pyc", "~"))]
    files = files_digest(sorted((p.relative_to(folder).as_posix(), p) for p in found))
    code = followed(files=sorted(p for p in found if p.suffix == ".py"))
    return digest(files, code_digest({name: c for name, c in code.items() if _in_simnav(name)}))


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
    return _package_code(path.parent) if path.name == "__init__.py" else code_digest(followed(files=[path]))


def simulator_version() -> str:
    """Version of simnav with a digest of the code that makes recordings; what reads log files is not in it."""
    from importlib.metadata import version

    return f"{version('simnav')}+{code_digest(followed(SIMULATOR, without=[_LOGS]))[:12]}"


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
            found.append(code_digest(followed(files=[path], without=[_LOGS, "simnav.estimators"])))
    return found


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
    except (ValueError, OSError):  # every run says so
        return _ABSENT
    return digest(files_digest(files), code_digest(followed([f"{_LOGS}.source"])))


def has_recordings(scenario: Scenario) -> bool:
    """Whether the files of a recorded scenario are on this machine; True for one that is simulated."""
    return _log_digest(scenario) != _ABSENT


def estimator_source(cls: type[Estimator]) -> str:
    """Digest of the code of an estimator, and of what runs it.

    Of a class of simnav: its module, those of its bases and of the pieces that it is made of, and what these import.
    Of a class in a file: likewise, with the files beside it that it imports. Of a class in an installed package: all
    files of the package, and what it imports of simnav. Of a class in a session: its text, what it uses of the
    session, and the files of the user's own that it uses. The content of a file that a default of its parameters names
    counts, too.
    """
    from simnav.estimator.parameters import parameters_of

    parts, ours = list[str](), set(RUNNER)
    for module in dict.fromkeys(_homes(cls)):
        if _in_simnav(module):
            ours.add(module)
            continue
        package = module.partition(".")[0]
        if is_session(module) and not module.startswith("simnav_file_"):
            continue  # below
        if package in sys.stdlib_module_names or package == "numpy":
            continue
        loaded = sys.modules.get(module)
        file = getattr(loaded, "__file__", None)
        if file is not None and "." not in module and not hasattr(loaded, "__path__"):
            parts.append(code_digest(followed(files=[Path(file).resolve()])))
        elif module in {base.__module__ for base in cls.__mro__}:
            parts.append(_installed_code(package))
    for base in cls.__mro__:
        if is_session(base.__module__) and not base.__module__.startswith("simnav_file_"):
            text, modules = source_of(base)
            parts += [digest(text), *filter(None, map(_used_digest, modules))]
            ours.update(filter(_in_simnav, modules))
    parts += [content for _, content in named_files(p.default for p in parameters_of(cls))]
    return digest(code_digest(followed(sorted(ours))), *dict.fromkeys(parts))


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
    return "" if is_installed(path) else code_digest(followed(files=[path]))


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
