"""Results for machines: ``results.json`` (see ``templates/results.schema.json``), ``results.csv``, ``results.parquet``.

JSON and Parquet are in SI units and radians under the names of `simnav.scoring.SCORES`; CSV has a unit at the end of
every column and angles in degrees. A score that does not apply is null, or an empty cell.

Each row has the digests of its scenario and estimator, its limits and its provenance: in JSON an id that names an entry
of ``provenance``, in CSV and Parquet columns of its own.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.formats import writes
from simnav.leaderboard.results.plain import plain
from simnav.leaderboard.results.provenance import Provenance, benchmark_of, distinct
from simnav.scoring import SCORES

if TYPE_CHECKING:
    import pyarrow as pa

    from simnav.leaderboard.results.result import Result

__all__ = ["SCHEMA_VERSION", "Document", "table", "write_csv", "write_json", "write_parquet"]

#: Raised whenever a reader of ``results.json`` would have to change.
SCHEMA_VERSION = 2

_UNIT_SUFFIX = {"-": "", "%": "_percent", "rad": "_deg", "m/s": "_m_s"}
_DEGREES = math.degrees(1.0)
_FACTS = ("scenario", "seed", "draws", "estimator", "parameters", "reference", "status", "reason", "note")
_COSTS = ("seconds", "peak_memory")
#: Column -> attribute: what made a result, and is its own.
_ORIGIN = {
    "scenario_digest": "scenario_digest",
    "estimator_digest": "estimator_digest",
    "simulator": "simnav",
    "time_limit_s": "time_limit",
    "memory_limit_bytes": "memory_limit",
}
_PROVENANCE = ("benchmark", "commit", "dirty", "simnav", "python", "numpy", "numba", "gtsam", "system", "cpu", "cores",
               "confinement", "seal", "date")  # fmt: skip


@dataclass(frozen=True)
class Document:
    """Results with what is needed to understand them elsewhere.

    Attributes
    ----------
    results : sequence of Result
        The results.
    ranking : mapping
        Of the same results, plain (``Ranking.to_dict``).
    scenarios : sequence of mapping
        What is known of each.
    command : str
        That makes the results again.
    generated : str
        Date and time.
    """

    results: Sequence[Result]
    ranking: Mapping[str, Any] = field(default_factory=dict)
    scenarios: Sequence[Mapping[str, Any]] = ()
    command: str = ""
    generated: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The content of ``results.json``.

        Raises
        ------
        RequestError
            If the results belong to different versions of the benchmark.
        """
        return {
            "schema": {"name": "simnav-leaderboard", "version": SCHEMA_VERSION},
            "benchmark": benchmark_of(r.provenance for r in self.results),
            "generated": self.generated,
            "command": self.command,
            "provenance": [p.to_dict() for p in distinct(r.provenance for r in self.results)],
            "scores": {name: {"title": s.title, "unit": s.unit, "better": s.better} for name, s in SCORES.items()},
            "scenarios": plain(self.scenarios),
            "ranking": plain(self.ranking),
            "results": [
                {
                    **{name: plain(getattr(r, name)) for name in (*_FACTS, *_COSTS)},
                    **_origin(r),
                    "provenance": r.provenance.id,
                    "scores": {name: plain(float(r.scores.get(name, math.nan))) for name in SCORES},
                }
                for r in self.results
            ],
        }


@writes("results", "json")
def write_json(document: Document, path: Path) -> list[Path]:
    """Write ``results.json``; NaN is not JSON and has become null."""
    text = json.dumps(document.to_dict(), indent=1, allow_nan=False, ensure_ascii=False)
    return [write_whole(path, text + "\n")]


@writes("results", "csv")
def write_csv(document: Document, path: Path) -> list[Path]:
    """A row a run."""
    columns = {f"{name}{_UNIT_SUFFIX.get(s.unit, '_' + s.unit)}": (name, s.unit) for name, s in SCORES.items()}
    text = io.StringIO()
    writer = csv.writer(text)
    origin = [*_ORIGIN, *_provenance(Provenance())]
    writer.writerow([*_FACTS, "wall_time_s", "peak_memory_bytes", *columns, *origin])
    for r in document.results:
        row: list[Any] = [*_facts(r).values(), f"{r.seconds:.6g}", r.peak_memory]
        for name, unit in columns.values():
            value = r.scores.get(name, math.nan) * (_DEGREES if unit == "rad" else 1.0)
            row.append("" if math.isnan(value) else f"{value:.9g}")
        writer.writerow([*row, *_origin(r).values(), *_provenance(r.provenance).values()])
    return [write_whole(path, text.getvalue())]


@writes("results", "parquet")
def write_parquet(document: Document, path: Path) -> list[Path]:
    """The same rows as Parquet, a column a score."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    sink = pa.BufferOutputStream()
    pq.write_table(table(document.results), sink, compression="zstd")
    return [write_whole(path, sink.getvalue().to_pybytes())]


def table(results: Sequence[Result]) -> pa.Table:
    """Results as a pyarrow table: a row a run, a column a score, in SI units and radians."""
    import pyarrow as pa

    rows = [
        {**_facts(r), **{name: getattr(r, name) for name in _COSTS}}
        | {name: None if math.isnan(v := r.scores.get(name, math.nan)) else v for name in SCORES}
        | _origin(r)
        | _provenance(r.provenance)
        for r in results
    ]
    text, flag, whole, real = pa.string(), pa.bool_(), pa.int64(), pa.float64()
    kinds = {"seed": whole, "reference": flag, "seconds": real, "peak_memory": whole, "time_limit_s": real,
             "memory_limit_bytes": whole, "dirty": flag, "cores": whole, **dict.fromkeys(SCORES, real)}  # fmt: skip
    origin = [*_ORIGIN, *_provenance(Provenance())]
    schema = pa.schema([(name, kinds.get(name, text)) for name in (*_FACTS, *_COSTS, *SCORES, *origin)])
    return pa.Table.from_pylist(rows, schema=schema)


def _origin(result: Result) -> dict[str, Any]:
    """Digests of scenario, estimator and simulator, and limits."""
    return {column: getattr(result, name) for column, name in _ORIGIN.items()}


def _provenance(provenance: Provenance) -> dict[str, Any]:
    """Columns of a provenance, with its id."""
    return {"provenance": provenance.id} | {name: getattr(provenance, name) for name in _PROVENANCE}


def _facts(result: Result) -> dict[str, Any]:
    found = {name: getattr(result, name) for name in _FACTS}
    texts = {name: json.dumps(plain(dict(found[name])), sort_keys=True) for name in ("draws", "parameters")}
    return found | texts
