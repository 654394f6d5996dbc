"""The files of scenarios outside the catalogue, in the folder of the results that were made on them.

With them a board knows the tracks of such scenarios, and a colleague can repeat the runs without asking for the file. A
file that came with the results of others is read only as data: a scenario that names plug-ins, a log or another file is
not loaded, because it would run code or read files of somebody else's choice.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from simnav.scenario import Scenario, headers, parse
from simnav.scenario.writing import toml_text
from simnav.spec import SpecError

from .admission import is_scenario_id
from .errors import RequestError
from .files import write_whole

__all__ = ["FOLDER", "add", "copy", "load", "tracks"]

#: Name of the folder in a folder of results.
FOLDER = "scenarios"
#: The largest file that is read [bytes].
_MOST = 1 << 20
#: Keys whose texts are for readers.
_PROSE = frozenset({"name", "title", "description", "source", "track", "group", "tags"})
#: A text with a slash or an ending, as names of files have; keys whose texts are names of files in any case.
_FILE, _FILES = re.compile(r"[/\\]|\.[A-Za-z][A-Za-z0-9]{0,7}$"), frozenset({"file", "files", "folder", "navigation"})


def add(folder: str | os.PathLike[str], scenarios: Iterable[Scenario]) -> None:
    """Write the files of those scenarios that are not in the catalogue."""
    known = {header.id for header in headers()}
    for scenario in scenarios:
        if scenario.id not in known:
            place = Path(folder) / FOLDER
            place.mkdir(exist_ok=True)
            write_whole(place / f"{scenario.id}.toml", toml_text(scenario.to_toml()))


def copy(folder: str | os.PathLike[str], sources: Iterable[str | os.PathLike[str]]) -> None:
    """Put the files of several folders into one; the first file of a scenario stays."""
    place = Path(folder) / FOLDER
    for source in sources:
        for path in _files(source):
            place.mkdir(exist_ok=True)
            if not (place / path.name).exists():
                write_whole(place / path.name, path.read_text(encoding="utf-8"))


def tracks(folder: str | os.PathLike[str]) -> dict[str, str]:
    """The track of each scenario that has a file, by versioned id. A file that cannot be read is left out."""
    found = {}
    for path in _files(folder):
        track = _table(path).get("track")
        if isinstance(track, str):
            found[path.stem] = track
    return found


def load(folder: str | os.PathLike[str], identity: str) -> Scenario | None:
    """The scenario of a folder of results with this versioned id; None if the folder has no file of it.

    Raises
    ------
    RequestError
        If the file is not valid, holds another scenario, or names a file or a plug-in: one sentence.
    """
    path = next((p for p in _files(folder) if p.stem == identity), None)
    if path is None:
        return None
    where = f"{path} came with the results"
    table = _table(path)
    if "plugins" in table or "log" in table or (named := _named_file(table)):
        what = "plug-ins" if "plugins" in table else "a log" if "log" in table else f"the file {named!r:.80}"
        raise RequestError(f"{where} and names {what}; read it, and give it with --scenario")
    try:
        scenario = parse(path.read_text(encoding="utf-8"), source=str(path))
    except (SpecError, OSError, ValueError, RecursionError) as error:
        raise RequestError(f"{where} and cannot be used: {error}") from None
    if scenario.id != identity:
        raise RequestError(f"{where} and holds {scenario.id}, not {identity}")
    return scenario


def _files(folder: str | os.PathLike[str]) -> list[Path]:
    """The files in the folder of scenarios: with names of scenarios, of a reasonable size, and no links."""
    try:
        return sorted(
            path
            for path in (Path(folder) / FOLDER).glob("*.toml")
            if is_scenario_id(path.stem) and path.is_file() and not path.is_symlink() and path.stat().st_size <= _MOST
        )
    except OSError:
        return []


def _table(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}


def _named_file(value: Any, key: str = "") -> str:
    """A text in a table that may be the name of a file; empty if there is none."""
    if isinstance(value, str):
        return value if key in _FILES or _FILE.search(value) else ""
    if isinstance(value, Mapping):
        return next(filter(None, (_named_file(v, str(k)) for k, v in value.items() if k not in _PROSE)), "")
    if isinstance(value, list):
        return next(filter(None, (_named_file(v, key) for v in value)), "")
    return ""
