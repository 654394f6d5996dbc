"""``simnav log identify``: the error model of a log's instruments."""

from __future__ import annotations

from simnav.leaderboard.arguments import require_folder
from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.logs import identify
from simnav.leaderboard.results.errors import RequestError

from .commands import IdentifyCommand
from .console import Output
from .options import absolute, require_figure

__all__ = ["show"]


def show(out: Output, request: IdentifyCommand) -> None:
    """Fit the error model of a log's instruments."""
    require_figure("--plot", request.plot)
    if request.output is not None and request.output.suffix != ".toml":
        raise RequestError(f"--output {request.output}: the file should end in .toml")
    for option, path in (("--output", request.output), ("--plot", request.plot)):
        if path is not None:
            require_folder(f"{option} {path}", path)
    found = identify.of(request)
    out.document(found.to_dict())
    out.print(*found.shown(), *(f"- {remark}" for remark in found.remarks), "", found.toml)
    if request.output is not None:
        found.save(absolute(request.output))
        out.print(f"scenario: {request.output}")
    if request.plot is not None:
        out.print(f"figure: {save_as(found.plot(), absolute(request.plot))}")
