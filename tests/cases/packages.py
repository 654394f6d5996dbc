"""Packages of a third party, installed into a folder the way pip leaves them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

__all__ = ["install", "install_pack"]


def install(folder: Path, name: str, entry_points: Mapping[str, Mapping[str, str]], files: Mapping[str, str]) -> Path:
    """Install a package; it is found once the folder is on the path of modules.

    Parameters
    ----------
    folder : Path
        Takes the place of ``site-packages``.
    name : str
        Of the distribution, version 1.0.
    entry_points : mapping
        By group, like ``simnav.estimators``: by name, the values.
    files : mapping
        By path below the folder, the texts.

    Returns
    -------
    Path
        The folder of the metadata.
    """
    info = folder / f"{name}-1.0.dist-info"
    lines = []
    for group, points in entry_points.items():
        lines += [f"[{group}]", *(f"{point} = {value}" for point, value in points.items())]
    metadata = {
        "METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nRequires-Dist: simnav\n",
        "WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        "entry_points.txt": "".join(f"{line}\n" for line in lines),
    }
    every = {**files, **{f"{info.name}/{path}": text for path, text in metadata.items()}}
    every[f"{info.name}/RECORD"] = "".join(f"{path},,\n" for path in every)
    for path, text in every.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text)
    return info


def install_pack(folder: Path, name: str, files: Mapping[str, str]) -> None:
    """Install a pack of scenarios, a package of the same name."""
    install(folder, name, {"simnav.scenarios": {name: name}}, files)
