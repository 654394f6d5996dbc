"""``simnav campaign cite``: how to cite simnav, or results."""

from __future__ import annotations

from simnav.leaderboard.inspection import cite

from .commands import CiteCommand
from .console import Output

__all__ = ["show"]


def show(out: Output, request: CiteCommand) -> None:
    """Print how to cite this version of simnav, or the results of a campaign."""
    found = cite.of(request)
    out.document(found.to_dict())
    out.print(found.text if request.text else found.bibtex)
