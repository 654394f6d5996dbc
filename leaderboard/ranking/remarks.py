"""What a board has to say about itself: that it is provisional, that it decides nothing, what its ratios are to."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from .board import FIRM_REFERENCE
from .statistics import FEWEST, Separation, smallest_p_value
from .superseded import in_words

if TYPE_CHECKING:
    from .board import Reference, Row

__all__ = [
    "learned_remarks", "recorded_remarks", "reference_remarks", "remarks", "request_remarks", "seed_remarks",
    "superseded_remarks",
]  # fmt: skip

#: From so many units on, equal rows are told apart on at most 5 % of boards; with ten, on up to so many per cent.
#: Measured with the differences of real rows, see docs/statistics.md.
_FIRM, _AT_TEN = 30, 11.0
_LEVEL = 0.05
_LEARNED = 5  # rows that a remark names


def remarks(
    separation: Separation | None, unit: str, rows: Sequence[Row], references: Sequence[Reference], unorderable: str
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
    unorderable : str
        Why the rows cannot be ordered; empty where they can.
    """
    found = []
    ranked = [r for r in rows if r.ranked]
    if unorderable:
        found.append(f"Not enough data: {unorderable}. No row has a rank.")
    if any(r.provisional for r in ranked):
        found.append(f"Provisional: fewer than ten {unit}s.")
    incomplete = [r for r in rows if r.standing == "incomplete"]
    if incomplete:
        rows_are = "row is" if len(incomplete) == 1 else "rows are"
        found.append(f"{len(incomplete)} {rows_are} incomplete: not all {unit}s and scenarios of the others were run.")
    variants = [r for r in rows if r.standing == "variant"]
    if variants:
        found.append(f"{len(variants)} variants of other rows are listed apart, and cost the others nothing.")
    if separation is not None and len(ranked) > 1:
        count = separation.clusters
        if smallest_p_value(count) > _LEVEL:
            found.append(
                f"With {count} {unit}{'s' if count != 1 else ''} no difference can be significant; {FEWEST} or more "
                "are needed. The rows are in order of score, and all are tied."
            )
        elif not separation.any:
            found.append("No two rows can be told apart: all are tied.")
        elif count < _FIRM:
            found.append(
                f"With fewer than {_FIRM} {unit}s equal rows may be told apart on more than 5 % of boards: "
                f"with ten, on up to {_AT_TEN:.0f} %."
            )
    without = [r for r in references if not r.estimator]
    if without and len(without) == len(references):
        found.append("Errors are in metres: there is no reference figure.")
    elif without:
        found.append(f"{len(without)} of {len(references)} scenarios have no reference figure, and count in metres.")
    return tuple(found)


def request_remarks(scenarios: Sequence[tuple[int, Sequence[int]]]) -> tuple[str, ...]:
    """Whether a campaign was stopped early, or made longer after results were there.

    Parameters
    ----------
    scenarios : sequence of (int, sequence of int)
        Of each scenario, how many seeds count, and how many were asked for, one number a time.

    Examples
    --------
    >>> request_remarks([(13, (10, 50)), (50, (50,))])
    ('Stopped early: 13 of 50 seeds that were asked for count on 1 of 2 scenarios.', 'The number of seeds was raised \
    after results were there (10, 50) on 1 of 2 scenarios.')
    >>> request_remarks([(30, (30,)), (30, ())])
    ()
    """
    found = []
    of = f"of {len(scenarios)} scenarios"
    early = [(count, asked[-1]) for count, asked in scenarios if asked and count < asked[-1]]
    if early:
        count, asked_for = min(early)
        found.append(f"Stopped early: {count} of {asked_for} seeds that were asked for count on {len(early)} {of}.")
    raised = [tuple(asked) for _, asked in scenarios if len(asked) > 1]
    if raised:
        longest = max(raised, key=len)
        steps = ", ".join(map(str, longest))
        found.append(f"The number of seeds was raised after results were there ({steps}) on {len(raised)} {of}.")
    return tuple(found)


def learned_remarks(rows: Sequence[Row]) -> tuple[str, ...]:
    """Which rows learned their parameters, and from what, as they say."""
    found = [f"{r.estimator} {r.learned}" for r in rows if r.learned]
    if not found:
        return ()
    more = f"; and {len(found) - _LEARNED} rows more" if len(found) > _LEARNED else ""
    return (f"Learned, as the rows say: {'; '.join(found[:_LEARNED])}{more}.",)


def superseded_remarks(rows: Sequence[Row]) -> tuple[str, ...]:
    """Which rows have results of an older version than the one that comes with simnav."""
    found = [(r.estimator, r.superseded) for r in rows if r.superseded]
    return (f"Some results are of an older version: {in_words(found)}.",) if found else ()


def seed_remarks(scenarios: Sequence[Collection[str]]) -> tuple[str, ...]:
    """Whether anybody could simulate the runs of a track beforehand.

    Parameters
    ----------
    scenarios : sequence of collection of str
        Of each scenario, the hashes of the keys of its seeds; an empty text for public seeds.

    Examples
    --------
    >>> seed_remarks([{""}, {""}])
    ('Seeds are public: anybody can simulate the runs, and choose or learn parameters on them.',)
    >>> seed_remarks([{"5ce1"}, {"5ce1"}])
    ('Seeds are sealed (5ce1): nobody could simulate the runs before the key was published.',)
    """
    seals = sorted({seal for found in scenarios for seal in found})
    public = sum("" in found for found in scenarios)
    sealed = ", ".join(seal for seal in seals if seal)
    if not sealed:
        return ("Seeds are public: anybody can simulate the runs, and choose or learn parameters on them.",)
    if not public:
        return (f"Seeds are sealed ({sealed}): nobody could simulate the runs before the key was published.",)
    return (f"Seeds are public on {public} of {len(scenarios)} scenarios, and sealed on the others ({sealed}).",)


def recorded_remarks(recorded: int, scenarios: int) -> tuple[str, ...]:
    """What is known of recorded voyages: their measurements and their reference may be public.

    Examples
    --------
    >>> recorded_remarks(0, 3)
    ()
    >>> recorded_remarks(1, 3)[0].partition(":")[0]
    '1 of 3 scenarios is recorded'
    """
    if not recorded:
        return ()
    verb = "is" if recorded == 1 else "are"
    return (
        f"{recorded} of {scenarios} scenarios {verb} recorded: logs and references can be downloaded by anybody, so an "
        "estimator can hold them, with sealed seeds, too. A row far below the plain smoother is not ranked; one that "
        "uses a reference a little would not be noticed.",
    )


def reference_remarks(references: Sequence[Reference]) -> tuple[str, ...]:
    """What the ratios of a track are to: an oracle on the same runs, shipped figures, or those of this campaign.

    Examples
    --------
    >>> from simnav.leaderboard.ranking.board import Reference
    >>> reference_remarks([Reference(2.0, "oracle", 30, 0.3, paired=True)])
    ('Scores are multiples of the error of oracle on the same runs.',)
    >>> reference_remarks([Reference(2.0, "oracle", 60, 0.3, stored=True)])
    ('Reference figures: the error of oracle over 60 runs, shipped with the scenario.',)
    >>> reference_remarks([Reference(2.0, "oracle", 9, 0.3, stored=True)])[-1]
    'Ratios are provisional: the reference figure is of fewer than 50 runs.'
    """
    found = []
    paired = [r for r in references if r.paired]
    if paired:
        names = " or ".join(sorted({r.estimator for r in paired}))
        where = "" if len(paired) == len(references) else f" on {len(paired)} of {len(references)} scenarios"
        found.append(f"Scores are multiples of the error of {names} on the same runs{where}.")
    for shipped in (True, False):
        those = [r for r in references if r.estimator and r.stored == shipped and not r.paired]
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
