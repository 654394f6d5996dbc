"""Whether a row that is lost says so: runs far beyond the plain row in which nothing warns of the error.

The runs are those of the standard result, all rows on all scenarios and seeds. A run is lost if its horizontal error is
more than `LOST` times that of the plain row on the same recording. It is admitted if one of these says so:

- the status: the run failed, or the row's own test says ``inconsistent``;
- the covariance: the normalised error squared of the horizontal position is at most `ADMITTED` by degree of freedom, in
  the mean over the run;
- the protection level: the error exceeds it in at most `EXCEEDED` of the epochs.

Promised is, for each row, that at least 99 % of its lost runs are admitted. A row that cannot promise it says on its
page when it does not notice that it is lost (`explained`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from simnav.estimator import find
from simnav.leaderboard.results import store
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.standard import RESULTS

__all__ = ["ADMITTED", "EXCEEDED", "LOST", "Lost", "lost_runs", "rows"]

LOST, ADMITTED, EXCEEDED = 10.0, 10.0, 0.05
_PROMISED = 0.99
_PLAIN = ("ekf", "ship-ekf")
_ERROR, _NEES, _LEVEL = "horizontal_rmse", "nees_horizontal", "protection_exceeded"


class Lost(NamedTuple):
    """A lost run.

    Attributes
    ----------
    result : Result
        The run.
    ratio : float
        Its error over that of the plain row.
    admitted : bool
        Whether something says so.
    """

    result: Result
    ratio: float
    admitted: bool


def admitted(result: Result) -> bool:
    """Whether a run says by itself that it is wrong."""
    scores = result.scores
    level = scores.get(_LEVEL, 1.0)  # NaN without a protection level
    return result.status != "ok" or scores.get(_NEES, float("inf")) <= ADMITTED or level <= EXCEEDED


def lost_runs(results: Iterable[Result]) -> dict[str, list[Lost]]:
    """The lost runs of each row that has run beside a plain row; references are left out."""
    by_run: dict[tuple[str, int], dict[str, Result]] = {}
    for r in results:
        by_run.setdefault((r.scenario, r.seed), {})[r.estimator] = r
    found: dict[str, list[Lost]] = {}
    for runs in by_run.values():
        plain = next((runs[p] for p in _PLAIN if p in runs and runs[p].status in ("ok", "inconsistent")), None)
        own = 0.0 if plain is None else plain.scores.get(_ERROR, 0.0)
        if not own > 0.0:
            continue
        for name, r in runs.items():
            if r.reference:
                continue
            ratio = r.scores.get(_ERROR, float("inf")) / own
            mine = found.setdefault(name, [])
            if not ratio <= LOST:
                mine.append(Lost(r, ratio, admitted(r)))
    return found


def explained(name: str) -> bool:
    """Whether the page of a row says when it does not notice that it is lost."""
    return "does not notice" in " ".join((find(name).__doc__ or "").split())


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    results = store.load(RESULTS, series=False, scores=(_ERROR, _NEES, _LEVEL))
    for name, lost in sorted(lost_runs(results).items()):
        silent = [one for one in lost if not one.admitted]
        if not silent:
            continue
        worst = max(silent, key=lambda one: one.ratio)
        where = Counter(one.result.scenario for one in silent).most_common(3)
        share = 1.0 - len(silent) / len(lost)
        yield (
            f"{name}: silent in {', '.join(f'{s} ({n})' for s, n in where)}",
            f"{100.0 * share:.0f} % of {len(lost)}; {worst.ratio:.0f} x",
            "page says so" if explained(name) else f"at least {100.0 * _PROMISED:.0f} %",
            share >= _PROMISED or explained(name),
        )
    yield "rows that are lost without a warning are named above", "", "", True
