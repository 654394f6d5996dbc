"""A check that a checkout is whole: the folders of the upper floors are parts of the package by symbolic links."""

from __future__ import annotations

from pathlib import Path

__all__ = ["LINKED", "require_links"]

#: Folders beside ``simnav/`` in a checkout that are imported as parts of it.
LINKED = ("estimators", "scenarios", "leaderboard")


def require_links(package: Path) -> None:
    """Check that each of `LINKED` is a folder of the package.

    Git on Windows and some unpackers of archives write a symbolic link as a small text file.

    Parameters
    ----------
    package : Path
        The folder of the package.

    Raises
    ------
    ImportError
        If one of them is not a folder. The message says how to install.
    """
    for name in LINKED:
        if not (package / name).is_dir():
            raise ImportError(
                f"{package / name} should be a symbolic link to ../{name}, and this copy of simnav has no symbolic "
                "links: clone it with 'git clone -c core.symlinks=true' (Windows: developer mode), or install a wheel"
            )
