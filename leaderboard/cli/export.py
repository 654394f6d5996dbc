"""``simnav export``: what an estimator receives, as files for programs of others."""

from __future__ import annotations

from simnav.leaderboard.log_requests import ExportRequest
from simnav.leaderboard.logs import export

from .console import Output

__all__ = ["show"]


def show(out: Output, request: ExportRequest) -> None:
    """Write what an estimator receives."""
    written = export.of(request)
    out.document({"files": [str(path) for path in written]})
    out.print(*(str(path) for path in written))
