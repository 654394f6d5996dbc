"""``simnav log twin``: a scenario of simulated voyages like a log."""

from __future__ import annotations

from simnav.leaderboard.log_requests import TwinRequest
from simnav.leaderboard.logs import twin

from .console import Output

__all__ = ["show"]


def show(out: Output, request: TwinRequest) -> None:
    """Write the twin of a log."""
    made = twin.of(request)
    names, fitted = list(made.table["instruments"]), made.from_reference
    files = [str(path) for path in made.files]
    out.document({"name": made.table["name"], "files": files, "from_reference": fitted})
    identified = [name for name in names if name not in fitted]
    if fitted:
        out.print(f"errors fitted to the differences from the reference: {', '.join(fitted)}")
    if identified:
        out.print(f"errors as identified: {', '.join(identified)}")
    out.print(f"scenario and track: {', '.join(files)}")
