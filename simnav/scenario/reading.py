"""Scenarios from TOML: from a text, from a file, or by name from the catalogue."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from simnav.log.spec import TO_FILL_IN
from simnav.plugins import PluginError, Registry, load_plugin
from simnav.scenario.catalogue import OWN_FOLDER, Header, headers
from simnav.scenario.replay import read_logs_by
from simnav.scenario.scenario import Scenario
from simnav.spec import SpecError, closest
from simnav.world import SURROUNDINGS, VESSELS

__all__ = ["load", "names", "parse"]

#: What the lines look like that the parser of TOML cannot read.
_LONG_NUMBER, _NESTED = r"[0-9_]{4000}", r"(?:[\[{][^\[{]{0,20}){40}"


def parse(text: str, *, source: str = "<toml>", folder: Path | None = None, tried: bool = False) -> Scenario:
    """Read a scenario from the text of a TOML file; load the plug-ins that it names.

    Parameters
    ----------
    text : str
        The whole text of the file.
    source : str
        Name of the text in messages.
    folder : Path, optional
        Folder to which the paths of plug-in files are relative; by default the working directory.
    tried : bool
        The text is known to be valid at the ends of its ranges, so that they are not tried again.

    Raises
    ------
    SpecError
        If the scenario is not valid: one sentence that names source, key and value, and what would be right.
    """
    try:
        table: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SpecError(f"{source}: not valid TOML: {error}") from None
    except ValueError:
        raise SpecError(f"{source}: {_key_of(text, _LONG_NUMBER)}: a number has more digits than can be read") from None
    except RecursionError:
        raise SpecError(f"{source}: {_key_of(text, _NESTED)}: lists or tables are nested too deeply") from None
    _refuse_incomplete(text, source)
    if "plugins" in table:
        table["plugins"] = _load_plugins(table["plugins"], source, folder or Path.cwd())
    if isinstance(table.get("vessel"), dict):
        table["vessel"] = _with_whole_paths(table["vessel"], VESSELS, folder or Path.cwd())
    if isinstance(table.get("surroundings"), dict):
        table["surroundings"] = {
            name: _with_whole_paths(part, SURROUNDINGS, folder or Path.cwd(), name) if isinstance(part, dict) else part
            for name, part in table["surroundings"].items()
        }
    try:
        return Scenario.from_toml(table, source=source, tried=tried)
    except RecursionError:
        raise SpecError(f"{source}: {_key_of(text, _NESTED)}: lists or tables are nested too deeply") from None


def _refuse_incomplete(text: str, source: str) -> None:
    """Raise a `SpecError` for the first line of a draft that its user has not filled in."""
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        table = line.strip() if line.startswith("[") else table
        line, _, what = line.partition("#")
        if TO_FILL_IN in line:
            key = line.partition("=")[0].strip()
            raise SpecError(f"{source}, line {number}: fill in {key!r} of {table}: {what.strip()}")


def _key_of(text: str, value: str) -> str:
    """The key of the first line that holds a value of a certain form."""
    for number, line in enumerate(text.splitlines(), 1):
        if re.search(value, line):
            key = line.partition("=")[0].strip() if "=" in line else ""
            return f"line {number}, {key[:60]}" if key else f"line {number}"
    return "its values"


def _load_plugins(names: Any, source: str, folder: Path) -> list[str]:
    """Load plug-in files; their absolute paths."""
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise SpecError(f"{source}: plugins = {names!r} should be a list of Python files, like ['beacon.py']")
    paths = [str((folder / Path(name).expanduser()).resolve()) for name in names]
    for name, path in zip(names, paths, strict=True):
        try:
            load_plugin(path)
        except PluginError as error:
            raise SpecError(f"{source}: plugins = {name!r}: {error}") from None
    return paths


def _with_whole_paths(
    table: dict[str, Any], kinds: Registry[Any], folder: Path, kind: str | None = None
) -> dict[str, Any]:
    """The table of a vessel or of a part of the surroundings, with the whole paths of the files that it names.

    A part of the surroundings without a ``kind`` has that of its name.
    """
    kind = table.get("kind", kind)
    cls = kinds.get(kind) if isinstance(kind, str) else None
    given = {k: table[k] for k in (() if cls is None else cls.files) if isinstance(table.get(k), str) and table[k]}
    return {**table, **{key: str((folder / Path(name).expanduser()).resolve()) for key, name in given.items()}}


def names() -> list[str]:
    """Names of all scenarios of the installed packs, sorted, without versions."""
    return sorted({h.name for h in headers()})


def load(name_or_path: str | Path) -> Scenario:
    """Find and read a scenario.

    Parameters
    ----------
    name_or_path : str or Path
        ``"coastal-voyage"`` (the newest version), ``"coastal-voyage-v1"``, or the path of a TOML file. A text is a path
        if it ends in ``.toml`` or contains a slash.

    Raises
    ------
    SpecError
        If there is no such scenario or file, or it is not valid: one sentence.
    """
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise SpecError(f"{name_or_path!r} is not a scenario; a name or the path of a TOML file is wanted")
    text = os.fspath(name_or_path)
    if isinstance(name_or_path, Path) or text.endswith(".toml") or "/" in text or os.sep in text:
        return _read(Path(text))
    path = _find(text).path
    return _read(path, tried=path.is_relative_to(OWN_FOLDER))  # a test tries simnav's own at their ends


def _find(name: str) -> Header:
    available = headers()
    by_id = {h.id: h for h in available}
    if name in by_id:
        return by_id[name]
    versions = [h for h in available if h.name == name]
    if versions:
        return versions[-1]
    stem = re.sub(r"-v\d+$", "", name)
    others = [h.id for h in available if h.name == stem]
    if others:
        raise SpecError(f"there is no scenario {name!r}; there is {' and '.join(others)}")
    raise SpecError(f"there is no scenario {name!r}{closest(stem, _unique(h.name for h in available))}")


def _unique(items: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(items))


def _read(path: Path, *, tried: bool = False) -> Scenario:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        near = closest(path.stem, names()) if path.parent == Path() else ""
        raise SpecError(f"{path}: no such file{near.replace('did you mean', 'did you mean the scenario')}") from None
    except UnicodeDecodeError:
        raise SpecError(f"{path}: not a TOML file, for it is not UTF-8 text") from None
    except OSError as error:
        raise SpecError(f"{path}: cannot be read: {error.strerror}") from None
    return parse(text, source=str(path), folder=path.parent, tried=tried)


read_logs_by(load)
