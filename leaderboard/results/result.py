"""A result: what one estimator did in one run, and its form in a Parquet file."""

from __future__ import annotations

import json
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from simnav.scoring.ending import ending, outcome, why_lost

from .ahead import made_ahead
from .errors import printable
from .former_names import present_label, present_parameters
from .plain import table_of
from .provenance import Provenance
from .stored_scores import StoredScores

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = [
    "BATCH",
    "FORMAT",
    "NO_TRIAL",
    "READABLE",
    "SINCE_VERSIONS",
    "Result",
    "batches",
    "listed",
    "of_scenarios",
    "rows",
    "schema",
    "to_table",
    "write_tables",
]

#: Version of the format of results, and those that can be read.
FORMAT = 5
READABLE = (1, 2, 3, 4, FORMAT)
#: The first format with declared versions.
SINCE_VERSIONS = 5

#: Results that are held in memory at a time where a file is streamed.
BATCH = 256

#: Ends the label of a row whose estimates were made elsewhere.
EXTERNAL = " (external)"
#: Statuses that say nothing about the estimator.
NO_TRIAL = ("unsuitable", "no-recording")

#: Columns that older formats do not have: the format that brought them, and what stands there (not known). All that was
#: computed before versions were declared counts as version 1.
_SINCE: dict[str, tuple[int, Any]] = {
    "time_limit": (2, 0.0),
    "memory_limit": (2, 0),
    "scoring": (2, ""),
    "scenario_digest": (3, ""),
    "estimator_digest": (3, ""),
    "provenance": (3, ""),
    "draws": (4, "{}"),
    "learned": (5, "{}"),
    "simulator_version": (SINCE_VERSIONS, 1),
    "estimator_version": (SINCE_VERSIONS, 1),
}

#: Columns that take most of the memory of a file of results.
_HEAVY = frozenset({"scores", "series"})

Series = NDArray[np.float32]


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What one estimator did in one run.

    Attributes
    ----------
    scenario : str
        Versioned id.
    seed : int
        Seed of the run.
    estimator : str
        Label, unique in a campaign.
    parameters : mapping
        Those that were set.
    reference : bool
        True for rows that are told the truth; they are not ranked.
    status, reason : str
        As in `simnav.trial.trial`, and ``timeout``, ``out-of-memory``, ``no-recording``.
    scores : mapping of str to float
        As in `simnav.scoring.SCORES`.
    series : mapping of str to array
        As from `simnav.scoring.series`, in single precision.
    note : str
        The recording's, e.g. which of several logs it is.
    seconds : float
        Wall-clock time of the estimator, start of its process included.
    peak_memory : int
        Taken by the estimator at most [bytes].
    key : str
        Digest of all that decides the result, and the seed: of declared versions
        (`simnav.leaderboard.results.versions`), or of code (`simnav.leaderboard.campaign.fingerprint`).
    recording : str
        Version of the simulator, or digest of scenario and simulator: runs of a scenario that share it and the seed
        share the recording.
    simnav : str
        Version and digest of the simulator.
    time_limit : float
        Time limit of the run [s]; 0 where it is not known.
    memory_limit : int
        Memory limit of the run [bytes]; 0 where it is not known.
    scoring : str
        With which code it was scored: JSON, digests by module. Empty where it is not known.
    scenario_digest, estimator_digest : str
        Of the scenario's content, and of the estimator's code. Empty where they are not known.
    provenance : Provenance
        Versions, machine and day; a file names its id only.
    draws : mapping of str to object
        What was drawn for the run, by key path, in the units of the scenario's file.
    learned : mapping of str to object
        What the estimator says that it learned from: ``learned_from``, pairs of a first and a last number as of
        `simnav.estimator.Estimator`, and ``trained_on``, the record of the training. Empty where it learned nothing,
        or results are older than format 5.
    simulator_version, estimator_version : int
        Declared versions of the simulator and of the estimator.
    """

    scenario: str
    seed: int
    estimator: str
    parameters: Mapping[str, Any]
    reference: bool
    status: str
    reason: str
    scores: Mapping[str, float]
    series: Mapping[str, Series] = field(default_factory=dict)
    note: str = ""
    seconds: float = 0.0
    peak_memory: int = 0
    key: str = ""
    recording: str = ""
    simnav: str = ""
    time_limit: float = 0.0
    memory_limit: int = 0
    scoring: str = ""
    scenario_digest: str = ""
    estimator_digest: str = ""
    provenance: Provenance = field(default_factory=Provenance)
    draws: Mapping[str, Any] = field(default_factory=dict)
    learned: Mapping[str, Any] = field(default_factory=dict)
    simulator_version: int = 1
    estimator_version: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "reason", printable(self.reason))  # it is what an estimator's exception says

    @property
    def variant(self) -> str:
        """The key without the seed."""
        return self.key.rpartition("-")[0]

    @property
    def outcome(self) -> str:
        """The status as it counts: ``lost`` in place of ``ok`` (`simnav.scoring.ending.outcome`)."""
        return outcome(self.status, self.scores)

    @property
    def why(self) -> str:
        """The reason of what it did not end well by; empty if it is ``ok``."""
        return why_lost(self.scores) if self.outcome == "lost" else self.reason

    @property
    def ending(self) -> str:
        """The outcome, or ``inconsistent`` (`simnav.scoring.ending.ending`)."""
        return ending(self.status, self.scores)

    @property
    def tried(self) -> bool:
        """Whether the run says something about the estimator."""
        return self.status not in NO_TRIAL


def schema() -> pa.Schema:
    """Columns of a file of results."""
    import pyarrow as pa

    series = pa.struct([("name", pa.string()), ("shape", pa.list_(pa.int64())), ("values", pa.list_(pa.float32()))])
    return pa.schema(
        [
            ("key", pa.string()),
            ("scenario", pa.string()),
            ("seed", pa.int64()),
            ("estimator", pa.string()),
            ("parameters", pa.string()),
            ("reference", pa.bool_()),
            ("status", pa.string()),
            ("reason", pa.string()),
            ("scores", pa.map_(pa.string(), pa.float64())),
            ("series", pa.list_(series)),
            ("note", pa.string()),
            ("seconds", pa.float64()),
            ("peak_memory", pa.int64()),
            ("recording", pa.string()),
            ("simnav", pa.string()),
            ("time_limit", pa.float64()),
            ("memory_limit", pa.int64()),
            ("scoring", pa.string()),
            ("scenario_digest", pa.string()),
            ("estimator_digest", pa.string()),
            ("provenance", pa.string()),
            ("draws", pa.string()),
            ("learned", pa.string()),
            ("simulator_version", pa.int64()),
            ("estimator_version", pa.int64()),
        ],
        metadata={"simnav_results": str(FORMAT)},
    )


def to_table(result: Result) -> pa.Table:
    """A result as a table with one row."""
    import pyarrow as pa

    arrays = {name: np.asarray(a, dtype=np.float32) for name, a in result.series.items()}
    row = {name: getattr(result, name) for name in schema().names}
    row["provenance"] = result.provenance.id
    row["parameters"] = json.dumps(dict(result.parameters), sort_keys=True, default=str)
    row["draws"] = json.dumps(dict(result.draws), default=str)
    row["learned"] = json.dumps(dict(result.learned), sort_keys=True, default=str)
    row["scores"] = [(str(name), float(value)) for name, value in result.scores.items()]
    row["series"] = [{"name": n, "shape": list(a.shape), "values": a.ravel()} for n, a in arrays.items()]
    return pa.Table.from_pylist([row], schema=schema())


def batches(path: Path, columns: list[str] | None = None) -> Iterator[pa.Table]:
    """The contents of a file, checked: a row group (a few hundred results) at a time, or at once where that is little.

    Raises
    ------
    pyarrow.ArrowException, ValueError, OSError
        If it is damaged or not ours.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    with open(path, "rb") as source:
        file = pq.ParquetFile(source, page_checksum_verification=True)
        found = file.schema_arrow
        names = schema().names
        known = {str(version).encode(): [n for n in names if version >= _SINCE.get(n, (1,))[0]] for version in READABLE}
        if found.names != known.get((found.metadata or {}).get(b"simnav_results", b"")):
            raise ValueError("it was not written by this version of simnav")
        for name in found.names:
            if name not in _HEAVY and found.field(name).type != schema().field(name).type:
                raise ValueError(f"{name} is a column of {found.field(name).type}, not {schema().field(name).type}")
        wanted = names if columns is None else columns
        there = [n for n in wanted if n in found.names]
        groups = range(file.num_row_groups)
        heavy = columns is None or not _HEAVY.isdisjoint(columns)
        parts = ([k] for k in groups) if heavy else filter(None, [list(groups)])
        tables = (file.read_row_groups(part, columns=there, use_threads=False) for part in parts)
        for table in made_ahead(tables) if heavy and len(groups) > 1 else tables:
            if lacks := [n for n in there if n not in _HEAVY and table.column(n).null_count]:
                raise ValueError(f"values of {lacks[0]} are missing")
            for name in (n for n in names if n in wanted and n not in there):
                unknown = pa.array([_SINCE[name][1]] * len(table), schema().field(name).type)
                table = table.append_column(schema().field(name), unknown)
            yield table.replace_schema_metadata(schema().metadata)


def write_tables(file: BinaryIO, tables: Iterator[pa.Table], *, level: int | None = None, split: bool = False) -> None:
    """Write a file of results, with check sums.

    Parameters
    ----------
    file : file
        Open for writing bytes.
    tables : iterator of pyarrow.Table
        Each becomes a row group.
    level : int, optional
        Level of the compression.
    split : bool
        Store the bytes of scores and series by their place, which makes them smaller.
    """
    import pyarrow.parquet as pq

    options: dict[str, Any] = {"compression": "zstd", "compression_level": level, "write_page_checksum": True}
    if split:
        values = "scores.key_value.value", "series.list.element.values.list.element"
        options["column_encoding"] = dict.fromkeys(values, "BYTE_STREAM_SPLIT")
        options["use_dictionary"] = [n for n in schema().names if n not in ("scores", "series")] + [
            "scores.key_value.key"
        ]
    with pq.ParquetWriter(file, schema(), **options) as writer:
        for table in tables:
            writer.write_table(table)


def of_scenarios(table: pa.Table, scenarios: Collection[str]) -> pa.Table:
    """The rows of a table that are of some scenarios, by their versioned ids."""
    import pyarrow as pa
    import pyarrow.compute as pc

    wanted = pa.array(sorted(scenarios), pa.string())
    return table.filter(pc.is_in(table.column("scenario").cast(pa.string()), value_set=wanted))


def rows(
    table: pa.Table,
    provenances: Mapping[str, Provenance],
    *,
    scores: Collection[str] | None = None,
    series: Callable[[int], Mapping[str, Series]] | None = None,
) -> Iterator[Result]:
    """Results of a table, parameters under their present names; the column of series may be missing.

    Parameters
    ----------
    table : pyarrow.Table
        Part of a file of results.
    provenances : mapping of str to Provenance
        By id. A result whose provenance is not among them keeps the id alone.
    scores : collection of str, optional
        Only these are read. Default: all.
    series : callable, optional
        Gives the series of a row of the table, where the column is missing.
    """
    converted: dict[str, Callable[[str], Any]] = {
        "parameters": table_of,
        "draws": table_of,
        "learned": table_of,
        "provenance": lambda identity: provenances.get(identity) or Provenance(identity=identity),
    }
    plain = [name for name in table.column_names if name not in _HEAVY]
    columns = {name: listed(table.column(name), converted.get(name)) for name in plain}
    for k, parameters in enumerate(columns["parameters"]):
        if parameters:
            label = columns["estimator"][k]
            columns["parameters"][k] = present_parameters(label, parameters)
            columns["estimator"][k] = present_label(label)
    columns["scores"] = _scores(table.column("scores"), scores)
    if "series" in table.column_names:
        found = SeriesColumn(table.column("series"))
        columns["series"] = [found[k] for k in range(len(found))]
    elif series is not None:
        columns["series"] = [series(k) for k in range(len(table))]
    names = list(columns)
    for values in zip(*columns.values(), strict=True):
        yield Result(**dict(zip(names, values, strict=True)))


def listed(column: pa.ChunkedArray, convert: Callable[[str], Any] | None = None) -> list[Any]:
    """The values of a column; equal texts are one object, converted once."""
    if column.type != "string":
        return list(column.to_pylist())
    encoded = column.combine_chunks().dictionary_encode()
    texts = encoded.dictionary.to_pylist()
    values = texts if convert is None else [convert(t) for t in texts]
    return [values[k] for k in encoded.indices.to_numpy(zero_copy_only=False).tolist()]


def _scores(column: pa.ChunkedArray, wanted: Collection[str] | None) -> list[StoredScores]:
    """The scores of each row, by name."""
    maps = column.combine_chunks()
    edges = maps.offsets.to_numpy()
    first, last = int(edges[0]), int(edges[-1])
    encoded = maps.keys.slice(first, last - first).dictionary_encode()
    names = encoded.dictionary.to_pylist()
    code = encoded.indices.to_numpy(zero_copy_only=False)
    value = maps.items.slice(first, last - first).to_numpy(zero_copy_only=False)
    edges = edges - first
    if wanted is not None:
        kept = np.flatnonzero(np.array([n in wanted for n in names], dtype=bool)[code]) if len(code) else code
        edges = np.searchsorted(kept, edges)
        code, value = code[kept], value[kept]
    values = array("d", np.ascontiguousarray(value, dtype=np.float64).tobytes())
    places: dict[bytes, dict[str, int]] = {}
    found = []
    for start, end in pairwise(edges.tolist()):
        mine = code[start:end]
        place = places.get(key := mine.tobytes())
        if place is None:
            place = places[key] = {names[c]: k for k, c in enumerate(mine.tolist())}
        found.append(StoredScores(place, values, start))
    return found


class SeriesColumn:
    """The series of each row of a column, by name; a row is decoded when it is asked for.

    Parameters
    ----------
    column : ChunkedArray
        Column of a file of results.
    """

    def __init__(self, column: pa.ChunkedArray):
        lists = column.combine_chunks()
        items = lists.values
        self._first = lists.offsets.to_numpy()
        encoded = items.field("name").dictionary_encode()
        self._names, self._codes = encoded.dictionary.to_pylist(), encoded.indices.to_numpy(zero_copy_only=False)
        shapes = items.field("shape")
        self._shapes, self._axes = shapes.values.to_numpy(zero_copy_only=False), shapes.offsets.to_numpy()
        self._edges = items.field("values").offsets.to_numpy()
        self._values = items.field("values").values.to_numpy(zero_copy_only=False)
        self._rows: dict[int, dict[str, Series]] = {}

    def __len__(self) -> int:
        return len(self._first) - 1

    def __getitem__(self, i: int) -> dict[str, Series]:
        if i not in self._rows:
            begin, end = int(self._first[i]), int(self._first[i + 1])
            edges, axes = self._edges[begin : end + 1].tolist(), self._axes[begin : end + 1].tolist()
            names, shapes, values = self._names, self._shapes, self._values
            self._rows[i] = {
                names[code]: values[low:high] if b - a == 1 else values[low:high].reshape(shapes[a:b])
                for code, low, high, a, b in zip(
                    self._codes[begin:end].tolist(), edges, edges[1:], axes, axes[1:], strict=False
                )
            }
        return self._rows[i]
