"""``simnav standard audit``: a random sample of the result that comes with simnav, repeated."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.publishing import audit_standard
from simnav.leaderboard.publishing_requests import AuditRequest

from .console import FAILED, Output

__all__ = ["show"]


def show(out: Output, request: AuditRequest) -> None:
    """Repeat a random sample of the standard result, and compare the scores."""
    with out.progress("repeating") as bar:
        made = audit_standard.of(replace(request, progress=bar))
    found = made.verification
    out.document(made.to_dict())
    out.print(
        f"results:   {found.folder} ({found.results}, of which {found.repeated} were repeated)",
        *(f"close:     {text}" for text in found.close),
        *(f"different: {text}" for text in found.different),
        *(f"left:      {text}" for text in (*found.not_repeatable, *found.not_here)),
        f"the sample: {made.sentence()}",
    )
    out.code = 0 if made.passed else FAILED
