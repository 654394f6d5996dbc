"""Public recordings of real voyages: from downloaded files to scenarios, by the checksums of the files.

``scenarios/recordings/sources.toml`` names the sources with licence and citation, and the files of each scenario with
their SHA-256. The scenarios are in the same folder, or in the catalogue. No recording comes with simnav.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.files import complete_file
from simnav.leaderboard.results.plain import as_json
from simnav.spec import closest

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["PublicFile", "PublicRecordings", "Source", "public_recordings", "state_table", "take"]

_FOLDER = (Path(__file__).parents[1] / "scenarios" / "recordings").resolve()


@dataclass(frozen=True)
class Source:
    """Where recordings come from.

    Attributes
    ----------
    name, title : str
        Its name in the list, and its title.
    address, licence, citation : str
        Where the files are published, under which licence, and what to cite.
    """

    name: str
    title: str
    address: str
    licence: str
    citation: str


@dataclass(frozen=True)
class PublicFile:
    """A file of a recording.

    Attributes
    ----------
    path, origin : str
        Its place below the data folder, and that in the source.
    size : int
        Number of bytes.
    sha256 : str
        Checksum.
    """

    path: str
    origin: str
    size: int
    sha256: str


@dataclass(frozen=True)
class PublicRecordings:
    """The recordings of one scenario.

    Attributes
    ----------
    scenario : str
        Its name.
    vessel : str
        Kind of the vessel.
    number : int
        How many recordings it has.
    source : Source
        Whose they are.
    commit : str
        State of the source at which the files were taken; empty where it has none.
    files : tuple of PublicFile
        All that it needs; empty where they come with an installed package.
    missing : tuple of str
        Paths of the files that are not there, or have another content.
    written : str
        Path of the scenario file that was written; empty: none, or the scenario is in the catalogue.
    """

    scenario: str
    vessel: str
    number: int
    source: Source
    commit: str = ""
    files: tuple[PublicFile, ...] = ()
    missing: tuple[str, ...] = field(default=())
    written: str = ""

    @property
    def state(self) -> Literal["ready", "incomplete", "absent"]:
        """Whether all files are there, some, or none."""
        if not self.missing:
            return "ready"
        return "absent" if len(self.missing) == len(self.files) else "incomplete"

    @property
    def catalogued(self) -> bool:
        """Whether the scenario is in the catalogue."""
        return not self.toml.exists()

    @property
    def toml(self) -> Path:
        """The scenario that comes with simnav, unless it is in the catalogue."""
        return _FOLDER / f"{self.scenario}.toml"

    def to_dict(self) -> dict[str, Any]:
        """Plain: what ``simnav log recordings --json`` prints."""
        found: dict[str, Any] = as_json({**asdict(self), "state": self.state})
        return found


def public_recordings(names: Sequence[str] = (), data: Path | None = None) -> list[PublicRecordings]:
    """The public recordings that simnav knows, with what of them is there.

    Parameters
    ----------
    names : sequence of str
        Scenarios; by default all.
    data : Path, optional
        The data folder. Default: the environment variable ``SIMNAV_DATA``, or ``./data``.

    Raises
    ------
    RequestError
        If there is no such scenario.
    """
    root = Path(os.environ.get("SIMNAV_DATA", "data")) if data is None else data
    known = _declared()
    for name in names:
        if name not in known:
            raise RequestError(f"there are no public recordings {name!r}{closest(name, list(known))}")
    return [_looked_for(known[name], root) for name in names or known]


def take(paths: Iterable[Path], output: Path, names: Sequence[str] = ()) -> list[PublicRecordings]:
    """Copy the files of recordings to a data folder, and write the scenarios that are then complete.

    Parameters
    ----------
    paths : iterable of Path
        Downloaded files, or folders with them at any depth, under any names: they are told by their checksums.
    output : Path
        The data folder.
    names : sequence of str
        Scenarios; by default all.

    Returns
    -------
    list of PublicRecordings
        As `public_recordings`.

    Raises
    ------
    RequestError
        If a path does not exist, no file is one of a recording, or another file is where one would be written.
    """
    known = public_recordings(names, output)
    wanted = {f.sha256: f for one in known for f in one.files}
    sizes = {f.size for f in wanted.values()}
    given, found = list(paths), 0
    for path in _all_files(given):
        if path.stat().st_size not in sizes:
            continue
        file = wanted.get(_digest(path))
        if file is None:
            continue
        found += 1
        _copy(path, output / file.path, file)
    if not found and wanted:
        raise RequestError(
            f"{', '.join(map(str, given)) or 'nothing'}: no file has the checksum of one of "
            f"{', '.join(one.scenario for one in known)}; it may be another version of it ('simnav log recordings' "
            "shows which one is meant)"
        )
    made = []
    for one in public_recordings(names, output):
        written = ""
        if one.state == "ready" and one.files and not one.catalogued:
            written = str(_copy_text(one.toml, output / one.toml.name))
        made.append(PublicRecordings(**{**vars(one), "written": written}))
    return made


def _declared() -> dict[str, PublicRecordings]:
    with open(_FOLDER / "sources.toml", "rb") as file:
        table = tomllib.load(file)
    sources = {s["name"]: Source(**s) for s in table["source"]}
    found = {}
    for entry in table["recordings"]:
        files = tuple(PublicFile(f["path"], f["from"], f["bytes"], f["sha256"]) for f in entry.get("files", ()))
        found[entry["scenario"]] = PublicRecordings(
            entry["scenario"], entry["vessel"], entry["number"], sources[entry["source"]], entry["commit"], files
        )
    return found


def _looked_for(one: PublicRecordings, root: Path) -> PublicRecordings:
    missing = tuple(f.path for f in one.files if not _is(root / f.path, f))
    return PublicRecordings(**{**vars(one), "missing": missing})


def _is(path: Path, file: PublicFile) -> bool:
    return path.is_file() and path.stat().st_size == file.size and _digest(path) == file.sha256


def _digest(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _all_files(paths: Sequence[Path]) -> Iterator[Path]:
    for path in paths:
        if path.is_dir():
            yield from (p for p in sorted(path.rglob("*")) if p.is_file())
        elif path.is_file():
            yield path
        else:
            raise RequestError(f"{path}: there is no such file or folder")


def _copy(path: Path, target: Path, file: PublicFile) -> None:
    if target.exists():
        if not _is(target, file):
            raise RequestError(f"{target}: another file has this name; move it away, or choose another data folder")
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with complete_file(target) as partial:
        shutil.copyfile(path, partial)


def _copy_text(path: Path, target: Path) -> Path:
    if target.exists() and target.read_bytes() != path.read_bytes():
        raise RequestError(f"{target}: another scenario has this name; move it away, or choose another data folder")
    shutil.copyfile(path, target)
    return target


def state_table(found: Sequence[PublicRecordings]) -> Table:
    """What is known, and what of it is there."""
    from .ranking import tables

    rows = []
    for one in found:
        where = f"{one.source.title}: {one.source.address}" + (f" at {one.commit[:12]}" if one.commit else "")
        there = f"{len(one.files) - len(one.missing)} of {len(one.files)} files" if one.files else "with gtsam"
        rows.append([one.scenario, one.vessel, one.number, f"{one.state} ({there})", where, one.source.licence])
    columns = ["scenario", "vessel", "recordings", "state", "source", "licence"]
    return tables.table("public recordings", columns, rows, numeric=["recordings"])
