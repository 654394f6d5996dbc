"""``simnav dataset``: recordings of random voyages to learn from, as Parquet."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.dataset_requests import DatasetRequest
from simnav.leaderboard.datasets import dataset
from simnav.leaderboard.ranking import tables

from .console import Output

__all__ = ["show"]


def show(out: Output, request: DatasetRequest) -> None:
    """Write a data set, and tell what it holds."""
    with out.progress("voyages") as progress:
        made = dataset.of(replace(request, progress=progress))
    out.document(made.to_dict())
    columns = ["split", "voyages", "hours", "MB"]
    rows = [[name, s.voyages, f"{s.duration / 3600.0:.1f}", f"{s.size / 1e6:.1f}"] for name, s in made.splits.items()]
    out.print(tables.table(made.family, columns, rows, numeric=columns[1:]))
    out.print(
        f"written:  {made.written} voyages in {made.seconds:.1f} s, {made.pace:.0f} a minute of processor time",
        f"size:     {made.density:.0f} bytes a second of voyage",
        f"data set: {made.folder}",
    )
