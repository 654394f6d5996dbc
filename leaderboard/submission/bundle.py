"""A submission as a file: source, parameters, results, provenance and hashes in one ZIP archive.

::

    bundle.json     title, benchmark, profile with its runs, estimators, requirements; SHA-256 of each other file
    source/         a Python file with those beside it that it needs, or a wheel
    results/        a packed folder of results (`simnav.leaderboard.results.packing`): Parquet and JSON

There is no pickle in it. The SHA-256 of the whole file names a submission.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from simnav.estimator.registry import is_own
from simnav.leaderboard.campaign.request import EstimatorRequest, file_of
from simnav.leaderboard.results.admission import is_scenario_id, label_fault, lookalikes
from simnav.leaderboard.results.errors import MOST_RUNS, RequestError
from simnav.leaderboard.results.files import complete_file

from .archive import digest_of, opened, unpack, write_archive
from .requirement import requirement

__all__ = ["SUFFIX", "Bundle", "Contents", "File", "Row", "open_bundle", "write_bundle"]

#: How the name of a bundle ends.
SUFFIX = ".simnav.zip"
_MANIFEST = "bundle.json"
_LONGEST = 4 << 20  # of the manifest [bytes]
_FOLDERS = ("source", "results")


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class File(_Part):
    """A file of a bundle.

    Attributes
    ----------
    sha256 : str
        SHA-256 digest of the file, hexadecimal.
    size : int
        Length of the file [bytes].
    """

    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    size: int = Field(ge=0)


class Row(_Part):
    """An estimator of a bundle.

    Attributes
    ----------
    label, name : str
        Label in the results; name of the class in the file (``my.py``, ``my.py:MyFilter``), or in the package.
    point : str
        Entry point of the package that registers it; empty for a file.
    parameters : mapping
        Parameters that were set.
    """

    label: str = Field(min_length=1, max_length=200)
    name: str = Field(min_length=1, max_length=200)
    point: str = Field("", max_length=200)
    parameters: dict[str, bool | int | float | str | None] = {}


class Contents(_Part):
    """What ``bundle.json`` says.

    Attributes
    ----------
    format : int
        Version of the format.
    title : str
        Name of the file or of the package.
    benchmark : str
        Name and version of the benchmark.
    profile : str
        Name of the profile.
    runs : mapping of str to int
        Versioned id of each scenario of the profile, and how many seeds it has.
    main : str
        Name of the Python file, or of the wheel, below ``source/``.
    estimators : tuple of Row
        The rows that are submitted.
    requires : tuple of str
        Packages that they need beside simnav.
    files : mapping of str to File
        All other files of the bundle.
    """

    format: int
    title: str = Field(min_length=1, max_length=200)
    benchmark: str = Field(max_length=200)
    profile: str = Field(max_length=200)
    runs: dict[str, Annotated[int, Field(ge=1, le=MOST_RUNS)]] = Field(max_length=1000)
    main: str = Field(min_length=1, max_length=200)
    estimators: tuple[Row, ...] = Field(min_length=1, max_length=100)
    requires: tuple[str, ...] = Field((), max_length=100)
    files: dict[str, File]


_FORMAT = 1


@dataclass(frozen=True)
class Bundle:
    """A bundle that was opened: each file has the hash that it should have.

    Attributes
    ----------
    path : Path
        Path of the ZIP file.
    digest : str
        SHA-256 of the ZIP file.
    contents : Contents
        Contents that the bundle declares.
    folder : Path
        Folder where it is unpacked.
    """

    path: Path
    digest: str
    contents: Contents
    folder: Path

    @property
    def results(self) -> Path:
        """Folder of the results."""
        return self.folder / "results"

    def requests(self, packages: Path) -> list[EstimatorRequest]:
        """The estimators, to be run from the bundle; nothing of them is imported here.

        Parameters
        ----------
        packages : Path
            Folder into which a wheel is unpacked, and in which packages that it requires may be.

        Raises
        ------
        RequestError
            If the wheel cannot be unpacked.
        """
        source, main = self.folder / "source", self.contents.main
        search: tuple[str, ...] = (str(packages),)
        if main.endswith(".whl"):
            wheel = self.folder / "wheel"
            if not wheel.exists():
                with opened(source / main) as archive:
                    unpack(archive, main, wheel)
            search = (str(wheel), *search)
        return [
            EstimatorRequest(
                row.name if row.point else f"{source / row.name}", dict(row.parameters), row.label, point=row.point,
                search=search,
            )
            for row in self.contents.estimators
        ]  # fmt: skip


def write_bundle(
    path: Path,
    *,
    title: str,
    benchmark: str,
    profile: str,
    runs: Mapping[str, int],
    main: str,
    estimators: Sequence[Row],
    requires: Sequence[str],
    source: Mapping[str, Path],
    results: Path,
) -> str:
    """Write a bundle; returns its SHA-256.

    Parameters
    ----------
    path : Path
        Path of the new file.
    title, benchmark, profile, runs, main, estimators, requires
        As in `Contents`.
    source : mapping of str to Path
        Files by name, below ``source/``.
    results : Path
        A packed folder of results.
    """
    files: dict[str, Path | bytes] = {f"source/{name}": place for name, place in source.items()}
    files |= {f"results/{p.relative_to(results).as_posix()}": p for p in sorted(results.rglob("*")) if p.is_file()}
    facts = {
        name: File(sha256=digest_of(place), size=place.stat().st_size)
        for name, place in files.items()
        if isinstance(place, Path)
    }
    contents = Contents(
        format=_FORMAT, title=title, benchmark=benchmark, profile=profile, runs=dict(runs), main=main,
        estimators=tuple(estimators), requires=tuple(requires), files=facts,
    )  # fmt: skip
    files[_MANIFEST] = (json.dumps(contents.model_dump(), indent=1, sort_keys=True) + "\n").encode()
    try:
        with complete_file(path) as part:
            write_archive(part, files)
    except OSError as error:
        raise RequestError(f"{path} cannot be written: {error.strerror or error}") from None
    return digest_of(path)


def open_bundle(path: Path, folder: Path) -> Bundle:
    """Unpack a bundle into an empty folder, and check it.

    Raises
    ------
    RequestError
        If it is no bundle, would leave the folder, is too large, or a file is not what ``bundle.json`` says.
    """
    with opened(path) as archive:
        unpacked = unpack(archive, path.name, folder)
    manifest = unpacked.pop(_MANIFEST, None)
    if manifest is None:
        raise RequestError(
            f"{path.name} is no bundle of a submission: {_MANIFEST} is missing; 'simnav submit' makes one"
        )
    contents = _contents(manifest, path.name)
    strange = [n for n in unpacked if PurePosixPath(n).parts[0] not in _FOLDERS]
    for name in sorted({*unpacked, *contents.files}):
        if name not in unpacked:
            raise RequestError(f"{path.name}: {name} is missing")
        if name not in contents.files or name in strange:
            raise RequestError(f"{path.name}: {name} does not belong to it: {_MANIFEST} does not name it")
        file, listed = unpacked[name], contents.files[name]
        if file.stat().st_size != listed.size or digest_of(file) != listed.sha256:
            raise RequestError(f"{path.name}: {name} was changed: its hash is not that of {_MANIFEST}")
    _check_rows(contents, path.name, unpacked)
    return Bundle(path, digest_of(path), contents, folder)


def _contents(manifest: Path, what: str) -> Contents:
    try:
        if manifest.stat().st_size > _LONGEST:
            raise RequestError(f"{what}: {_MANIFEST} is too long")
        facts: Any = json.loads(manifest.read_bytes())
        if isinstance(facts, dict) and facts.get("format", _FORMAT) != _FORMAT:
            raise RequestError(f"{what} has format {facts['format']!r:.20}; this version of simnav reads {_FORMAT}")
        return Contents.model_validate_json(manifest.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise RequestError(f"{what}: {_MANIFEST}: {key}: {first['msg']}") from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, RequestError):
            raise
        raise RequestError(f"{what}: {_MANIFEST} is no JSON: {error}") from None


def _check_rows(contents: Contents, what: str, files: Mapping[str, Path]) -> None:
    """Whether the estimators are in the bundle, and are none of simnav's own."""
    for name in ("title", "benchmark", "profile", "main"):
        text = getattr(contents, name)
        if not (text.isascii() and text.isprintable()):
            raise RequestError(f"{what}: {name} = {text!a:.80} is no printable ASCII text")
    labels = [row.label for row in contents.estimators]
    if len(set(labels)) < len(labels):
        raise RequestError(f"{what}: two of its estimators have the same label")
    for label in labels:
        if why := label_fault(label):
            raise RequestError(f"{what}: estimator {label!a:.80}: {why}")
    for label, other in lookalikes(labels).items():
        raise RequestError(f"{what}: estimator {label!a:.80} can be taken for {other}; choose another name")
    for scenario in contents.runs:
        if not is_scenario_id(scenario):
            raise RequestError(f"{what}: {scenario!a:.80} is no versioned id of a scenario")
    if sum(contents.runs.values()) * len(labels) > MOST_RUNS:
        raise RequestError(f"{what}: it states more than {MOST_RUNS} runs")
    for text in contents.requires:
        try:
            requirement(text)
        except RequestError as error:
            raise RequestError(f"{what}: {error}") from None
    if f"source/{contents.main}" not in files:
        raise RequestError(f"{what}: source/{contents.main} is missing")
    for row in contents.estimators:
        named = re.split(r"[(:\[ ]", row.label, maxsplit=1)[0]  # with parameters it would be shown as one of theirs
        if is_own(named) or (row.point and is_own(row.name)):
            raise RequestError(f"{what}: {row.label} is a name of one of simnav's own estimators; choose another one")
        file = file_of(row.name)
        if contents.main.endswith(".whl"):
            if not row.point:
                raise RequestError(f"{what}: {row.label}: the entry point of the package is missing")
        elif row.point or file != contents.main or "/" in file:
            raise RequestError(f"{what}: {row.label}: {row.name} is not in {contents.main}")
