"""``simnav standard check``: what has another version than the result that comes with simnav."""

from __future__ import annotations

from simnav.leaderboard.publishing import check_standard
from simnav.leaderboard.publishing_requests import CheckStandardRequest

from .console import FAILED, Output

__all__ = ["show"]


def show(out: Output, request: CheckStandardRequest) -> None:
    """Say which rows and scenarios have another version than the standard result."""
    found = check_standard.of(request)
    out.document(found.to_dict())
    out.print(*(found.sentences() or ["the standard result has the versions of today"]))
    out.code = FAILED if found else 0
