"""``simnav campaign seal``: the key of sealed seeds, and its commitment."""

from __future__ import annotations

from simnav.leaderboard.inspection import seal
from simnav.leaderboard.requests import SealRequest

from .console import Output
from .options import absolute

__all__ = ["show"]


def show(out: Output, request: SealRequest) -> None:
    """Make or check a key of sealed seeds, and print the commitment to publish before the campaign."""
    made = seal.of(request)
    where = absolute(request.key)
    out.document({"key": str(where), "commitment": made.commitment, "seal": made.hash, "public": made.public})
    out.print(f"key:        {where} (keep it secret until the campaign has ended)", f"commitment: {made.commitment}")
    if made.public:
        out.print(f"public:     {made.public}", f"seal:       {made.hash} (stands in the results)")
    out.print(f"next:       publish the commitment, then simnav campaign --sealed {request.key}")
