"""The site: one static folder, opened from disk or served, that needs nothing from elsewhere.

``index.html`` is the first view; the tables of the tracks stand under five headings, each a page. There is a page for
each scenario and each estimator, one to compare two rows, and one on where the results come from. Each page has a file
of data, ``data/NAME.js``, of which its tables are made and its charts are drawn, by one copy of Vega (``vega.js``). The
folder is built beside its place and swapped in at the end: a run that is killed leaves the old site.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.estimator import names
from simnav.leaderboard.figures import appearance
from simnav.leaderboard.figures.style import save
from simnav.leaderboard.forks import forked
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.first_view import first_view
from simnav.leaderboard.ranking.lost_runs import LOSS
from simnav.leaderboard.ranking.ranking_figure import ranking_figure
from simnav.leaderboard.ranking.runs import group
from simnav.leaderboard.ranking.statistics import FAILURE
from simnav.leaderboard.ranking.summary import spread
from simnav.leaderboard.ranking.trouble_profile import profiles_of
from simnav.leaderboard.ranking.voyages import side_by_side
from simnav.leaderboard.results.citation import citation
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.export import Document
from simnav.leaderboard.results.formats import formats, write
from simnav.leaderboard.results.provenance import benchmark_of, distinct
from simnav.leaderboard.results.stored_series import LostSeriesError
from simnav.leaderboard.results.web_addresses import NOWHERE, Home

from .advisor import advisor
from .background import Background, background_of
from .columns import glossary
from .content import ExtraPage, Fact, ScenarioEntry, SiteFacts
from .curves import BAND_RUNS, Gathered, gather, one_run
from .entries import argument_of, entries
from .estimator_page import estimator_data, facts_of, worst_runs
from .facts import catalogued, name_of
from .first_page import picture
from .headings import headings
from .library import bundle
from .light_pictures import in_few_colours
from .overview import BOARD_COLUMNS, track_data
from .pages import STATIC, TEMPLATES, environment
from .print_figures import filled, write_figure
from .scenario_page import RUNS_SHOWN, ScenarioData, scenario_data, seeds_to_show
from .sweeps import SweepFile
from .win_matrix import win_matrix

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Ranking
    from simnav.leaderboard.ranking.track_runs import TrackRuns
    from simnav.leaderboard.results.result import Result

__all__ = ["build"]

#: Fewer scenarios than this are written by one process.
WORTH_PROCESSES = 3
_STALE = 3600.0  # a build of this age runs no more [s]
_STATIC = (*STATIC, "core.js", "table.js", "compare.js", "page.js", "results.schema.json")


def build(
    results: Sequence[Result],
    ranking: Ranking,
    output: Path,
    *,
    command: str | None = None,
    progress: Callable[..., None] | None = None,
    workers: int = 1,
    papers: Sequence[ExtraPage] = (),
    editions: Sequence[ExtraPage] = (),
    runs_shown: int = RUNS_SHOWN,
    figures: bool = False,
    sweeps: Sequence[SweepFile] = (),
    seeds: Mapping[str, Sequence[int]] | None = None,
    home: Home = NOWHERE,
    tracks: Sequence[TrackRuns] = (),
    backgrounds: Mapping[str, Background] | None = None,
) -> Path:
    """Write the site.

    Parameters
    ----------
    results : sequence of Result
        Results with their series.
    ranking : Ranking
        Ranking of the same results.
    output : Path
        Folder of the site; an older site there is replaced.
    command : str, optional
        Command that repeats the results. Default: it is derived from them.
    progress : callable, optional
        Called with (done, total, note=...).
    workers : int
        Processes that write the pages of scenarios and estimators, and the results in other formats.
    papers : sequence of ExtraPage, optional
        Reproductions of papers (`simnav.leaderboard.papers.page.pages_in`).
    editions : sequence of ExtraPage, optional
        Editions of the board (`simnav.leaderboard.standard.editions.pages_of`).
    runs_shown : int
        Runs of each scenario of which track and errors are on the site.
    figures : bool
        Write the charts as SVG and PNG, too, for print.
    sweeps : sequence of SweepFile
        Over dials of the scenarios (`simnav.leaderboard.site.sweeps.sweeps_in`).
    seeds : mapping of str to sequence of int, optional
        By scenario, the runs that have series, where not all have.
    home : Home
        Where the repository and the documentation are (`simnav.leaderboard.results.web_addresses.linked_from`).
    tracks : sequence of TrackRuns, optional
        The runs that the ranking is made from; without them there are no picture and no advice on the first page.
    backgrounds : mapping of str to Background, optional
        By scenario, what is known of its recordings; others are made, or are in the user's cache.

    Returns
    -------
    Path
        Path of ``index.html``.

    Raises
    ------
    RequestError
        If there are no results, if they belong to different versions of the benchmark, or if the folder holds something
        that is no site.
    """
    if not results:
        raise RequestError("there are no results to show")
    output = Path(output).expanduser().resolve()
    with _in_place_of(output) as draft:
        catalogued.cache_clear()
        report = progress or (lambda *_, **__: None)
        site = _Site(results, ranking, draft, command or reproduce(results), report, workers, papers, editions, home,
                     tracks)  # fmt: skip
        site.write(runs_shown, figures, sweeps, seeds or {}, backgrounds or {})
    return output / "index.html"


@contextmanager
def _in_place_of(output: Path) -> Iterator[Path]:
    """A folder beside another one, which takes its place at the end; a build that is killed leaves the old one.

    What builds that were killed left, a while ago, is deleted.
    """
    if output.is_file():
        raise RequestError(f"{output} is a file; a folder for the site is wanted")
    if output.is_dir() and any(output.iterdir()) and not (output / "results.schema.json").is_file():
        raise RequestError(f"{output} holds other files and no site of simnav; name an empty or a new folder")
    output.parent.mkdir(parents=True, exist_ok=True)
    for folder in [*output.parent.glob(f".{output.name}.*.part"), *output.parent.glob(f".{output.name}.*.old")]:
        if time.time() - folder.stat().st_mtime > _STALE and (output.exists() or folder.suffix == ".part"):
            shutil.rmtree(folder, ignore_errors=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{output.name}.", suffix=".part", dir=output.parent))
    try:
        draft.chmod(0o755)
        yield draft
        if not output.exists():
            os.replace(draft, output)
            return
        old = Path(tempfile.mkdtemp(prefix=f".{output.name}.", suffix=".old", dir=output.parent))
        os.replace(output, old)
        try:
            os.replace(draft, output)
        except OSError:
            os.replace(old, output)
            raise
        shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def reproduce(results: Sequence[Result]) -> str:
    """The command that makes results like these."""
    scenarios = [argument_of(s) for s in dict.fromkeys(r.scenario for r in results)]
    estimators = list(dict.fromkeys(_request(r) for r in results))
    seeds = [r.seed for r in results]
    first, runs = min(seeds), max(seeds) - min(seeds) + 1
    command = f"simnav campaign --scenario {','.join(scenarios)} --estimator {','.join(estimators)} --runs {runs}"
    return command + (f" --seed {first}" if first else "")


def _request(result: Result) -> str:
    """An estimator as it is asked for; one that is not registered came from a file."""
    name, _, class_name = name_of(result.estimator).partition(":")
    if name not in names():
        name += f".py:{class_name}" if class_name else ".py"
    if not result.parameters:
        return name
    return name + ":" + ",".join(f"{k}={v}" for k, v in result.parameters.items())


@dataclass(frozen=True)
class _Plan:
    """What pages show: by scenario, runs one by one, and recordings; by estimator, its runs from the worst on, and the
    worst that has series; what was read of series; charts for print; sweeps.
    """

    seeds: Mapping[str, Sequence[int]]
    backgrounds: Mapping[str, Background]
    ordered: Mapping[str, Sequence[tuple[Result, float]]]
    worst: Mapping[str, tuple[Result, float] | None]
    gathered: Gathered
    figures: bool
    sweeps: Sequence[SweepFile]


def _with_series(ordered: Sequence[tuple[Result, float]], gathered: Gathered) -> tuple[Result, float] | None:
    """The first of these runs that has series. They are nearly always those of the first, which are gathered."""
    for pair in ordered:
        with suppress(LostSeriesError):  # the first pass said so
            if pair[0] not in gathered.single and pair[0].series:
                gathered.single.update(gather((), [pair[0]]).single)
        if pair[0] in gathered.single:
            return pair
    return None


class _Site:
    """One build: everything that the pages share."""

    plan: _Plan

    def __init__(
        self,
        results: Sequence[Result],
        ranking: Ranking,
        folder: Path,
        command: str,
        progress: Callable[..., None],
        workers: int,
        papers: Sequence[ExtraPage],
        editions: Sequence[ExtraPage],
        home: Home,
        tracks: Sequence[TrackRuns],
    ):
        self.results = sorted(results, key=lambda r: (r.scenario, r.estimator, r.seed))
        self.ranking, self.folder, self.progress, self.workers = ranking, folder, progress, workers
        self.tracks, profiles = tracks, profiles_of(tracks)
        self.view = first_view(ranking, profiles)
        self.silence = {p.track: p.silence for p in profiles}
        self.runs = group(self.results)
        self.pages = environment()
        self.estimators, self.scenarios = entries(self.runs, ranking)
        provenances, tried = [r.provenance for r in self.results], [r.provenance for r in self.results if r.tried]
        self.facts = SiteFacts(
            version=version("simnav"),
            generated=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            total=len(self.results),
            runs=len(tried),
            headings=headings(ranking.tracks),
            scenarios=list(self.scenarios.values()),
            estimators=list(self.estimators.values()),
            papers=papers,
            editions=editions,
            command=command,
            benchmark=benchmark_of(provenances),
            provenance=distinct(provenances),
            citation=citation(tried),
            home=home,
        )

    def write(
        self,
        runs_shown: int,
        figures: bool,
        sweeps: Sequence[SweepFile],
        kept: Mapping[str, Sequence[int]],
        backgrounds: Mapping[str, Background],
    ) -> None:
        """Write all pages and data."""
        (self.folder / "data").mkdir()
        if figures:
            (self.folder / "figures").mkdir()
        seeds = {
            s: seeds_to_show(self.ranking.scenario(s), self.runs[s], kept.get(s) or entry.seeds, runs_shown)
            for s, entry in self.scenarios.items()
        }
        ordered = {label: worst_runs(label, self.ranking, self.runs) for label in self.estimators}
        workers = self.workers if len(self.scenarios) >= WORTH_PROCESSES else 1
        with forked(self.export, formats("results"), workers) as exported:
            gathered = self._gathered(seeds, [found[0][0] for found in ordered.values() if found])
            worst = {label: _with_series(found, gathered) for label, found in ordered.items()}
            self.plan = _Plan(seeds, backgrounds, ordered, worst, gathered, figures, sweeps)
            pages = [*(partial(self.scenario, s) for s in self.scenarios),
                     *(partial(self.estimator, label) for label in self.estimators)]  # fmt: skip
            with forked(lambda k: pages[k](), range(len(pages)), workers) as written:
                self._other_pages()
                steps = len(pages) + 1
                self.progress(0, steps)
                for k, (page, _) in enumerate(zip(pages, written, strict=True)):
                    self.progress(k + 1, steps, note=page.args[0])
            list(exported)
        self.progress(steps, steps)

    def estimator(self, label: str) -> None:
        """Write the page of an estimator and its data, with the worst run that has series."""
        entry, last = self.estimators[label], self.plan.worst[label]
        shown = None if last is None else one_run(self.plan.gathered.single[last[0]])
        data = estimator_data(entry, self.ranking, self.runs, self.scenarios, self.estimators, last, shown)
        if data["worst"] is not None:
            data["worst"]["of_all"] = last is self.plan.ordered[label][0]
        parameters = [runs[label].results[0].parameters for runs in self.runs.values() if label in runs]
        self._page("estimator.html", entry.page, data, estimator=entry, facts=facts_of(label, self.ranking),
                   data=data, parameters=tables.parameters(parameters[0]) if parameters else "")  # fmt: skip

    def _other_pages(self) -> None:
        """Write the pages of the board, and all that pages share."""
        if self.plan.figures:
            for track in self.ranking.tracks:
                save(ranking_figure(track), self.folder / "figures" / f"board-{track.track}", formats=("svg", "png"))
        index = {"kind": "index", "advisor": advisor(self.tracks)}
        self._page("index.html", "index.html", index, facts=self._counts(),
                   view=None if self.view is None else picture(self.view, self.estimators))  # fmt: skip
        voyages = side_by_side(self.ranking)
        for heading in self.facts.headings:
            shown_tracks = [
                track_data(t, self.estimators, self.scenarios, self.runs) | {"silence": self.silence.get(t.track, "")}
                for t in heading.tracks
            ]
            own = {t.track for t in heading.tracks}
            self._page("tracks.html", heading.page, {"kind": "tracks", "tracks": shown_tracks}, heading=heading,
                       tracks=shown_tracks, voyages=[v for v in voyages if v.recorded in own], loss=LOSS)  # fmt: skip
        rows = {label: {"data": e.data, "page": e.page} for label, e in self.estimators.items()}
        self._page("compare.html", "compare.html", {"kind": "compare", "rows": rows, "wins": self._wins()})
        self._page("about.html", "about.html", {"kind": "about"}, glossary=glossary(BOARD_COLUMNS))
        for extra in (*self.facts.papers, *self.facts.editions):
            extra.install(self.folder, self.facts)
        for path in (self.folder / "figures").glob("paper-*/*.png"):
            in_few_colours(path)
        for name in _STATIC:
            shutil.copyfile(TEMPLATES / name, self.folder / name)
        menus = {
            "scenarios": [(s.name, s.page) for s in self.facts.scenarios],
            "estimators": sorted((e.label, e.page) for e in self.facts.estimators),
        }
        for name, key, value in (("charts.js", "$APPEARANCE", appearance.for_browser()), ("menu.js", "$MENUS", menus)):
            text = (TEMPLATES / name).read_text(encoding="utf-8").replace(key, json.dumps(value))
            (self.folder / name).write_text(text, encoding="utf-8")
        (self.folder / "vega.js").write_text(bundle(), encoding="utf-8")

    def _wins(self) -> list[dict[str, Any]]:
        """The matrix of wins of each track that has one."""
        found = []
        for track in self.ranking.tracks:
            chart = win_matrix(track, [self.ranking.scenario(s) for s in track.scenarios])
            if chart is not None:
                found.append({"key": track.track, "title": track.title, "chart": chart.to_dict()})
        return found

    def _gathered(self, seeds: Mapping[str, Sequence[int]], worst: Sequence[Result]) -> Gathered:
        """What charts need of the series, each part of a file read once."""
        single, over_all = list(worst), []
        for scenario, by in self.runs.items():
            for runs in by.values():
                over_all += runs.good[:BAND_RUNS]
                single += [r for r in runs.good if r.seed in seeds[scenario]]
        return gather(over_all, single)

    def scenario(self, identity: str) -> None:
        """Write the page of a scenario and its data."""
        entry, runs, plan = self.scenarios[identity], self.runs[identity], self.plan
        seeds, around = plan.seeds[identity], plan.backgrounds.get(identity)
        if around is None or list(around.runs) != list(map(str, seeds)):
            around = background_of(identity, seeds)
        found = scenario_data(
            entry, self.ranking.scenario(identity), runs, {n: self.estimators[n] for n in runs}, seeds, around,
            plan.gathered, [s for s in plan.sweeps if s.scenario == identity],
        )  # fmt: skip
        if plan.figures:
            self._print(entry, found)
        self._page("scenario.html", entry.page, found.page, scenario=entry)

    def _counts(self) -> list[Fact]:
        tried = [r for r in self.results if r.tried]
        return [
            Fact("Scenarios", len(self.scenarios)),
            Fact("Estimators", len(self.estimators)),
            Fact("Seeds a scenario", spread(len(s.seeds) for s in self.scenarios.values())),
            Fact("Runs", len(tried)),
            Fact("Failed runs", sum(r.status != "ok" for r in tried)),
        ]

    def export(self, name: str) -> None:
        """Write the results in a format."""
        known = ("id", "name", "title", "description", "source", "seeds")
        document = Document(
            self.results,
            self.ranking.to_dict(),
            [{key: getattr(s, key) for key in known} for s in self.scenarios.values()],
            self.facts.command,
            self.facts.generated,
        )
        write("results", name, document, self.folder / f"results.{name}")

    def _print(self, scenario: ScenarioEntry, found: ScenarioData) -> None:
        for chart in found.charts:
            write_figure(filled(chart, found.first), self.folder / "figures" / f"{scenario.data}-{chart.name}")

    def _page(self, template: str, name: str, content: Mapping[str, Any], **values: Any) -> None:
        """Write a page, and its data as a compressed script: a page from disk can read no other file."""
        cited = self.facts.citation.text if self.facts.citation is not None else ""
        data = Path(name).stem
        text = self.pages.get_template(template).render(
            page=name, site=self.facts, data_file=data, **{"data": content, **values}
        )
        (self.folder / name).write_text(text, encoding="utf-8")
        plain = json.dumps({**content, "citation": cited, "failure": FAILURE}, allow_nan=False, separators=(",", ":"))
        packed = base64.b64encode(zlib.compress(plain.encode(), 9)).decode()
        script = f'simnav.packed["{data}"] = "{packed}";\n'
        (self.folder / "data" / f"{data}.js").write_text(script, encoding="ascii")
