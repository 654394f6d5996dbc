"""The results of the papers' comparisons that come with simnav: one small Parquet file for each paper.

A file holds one row for each run of an estimator on a scenario: status, peak memory and those scores that the paper's
rows need, in single precision. Its metadata hold the estimators that stand for the paper's methods, and the
provenance of the results.

``python -m simnav.leaderboard.papers.documentation FOLDER`` writes the files from ``FOLDER/PAPER/results``, where
FOLDER is the output of ``simnav paper reproduce PAPER --until-decided``, and then the tables of ``docs/papers``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.provenance import Provenance, distinct
from simnav.leaderboard.results.result import Result

from .measures import scores_of
from .paper import Gain, Paper
from .reproduction import Reproduction, fill, find_method

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.request import EstimatorRequest

__all__ = ["FOLDER", "add", "provenance", "save", "shipped_reproduction"]

#: Where the files are.
FOLDER = Path(__file__).with_name("results")

_KEY = b"simnav_paper"


def save(found: Reproduction, folder: Path = FOLDER, sources: Sequence[Provenance] | None = None) -> Path:
    """Write the results of a comparison; returns the path of the file.

    Parameters
    ----------
    found : Reproduction
        The comparison.
    folder : Path
        Folder of the file.
    sources : sequence of Provenance, optional
        Where the results come from; default: what they say themselves.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = _scores(found.paper)
    results = sorted(found.results, key=lambda r: (r.scenario, r.estimator, r.seed))
    columns: dict[str, Any] = {
        "scenario": pa.array([r.scenario for r in results]).dictionary_encode(),
        "estimator": pa.array([r.estimator for r in results]).dictionary_encode(),
        "seed": pa.array([r.seed for r in results], pa.int32()),
        "status": pa.array([r.status for r in results]).dictionary_encode(),
        "reason": pa.array([r.reason for r in results]).dictionary_encode(),
        "peak_memory": pa.array([r.peak_memory for r in results], pa.int64()),
        "variant": pa.array([r.variant for r in results]).dictionary_encode(),
    }
    for name in names:
        columns[f"score.{name}"] = pa.array([r.scores.get(name, math.nan) for r in results], pa.float32())
    about = {
        "paper": found.paper.key,
        "methods": {name: None if r is None else r.label for name, r in found.stands_for.items()},
        "provenance": [p.to_dict() for p in (distinct(r.provenance for r in results) if sources is None else sources)],
    }
    table = pa.table(columns).replace_schema_metadata({_KEY: json.dumps(about).encode()})
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{found.paper.key}.parquet"
    pq.write_table(table, path, compression="zstd", compression_level=19)
    return path


def add(paper: Paper, results: Sequence[Result], folder: Path = FOLDER) -> Path:
    """Add results to those that are stored; returns the path of the file.

    What is stored of an estimator on a scenario is replaced by the results of the same estimator on this scenario, all
    seeds, so that no two versions of an estimator are mixed.
    """
    new = {(r.scenario, r.estimator) for r in results}
    kept: list[Result] = []
    sources = [r.provenance for r in results]
    if (folder / f"{paper.key}.parquet").exists():
        wanted = {paper.scenario(s).id for s in paper.participants()}
        kept = [r for r in _results(_read(paper.key, folder)[0])
                if (r.scenario, r.estimator) not in new and r.scenario in wanted]  # fmt: skip
        sources += provenance(paper, folder)
    stands_for = {m.name: find_method(m) for m in paper.methods}
    every = [*kept, *results]
    found = fill(paper, stands_for, every, range(max((r.seed + 1 for r in every), default=0)))
    return save(found, folder, distinct(sources))


def shipped_reproduction(paper: Paper, folder: Path = FOLDER) -> Reproduction:
    """The comparison from the stored results; nothing is run.

    Raises
    ------
    ValueError
        If there are none for this paper, or the file is damaged; one sentence.
    """
    table, about = _read(paper.key, folder)
    stands_for: dict[str, EstimatorRequest | None] = {}
    for method in paper.methods:
        request = find_method(method)
        same = request is not None and request.label == about["methods"].get(method.name)
        stands_for[method.name] = request if same else None
    results = _results(table)
    most = max((r.seed + 1 for r in results), default=0)
    return fill(paper, stands_for, results, range(most))


def _results(table: Any) -> list[Result]:
    """The results of a table."""
    found = []
    for row in table.to_pylist():
        scores = {k.removeprefix("score."): v for k, v in row.items() if k.startswith("score.") and not math.isnan(v)}
        found.append(
            Result(row["scenario"], row["seed"], row["estimator"], {}, False, row["status"], row["reason"], scores,
                   peak_memory=row["peak_memory"])
        )  # fmt: skip
    return found


def provenance(paper: Paper, folder: Path = FOLDER) -> list[Provenance]:
    """Where the stored results come from: versions, commit, processor and date; the latest first."""
    return [Provenance.from_dict(values) for values in _read(paper.key, folder)[1]["provenance"]]


def _read(key: str, folder: Path) -> tuple[Any, Mapping[str, Any]]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / f"{key}.parquet"
    try:
        table = pq.read_table(path)
        return table, json.loads(table.schema.metadata[_KEY])
    except FileNotFoundError:
        raise ValueError(f"there are no stored results of {key}: {path} is missing") from None
    except (pa.ArrowException, OSError, ValueError, TypeError, KeyError) as error:
        raise ValueError(f"the stored results {path} cannot be read: {error}") from None


def _scores(paper: Paper) -> list[str]:
    """The scores that the rows of a paper need, and those of its figures that show all runs."""
    names = {row.score for row in paper.rows()}
    names |= {row.than_score for row in paper.rows() if isinstance(row, Gain) and row.than_score}
    names |= {s for f in paper.figures if f.draw in ("bars", "gains") for s in f.series.values()}
    return sorted({score for name in names for score in scores_of(name)})
