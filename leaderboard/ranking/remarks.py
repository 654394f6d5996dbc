"""What a board has to say about itself: that it is provisional, that it decides nothing, what its ratios are to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.ranking.board import FIRM_REFERENCE
from simnav.leaderboard.ranking.statistics import FEWEST, Separation, smallest_p_value

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Reference, Row

__all__ = ["reference_remarks", "remarks"]

_LEVEL = 0.05


def remarks(
    separation: Separation | None, unit: str, rows: Sequence[Row], references: Sequence[Reference]
) -> tuple[str, ...]:
    """Sentences that stand with a board.

    Parameters
    ----------
    separation : Separation or None
        Separation of the ranked rows.
    unit : str
        ``seed`` or ``recording``.
    rows : sequence of Row
        Rows of the ranking.
    references : sequence of Reference
        References of the scenarios.
    """
    found = []
    ranked = [r for r in rows if r.ranked]
    if any(r.provisional for r in ranked):
        found.append(f"Provisional: fewer than ten {unit}s.")
    fewer = [r for r in ranked if r.adjustment != 1.0]
    if fewer:
        found.append(
            f"{len(fewer)} of {len(ranked)} rows have run fewer {unit}s than others. Their scores are adjusted for how "
            f"hard the missing {unit}s are."
        )
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
    if without and len(without) == len(references):
        found.append("Errors are in metres: there is no reference figure.")
    elif without:
        found.append(f"{len(without)} of {len(references)} scenarios have no reference figure, and count in metres.")
    return tuple(found)


def reference_remarks(references: Sequence[Reference]) -> tuple[str, ...]:
    """What the ratios of a track are to: figures that are shipped, or those of an oracle of this campaign.

    Examples
    --------
    >>> from simnav.leaderboard.ranking.board import Reference
    >>> reference_remarks([Reference(2.0, "oracle", 60, 0.3, stored=True)])
    ('Reference figures: the error of oracle over 60 runs, shipped with the scenario.',)
    >>> reference_remarks([Reference(2.0, "oracle", 9, 0.3, stored=True)])[-1]
    'Ratios are provisional: the reference figure is of fewer than 50 runs.'
    """
    found = []
    for shipped in (True, False):
        those = [r for r in references if r.estimator and r.stored == shipped]
        if not those:
            continue
        names = " or ".join(sorted({r.estimator for r in those}))
        few, many = min(r.runs for r in those), max(r.runs for r in those)
        runs = f"{few} runs" if few == many else f"{few} to {many} runs"
        where = "" if len(those) == len(references) else f" on {len(those)} of {len(references)} scenarios"
        s = "s" if len(those) > 1 else ""
        origin = f"shipped with the scenario{s}" if shipped else "of this campaign, for none is shipped"
        found.append(f"Reference figures{where}: the error of {names} over {runs}, {origin}.")
    weak = sum(r.provisional for r in references)
    if weak:
        where = f" on {weak} of {len(references)} scenarios" if weak < len(references) else ""
        figures = "reference figure is" if weak == 1 else "reference figures are"
        found.append(f"Ratios are provisional{where}: the {figures} of fewer than {FIRM_REFERENCE} runs.")
    return tuple(found)
