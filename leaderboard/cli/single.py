"""Commands about one run or one estimator: run, simulate, check, new-estimator, warmup."""

from __future__ import annotations

import keyword
import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.cli.console import FAILED, USER, Output, UserError, absolute, mistakes
from simnav.leaderboard.ranking import tables

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.recording import Recording
    from simnav.scenario import Scenario

__all__ = ["check", "run", "scaffold", "simulate", "warmup"]

_DEGREES = 57.29577951308232
_TEMPLATE = Path(__file__).parent / "estimator.py.jinja"


def record(scenario: Scenario, seed: int) -> Recording:
    """The recording of a run; what a log's files lack is the user's to mend."""
    from simnav.source import record

    with mistakes(ValueError, FileNotFoundError):
        return record(scenario, seed)


def run(out: Output, scenario: Scenario, requests: list[EstimatorRequest], seed: int, plot: Path | None) -> int:
    """Run estimators over one recording; returns the exit code."""
    from simnav.estimator import make
    from simnav.scoring import SCORES, score
    from simnav.trial import run_trial

    with mistakes(ValueError):
        estimators = [make(request.name, **request.parameters) for request in requests]
    begun = time.perf_counter()
    recording = record(scenario, seed)
    simulated = time.perf_counter() - begun
    trials, rows = [], []
    with out.progress(f"{scenario.id}, seed {seed}", len(requests)) as progress:
        for k, (request, estimator) in enumerate(zip(requests, estimators, strict=True)):
            progress(k, note=request.label)
            begun = time.perf_counter()
            trial = run_trial(estimator, recording)
            trials.append((request.label, trial))
            rows.append(
                {
                    "estimator": request.label,
                    "parameters": request.parameters,
                    "reference": estimator.reference,
                    "status": trial.status,
                    "reason": trial.reason,
                    "seconds": time.perf_counter() - begun,
                    "scores": score(trial, recording) if len(trial) else {},
                }
            )
        progress(len(requests))
    drawn = None
    if plot is not None and any(len(t) for _, t in trials):
        from simnav.leaderboard.figures.plots import save
        from simnav.leaderboard.figures.run_figure import run_figure

        references = [str(row["estimator"]) for row in rows if row["reference"]]
        drawn = save(run_figure(recording, trials, references), absolute(plot), formats=(plot.suffix[1:],))[0]
    out.document(
        {
            "scenario": scenario.id,
            "seed": seed,
            "duration": recording.duration,
            "note": recording.note,
            "simulation_seconds": simulated,
            "estimators": rows,
            "scores": {name: {"title": s.title, "unit": s.unit, "better": s.better} for name, s in SCORES.items()},
            "plot": None if drawn is None else str(drawn),
        }
    )
    out.print(run_table(recording, rows))
    for row in rows:
        if row["status"] != "ok":
            out.note(f"simnav: {row['estimator']}: {row['status']}: {row['reason']}")
    if drawn is not None:
        out.print(f"figure: {drawn}")
    if any(trial.failed for _, trial in trials):
        return FAILED
    return USER if all(trial.status == "unsuitable" for _, trial in trials) else 0


def run_table(recording: Recording, rows: list[dict[str, Any]]) -> Any:
    """Scores of the estimators on one run, the best horizontal RMSE first."""
    from math import inf, isfinite

    def key(row: dict[str, Any]) -> tuple[bool, float]:
        value = row["scores"].get("horizontal_rmse", inf)
        return row["status"] != "ok", value if isfinite(value) else inf

    ordered = sorted(rows, key=key)
    cells = []
    for row in ordered:
        s = row["scores"]
        cells.append(
            [
                row["estimator"] + (" *" if row["reference"] else ""),
                row["status"],
                *(tables.number(s.get(name)) for name in
                  ("horizontal_rmse", "r95", "horizontal_max", "vertical_rmse", "velocity_horizontal_rmse")),
                tables.number(_times(s.get("heading_rmse"), _DEGREES)),
                tables.number(s.get("nees_horizontal")),
                tables.percent(s.get("coverage_95")),
                tables.duration(s.get("update_median")),
            ]
        )  # fmt: skip
    columns = ["estimator", "status", "horizontal RMSE [m]", "R95 [m]", "max [m]", "vertical RMSE [m]",
               "velocity RMSE [m/s]", "heading RMSE [deg]", "NEES/dof", "95 % coverage", "per epoch"]  # fmt: skip
    note = f"; {recording.note}" if recording.note else ""
    reference = [i for i, row in enumerate(ordered) if row["reference"]]
    return tables.table(
        f"{recording.scenario}, seed {recording.seed}, {tables.duration(recording.duration)}{note}",
        columns,
        cells,
        numeric=columns[2:],
        dim=reference,
        caption="* reference: it is told the truth" if reference else None,
    )


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def simulate(out: Output, scenario: Scenario, seed: int, output: Path, csv: Path | None) -> None:
    """Write the recording of a run as .npz, and as CSV where asked."""
    from simnav.leaderboard.results.formats import write

    recording = record(scenario, seed)
    target = absolute(output)
    write("recording", "npz", recording, target)
    written = [] if csv is None else write("recording", "csv", recording, absolute(csv))
    counts = {name: len(stream) for name, stream in recording.data.aids.items()}
    out.document(
        {
            "scenario": scenario.id,
            "seed": seed,
            "duration": recording.duration,
            "imu_samples": 0 if recording.data.imu is None else len(recording.data.imu),
            "measurements": counts,
            "file": str(target),
            "csv": [str(p) for p in written],
        }
    )
    rows: list[list[Any]] = [[s.name, s.kind, len(s), len(s.dropped), int((s.faults != 0).sum())]
                             for s in recording.data.aids.values()]  # fmt: skip
    if recording.data.imu is not None:
        rows.insert(0, ["imu", "imu", len(recording.data.imu), 0, 0])
    columns = ["instrument", "kind", "measurements", "dropped", "touched by a fault"]
    out.print(tables.table(f"{scenario.id}, seed {seed}", columns, rows, numeric=columns[2:]), f"recording: {target}")
    if written:
        out.print(f"CSV: {written[0].parent}")


def check(out: Output, request: EstimatorRequest) -> int:
    """Run the contract test; returns the exit code."""
    from simnav.check import check as run_checks

    with mistakes(ValueError):
        report = run_checks(request.name, **request.parameters)
    findings = [{"name": f.name, "ok": f.ok, "sentence": f.sentence} for f in report.findings]
    out.document({"estimator": report.estimator, "passed": report.passed, "findings": findings})
    out.print(tables.table(f"{report.estimator} and the contract", ["", "test", "finding"],
                           [["ok" if f.ok else "FAIL", f.name, f.sentence] for f in report.findings],
                           strong=[i for i, f in enumerate(report.findings) if not f.ok]),
              f"{report.estimator} {'passes' if report.passed else 'fails'}")  # fmt: skip
    return 0 if report.passed else FAILED


def scaffold(out: Output, name: str, output: Path | None) -> None:
    """Write a new estimator's file; never over an existing one."""
    from jinja2 import Environment

    from simnav.catalogue import headers
    from simnav.estimator import names

    kebab = re.sub(r"[^a-z0-9]+", "-", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name).lower()).strip("-")
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", kebab) or keyword.iskeyword(kebab):
        raise UserError(f"{name!r} is no name for an estimator; it should be words like 'my-filter'")
    if kebab in names():
        raise UserError(f"there is an estimator {kebab!r} already; choose another name")
    path = absolute(output or Path(kebab.replace("-", "_") + ".py"))
    if path.suffix != ".py":
        raise UserError(f"--output {output}: the file should end in .py")
    scenarios = [h.name for h in headers()]
    text = Environment(keep_trailing_newline=True).from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        name=kebab,
        class_name="".join(part.capitalize() for part in kebab.split("-")),
        file=path.name,
        scenario=next((s for s in scenarios if "open" in s), scenarios[0] if scenarios else "open-sea"),
    )  # fmt: skip
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UserError(f"{path} exists; choose another name, or --output") from None
    except FileNotFoundError:
        raise UserError(f"there is no folder {path.parent}") from None
    out.document({"name": kebab, "file": str(path)})
    out.print(f"written: {path}", f"next:    simnav check {path.name}")


def warmup(out: Output) -> None:
    """Compile every kernel ahead of its first use."""
    from simnav.compiled import kernels
    from simnav.warmup import warmup as compile_all

    begun = time.perf_counter()
    with out.progress("compiling kernels") as progress:
        compile_all(progress)
    seconds = time.perf_counter() - begun
    count = len(kernels())
    out.document({"kernels": count, "seconds": seconds})
    out.print(f"{count} kernels ready in {seconds:.1f} s")
