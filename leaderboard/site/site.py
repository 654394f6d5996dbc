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

from simnav.leaderboard.figures.plots import Dot, Style, dots
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking_table import (
    SCORE_AXIS,
    SCORE_LEAD,
    SCORE_TITLE,
    add_bars,
    between,
    ranking_rows,
    ratio,
    score_caption,
    sortable,
)
from simnav.leaderboard.ranking.runs import Runs, group
from simnav.leaderboard.ranking.statistics import Interval
from simnav.leaderboard.results import export
from simnav.leaderboard.site.pages import STATIC, TEMPLATES, ExtraPage, environment
from simnav.leaderboard.site.scenario_figures import catalogued, scenario_figures, write_figure

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.ranking import Ranking
    from simnav.leaderboard.results.store import Result

__all__ = ["SiteError", "build"]

_WORTH_PROCESSES = 3  # scenarios
_STALE = 3600.0  # a build of this age runs no more [s]
_NAME_OF_LABEL = re.compile(r"[(\[ ]")  # a label is a name, and its parameters in brackets
_STATIC = (*STATIC, "results.schema.json")
_DEGREES = math.degrees(1.0)

#: Columns of score tables: score, heading, factor, how it is written ("": with interval), whether small is best.
_COLUMNS: tuple[tuple[str, str, float, str, bool], ...] = (
    ("horizontal_rmse", "Horizontal RMSE [m]", 1.0, "", True),
    ("r95", "R95 [m]", 1.0, "", True),
    ("vertical_rmse", "Vertical RMSE [m]", 1.0, "", True),
    ("velocity_horizontal_rmse", "Velocity RMSE [m/s]", 1.0, "", True),
    ("heading_rmse", "Heading RMSE [deg]", _DEGREES, "", True),
    ("outage_end_error", "At outage end [m]", 1.0, "", True),
    ("recovery_time", "Recovery [s]", 1.0, "", True),
    ("nees_horizontal", "NEES / dof", 1.0, "-", False),
    ("coverage_95", "95 % coverage", 1.0, "%", False),
    ("detection_rate", "Faults detected", 1.0, "%", False),
    ("false_alarm_rate", "False alarms", 1.0, "%", False),
    ("smoothed_horizontal_rmse", "Smoothed RMSE [m]", 1.0, "", True),
    ("update_median", "Per epoch", 1.0, "time", False),
)


class SiteError(RuntimeError):
    """A site that cannot be built here; the message is one sentence."""


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
    SiteError
        If there are no results, or the folder holds something that is no site.
    """
    if not results:
        raise SiteError("there are no results to show")
    output = Path(output).expanduser().resolve()
    _refuse_strangers(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    _sweep(output)
    draft = Path(tempfile.mkdtemp(prefix=f".{output.name}.", suffix=".part", dir=output.parent))
    try:
        draft.chmod(0o755)
        site = _Site(
            results, ranking, draft, command or reproduce(results), progress or (lambda *_, **__: None), workers
        )
        site.papers = list(papers)
        site.write()
        _swap(draft, output)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return output / "index.html"


def _refuse_strangers(output: Path) -> None:
    if output.is_file():
        raise SiteError(f"{output} is a file; a folder for the site is wanted")
    if output.is_dir() and any(output.iterdir()) and not (output / "results.schema.json").is_file():
        raise SiteError(f"{output} holds other files and no site of simnav; name an empty or a new folder")


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
    ):
        self.results = sorted(results, key=lambda r: (r.scenario, r.estimator, r.seed))
        self.ranking = ranking.to_dict()
        self.folder, self.command, self.progress, self.workers = folder, command, progress, workers
        self.papers: list[ExtraPage] = []
        self.runs = group(self.results)
        self.rows = ranking_rows(self.ranking, self.results)
        labels = list(
            dict.fromkeys([*(row["label"] for row in self.rows), *sorted({r.estimator for r in self.results})])
        )
        references = {r.estimator for r in self.results if r.reference}
        self.style = Style(labels, references)
        taken = {"index"}
        self.estimators = {label: self._estimator(label, taken) for label in labels}
        self.scenarios = [_describe(s, by, f"{slug(s, taken)}.html") for s, by in self.runs.items()]

    def _estimator(self, label: str, taken: set[str]) -> dict[str, Any]:
        return {
            "label": label,
            "page": f"estimator-{slug(label, taken)}.html",
            "colour": self.style.colour(label),
            "dark": self.style.colour(label, dark=True),
            "reference": any(r.reference for r in self.results if r.estimator == label),
        }

    def write(self) -> None:
        """Write all pages, figures and data."""
        pages = environment()
        (self.folder / "figures").mkdir()
        generated = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
        shared = {
            "version": _versions()["simnav"],
            "versions": _versions(),
            "generated": generated,
            "scenarios": self.scenarios,
            "papers": self.papers,
            "total": len(self.results),
            "command": self.command,
        }
        steps = len(self.scenarios) + 1
        self.progress(0, steps)
        for k, (scenario, figures) in enumerate(zip(self.scenarios, self._draw(), strict=True)):
            page = {**scenario, **self._scenario(scenario), "figures": figures}
            self._page(pages, "scenario.html", scenario["page"], scenario=page, **shared)
            self.progress(k + 1, steps, note=scenario["name"])
        for label, estimator in self.estimators.items():
            self._page(pages, "estimator.html", estimator["page"], estimator=self._of_estimator(label), **shared)
        self._page(pages, "index.html", "index.html", **self._index(), **shared)
        for extra in self.papers:
            extra.install(self.folder, shared)
        for name in _STATIC:
            shutil.copyfile(TEMPLATES / name, self.folder / name)
        facts = ("id", "name", "title", "description", "source", "seeds")
        document = export.as_document(
            self.results,
            self.ranking,
            [{key: s[key] for key in facts} for s in self.scenarios],
            command=self.command,
            versions=_versions(),
            generated=generated,
        )
        export.write_json(self.folder / "results.json", document)
        export.write_csv(self.folder / "results.csv", self.results)
        export.write_parquet(self.folder / "results.parquet", self.results)
        self.progress(steps, steps)

    def _draw(self) -> Iterator[list[dict[str, Any]]]:
        """The figures of one scenario after the other; several processes where it is worth their start."""
        tasks = []
        ranked = {s["scenario"]: [row["estimator"] for row in s["rows"]] for s in self.ranking["scenarios"]}
        for s in self.scenarios:
            by = self.runs[s["id"]]
            head = {key: s[key] for key in ("id", "page", "seeds")}
            tasks.append((self.folder, head, [by[e] for e in ranked[s["id"]]], self.style))
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
        text = pages.get_template(template).render(page="index" if name == "index.html" else name, **values)
        (self.folder / name).write_text(text, encoding="utf-8")

    # -- index -----------------------------------------------------------------------------------

    def _index(self) -> dict[str, Any]:
        tried = [r for r in self.results if r.tried]
        facts = [
            ("Scenarios", len(self.scenarios)),
            ("Estimators", len(self.estimators)),
            ("Seeds a scenario", max(len(s["seeds"]) for s in self.scenarios)),
            ("Runs", len(tried)),
            ("Failed", sum(row["failed"] for row in self.rows)),
        ]
        rows = [{**row, **self.estimators[row["label"]]} for row in self.rows]
        add_bars(rows)
        figure = None
        if any(row["value"] is not None for row in rows):
            points = [
                Dot(r["label"], _number(r["value"]), _number(r["low"]), _number(r["high"]), hollow=r["reference"],
                    note=f"({r['failed']} failed)" if r["failed"] else "")
                for r in rows if r["value"] is not None
            ]  # fmt: skip
            figure = write_figure(
                self.folder,
                dots(points, self.style, label=SCORE_AXIS, title="Overall, 95 % interval"),
                "ranking",
                "The ranking with its intervals; hollow: reference.",
                "Overall score of every estimator with its interval, as in the table above",
            )
        return {
            "score": {
                "title": SCORE_TITLE.replace(" ", "\u00a0"),
                "caption": score_caption(self.ranking),
                "lead": SCORE_LEAD,
            },
            "facts": [{"name": n, "value": v} for n, v in facts],
            "ranking": rows,
            "matrix": self._matrix(),
            "figure": figure,
        }

    def _matrix(self) -> list[dict[str, Any]]:
        medians = {
            (label, s["id"]): self.runs[s["id"]][label].score("horizontal_rmse").value
            for label in self.estimators
            for s in self.scenarios
            if label in self.runs[s["id"]]
        }
        rows = []
        for label, estimator in self.estimators.items():
            row = []
            for s in self.scenarios:
                value = medians.get((label, s["id"]), math.nan)
                ranked = [v for (e, i), v in medians.items() if i == s["id"] and not self.estimators[e]["reference"]]
                best = min((v for v in ranked if not math.isnan(v)), default=math.nan)
                text = "" if math.isnan(value) else tables.number(value)
                row.append({"text": text, "sort": sortable(value), "page": s["page"],
                            "best": value == best and not estimator["reference"]})  # fmt: skip
            rows.append({**estimator, "row": row})
        return rows

    # -- scenario --------------------------------------------------------------------------------

    def _scenario(self, scenario: Mapping[str, Any]) -> dict[str, Any]:
        by = self.runs[scenario["id"]]
        ranking = next(s for s in self.ranking["scenarios"] if s["scenario"] == scenario["id"])
        ranked = ranking["rows"]
        suited = [by[row["estimator"]] for row in ranked]
        columns, cells = _score_cells([(r, r.reference) for r in suited])
        before = [None, *(row["tier"] for row in ranked)]
        rows = [
            {
                **row,
                **self.estimators[row["estimator"]],
                "cells": c,
                "ratio": ratio(row["score"]),
                "sort": sortable(row["score"]),
                "interval": between(row["low"], row["high"], ratio),
                "starts_tier": k > 0 and row["tier"] != before[k],
            }
            for k, (row, c) in enumerate(zip(ranked, cells, strict=True))
        ]
        return {
            "columns": columns,
            "rows": rows,
            "baseline": ranking["baseline"],
            "unsuitable": _by_reason(ranking["unsuitable"]),
            "failures": [
                {"label": row["estimator"], "status": status, "runs": count,
                 "reason": _reason(by[row["estimator"]], status)}
                for row in ranked for status, count in row["statuses"].items() if status != "ok"
            ],
            "seeds": len(scenario["seeds"]),
            "first_seed": scenario["seeds"][0],
        }  # fmt: skip

    # -- estimator -------------------------------------------------------------------------------

    def _of_estimator(self, label: str) -> dict[str, Any]:
        mine = [self.runs[s["id"]][label] for s in self.scenarios if label in self.runs[s["id"]]]
        suited = [r for r in mine if r.tried]
        columns, cells = _score_cells([(r, True) for r in suited])
        described = {s["id"]: s for s in self.scenarios}
        row = next((r for r in self.rows if r["label"] == label), None)  # None: no scenario suits it
        facts = [] if row is None else [
            ("Rank", row["rank"] or "–"), ("Tier", row["tier"] or "–"), (SCORE_TITLE, row["score"]),
            ("Failed", f"{row['failed']} of {row['runs']}"), ("Per epoch", row["cost"]),
        ]  # fmt: skip
        return {
            **self.estimators[label],
            "summary": _summary(label),
            "facts": [{"name": n, "value": v} for n, v in facts],
            "columns": columns,
            "rows": [
                {"name": described[r.scenario]["name"], "page": described[r.scenario]["page"], "failed": r.failed,
                 "runs": len(r.tried), "cells": c, "badge": _badge(r)}
                for r, c in zip(suited, cells, strict=True)
            ],
            "unsuitable": _by_reason({described[r.scenario]["name"]: r.results[0].reason for r in mine if not r.tried}),
            "parameters": tables.parameters(mine[0].results[0].parameters) if mine else "",
        }  # fmt: skip


# ------------------------------------------------------------------------------------------------


def _versions() -> dict[str, str]:
    import platform
    from importlib.metadata import version

    return {"simnav": version("simnav"), "python": platform.python_version(), "numpy": version("numpy")}


def _describe(identity: str, by: Mapping[str, Runs], page: str) -> dict[str, Any]:
    """What is known of a scenario, from the catalogue where it is in there."""
    name, _, version = identity.rpartition("-v")
    seeds = sorted({r.seed for runs in by.values() for r in runs.results})
    found: dict[str, Any] = {"id": identity, "name": name or identity, "page": page, "seeds": seeds}
    found |= {"title": "", "description": "", "source": "", "argument": _argument(identity)}
    facts = [("Version", version or "–"), ("Seeds", len(seeds))]
    scenario = catalogued(identity)
    if scenario is not None:
        found |= {"title": scenario.title, "description": scenario.description, "source": scenario.source}
        facts += [("Duration", tables.duration(scenario.duration)), ("Step", tables.duration(scenario.step))]
        if scenario.instruments:
            facts.append(("Instruments", len(scenario.instruments)))
        if scenario.faults:
            facts.append(("Faults", len(scenario.faults)))
    return {**found, "facts": [{"name": n, "value": v} for n, v in facts]}


def _summary(label: str) -> str:
    """First line of an estimator's docstring, where it is installed."""
    from simnav.estimator import describe

    try:
        return describe(_NAME_OF_LABEL.split(label, maxsplit=1)[0]).summary
    except (ValueError, ImportError):
        return ""


def _badge(runs: Runs) -> str:
    from simnav.scoring import badge

    return str(badge(np.array(runs.scores("nees_horizontal"))))


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


def _score_cells(runs: Sequence[tuple[Runs, bool]]) -> tuple[list[dict[str, str]], list[dict[str, Any]]]:
    """Columns in which anybody who is ranked has a figure, and the cells of each row.

    The second of a pair says whether it is barred from being the best.
    """
    columns = []
    cells: list[dict[str, Any]] = [{} for _ in runs]
    for key, title, factor, form, lower in _COLUMNS:
        found = [r.score(key) for r, _ in runs]
        ranked = [f for f, (r, _) in zip(found, runs, strict=True) if not r.reference] or found
        if all(math.isnan(f.value) for f in ranked):
            continue
        columns.append({"key": key, "title": title})
        best = min((f.value for f, (_, barred) in zip(found, runs, strict=True) if not barred and f.value == f.value),
                   default=math.nan)  # fmt: skip
        for cell, f, (_, barred) in zip(cells, found, runs, strict=True):
            cell[key] = {**_cell(f, factor, form), "best": lower and not barred and f.value == best}
    return columns, cells


def _cell(f: Interval, factor: float, form: str) -> dict[str, Any]:
    if math.isnan(f.value):
        return {"text": "–", "sort": "", "interval": ""}
    write = {"%": tables.percent, "time": tables.duration}.get(form, tables.number)
    interval = "" if form else between(f.low * factor, f.high * factor)
    return {"text": write(f.value * factor), "sort": sortable(f.value), "interval": interval}


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
