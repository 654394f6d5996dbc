"""``simnav campaign merge``: the results of several folders in one."""

from __future__ import annotations

from simnav.leaderboard.inspection import merge
from simnav.leaderboard.requests import MergeRequest

from .console import Output
from .options import absolute

__all__ = ["show"]


def show(out: Output, request: MergeRequest) -> None:
    """Put the results of several folders into one, e.g. of campaigns with --shard."""
    results = merge.of(request)
    where = absolute(request.output)
    out.document({"results": str(where), "runs": len(results)})
    out.print(f"results: {where} ({len(results)} runs)", f"next:    simnav leaderboard {where}")
