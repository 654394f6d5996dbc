"""The source of what is submitted: a Python file with those beside it that it needs, or a package as a wheel."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import Distribution
from pathlib import Path
from typing import Any

from simnav.estimator import find, names
from simnav.estimator.registry import GROUP, point_of
from simnav.leaderboard.campaign.fingerprint import named_files
from simnav.leaderboard.campaign.request import EstimatorRequest, comes_with_simnav, file_of, request
from simnav.leaderboard.campaign.sources import code_of, followed
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.plugins import entry_points

from .archive import write_archive
from .requirement import here, requirement

__all__ = ["Source", "requirements_of", "source_of"]

_LONGEST = 300.0  # that building a wheel may take [s]


@dataclass(frozen=True)
class Source:
    """What is submitted.

    Attributes
    ----------
    title : str
        Name of the file or of the package.
    requests : tuple of EstimatorRequest
        As they are run here.
    files : mapping of str to Path
        Names in the bundle, below ``source/``.
    main : str
        Name of the Python file or of the wheel among them.
    requires : tuple of str
        Requirements beside simnav, as ``pip`` takes them.
    """

    title: str
    requests: tuple[EstimatorRequest, ...]
    files: Mapping[str, Path]
    main: str
    requires: tuple[str, ...] = field(default=())


def source_of(given: str, parameters: Mapping[str, Any], scratch: Path, requires: tuple[str, ...] = ()) -> Source:
    """The source of an estimator, or of all estimators of a package.

    Parameters
    ----------
    given : str
        A file (``my.py``, ``my.py:MyFilter``), the name of an installed package that registers estimators, or the name
        of one of its estimators; also with parameters (``my.py:gain=0.5``).
    parameters : mapping
        Parameters that are added.
    scratch : Path
        Folder for a wheel that has to be made.
    requires : tuple of str
        Requirements of a file.

    Raises
    ------
    RequestError
        If there is no such estimator, it comes with simnav, or it cannot be passed on.
    """
    packaged = _points(given)
    if packaged:
        asked = [EstimatorRequest(n, dict(parameters)) for n in names() if point_of(n) in packaged]
        if not asked:
            raise RequestError(f"the package {given!r} registers no estimator that can be loaded")
    else:
        asked = [request(given, parameters)]
    for one in asked:
        if named_files(one.parameters.values()):
            raise RequestError(
                f"{one.label}: a parameter names a file of this machine, which nobody else has; put the file beside "
                "the estimator, and let a default of its constructor name it relative to __file__"
            )
    first = asked[0]
    if file_of(first.name):
        return _file(first, tuple(map(requirement, requires)))
    with mistakes():
        cls = find(first.name)
    if comes_with_simnav(cls):
        raise RequestError(f"{first.name} comes with simnav; its row is on the board already")
    point = point_of(first.name)
    owner = next((p.dist for p in entry_points(GROUP) if p.value == point and p.dist is not None), None)
    if not point or owner is None:
        raise RequestError(f"{first.name} belongs to no installed package; submit its file instead")
    wheel = _wheel(owner, scratch)
    return Source(
        owner.name,
        tuple(asked),
        {wheel.name: wheel},
        wheel.name,
        (*requirements_of(owner), *map(requirement, requires)),
    )


def _points(name: str) -> set[str]:
    """The entry points of an installed package, by the name of its distribution or of its module."""
    wanted = _normal(name)
    return {
        p.value
        for p in entry_points(GROUP)
        if p.dist is not None
        and p.dist.name != "simnav"
        and wanted in (_normal(p.dist.name), _normal(p.module.partition(".")[0]))
    }


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _file(asked: EstimatorRequest, requires: tuple[str, ...]) -> Source:
    path = Path(file_of(asked.name)).expanduser().resolve()
    if not path.is_file():
        raise RequestError(f"there is no file {path}")
    folder, files = path.parent, dict[Path, None]()
    for name in followed([path]):
        part = (folder / name).resolve()
        if not part.is_file():
            continue
        files[part] = None
        for pattern in code_of(part).data:
            files |= dict.fromkeys(p.resolve() for p in part.parent.glob(pattern) if p.is_file())
    outside = [p for p in files if not p.is_relative_to(folder)]
    if outside:
        raise RequestError(f"{outside[0]} is outside of {folder}: a submission holds files of one folder only")
    return Source(path.stem, (asked,), {p.relative_to(folder).as_posix(): p for p in files}, path.name, requires)


def requirements_of(dist: Distribution) -> tuple[str, ...]:
    """What a package requires here beside simnav, without its extras."""
    found = filter(None, map(here, dist.requires or ()))
    return tuple(r for r in found if _normal(re.split(r"[\s\[<>=!~;(]", r, maxsplit=1)[0]) != "simnav")


def _wheel(dist: Distribution, scratch: Path) -> Path:
    """The wheel of an installed package: built from its source where it is an editable install, else put together."""
    try:
        origin = json.loads(dist.read_text("direct_url.json") or "{}")
    except ValueError:
        origin = {}
    if origin.get("dir_info", {}).get("editable"):
        return _built(Path(origin["url"].removeprefix("file://")), scratch)
    info, files = "", dict[str, Path | bytes]()
    for item in dist.files or ():
        name = item.as_posix()
        if name.startswith("..") or "__pycache__" in item.parts or item.suffix == ".pyc":
            continue
        place = Path(str(dist.locate_file(item)))
        if item.parts[0].endswith(".dist-info"):
            info = item.parts[0]
            if item.name in ("RECORD", "INSTALLER", "REQUESTED", "direct_url.json"):
                continue
        if place.is_file():
            files[name] = place
    if not info or not files:
        raise RequestError(f"the package {dist.name} does not say which files it has; install it with pip")
    tag = re.search(r"^Tag: (\S+)", dist.read_text("WHEEL") or "", re.MULTILINE)
    files.setdefault(f"{info}/WHEEL", b"Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
    lines = []
    for name, content in sorted(files.items()):
        data = content if isinstance(content, bytes) else content.read_bytes()
        hashed = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        lines.append(f"{name},sha256={hashed},{len(data)}")
    files[f"{info}/RECORD"] = "\n".join([*lines, f"{info}/RECORD,,", ""]).encode()
    stem = f"{re.sub(r'[^A-Za-z0-9.]+', '_', dist.name)}-{dist.version}-{tag[1] if tag else 'py3-none-any'}"
    path = scratch / f"{stem}.whl"
    write_archive(path, files)
    return path


def _built(project: Path, scratch: Path) -> Path:
    """The wheel that the build system of a project makes, with the tools that are installed here."""
    folder = scratch / "wheel"
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps",
               "--no-build-isolation", "--wheel-dir", str(folder), str(project)]  # fmt: skip
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise RequestError(f"the wheel of {project} cannot be built: {error}") from None
    made = sorted(folder.glob("*.whl")) if folder.is_dir() else []
    if done.returncode or len(made) != 1:
        said = [line for line in done.stderr.splitlines() if line.strip()]
        raise RequestError(
            f"the wheel of {project} cannot be built: {(said or ['pip says nothing'])[-1].strip()}; install the "
            "package without --editable, and submit it then"
        )
    return made[0]
