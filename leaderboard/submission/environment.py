"""The environment in which a submission is repeated: a new one, or the present one."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from simnav.leaderboard.campaign.sources import LIBRARY
from simnav.leaderboard.results.errors import RequestError

from .requirement import requirement

__all__ = ["clean_python", "install_requirements", "search_variables"]

_LONGEST = 1800.0  # that an installation may take [s]
_PINNED = ("numpy", "numba", "gtsam", "scipy", "filterpy")  # whose versions may change the bits of results
_WHEELS = ("numpy", "numba", "gtsam", "scipy")


def clean_python(folder: Path, versions: Mapping[str, str]) -> Path:
    """Make a virtual environment with simnav in it; returns its Python.

    Parameters
    ----------
    folder : Path
        Folder of the environment; it should not exist yet.
    versions : mapping of str to str
        Versions of numpy, numba, gtsam, scipy and filterpy that the results were made with; empty ones are not pinned.

    Raises
    ------
    RequestError
        If it cannot be made, as without a network: one sentence.
    """
    _run([sys.executable, "-m", "venv", str(folder)], "a new environment cannot be made")
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    simnav = _copied(LIBRARY.parent, folder.with_name("simnav-source")) or f"simnav=={version('simnav')}"
    pinned = [f"{name}=={versions[name]}" for name in _PINNED if re.fullmatch(r"[\w.+!]+", versions.get(name, ""))]
    wheels = ["--only-binary", ",".join(_WHEELS)]  # of an old version that only its source is left, nothing is built
    _pip(python, [*wheels, simnav, *pinned], "simnav cannot be installed into a new environment")
    return python


def _copied(checkout: Path, folder: Path) -> str:
    """Copy what simnav is built from; empty where it does not run from a checkout.

    A build in the checkout would leave files there, and would take up what an earlier one left.
    """
    if not (checkout / "pyproject.toml").is_file():
        return ""
    shutil.copytree(LIBRARY, folder / LIBRARY.name, ignore=shutil.ignore_patterns("__pycache__"))  # links are followed
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copyfile(checkout / name, folder / name)
    return str(folder)


def install_requirements(python: Path, requires: Sequence[str], folder: Path) -> None:
    """Install what a submission requires into a folder that only its own processes search.

    Only wheels are taken, because installing them runs no code. What the environment has keeps its version.
    """
    if not requires:
        return
    plain = [requirement(text) for text in requires]
    frozen = _run([str(python), "-m", "pip", "freeze", "--exclude-editable"], "the environment cannot be listed")
    kept = [line for line in frozen.splitlines() if re.fullmatch(r"[\w.-]+==[\w.+!]+", line)]
    constraints = folder.with_name(f"{folder.name}.txt")
    constraints.write_text("\n".join(kept) + "\n")
    words = ["--only-binary", ":all:", "--target", str(folder), "--constraint", str(constraints), *plain]
    with tempfile.TemporaryDirectory(prefix="simnav-empty-") as empty:  # a name may be that of a file where pip runs
        _pip(python, words, "what the submission requires cannot be installed", Path(empty))


def search_variables(clean: bool) -> dict[str, str]:
    """Environment variables for a Python in which a submission is repeated."""
    variables = {k: v for k, v in os.environ.items() if not (clean and k.startswith("PYTHON"))}
    return variables | {"PYTHONSAFEPATH": "1"}


def _pip(python: Path, words: Sequence[str], failure: str, folder: Path | None = None) -> None:
    _run([str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *words], failure, folder)


def _run(command: Sequence[str], failure: str, folder: Path | None = None) -> str:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_LONGEST, check=False, env=search_variables(True),
            cwd=folder,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise RequestError(f"{failure}: {error}; --present uses the packages that are here") from None
    if done.returncode:
        said = [line.strip() for line in (done.stderr or done.stdout).splitlines() if line.strip()]
        raise RequestError(
            f"{failure}: {(said or ['pip says nothing'])[-1]}; --present uses the packages that are here"
        )
    return done.stdout
