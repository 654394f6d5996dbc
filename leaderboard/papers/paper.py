"""Description of a paper: its citation, the methods that it compares, their figures and claims, and its drawings."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from pydantic import Field

from simnav.scenario import Scenario
from simnav.scenario import load as load_scenario
from simnav.spec import Spec

from .settings import PaperSetting

__all__ = [
    "ERROR_LABELS",
    "KINDS_OF_ROWS",
    "Draw",
    "Figure",
    "Gain",
    "Method",
    "NotShown",
    "Paper",
    "Range",
    "Row",
    "Rule",
    "Table",
    "Value",
    "Variant",
    "kind_of",
]

#: A figure, or the lower and upper end of a range that a paper gives.
Range = float | tuple[float, float]

#: ``equal``: our figure should equal the paper's. ``at-most``, ``at-least``: the paper's figure is a bound. ``beside``:
#: the two figures are of different data and are shown without a verdict.
Rule = Literal["equal", "at-most", "at-least", "beside"]

#: ``track`` and ``run`` (errors over time) show one run. ``spread`` (errors over time), ``bars``, ``gains`` and
#: ``distribution`` show all runs; ``ratios``, which every table has, shows all its figures over the paper's.
Draw = Literal["track", "run", "spread", "bars", "gains", "distribution", "ratios"]


#: Panels of errors over time: error of a run -> label, with its unit.
ERROR_LABELS: Mapping[str, str] = {
    "north": "North error [m]",
    "east": "East error [m]",
    "down": "Down error [m]",
    "velocity_north": "North velocity error [m/s]",
    "velocity_east": "East velocity error [m/s]",
    "velocity_down": "Down velocity error [m/s]",
    "tilt_north": "Tilt about north [deg]",
    "tilt_east": "Tilt about east [deg]",
    "heading": "Heading error [deg]",
    "horizontal": "Horizontal error [m]",
    "position": "Position error [m]",
    "velocity": "Velocity error [m/s]",
    "attitude": "Attitude error [deg]",
}


@dataclass(frozen=True)
class Method:
    """A method of a paper, and the registered estimators that can stand for it.

    Attributes
    ----------
    name : str
        As the paper calls it.
    rows : tuple of str
        Estimators as typed on the command line (``adkf:factor=two-segment``), the most suitable first. The first one
        that is registered is used.
    smoothed : bool
        Whether its output is the smoothed trajectory. Figures of one run then show the smoothed trajectory.
    """

    name: str
    rows: tuple[str, ...]
    smoothed: bool = False


@dataclass(frozen=True)
class Value:
    """One figure of a method.

    Attributes
    ----------
    scenario, method : str
        A scenario of the catalogue, or one of the paper's variants; a name of the paper's methods.
    score : str
        Name of a measure (`simnav.leaderboard.papers.measures`).
    paper : float, pair of float or None
        The paper's figure or range, in the measure's unit. None if the paper has none: our figure is shown alone.
    rule : str
        How the two figures are compared (see `Rule`).
    derived : bool
        Whether the figure follows from other printed figures or from the paper's text, and is not printed itself.
    lower, higher : str
        Reason why our figure is lower, or higher, than the paper's. It is shown only if that is the case.
    """

    scenario: str
    method: str
    score: str
    paper: Range | None = None
    rule: Rule = "equal"
    derived: bool = False
    lower: str = ""
    higher: str = ""


@dataclass(frozen=True)
class Gain:
    """A claim that one method is better than another.

    Attributes
    ----------
    scenario, method, than, score
        As for `Value`.
    paper : float
        Fraction by which the score of ``method`` is below that of ``than``; negative if it is above. None if the paper
        has no such claim: our gain is shown without a verdict.
    than_score : str
        Measure of the other method, if it differs (a filtered error against a smoothed one).
    derived : bool
        As for `Value`.
    lower, higher : str
        Reason why our gain is smaller, or larger, than the paper's.
    """

    scenario: str
    method: str
    than: str
    score: str
    paper: float | None = None
    than_score: str = ""
    derived: bool = False
    lower: str = ""
    higher: str = ""


Row = Value | Gain

#: Kinds of rows that have a verdict (see `kind_of`), with their plural.
KINDS_OF_ROWS: Mapping[str, str] = {
    "figure": "figures",
    "bound": "one-sided bounds",
    "cost bound": "one-sided bounds on time and memory",
}
_COST = ("update_mean", "peak_memory")
_LONGEST_NAME = 60  # of a file of a figure, without its ending


def kind_of(row: Row) -> str:
    """Kind of a row, for counting verdicts: ``figure``, ``bound`` or ``cost bound``.

    A bound is easier to keep than a figure is to match, and a bound on time or memory also compares two computers. So
    the three are counted separately.
    """
    if isinstance(row, Gain) or row.rule not in ("at-most", "at-least"):
        return "figure"
    return "cost bound" if row.score in _COST else "bound"


@dataclass(frozen=True)
class Table:
    """Rows that belong together.

    Attributes
    ----------
    title : str
        Our title.
    rows : tuple of Row
        The rows, in the order of the table.
    number : str
        The paper's table or figure with these figures (``Table 3``); empty if they are in its text.
    """

    title: str
    rows: tuple[Row, ...]
    number: str = ""


@dataclass(frozen=True)
class Figure:
    """A figure of a paper, drawn from our runs.

    Attributes
    ----------
    number : str
        ``Figure 4``; empty for one that the paper does not have.
    what : str
        What it shows.
    draw : str
        How (see `Draw`).
    scenario : str
        Scenario of the catalogue, or a variant of the paper.
    methods : tuple of str
        For ``gains`` the first is the one that is compared with each of the others.
    series : mapping of str to str
        Label of each panel, with its unit -> what is in it. ``run``: an error
        (`simnav.leaderboard.papers.figures.ERRORS`) or a diagnostic (``weight.gnss``; a ``sigma_...`` gets the true
        one beside it). ``spread``: a series of the results (`simnav.scoring.series`). ``bars``, ``gains``: a measure.
    part : str
        Tells several figures of the same number apart.
    """

    number: str
    what: str
    draw: Draw
    scenario: str
    methods: tuple[str, ...]
    series: Mapping[str, str] = field(default_factory=dict)
    part: str = ""

    @property
    def full_number(self) -> str:
        """With the letter of its part, where it has one."""
        return f"{self.number}{self.part}" if len(self.part) == 1 else self.number

    @property
    def title(self) -> str:
        """What it shows, with the name of its part, where it has one."""
        return f"{self.what}, {self.part}" if len(self.part) > 1 else self.what

    @property
    def name(self) -> str:
        """Of the file, without its ending.

        >>> Figure("Figure 5", "Errors", "run", "ship-turn", (), part="CTM").name
        'figure-5-ctm'
        """
        words = re.sub(r"[^a-z0-9]+", "-", f"{self.number or self.what} {self.part}".lower()).strip("-")
        return words[:_LONGEST_NAME].rstrip("-")


class NotShown(Spec):
    """A table or figure of a paper that a simulation cannot show, and why."""

    number: str
    what: str
    why: str


class Variant(Spec):
    """Another reading of a scenario of the catalogue.

    Attributes
    ----------
    of : str
        The scenario of the catalogue.
    without : tuple of str
        Kinds of faults that are taken out of it.
    keys : mapping
        Keys of the scenario's file, like ``fault[0].sigma_m``, with other values. Faults are counted without those that
        were taken out.
    """

    of: str
    without: tuple[str, ...] = ()
    keys: dict[str, Any] = Field(default_factory=dict)

    def scenario(self, name: str) -> Scenario:
        """The variant, as a scenario of this name."""
        base = load_scenario(self.of)
        if self.without:
            base = base.model_copy(update={"faults": tuple(f for f in base.faults if f.kind not in self.without)})
        return base.with_values({"name": name, **self.keys})


@dataclass(frozen=True)
class Paper:
    """A paper.

    Attributes
    ----------
    key : str
        Name on the command line, such as ``guo-2026`` (`simnav.leaderboard.papers.PAPERS`).
    authors : str
        All authors, as a list of references prints them.
    short : str
        Citation in a sentence, such as ``Guo et al. (2026)``.
    title : str
        Title of the paper.
    published : str
        Journal or preprint server, volume, pages and year.
    doi : str
        Digital object identifier; empty if none is known.
    about : str
        Subject of the comparison in a few words.
    runs : int
        Default number of runs of each scenario; the comparison then takes a few minutes.
    full : int
        Number of runs in the paper, or the number that decides most rows.
    methods : tuple of Method
        The methods that the paper compares, and ours beside them.
    tables : tuple of Table
        Tables with the rows to be compared.
    figures : tuple of Figure
        Figures to be drawn.
    not_shown : tuple of NotShown
        Together with tables and figures all that the paper has.
    notes : tuple of str
        What the reader has to know of the comparison.
    settings : tuple of PaperSetting
        The settings of the comparison, each with what the paper says of it.
    variants : mapping of str to Variant
        Other readings of a scenario, by their names.
    """

    key: str
    authors: str
    short: str
    title: str
    published: str
    doi: str
    about: str
    runs: int
    full: int
    methods: tuple[Method, ...]
    tables: tuple[Table, ...]
    figures: tuple[Figure, ...] = ()
    not_shown: tuple[NotShown, ...] = ()
    notes: tuple[str, ...] = ()
    settings: tuple[PaperSetting, ...] = ()
    variants: Mapping[str, Variant] = field(default_factory=dict)

    @property
    def citation(self) -> str:
        """Authors, title, place of publication and DOI."""
        doi = f" doi:{self.doi}" if self.doi else " No DOI is known."
        return f"{self.authors}: {self.title}. {self.published}.{doi}"

    def rows(self) -> Iterator[Row]:
        """All rows of all tables."""
        for table in self.tables:
            yield from table.rows

    def method(self, name: str) -> Method:
        """The method of that name."""
        return next(m for m in self.methods if m.name == name)

    def only(self, names: Collection[str]) -> Paper:
        """The part of it that is about these methods and no others: what is costly can be left out of a long run.

        Raises
        ------
        ValueError
            If there is no such method, or no row is left; one sentence.
        """
        known = [m.name for m in self.methods]
        for name in names:
            if name not in known:
                raise ValueError(f"{self.short} has no method {name!r}; it has {', '.join(known)}")

        def about(row: Row) -> bool:
            return row.method in names and (not isinstance(row, Gain) or row.than in names)

        tables = tuple(replace(t, rows=rows) for t in self.tables if (rows := tuple(filter(about, t.rows))))
        if not tables:
            raise ValueError(f"{self.short} has no row that is about {' and '.join(names)} alone")
        figures = tuple(f for f in self.figures if set(f.methods) <= set(names))
        methods = tuple(m for m in self.methods if m.name in names)
        return replace(self, methods=methods, tables=tables, figures=figures)

    def scenario(self, name: str) -> Scenario:
        """A scenario of the catalogue, or a variant of one."""
        if name in self.variants:
            return self.variants[name].scenario(name)
        return load_scenario(name)

    def participants(self) -> dict[str, list[str]]:
        """Scenario -> methods that its rows and figures are about, in the paper's order."""
        wanted: dict[str, set[str]] = {}
        for row in self.rows():
            wanted.setdefault(row.scenario, set()).add(row.method)
            if isinstance(row, Gain):
                wanted[row.scenario].add(row.than)
        for figure in self.figures:
            if figure.draw not in ("run", "track"):  # those are of one run, which is made for them
                wanted.setdefault(figure.scenario, set()).update(figure.methods)
        return {s: [m.name for m in self.methods if m.name in names] for s, names in wanted.items()}
