"""Results for machines: ``results.json`` (see ``templates/results.schema.json``) and ``results.parquet``.

Both are in SI units and radians under the names of `simnav.scoring.SCORES`. A score that does not apply is null.

Each row has the digests of its scenario and estimator, its limits and its provenance: in JSON an id that names an entry
of ``provenance``, in Parquet columns of its own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.scoring import SCORES

from .binary_digits import with_bits
from .files import complete_file
from .formats import writes
from .plain import as_json
from .provenance import Provenance, benchmark_of, distinct
from .stored_scores import score_matrix

if TYPE_CHECKING:
    import pyarrow as pa

    from .result import Result

__all__ = ["MOST_IN_JSON", "SCHEMA_VERSION", "Document", "table", "write_json", "write_parquet"]

#: Raised whenever a reader of ``results.json`` would have to change.
SCHEMA_VERSION = 2

#: Runs that ``results.json`` holds at most; of more it holds the ranking of the tracks alone.
MOST_IN_JSON = 20_000

_CHUNK = 8192  # runs that are converted at a time
_DIGITS = 4  # of figures of the ranking
#: Of more runs than `MOST_IN_JSON`: binary digits of figures (three decimal ones) and of times; unit of memory [byte].
_BITS, _BITS_OF_TIMES, _MEMORY = 10, 7, 65536
_FACTS = ("scenario", "seed", "draws", "estimator", "parameters", "learned", "reference", "status", "reason", "note")
_COSTS = ("seconds", "peak_memory")
_TIMES = ("seconds", "update_median", "update_mean", "update_p95")
#: Column -> attribute: how a run ended as tables count it, and why.
_ENDED = {"status": "outcome", "reason": "why"}
#: Column -> attribute: digests of scenario, estimator and simulator, and limits.
_ORIGIN = {
    "scenario_digest": "scenario_digest",
    "estimator_digest": "estimator_digest",
    "estimator_version": "estimator_version",
    "simulator_version": "simulator_version",
    "simulator": "simnav",
    "time_limit_s": "time_limit",
    "memory_limit_bytes": "memory_limit",
}


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
        Facts about each scenario.
    command : str
        Command that repeats the results.
    generated : str
        Date and time.
    """

    results: Sequence[Result]
    ranking: Mapping[str, Any] = field(default_factory=dict)
    scenarios: Sequence[Mapping[str, Any]] = ()
    command: str = ""
    generated: str = ""

    @property
    def is_long(self) -> bool:
        """Whether it has more than `MOST_IN_JSON` runs, so that its files are kept short."""
        return len(self.results) > MOST_IN_JSON

    def to_dict(self) -> dict[str, Any]:
        """The content of ``results.json``.

        Raises
        ------
        RequestError
            If the results belong to different versions of the benchmark.
        """
        return self._head() | {"results": [_run(r) for r in self.results]}

    def _head(self) -> dict[str, Any]:
        return {
            "schema": {"name": "simnav-leaderboard", "version": SCHEMA_VERSION},
            "benchmark": benchmark_of(r.provenance for r in self.results),
            "generated": self.generated,
            "command": self.command,
            "runs": len(self.results),
            "provenance": [p.to_dict() for p in distinct(r.provenance for r in self.results)],
            "scores": {name: {"title": s.title, "unit": s.unit, "better": s.better} for name, s in SCORES.items()},
            "scenarios": as_json(self.scenarios),
            "ranking": as_json(self.ranking),
        }

    def tables(self) -> Iterator[pa.Table]:
        """The results as tables of some thousand rows each; one without a row where there are none."""
        for k in range(0, max(len(self.results), 1), _CHUNK):
            yield table(self.results[k : k + _CHUNK])


def _run(result: Result) -> dict[str, Any]:
    scores = ((name, float(result.scores.get(name, math.nan))) for name in SCORES)
    return {
        **{name: as_json(getattr(result, _ENDED.get(name, name))) for name in (*_FACTS, *_COSTS)},
        **{column: getattr(result, name) for column, name in _ORIGIN.items()},
        "provenance": result.provenance.id,
        "scores": {name: value if math.isfinite(value) else None for name, value in scores},
    }


@writes("results", "json")
def write_json(document: Document, path: Path) -> list[Path]:
    """Write ``results.json``: a line a run. NaN is not JSON and has become null.

    Of more than `MOST_IN_JSON` runs it has neither the runs, which are in the Parquet file, nor the ranking of each
    scenario. Figures of the ranking have `_DIGITS` digits.
    """
    found = _short(document._head())
    if document.is_long:
        found["ranking"]["scenarios"] = []
    head = json.dumps(found, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    results = () if document.is_long else document.results
    lines = (json.dumps(_run(r), allow_nan=False, ensure_ascii=False, separators=(",", ":")) for r in results)
    with complete_file(path) as part, open(part, "w", encoding="utf-8") as file:
        file.write(head[:-1] + ',\n "results": [')
        for k, line in enumerate(lines):
            file.write((",\n  " if k else "\n  ") + line)
        file.write("\n ]\n}\n" if results else "]\n}\n")
    return [path]


def _short(value: Any) -> Any:
    """The same document with fewer digits."""
    if isinstance(value, dict):
        return {key: _short(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_short(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


@writes("results", "parquet")
def write_parquet(document: Document, path: Path) -> list[Path]:
    """A row a run, a column a score. Figures of more than `MOST_IN_JSON` runs are rounded, for the file's size."""
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    every = pa.concat_tables(document.tables()).combine_chunks()
    real = [f.name for f in every.schema if f.type == pa.float64()]  # their bytes side by side take a third less
    for name in real if document.is_long else ():
        column, k = every[name].combine_chunks(), every.column_names.index(name)
        bits = _BITS_OF_TIMES if name in _TIMES else _BITS
        figures = with_bits(column.to_numpy(zero_copy_only=False), bits)
        shorter = pa.array(figures, mask=column.is_null().to_numpy(zero_copy_only=False))
        every = every.set_column(k, every.schema.field(k), shorter)
    if document.is_long:
        memory, k = every["peak_memory"], every.column_names.index("peak_memory")
        every = every.set_column(k, every.schema.field(k), pc.multiply(pc.divide(memory, _MEMORY), _MEMORY))
    rest = [name for name in every.column_names if name not in real]
    with complete_file(path) as part:
        pq.write_table(every, part, compression="brotli", compression_level=11, use_dictionary=rest,
                       use_byte_stream_split=real)  # fmt: skip
    return [path]


def table(results: Sequence[Result]) -> pa.Table:
    """Results as a pyarrow table: a row a run, a column a score, in SI units and radians."""
    import pyarrow as pa

    text, real = pa.string(), pa.float64()
    whole = ("seed", "peak_memory", "memory_limit_bytes", "cores", "estimator_version", "simulator_version")
    kinds = dict.fromkeys(whole, pa.int64())
    kinds |= dict.fromkeys(("reference", "dirty"), pa.bool_()) | dict.fromkeys(("seconds", "time_limit_s"), real)
    columns: dict[str, Any] = {}
    for name in (*_FACTS, *_COSTS):
        values = [getattr(r, _ENDED.get(name, name)) for r in results]
        if name in ("draws", "parameters", "learned"):  # runs share them
            texts = {id(v): v for v in values}
            known = {key: json.dumps(as_json(dict(v)), sort_keys=True) for key, v in texts.items()}
            values = [known[id(v)] for v in values]
        columns[name] = pa.array(values, kinds.get(name, text))
    for name, scores in zip(SCORES, score_matrix([r.scores for r in results], list(SCORES)).T, strict=True):
        columns[name] = pa.array(scores, real, mask=np.isnan(scores))
    for column, name in _ORIGIN.items():
        columns[column] = pa.array([getattr(r, name) for r in results], kinds.get(column, text))
    index: dict[str, int] = {}
    number = pa.array([index.setdefault(r.provenance.id, len(index)) for r in results], pa.int32())
    by_id = {r.provenance.id: r.provenance for r in results}
    origins = [_provenance(by_id[key]) for key in index]
    for name in _provenance(Provenance()):
        columns[name] = pa.array([o[name] for o in origins], kinds.get(name, text)).take(number)
    units = {name: score.unit for name, score in SCORES.items()} | _UNITS
    fields = [pa.field(n, c.type, metadata={"unit": units[n]} if n in units else None) for n, c in columns.items()]
    return pa.table(list(columns.values()), schema=pa.schema(fields))


#: Units of columns that are no scores; they and those of the scores are metadata of the columns of a Parquet file.
_UNITS = {"seconds": "s", "time_limit_s": "s", "peak_memory": "byte", "memory_limit_bytes": "byte"}


def _provenance(provenance: Provenance) -> dict[str, Any]:
    """Columns of a provenance, with its id."""
    facts = provenance.to_dict()
    return {"provenance": facts.pop("id"), **facts}
