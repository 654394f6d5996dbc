"""Results for machines: ``results.json`` (see ``templates/results.schema.json``), ``results.csv``, ``results.parquet``.

JSON and Parquet are in SI units and radians under the names of `simnav.scoring.SCORES`; CSV has a unit at the end of
every column and angles in degrees. A score that does not apply is null, or an empty cell.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.plain import plain
from simnav.scoring import SCORES

if TYPE_CHECKING:
    from simnav.leaderboard.results.store import Result

__all__ = ["SCHEMA_VERSION", "as_document", "write_csv", "write_json", "write_parquet"]

#: Raised whenever a reader of ``results.json`` would have to change.
SCHEMA_VERSION = 1

_UNIT_SUFFIX = {"-": "", "%": "_percent", "rad": "_deg", "m/s": "_m_s"}
_DEGREES = math.degrees(1.0)


def as_document(
    results: Sequence[Result],
    ranking: Mapping[str, Any],
    scenarios: Sequence[Mapping[str, Any]],
    *,
    command: str,
    versions: Mapping[str, str],
    generated: str,
) -> dict[str, Any]:
    """The content of ``results.json``."""
    return {
        "schema": {"name": "simnav-leaderboard", "version": SCHEMA_VERSION},
        "generated": generated,
        "command": command,
        "versions": dict(versions),
        "scores": {name: {"title": s.title, "unit": s.unit, "better": s.better} for name, s in SCORES.items()},
        "scenarios": [dict(s) for s in scenarios],
        "ranking": plain(ranking),
        "results": [
            {
                "scenario": r.scenario,
                "seed": r.seed,
                "estimator": r.estimator,
                "parameters": plain(r.parameters),
                "reference": r.reference,
                "status": r.status,
                "reason": r.reason,
                "note": r.note,
                "seconds": plain(float(r.seconds)),
                "peak_memory": r.peak_memory,
                "scores": {name: plain(float(r.scores.get(name, math.nan))) for name in SCORES},
            }
            for r in results
        ],
    }


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a JSON file; NaN is not JSON and must have become null before."""
    text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


def write_csv(path: Path, results: Sequence[Result]) -> None:
    """A row a run."""
    columns = {f"{name}{_UNIT_SUFFIX.get(s.unit, '_' + s.unit)}": (name, s.unit) for name, s in SCORES.items()}
    head = ["scenario", "seed", "estimator", "parameters", "reference", "status", "reason", "note", "wall_time_s",
            "peak_memory_bytes"]  # fmt: skip
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*head, *columns])
        for r in results:
            row: list[Any] = [r.scenario, r.seed, r.estimator, _parameters(r), r.reference, r.status, r.reason, r.note,
                              f"{r.seconds:.6g}", r.peak_memory]  # fmt: skip
            for name, unit in columns.values():
                value = r.scores.get(name, math.nan) * (_DEGREES if unit == "rad" else 1.0)
                row.append("" if math.isnan(value) else f"{value:.9g}")
            writer.writerow(row)


def write_parquet(path: Path, results: Sequence[Result]) -> None:
    """The same rows as Parquet, a column a score."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns: dict[str, Any] = {
        "scenario": [r.scenario for r in results],
        "seed": pa.array([r.seed for r in results], pa.int64()),
        "estimator": [r.estimator for r in results],
        "parameters": [_parameters(r) for r in results],
        "reference": [r.reference for r in results],
        "status": [r.status for r in results],
        "reason": [r.reason for r in results],
        "note": [r.note for r in results],
        "seconds": pa.array([r.seconds for r in results], pa.float64()),
        "peak_memory": pa.array([r.peak_memory for r in results], pa.int64()),
    }
    for name in SCORES:
        values = [r.scores.get(name, math.nan) for r in results]
        columns[name] = pa.array([None if math.isnan(v) else v for v in values], pa.float64())
    pq.write_table(pa.table(columns), path, compression="zstd")


def _parameters(result: Result) -> str:
    return json.dumps(plain(dict(result.parameters)), sort_keys=True)
