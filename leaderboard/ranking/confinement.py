"""What kept the estimators of results apart from the truth, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["confined", "confinement_line"]

_MEANS = {
    "bubblewrap": "a process without the recording, no network, read-only files, the results out of sight",
    "landlock": "a process without the recording, no writing, no TCP, the results out of sight",
    "process": "a process without the recording, but with all rights of the user",
    "none": "nothing: an estimator could read the truth",
    "external": "",
    "not known": "the results do not say",
}


def confined(results: Iterable[Result]) -> dict[str, int]:
    """How many results were made under which confinement, without those of references, which are told the truth."""
    found = Counter(r.provenance.confinement or "not known" for r in results if r.tried and not r.reference)
    return dict(sorted(found.items(), key=lambda item: list(_MEANS).index(item[0]) if item[0] in _MEANS else 0))


def confinement_line(results: Iterable[Result]) -> str:
    """One line for the terminal; empty where there is nothing to be said."""
    found = confined(results)
    elsewhere = found.pop("external", 0)
    parts = [f"{name} ({count} results: {_MEANS.get(name, 'unknown here')})" for name, count in found.items()]
    said = [f"estimators were confined by {'; '.join(parts)}"] if parts else []
    if elsewhere:
        said.append(f"{elsewhere} results were made elsewhere: nobody knows what their makers saw")
    return "; ".join(said)
