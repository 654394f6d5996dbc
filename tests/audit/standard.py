"""The standard result: a random sample of it, repeated with the code of today."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from simnav.leaderboard import publishing
from simnav.leaderboard.standard.auditing import CONFIDENCE, SAMPLE

__all__ = ["rows"]


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """What, figure, promised, kept."""
    made = publishing.audit_standard(sample=SAMPLE)
    found = made.verification
    for text in (*found.different, *found.not_repeatable, *found.not_here):
        print(f"  {text}", file=sys.stderr)
    wrong = len(found.different) + len(found.not_repeatable) + len(found.not_here)
    figure = f"{found.repeated - wrong} of {found.repeated}"
    yield "results of the standard result that come out as stored", figure, "all", made.passed
    what = f"share of wrong results that such a sample finds ({CONFIDENCE:.0%})"
    yield what, f"{made.share:.1%}", f"of {found.results} results", True
