"""What several commands do with their options: paths for messages, endings of figures, a campaign's progress."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.errors import RequestError, mistakes

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress

    from .console import ProgressBar

__all__ = ["absolute", "campaign_progress", "require_figure", "write_columns"]


def absolute(path: str | os.PathLike[str]) -> Path:
    """The absolute form of a path, for messages."""
    return Path(path).expanduser().resolve()


def require_figure(option: str, path: Path | None) -> None:
    """RequestError where a figure cannot be written to a file of this name."""
    if path is not None and path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise RequestError(f"{option} {path}: the file should end in .png, .svg or .pdf")


def campaign_progress(bar: ProgressBar, running: str = "running") -> Callable[[Progress], None]:
    """What shows a campaign's progress on a bar; ``running`` is its text while estimators run."""

    def show(p: Progress) -> None:
        bar.begin("compiling kernels" if p.stage == "compile" else running)
        bar(p.done, p.total, f"{p.failed} failed, {p.note}" if p.failed else p.note, p.left)

    return show


def write_columns(columns: Mapping[str, Any], path: Path) -> Path:
    """Write columns of numbers as CSV, with their names in the first line; returns the path."""
    import numpy as np

    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        values = np.column_stack(list(columns.values()))
        np.savetxt(path, values, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path
