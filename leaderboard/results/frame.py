"""Rows of named values as a data frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["frame"]


def frame(rows: Sequence[Mapping[str, Any]]) -> Any:
    """A ``pandas.DataFrame`` if pandas is installed; otherwise a ``pyarrow.Table`` with the same columns.

    simnav does not need pandas, and does not install it.

    Parameters
    ----------
    rows : sequence of mapping
        All with the same keys, in the order of the columns.
    """
    columns = {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}
    try:
        from pandas import DataFrame  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        import pyarrow as pa

        return pa.table(columns)
    return DataFrame(columns)
