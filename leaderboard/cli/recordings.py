"""``simnav log recordings``: public recordings of real voyages, as scenarios."""

from __future__ import annotations

from simnav.leaderboard.log_requests import RecordingsRequest
from simnav.leaderboard.logs import recordings
from simnav.leaderboard.recordings import state_table

from .console import Output

__all__ = ["show"]


def show(out: Output, request: RecordingsRequest) -> None:
    """List public recordings of real voyages, or make scenarios from their downloaded files."""
    found = recordings.of(request)
    out.document({"recordings": [one.to_dict() for one in found]})
    out.print(state_table(found))
    for source in {one.source.name: one.source for one in found}.values():
        out.print(f"{source.title} ({source.licence}): {source.citation}. {source.address}")
    written = [one.written for one in found if one.written]
    if written:
        out.print("scenarios: " + " ".join(written), "next:      simnav check " + written[0])
