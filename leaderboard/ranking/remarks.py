"""What a board has to say about itself: that it is provisional, or that it decides nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.ranking.statistics import FEWEST, Separation, smallest_p_value

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Reference, Row

__all__ = ["remarks"]

_LEVEL = 0.05


def remarks(
    separation: Separation | None, unit: str, rows: Sequence[Row], references: Sequence[Reference]
) -> tuple[str, ...]:
    """Sentences that stand with a board.

    Parameters
    ----------
    separation : Separation or None
        Of the ranked rows.
    unit : str
        ``seed`` or ``recording``.
    rows : sequence of Row
        Rows of the ranking.
    references : sequence of Reference
        Of the scenarios.
    """
    found = []
    ranked = [r for r in rows if r.ranked]
    if any(r.provisional for r in ranked):
        found.append(f"Provisional: fewer than ten {unit}s.")
    if separation is not None and len(ranked) > 1:
        count = separation.clusters
        if smallest_p_value(count) > _LEVEL:
            found.append(
                f"With {count} {unit}{'s' if count != 1 else ''} no difference can be significant; {FEWEST} or more "
                "are needed. The rows are in order of score, and all are tied."
            )
        elif not separation.any:
            found.append("No two rows can be told apart: all are tied.")
    without = [r for r in references if not r.estimator]
    if without:
        what = "there is no reference figure" if len(without) == len(references) else (
            f"{len(without)} of {len(references)} scenarios have no reference figure, and count")  # fmt: skip
        found.append(f"Errors are in metres: {what}." if len(without) == len(references) else f"{what} in metres.")
    return tuple(found)
