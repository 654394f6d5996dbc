"""``simnav submit``: an estimator with its results as one file."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.publishing import submit
from simnav.leaderboard.publishing_requests import SubmitRequest

from .console import Output
from .options import campaign_progress

__all__ = ["show"]


def show(out: Output, request: SubmitRequest) -> None:
    """Run an estimator on a profile, and write its source and results as a bundle."""
    with out.progress("starting") as bar:
        made = submit.of(replace(request, progress=campaign_progress(bar)))
    out.document(made.to_dict())
    out.print(
        f"bundle:  {made.path} ({', '.join(made.estimators)}; {made.results} results, {made.failed} failed)",
        f"sha256:  {made.digest}",
        *(f"remark:  {text}" for text in made.remarks),
        f"next:    simnav campaign verify {made.path}",
    )
