"""What all pages of the site share: scenarios and estimators wherever they are named, and the facts at the foot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from simnav.leaderboard.results.citation import Citation
from simnav.leaderboard.results.provenance import Provenance
from simnav.leaderboard.results.web_addresses import NOWHERE, Home

from .facts import EstimatorFacts
from .headings import Heading

__all__ = ["PLAIN", "EstimatorEntry", "ExtraPage", "Fact", "ScenarioEntry", "SiteFacts"]

#: The row that every estimator is compared with, and that everybody knows.
PLAIN = "ekf"


@dataclass(frozen=True)
class Fact:
    """A name and a value at the head of a page."""

    name: str
    value: str | int


@dataclass(frozen=True)
class EstimatorEntry:
    """An estimator wherever it is named.

    Attributes
    ----------
    label, page : str
        Label of the estimator, and file of its page.
    reference : bool
        Whether it is a reference, which is not ranked.
    facts : EstimatorFacts
        What is shown of it beside its results.
    """

    label: str
    page: str
    reference: bool
    facts: EstimatorFacts

    @property
    def data(self) -> str:
        """Name of the file of its data (``data/NAME.js``)."""
        return Path(self.page).stem


@dataclass(frozen=True)
class ScenarioEntry:
    """A scenario wherever it is named, with what the catalogue knows of it.

    Attributes
    ----------
    id, name, page : str
        Versioned id, name, and file of its page.
    seeds : tuple of int
        All that any estimator ran.
    argument : str
        As the command takes it.
    facts : tuple of Fact
        Facts that are shown beside the title.
    title, description, source, toml, group : str
        Empty for one that is not in the catalogue.
    from_file : bool
        Whether it is not in the catalogue, so that it came from a file of somebody's own.
    duration : float
        Length of a run [s]; 0 where it is not known.
    """

    id: str
    name: str
    page: str
    seeds: tuple[int, ...]
    argument: str
    facts: tuple[Fact, ...]
    title: str = ""
    description: str = ""
    source: str = ""
    toml: str = ""
    group: str = "other"
    from_file: bool = False
    duration: float = 0.0

    @property
    def data(self) -> str:
        """Name of the file of its data."""
        return Path(self.page).stem


class ExtraPage(Protocol):
    """A page that something other than a campaign's results brings to the site: a paper, an edition of the board."""

    @property
    def page(self) -> str:
        """Name of its file."""

    @property
    def paper(self) -> str:
        """What the menu calls it: authors and year of the paper, number of the edition."""

    @property
    def title(self) -> str:
        """Of the paper."""

    @property
    def summary(self) -> str:
        """One line for the index."""

    def install(self, folder: Path, site: SiteFacts) -> None:
        """Write the page and its figures into the folder of a site."""


@dataclass(frozen=True)
class SiteFacts:
    """What all pages share.

    Attributes
    ----------
    version, generated : str
        Version of simnav that wrote the site; date and time.
    total, runs : int
        Results, also of estimators that a scenario does not suit; 0 for a page that stands alone. Runs among them.
    headings : sequence of Heading
        Pages of the tracks.
    scenarios, estimators : sequence
        What has a page of its own, in the order of the menus.
    papers : sequence of ExtraPage
        Pages of the comparisons of papers.
    editions : sequence of ExtraPage
        Pages of the editions of the board.
    command : str
        Command that repeats the results.
    benchmark : str
        Name and version; empty where it is not known.
    provenance : sequence of Provenance
        Provenance of the results, each once.
    citation : Citation or None
        Citation of the results.
    home : Home
        Where the repository and the documentation are, for links.
    """

    version: str
    generated: str
    total: int = 0
    runs: int = 0
    headings: Sequence[Heading] = ()
    scenarios: Sequence[ScenarioEntry] = ()
    estimators: Sequence[EstimatorEntry] = ()
    papers: Sequence[ExtraPage] = ()
    editions: Sequence[ExtraPage] = ()
    command: str = ""
    benchmark: str = ""
    provenance: Sequence[Provenance] = field(default_factory=tuple)
    citation: Citation | None = None
    home: Home = NOWHERE
