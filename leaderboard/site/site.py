"""The site: one static folder, opened from disk or served, that needs nothing from elsewhere.

``index.html`` holds the ranking, and there is a page for each scenario and each estimator; the figures are SVG and
PNG, the data JSON, CSV and Parquet. The folder is built beside its place and swapped in at the end: a run that is
killed leaves the old site.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.figures.plots import Style
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking_figure import ranking_figure
from simnav.leaderboard.ranking.ranking_table import ratio, score_caption, score_title, tier_starts
from simnav.leaderboard.ranking.runs import Runs, group
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.export import Document
from simnav.leaderboard.results.formats import formats, write
from simnav.leaderboard.site.content import (
    Cell,
    EstimatorEntry,
    EstimatorPage,
    EstimatorRow,
    ExtraPage,
    Fact,
    Failure,
    Image,
    IndexRow,
    IndexTrack,
    MatrixRow,
    ScenarioEntry,
    ScenarioPage,
    ScenarioPageRow,
    SiteFacts,
    bars,
    score_cells,
)
from simnav.leaderboard.site.pages import STATIC, TEMPLATES, environment
from simnav.leaderboard.site.scenario_figures import catalogued, scenario_figures, write_figure
from simnav.scoring import badge

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Ranking, ScenarioRanking, TrackRanking
    from simnav.leaderboard.results.result import Result

__all__ = ["build"]

_WORTH_PROCESSES = 3  # scenarios
_STALE = 3600.0  # a build of this age runs no more [s]
_NAME_OF_LABEL = re.compile(r"[(\[ ]")  # a label is a name, and its parameters in brackets
_STATIC = (*STATIC, "results.schema.json")


def build(
    results: Sequence[Result],
    ranking: Ranking,
    output: Path,
    *,
    command: str | None = None,
    progress: Callable[..., None] | None = None,
    workers: int = 1,
    papers: Sequence[ExtraPage] = (),
) -> Path:
    """Write the site.

    Parameters
    ----------
    results : sequence of Result
    ranking : Ranking
        Of the same results.
    output : Path
        Folder of the site; an older site there is replaced.
    command : str, optional
        That makes the results again; by default it is put together from them.
    progress : callable, optional
        Called with (done, total, note=...).
    workers : int
        Processes that draw the figures.
    papers : sequence of ExtraPage, optional
        Reproductions of papers (`simnav.leaderboard.papers.page.find`).

    Returns
    -------
    Path
        Of ``index.html``.

    Raises
    ------
    RequestError
        If there are no results, or the folder holds something that is no site.
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
        _Site(results, ranking, draft, command or reproduce(results), report, workers, papers).write()
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

    name, _, class_name = _NAME_OF_LABEL.split(result.estimator, maxsplit=1)[0].partition(":")
    if name not in names():
        name += f".py:{class_name}" if class_name else ".py"
    if not result.parameters:
        return name
    return name + ":" + ",".join(f"{k}={v}" for k, v in result.parameters.items())


def slug(text: str, taken: set[str]) -> str:
    """A file name for a label: plain characters only, and none twice."""
    plain = re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.")[:60] or "unnamed"
    if plain in taken or plain != text:
        plain += "-" + hashlib.blake2b(text.encode(), digest_size=3).hexdigest()
    taken.add(plain)
    return plain


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
    ):
        self.results = sorted(results, key=lambda r: (r.scenario, r.estimator, r.seed))
        self.ranking, self.folder, self.progress, self.workers = ranking, folder, progress, workers
        self.runs = group(self.results)
        labels = list(
            dict.fromkeys(
                [
                    *(row.estimator for track in ranking.tracks for row in track.rows),
                    *sorted({r.estimator for r in self.results}),
                ]
            )
        )
        references = {r.estimator for r in self.results if r.reference}
        self.style = Style(labels, references)
        taken = {"index"}
        self.estimators = {
            label: EstimatorEntry(
                label,
                f"estimator-{slug(label, taken)}.html",
                self.style.colour(label),
                self.style.colour(label, dark=True),
                label in references,
            )
            for label in labels
        }
        self.scenarios = [_describe(s, by, f"{slug(s, taken)}.html") for s, by in self.runs.items()]
        versions = _versions()
        generated = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
        self.facts = SiteFacts(
            versions["simnav"], generated, len(self.results), self.scenarios, papers, command, versions
        )

    def write(self) -> None:
        """Write all pages, figures and data."""
        pages = environment()
        (self.folder / "figures").mkdir()
        steps = len(self.scenarios) + 1
        self.progress(0, steps)
        for k, (scenario, figures) in enumerate(zip(self.scenarios, self._draw(), strict=True)):
            self._page(pages, "scenario.html", scenario.page, scenario=self._scenario(scenario, figures))
            self.progress(k + 1, steps, note=scenario.name)
        for label, estimator in self.estimators.items():
            self._page(pages, "estimator.html", estimator.page, estimator=self._estimator(label))
        self._page(pages, "index.html", "index.html", **self._index())
        for extra in self.facts.papers:
            extra.install(self.folder, self.facts)
        for name in _STATIC:
            shutil.copyfile(TEMPLATES / name, self.folder / name)
        self._export()
        self.progress(steps, steps)

    def _export(self) -> None:
        known = ("id", "name", "title", "description", "source", "seeds")
        document = Document(
            self.results,
            self.ranking.to_dict(),
            [{key: getattr(s, key) for key in known} for s in self.scenarios],
            self.facts.command,
            self.facts.generated,
        )
        for name in formats("results"):
            write("results", name, document, self.folder / f"results.{name}")

    def _ranking_of(self, scenario: ScenarioEntry) -> ScenarioRanking:
        return next(s for s in self.ranking.scenarios if s.scenario == scenario.id)

    def _draw(self) -> Iterator[list[Image]]:
        """The figures of one scenario after the other; several processes where it is worth their start."""
        tasks = [
            (self.folder, s, [self.runs[s.id][row.estimator] for row in self._ranking_of(s).rows], self.style)
            for s in self.scenarios
        ]
        if self.workers < 2 or len(tasks) < _WORTH_PROCESSES:
            yield from (scenario_figures(*task) for task in tasks)
            return
        from joblib import Parallel, delayed

        before = os.environ.get("PYTHONSAFEPATH")
        os.environ["PYTHONSAFEPATH"] = "1"  # a folder of ours where the user stands must not be imported
        try:
            parallel = Parallel(n_jobs=min(self.workers, len(tasks)), return_as="generator", pre_dispatch="2*n_jobs")
            yield from parallel(delayed(scenario_figures)(*task) for task in tasks)
        finally:
            os.environ.pop("PYTHONSAFEPATH") if before is None else os.environ.update(PYTHONSAFEPATH=before)

    def _page(self, pages: Any, template: str, name: str, **values: Any) -> None:
        page = "index" if name == "index.html" else name
        text = pages.get_template(template).render(page=page, site=self.facts, **values)
        (self.folder / name).write_text(text, encoding="utf-8")

    # -- index -----------------------------------------------------------------------------------

    def _index(self) -> dict[str, object]:
        facts = [
            Fact("Scenarios", len(self.scenarios)),
            Fact("Estimators", len(self.estimators)),
            Fact("Seeds a scenario", max(len(s.seeds) for s in self.scenarios)),
            Fact("Runs", sum(r.tried for r in self.results)),
            Fact("Failed", sum(runs.failed for by in self.runs.values() for runs in by.values())),
        ]
        return {"facts": facts, "tracks": [self._track(t) for t in self.ranking.tracks], "matrix": self._matrix()}

    def _track(self, track: TrackRanking) -> IndexTrack:
        starts = tier_starts([r.tier for r in track.rows])
        rows = tuple(
            IndexRow(row, self.estimators[row.estimator], first, bar)
            for row, first, bar in zip(track.rows, starts, bars(track.rows), strict=True)
        )
        figure = None
        if any(math.isfinite(row.score) for row in track.rows):
            figure = write_figure(
                self.folder,
                ranking_figure(track, self.style),
                f"ranking-{track.track}",
                f"{track.title}: the ranking with its intervals; hollow: reference.",
                "Score of every estimator with its interval, as in the table above",
            )
        barred = [r for r in track.rows if r.why]
        notes = (*track.remarks, *(f"{r.estimator} is not ranked ({r.standing}): {r.why}." for r in barred))
        title = score_title(track).replace(" ", "\u00a0")
        return IndexTrack(track.track, track.title, score_caption(track), title, track.provisional, rows, notes, figure)

    def _matrix(self) -> list[MatrixRow]:
        medians = {
            (label, s.id): self.runs[s.id][label].score("horizontal_rmse").value
            for label in self.estimators
            for s in self.scenarios
            if label in self.runs[s.id]
        }
        best: dict[str, float] = {}
        for (label, scenario), value in medians.items():
            if not self.estimators[label].reference and not math.isnan(value):
                best[scenario] = min(value, best.get(scenario, math.inf))

        def cell(entry: EstimatorEntry, s: ScenarioEntry) -> Cell:
            value = medians.get((entry.label, s.id), math.nan)
            text = "" if math.isnan(value) else tables.number(value)
            return Cell(text, value, best=value == best.get(s.id) and not entry.reference, page=s.page)

        return [MatrixRow(e, tuple(cell(e, s) for s in self.scenarios)) for e in self.estimators.values()]

    # -- scenario --------------------------------------------------------------------------------

    def _scenario(self, entry: ScenarioEntry, figures: Sequence[Image]) -> ScenarioPage:
        by, ranking = self.runs[entry.id], self._ranking_of(entry)
        columns, cells = score_cells([(by[row.estimator], row.reference) for row in ranking.rows])
        return ScenarioPage(
            entry=entry,
            baseline=ranking.reference.text,
            remarks=ranking.remarks,
            columns=columns,
            rows=tuple(
                ScenarioPageRow(row, self.estimators[row.estimator], c, starts)
                for row, c, starts in zip(ranking.rows, cells, tier_starts([r.tier for r in ranking.rows]), strict=True)
            ),
            unsuitable=_by_reason(ranking.unsuitable),
            failures=tuple(
                Failure(row.estimator, status, count, _reason(by[row.estimator], status))
                for row in ranking.rows
                for status, count in row.statuses.items()
                if status != "ok"
            ),
            figures=tuple(figures),
        )

    # -- estimator -------------------------------------------------------------------------------

    def _estimator(self, label: str) -> EstimatorPage:
        mine = [(s, self.runs[s.id][label]) for s in self.scenarios if label in self.runs[s.id]]
        suited = [(s, r) for s, r in mine if r.tried]
        columns, cells = score_cells([(r, True) for _, r in suited])
        facts = tuple(
            Fact(track.title, f"{row.ranks or '–'} of {sum(r.ranked for r in track.rows)}, {ratio(row.score)}")
            for track in self.ranking.tracks
            for row in track.rows
            if row.estimator == label and math.isfinite(row.score)
        )
        return EstimatorPage(
            entry=self.estimators[label],
            summary=_summary(label),
            facts=facts,
            columns=columns,
            rows=tuple(
                EstimatorRow(s, len(r.tried), r.failed, c, badge(np.array(r.scores("nees_horizontal"))))
                for (s, r), c in zip(suited, cells, strict=True)
            ),
            unsuitable=_by_reason({s.name: r.results[0].reason for s, r in mine if not r.tried}),
            parameters=tables.parameters(mine[0][1].results[0].parameters) if mine else "",
        )


# ------------------------------------------------------------------------------------------------


def _versions() -> dict[str, str]:
    import platform
    from importlib.metadata import version

    return {"simnav": version("simnav"), "python": platform.python_version(), "numpy": version("numpy")}


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
    texts = (scenario.title, scenario.description, scenario.source)
    return ScenarioEntry(identity, name or identity, page, seeds, _argument(identity), tuple(facts), *texts)


def _summary(label: str) -> str:
    """First line of an estimator's docstring, where it is installed."""
    from simnav.estimator import describe

    try:
        return describe(_NAME_OF_LABEL.split(label, maxsplit=1)[0]).summary
    except (ValueError, ImportError):
        return ""


def _by_reason(reasons: Mapping[str, str]) -> dict[str, list[str]]:
    """Reason -> those that share it."""
    found: dict[str, list[str]] = {}
    for name, why in reasons.items():
        found.setdefault(why, []).append(name)
    return found


def _reason(runs: Runs, status: str) -> str:
    """Why the first run with a status ended so."""
    if status == "incomplete":
        return "it ended well, but gave a position at too few of the epochs"
    return next((r.reason for r in runs.results if r.status == status), "")
