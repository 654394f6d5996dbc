"""The site: one static folder, opened from disk or served, that needs nothing from elsewhere.

``index.html`` holds a table a track; there is a page for each scenario and each estimator, one to compare two rows, and
one on where the results come from. Charts are drawn by one copy of Vega (``vega.js``) from the files in ``data/``. The
folder is built beside its place and swapped in at the end: a run that is killed leaves the old site.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.figures.style import save
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking_figure import ranking_figure
from simnav.leaderboard.ranking.runs import Runs, group
from simnav.leaderboard.results.citation import citation
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.export import Document
from simnav.leaderboard.results.formats import formats, write
from simnav.leaderboard.results.provenance import benchmark_of, distinct
from simnav.leaderboard.site.background import backgrounds
from simnav.leaderboard.site.columns import glossary
from simnav.leaderboard.site.content import EstimatorEntry, ExtraPage, Fact, ScenarioEntry, SiteFacts, slug
from simnav.leaderboard.site.curves import BAND_RUNS, Gathered, gather
from simnav.leaderboard.site.estimator_page import errors_data, estimator_data, facts_of, runs_data, worst_run
from simnav.leaderboard.site.facts import catalogued, estimator_facts, name_of, toml_of
from simnav.leaderboard.site.library import bundle
from simnav.leaderboard.site.overview import BOARD_COLUMNS, overview
from simnav.leaderboard.site.pages import STATIC, TEMPLATES, environment
from simnav.leaderboard.site.scenario_page import RUNS_SHOWN, ScenarioData, scenario_data, seeds_to_show
from simnav.leaderboard.site.sweeps import SweepFile

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Ranking
    from simnav.leaderboard.results.result import Result

__all__ = ["build"]

_STALE = 3600.0  # a build of this age runs no more [s]
_STATIC = (*STATIC, "core.js", "table.js", "charts.js", "compare.js", "page.js", "results.schema.json")


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
) -> Path:
    """Write the site.

    Parameters
    ----------
    results : sequence of Result
        With their series.
    ranking : Ranking
        Of the same results.
    output : Path
        Folder of the site; an older site there is replaced.
    command : str, optional
        That makes the results again; by default it is put together from them.
    progress : callable, optional
        Called with (done, total, note=...).
    workers : int
        Processes that prepare the scenarios.
    papers : sequence of ExtraPage, optional
        Reproductions of papers (`simnav.leaderboard.papers.page.find`).
    editions : sequence of ExtraPage, optional
        Editions of the board (`simnav.leaderboard.standard.editions.pages_of`).
    runs_shown : int
        Runs of each scenario of which track and errors are on the site.
    figures : bool
        Write the charts as SVG and PNG, too, for print.
    sweeps : sequence of SweepFile
        Over dials of the scenarios (`simnav.leaderboard.site.sweeps.find`).

    Returns
    -------
    Path
        Of ``index.html``.

    Raises
    ------
    RequestError
        If there are no results, if they belong to different versions of the benchmark, or if the folder holds something
        that is no site.
    """
    if not results:
        raise RequestError("there are no results to show")
    output = Path(output).expanduser().resolve()
    _refuse_strangers(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    _sweep(output)
    draft = Path(tempfile.mkdtemp(prefix=f".{output.name}.", suffix=".part", dir=output.parent))
    try:
        draft.chmod(0o755)
        report = progress or (lambda *_, **__: None)
        site = _Site(results, ranking, draft, command or reproduce(results), report, workers, papers, editions)
        site.write(runs_shown, figures, sweeps)
        _swap(draft, output)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return output / "index.html"


def _refuse_strangers(output: Path) -> None:
    if output.is_file():
        raise RequestError(f"{output} is a file; a folder for the site is wanted")
    if output.is_dir() and any(output.iterdir()) and not (output / "results.schema.json").is_file():
        raise RequestError(f"{output} holds other files and no site of simnav; name an empty or a new folder")


def _sweep(output: Path) -> None:
    """Delete what builds that were killed left, a while ago, beside the site."""
    for folder in [*output.parent.glob(f".{output.name}.*.part"), *output.parent.glob(f".{output.name}.*.old")]:
        if time.time() - folder.stat().st_mtime > _STALE and (output.exists() or folder.suffix == ".part"):
            shutil.rmtree(folder, ignore_errors=True)


def _swap(draft: Path, output: Path) -> None:
    """Put the new folder in the place of the old one."""
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


def reproduce(results: Sequence[Result]) -> str:
    """The command that makes results like these."""
    scenarios = [_argument(s) for s in dict.fromkeys(r.scenario for r in results)]
    estimators = list(dict.fromkeys(_request(r) for r in results))
    seeds = [r.seed for r in results]
    first, runs = min(seeds), max(seeds) - min(seeds) + 1
    command = f"simnav campaign --scenario {','.join(scenarios)} --estimator {','.join(estimators)} --runs {runs}"
    return command + (f" --seed {first}" if first else "")


def _argument(identity: str) -> str:
    """A scenario as it is asked for: one that is not in the catalogue came from a file."""
    return identity if catalogued(identity) is not None else f"{identity.rpartition('-v')[0]}.toml"


def _request(result: Result) -> str:
    """An estimator as it is asked for; one that is not registered came from a file."""
    from simnav.estimator import names

    name, _, class_name = name_of(result.estimator).partition(":")
    if name not in names():
        name += f".py:{class_name}" if class_name else ".py"
    if not result.parameters:
        return name
    return name + ":" + ",".join(f"{k}={v}" for k, v in result.parameters.items())


class _Site:
    """One build: everything that the pages share."""

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
    ):
        from importlib.metadata import version

        catalogued.cache_clear()
        self.results = sorted(results, key=lambda r: (r.scenario, r.estimator, r.seed))
        self.ranking, self.folder, self.progress, self.workers = ranking, folder, progress, workers
        self.runs = group(self.results)
        ranked = [row.estimator for track in ranking.tracks for row in track.rows]
        labels = list(dict.fromkeys([*ranked, *sorted({r.estimator for r in self.results})]))
        references = {r.estimator for r in self.results if r.reference}
        taken = {"index", "compare", "about"}
        self.estimators: dict[str, EstimatorEntry] = {}
        for label in labels:
            stem = slug(label, taken)
            self.estimators[label] = EstimatorEntry(
                label, f"estimator-{stem}.html", f"row-{stem}", f"runs-{stem}", label in references,
                estimator_facts(label),
            )  # fmt: skip
        described = [_describe(s, by, f"{slug(s, taken)}.html") for s, by in self.runs.items()]
        self.scenarios = {s.id: s for s in described}
        provenances = [r.provenance for r in self.results]
        self.facts = SiteFacts(
            version=version("simnav"),
            generated=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            total=len(self.results),
            scenarios=described,
            estimators=list(self.estimators.values()),
            papers=papers,
            editions=editions,
            command=command,
            benchmark=benchmark_of(provenances),
            provenance=distinct(provenances),
            citation=citation(provenances),
        )

    def write(self, runs_shown: int, figures: bool, sweeps: Sequence[SweepFile]) -> None:
        """Write all pages and data."""
        pages = environment()
        (self.folder / "data").mkdir()
        seeds = {
            s: seeds_to_show(self.ranking.scenario(s), self.runs[s], entry.seeds, runs_shown)
            for s, entry in self.scenarios.items()
        }
        around = backgrounds(list(seeds.items()), self.workers)  # other processes begin to work
        worst = {label: worst_run(label, self.ranking, self.runs) for label in self.estimators}
        gathered = self._gathered(seeds, [found[0] for found in worst.values() if found is not None])
        steps = len(self.scenarios) + 1
        self.progress(0, steps)
        for k, (scenario, behind) in enumerate(zip(self.scenarios.values(), around, strict=True)):
            mine = {n: self.estimators[n] for n in self.runs[scenario.id]}
            found = scenario_data(scenario, self.ranking.scenario(scenario.id), self.runs[scenario.id], mine,
                                  seeds[scenario.id], behind, gathered,
                                  [s for s in sweeps if s.scenario == scenario.id])  # fmt: skip
            for name, content in found.files.items():
                self._data(name, content)
            if figures:
                self._print(scenario, found)
            self._page(pages, "scenario.html", scenario.page, found.page, scenario=scenario)
            self.progress(k + 1, steps, note=scenario.name)
        for label, entry in self.estimators.items():
            self._data(entry.data, errors_data(label, self.ranking, self.scenarios))
            self._data(entry.runs, runs_data(label, self.ranking, self.runs))
            last = worst[label]
            single = None if last is None else gathered.single.get(last[0])
            data = estimator_data(entry, self.ranking, self.runs, self.scenarios, self.estimators, last, single)
            parameters = [runs[label].results[0].parameters for runs in self.runs.values() if label in runs]
            self._page(pages, "estimator.html", entry.page, data, estimator=entry, facts=facts_of(label, self.ranking),
                       data=data, parameters=tables.parameters(parameters[0]) if parameters else "")  # fmt: skip
        tracks = overview(self.ranking, self.estimators, self.scenarios, self.runs)
        if figures:
            for track in self.ranking.tracks:
                save(ranking_figure(track), self.folder / "figures" / f"board-{track.track}", formats=("svg", "png"))
        self._page(
            pages, "index.html", "index.html", {"kind": "index", "tracks": tracks}, tracks=tracks, facts=self._counts()
        )
        rows = {label: {"data": e.data, "page": e.page} for label, e in self.estimators.items()}
        self._page(pages, "compare.html", "compare.html", {"kind": "compare", "rows": rows})
        self._page(pages, "about.html", "about.html", {"kind": "about"}, glossary=glossary(BOARD_COLUMNS))
        for extra in (*self.facts.papers, *self.facts.editions):
            extra.install(self.folder, self.facts)
        for name in _STATIC:
            shutil.copyfile(TEMPLATES / name, self.folder / name)
        (self.folder / "vega.js").write_text(bundle(), encoding="utf-8")
        self._export()
        self.progress(steps, steps)

    def _gathered(self, seeds: Mapping[str, Sequence[int]], worst: Sequence[Result]) -> Gathered:
        """What charts need of the series, each part of a file read once."""
        single, over_all = list(worst), []
        for scenario, by in self.runs.items():
            for runs in by.values():
                over_all += runs.good[:BAND_RUNS]
                single += [r for r in runs.good if r.seed in seeds[scenario]]
        return gather(over_all, single)

    def _counts(self) -> list[Fact]:
        tried = [r for r in self.results if r.tried]
        return [
            Fact("Scenarios", len(self.scenarios)),
            Fact("Estimators", len(self.estimators)),
            Fact("Seeds a scenario", max(len(s.seeds) for s in self.scenarios.values())),
            Fact("Runs", len(tried)),
            Fact("Failed runs", sum(r.status != "ok" for r in tried)),
        ]

    def _export(self) -> None:
        known = ("id", "name", "title", "description", "source", "seeds")
        document = Document(
            self.results,
            self.ranking.to_dict(),
            [{key: getattr(s, key) for key in known} for s in self.scenarios.values()],
            self.facts.command,
            self.facts.generated,
        )
        for name in formats("results"):
            write("results", name, document, self.folder / f"results.{name}")

    def _data(self, name: str, content: Mapping[str, Any]) -> None:
        text = f"simnav.data[{json.dumps(name)}] = {_json(content)};\n"
        (self.folder / "data" / f"{name}.js").write_text(text, encoding="utf-8")

    def _print(self, scenario: ScenarioEntry, found: ScenarioData) -> None:
        from simnav.leaderboard.site.print_figures import filled, write_figure

        (self.folder / "figures").mkdir(exist_ok=True)
        for chart in found.charts:
            write_figure(filled(chart, found.first), self.folder / "figures" / f"{scenario.data}-{chart.name}")

    def _page(self, pages: Any, template: str, name: str, content: Mapping[str, Any], **values: Any) -> None:
        cited = self.facts.citation.text if self.facts.citation is not None else ""
        values.setdefault("data", content)
        text = pages.get_template(template).render(
            page=name, site=self.facts, page_data=_json({**content, "citation": cited}), **values
        )
        (self.folder / name).write_text(text, encoding="utf-8")


def _json(content: Mapping[str, Any]) -> str:
    """JSON that can stand in a page: nothing in it closes an element."""
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _describe(identity: str, by: Mapping[str, Runs], page: str) -> ScenarioEntry:
    """What is known of a scenario, from the catalogue where it is in there."""
    name, _, version = identity.rpartition("-v")
    seeds = tuple(sorted({r.seed for runs in by.values() for r in runs.results}))
    facts = [Fact("Version", version or "–"), Fact("Seeds", len(seeds))]
    scenario = catalogued(identity)
    if scenario is None:
        return ScenarioEntry(identity, name or identity, page, seeds, _argument(identity), tuple(facts))
    facts += [Fact("Duration", tables.duration(scenario.duration)), Fact("Step", tables.duration(scenario.step))]
    if scenario.instruments:
        facts.append(Fact("Instruments", len(scenario.instruments)))
    if scenario.faults:
        facts.append(Fact("Faults", len(scenario.faults)))
    return ScenarioEntry(
        identity, name or identity, page, seeds, _argument(identity), tuple(facts), scenario.title,
        scenario.description, scenario.source, toml_of(identity), scenario.group,
    )  # fmt: skip
