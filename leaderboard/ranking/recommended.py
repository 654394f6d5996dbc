"""What a recommendation says: the row, those that may be as good, and the evidence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .trouble_profile import GroupRow, TroubleGroup

__all__ = ["Answer", "Candidate", "Confidence", "Elsewhere"]

#: How sure it is: the row is better than the plain row in other scenarios of the kind, too; it is in these scenarios;
#: no row is significantly better; there is no evidence.
Confidence = Literal["beyond these scenarios", "in these scenarios", "undecided", "none"]


@dataclass(frozen=True)
class Candidate:
    """A row that may be taken.

    Attributes
    ----------
    estimator : str
        Label.
    cost : float
        Processor time as a multiple of that of the plain row; NaN where it was not measured.
    milliseconds : float
        The same times the median time of an epoch of the plain row in the stored runs.
    result : GroupRow
        Over all of the evidence.
    """

    estimator: str
    cost: float
    milliseconds: float
    result: GroupRow


@dataclass(frozen=True)
class Elsewhere:
    """The chosen row in scenarios that speak for the instruments, and decide nothing.

    Attributes
    ----------
    title : str
        Title of the track, or of the kind of trouble.
    scenarios : tuple of str
        Versioned ids.
    result : GroupRow
        The chosen row there.
    """

    title: str
    scenarios: tuple[str, ...]
    result: GroupRow


@dataclass(frozen=True, repr=False)
class Answer:
    """Which row to take.

    Attributes
    ----------
    instruments : tuple of str
        Kinds of instruments of the vessel.
    troubles : tuple of str
        Kinds of trouble that the answer is about.
    without_evidence : tuple of str
        Kinds of trouble that were asked for, or exist, and of which no scenario speaks for the instruments.
    on_other_tracks : tuple of str
        Kinds of trouble of which only other tracks have scenarios for the instruments, if none was asked for.
    limit : float or None
        Milliseconds that an epoch may take.
    confidence : str
        ``beyond these scenarios``: better than the plain row, and so it is likely in other scenarios of the kind;
        ``in these scenarios``: significantly better there; ``undecided``: no row is; ``none``: no evidence.
    why : str
        Why there is no evidence, or why the rows cannot be ordered; empty otherwise.
    row, plain : Candidate or None
        The row that should be taken, and the plain row; None without evidence.
    as_good : tuple of Candidate
        Rows that may be taken, too: no row is significantly better. The cheapest first; where it is undecided,
        the one with the smallest error.
    compared : int
        Number of rows that were compared.
    groups : tuple of TroubleGroup
        The evidence, by kind of trouble.
    elsewhere : tuple of Elsewhere
        The row in the same troubles on other tracks, and on recorded voyages.
    worse : tuple of Elsewhere
        The kinds of trouble that were not asked for in which the row is significantly worse than the plain row.
    """

    instruments: tuple[str, ...]
    troubles: tuple[str, ...]
    without_evidence: tuple[str, ...]
    on_other_tracks: tuple[str, ...]
    limit: float | None
    confidence: Confidence
    why: str
    row: Candidate | None
    plain: Candidate | None
    as_good: tuple[Candidate, ...]
    compared: int
    groups: tuple[TroubleGroup, ...]
    elsewhere: tuple[Elsewhere, ...]
    worse: tuple[Elsewhere, ...]
