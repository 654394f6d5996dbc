"""The catalogue of scenarios: the packs in the entry-point group ``simnav.scenarios``.

A pack is an importable package with scenario files (``*.toml``, and families in ``families/*.toml``). Its scenarios are
found when it is installed. Only the heads of the files are read here, because ``import simnav`` needs them for its
Gymnasium ids. If a pack or a file has an error, a warning names it, and the others are not affected.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
import tomllib
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simnav.plugins import entry_points

__all__ = ["NAME", "OWN_FOLDER", "Header", "ScenarioWarning", "headers"]

_GROUP = "simnav.scenarios"

#: Kinds of instruments with channels, and how a scenario names one.
_WITH_CHANNELS = (
    "gnss_raw",
    "dvl_beams",
    "usbl_fix",
    "acoustic_range",
    "vessel_range",
    "altimeter",
    "multibeam_profile",
)
_ANY_OF_THEM = "|".join(_WITH_CHANNELS)
_CHANNELS = re.compile(
    rf"^(?:[^#\n]*\bkind *= *[\"'](?:{_ANY_OF_THEM})[\"']|\[instruments\.(?:{_ANY_OF_THEM})\])", re.MULTILINE
)

#: Names of scenarios: kebab-case.
NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


#: Folder of the scenarios that come with simnav.
OWN_FOLDER = (Path(__file__).parents[1] / "scenarios").resolve()

#: The heads that were read, by path, time of the last change [ns] and size of the file.
_known: dict[tuple[Path, int, int], Header] = {}


class ScenarioWarning(UserWarning):
    """A scenario pack, or a file in one, was left out; the message says which and why."""


@dataclass(frozen=True)
class Header:
    """The head of a scenario file: what a list of scenarios shows.

    Attributes
    ----------
    name : str
        Name of the scenario, in kebab-case.
    version : int
        Version; every change that alters the numbers of a run increases it.
    title : str
        One line for tables.
    duration : float
        Length of a run [s].
    tags : tuple of str
        Words by which lists are filtered; ``long`` is left out of quick campaigns.
    track, group : str
        Scenarios of one track are ranked together; scenarios of one group have a common property.
    training : bool
        True if the scenario is for choosing parameters; campaigns leave it out unless it is named.
    path : Path
        Path of the TOML file.
    recorded : bool
        Whether the measurements come from a log.
    channels : bool
        Whether an instrument has channels, such as satellites; learning tasks take none. That a kind of instrument of a
        plug-in has channels is not known from the head of a file.
    """

    name: str
    version: int
    title: str
    duration: float
    tags: tuple[str, ...]
    track: str
    group: str
    training: bool
    path: Path
    recorded: bool = False
    channels: bool = False

    @property
    def id(self) -> str:
        """``coastal-voyage-v1``."""
        return f"{self.name}-v{self.version}"

    @property
    def gym_id(self) -> str:
        """``simnav/CoastalVoyage-v1``."""
        return gym_id(self.name, self.version)


def gym_id(name: str, version: int) -> str:
    """The Gymnasium id of a scenario.

    >>> gym_id("coastal-voyage", 1)
    'simnav/CoastalVoyage-v1'
    """
    return f"simnav/{''.join(part.capitalize() for part in name.split('-'))}-v{version}"


def headers() -> list[Header]:
    """Every scenario of every installed pack, sorted by name and version."""
    found: dict[str, Header] = {}
    ids: dict[str, Header] = {}
    for folder in _folders():
        for path in (*sorted(folder.glob("*.toml")), *sorted(folder.glob("families/*.toml"))):
            header = _header(path)
            if header is None:
                continue
            other = found.get(header.id) or ids.get(header.gym_id)
            if other is not None:
                _warn(f"{path}: left out, {other.path} already has the id {other.id!r} ({other.gym_id})")
                continue
            found[header.id] = ids[header.gym_id] = header
    return sorted(found.values(), key=lambda h: (h.name, h.version))


def _folders() -> Iterator[Path]:
    """The folder of each pack, the project's own first."""
    # Metadata on sys.path twice (a source tree that is also installed) must not count twice.
    points = {(p.name, p.value): p for p in entry_points(_GROUP)}
    for point in sorted(points.values(), key=lambda p: (not _own(p), p.name)):
        if _own(point):
            yield OWN_FOLDER
            continue
        try:
            folders = _package_folders(point.module)
        except Exception as error:
            _warn(f"scenario pack {point.name!r} ({point.value}) left out: {error}")
        else:
            yield from folders


def _package_folders(package: str) -> list[Path]:
    """Without running the package's code; only the parents of a dotted name are imported."""
    spec = importlib.util.find_spec(package)
    if spec is None:
        raise ModuleNotFoundError(f"there is no package {package!r}")
    if spec.submodule_search_locations is None:
        raise ValueError(f"{package!r} is a module; a pack is a package, with its scenarios as *.toml in its folder")
    return [Path(location) for location in spec.submodule_search_locations]


def _own(point: importlib.metadata.EntryPoint) -> bool:
    return point.value == "simnav.scenarios"  # to ask its distribution takes milliseconds


def _header(path: Path) -> Header | None:
    """The head of a file, read again if the file has changed; None, and a warning, if it has an error."""
    try:
        state = path.stat()
        key = (path, state.st_mtime_ns, state.st_size)
    except OSError as error:
        _warn(f"{path}: left out, cannot be read: {error.strerror}")
        return None
    if key not in _known and (header := _read(path)) is not None:
        _known[key] = header
    return _known.get(key)


def _read(path: Path) -> Header | None:
    try:
        text = path.read_text(encoding="utf-8")
        table = _head(text)
    except (OSError, ValueError, RecursionError) as error:
        _warn(f"{path}: left out, not valid TOML: {error}")
        return None
    name, version, duration = table.get("name"), table.get("version"), table.get("duration_s")
    if isinstance(duration, dict):
        duration = _middle(text, str(path))
    if not isinstance(name, str) or not NAME.fullmatch(name):
        _warn(f"{path}: left out, name = {name!r} should be in kebab-case, like 'coastal-voyage'")
        return None
    if not isinstance(version, int) or version < 1:
        _warn(f"{path}: left out, version = {version!r} should be a whole number from 1")
        return None
    if not isinstance(duration, (int, float)):
        _warn(f"{path}: left out, duration_s = {duration!r} should be a number")
        return None
    tags = table.get("tags", [])
    return Header(
        name=name,
        version=version,
        title=str(table.get("title", "")),
        duration=float(duration),
        tags=tuple(map(str, tags)) if isinstance(tags, list) else (),
        track=str(table.get("track", "other")),
        group=str(table.get("group", "other")),
        training=table.get("training") is True,
        path=path,
        recorded="\n[log" in text and re.search(r"^\[log[\].]", text, re.MULTILINE) is not None,
        channels=any(kind in text for kind in _WITH_CHANNELS) and _CHANNELS.search(text) is not None,
    )


def _head(text: str) -> dict[str, Any]:
    """The keys of a file before its first table. To parse forty files completely would take longer than the import."""
    lines = text.splitlines(keepends=True)
    end = next((i for i, line in enumerate(lines) if line.startswith("[")), len(lines))
    try:
        return tomllib.loads("".join(lines[:end]))
    except (ValueError, RecursionError):  # a line of a text may begin like a table
        return tomllib.loads(text)


def _middle(text: str, source: str) -> float | None:
    """The median duration of a scenario that draws it."""
    from simnav.scenario.draws import Template

    try:
        duration = Template(tomllib.loads(text), source).middle().get("duration_s")
    except (ValueError, RecursionError):
        return None
    return float(duration) if isinstance(duration, (int, float)) else None


def _warn(message: str) -> None:
    warnings.warn(message, ScenarioWarning, stacklevel=3)
