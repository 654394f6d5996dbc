"""The file of a paper: the keys of its TOML, and what they mean.

`simnav.leaderboard.papers.reading` makes a paper of it, and `simnav.leaderboard.papers.claims.declared` its claims.

- A list of names may name a group of ``[groups]``, which stands for its names.
- ``lower`` and ``higher`` name a sentence of ``[reasons]``.
- A figure of the paper is a number, ``"none"``, or a range like ``"2.7 to 3.4"``.
- What a table or the file says of rows (`Rows`) holds for all rows below that do not say it themselves.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from simnav.spec import Spec, entries

from .paper import Draw, NotShown, Rule, Variant
from .settings import PaperSetting

__all__ = ["Cells", "ClaimEntry", "DialEntry", "FigureEntry", "PaperFile", "Printed", "Rows", "TableEntry"]

Names = str | list[str]
#: A figure of the paper.
Printed = float | str
#: Figures of rows: one for all, one for each score, or either by method.
Cells = Printed | list[Printed] | dict[str, Printed | list[Printed]]
#: A reason for all scores, or by score.
Reasons = str | dict[str, str]


class Rows(Spec):
    """Rows of a table: one for each scenario, method, other method and score, in this order.

    Attributes
    ----------
    scenario, method, than, score : str or list of str
        Names. With ``than`` a row is a gain over this method. If a table has scenarios, its rows come for each scenario
        in turn, and rows with a scenario of their own only for this one.
    than_score : str or list of str
        Score of the other method, for each score, if it is another one.
    paper : figure, list of figures, or a table of these
        The paper's figure: one for all rows, or a list with one for each score, or either by the name of the method.
    rule : str
        As of `simnav.leaderboard.papers.paper.Value`.
    derived : bool
        Whether the figures are not printed themselves.
    lower, higher : str or mapping
        Names of the reasons why ours is lower, or higher: one for all rows, or by score.
    """

    scenario: Names = ""
    method: Names = ""
    than: Names = ""
    score: Names = ""
    than_score: Names = ""
    paper: Cells = "none"
    rule: Rule = "equal"
    derived: bool = False
    lower: Reasons = ""
    higher: Reasons = ""


class TableEntry(Rows):
    """A table; without ``rows`` what it says is its only block of rows.

    Attributes
    ----------
    title, number : str
        As of `simnav.leaderboard.papers.paper.Table`. ``{part}`` and ``{scenario}`` stand for those of `parts`.
    parts : mapping of str to str
        Name of a part -> scenario: one table for each.
    rows : list of Rows
        The rows.
    """

    title: str
    number: str = ""
    parts: dict[str, str] = Field(default_factory=dict)
    rows: tuple[Rows, ...] = ()


class FigureEntry(Spec):
    """A figure, as of `simnav.leaderboard.papers.paper.Figure`.

    Attributes
    ----------
    series : list of str or mapping
        Label -> what is in the panel; or a list of errors (`simnav.leaderboard.papers.paper.ERROR_LABELS`).
    """

    number: str = ""
    what: str
    draw: Draw = "run"
    scenario: str = ""
    methods: Names = ""
    series: list[str] | dict[str, str] = Field(default_factory=list)
    part: str = ""


class ChoiceEntry(Spec):
    """A choice of a dial: other estimators or another scenario; what is left out stays."""

    row: str = ""
    than: str = ""
    scenario: str = ""


class DialEntry(Spec):
    """A dial of a claim (`simnav.leaderboard.papers.claims.claim.Dial`).

    Attributes
    ----------
    name : str
        On the command line; default: its name in the file.
    title, unit, values, ours, why
        As of `simnav.leaderboard.papers.claims.claim.Dial`; the values of ``choices`` are their names.
    lag : str
        ``row`` or ``both``: the values are the delay of the output of the first method, or of both.
    score : str
        Another score, for this dial.
    row : mapping
        Parameters of the first method (with ``lag``: of those whose output is late).
    keys, than_keys : mapping
        Keys of the scenario of both methods, and of that of the other method alone, which is told another datasheet.
    choices : mapping of str to ChoiceEntry
        Choices that have a name and no number.

    Notes
    -----
    In ``row``, ``keys`` and ``than_keys`` the text ``"value"`` stands for the dial's value, ``"2.5 * value"`` for a
    multiple of it, and ``"20 / value"`` for a number divided by it.
    """

    name: str = ""
    title: str = ""
    unit: str = ""
    values: tuple[float, ...] = ()
    ours: float | str | None = None
    why: str = ""
    lag: Literal["row", "both"] | None = None
    score: str = ""
    row: dict[str, Any] = Field(default_factory=dict)
    keys: dict[str, Any] = Field(default_factory=dict)
    than_keys: dict[str, Any] = Field(default_factory=dict)
    choices: dict[str, ChoiceEntry] = Field(default_factory=dict)


class ClaimEntry(Spec):
    """A claim: the sentence, the printed gain, and the two estimators as they are typed."""

    name: str
    sentence: str
    gain: float
    derived: bool = False
    scenario: str = ""
    row: str
    than: str
    score: str
    than_score: str = ""
    dials: tuple[str, ...] = ()


class PaperFile(Spec):
    """A file; `simnav.leaderboard.papers.paper.Paper` has the meaning of what is not told here.

    Attributes
    ----------
    scenario : str
        Scenario of all that names none.
    methods : mapping of str to str or list of str
        Method of the paper -> the estimators that can stand for it, as typed, the most suitable first.
    smoothed : tuple of str
        Methods whose output is the smoothed trajectory.
    groups : mapping of str to list of str
        Names that are needed more than once.
    reasons : mapping of str to str
        Why our figure is another one, each in one sentence.
    """

    authors: str
    short: str
    title: str
    published: str
    doi: str = ""
    about: str
    runs: int
    full: int
    scenario: str = ""
    notes: tuple[str, ...] = ()
    smoothed: tuple[str, ...] = ()
    methods: dict[str, Names]
    groups: dict[str, list[str]] = Field(default_factory=dict)
    reasons: dict[str, str] = Field(default_factory=dict)
    variants: dict[str, Variant] = Field(default_factory=dict)
    settings: tuple[PaperSetting, ...] = entries("setting", ())
    tables: tuple[TableEntry, ...] = entries("table")
    figures: tuple[FigureEntry, ...] = entries("figure", ())
    not_shown: tuple[NotShown, ...] = ()
    claims: tuple[ClaimEntry, ...] = entries("claim", ())
    dials: dict[str, DialEntry] = Field(default_factory=dict)
