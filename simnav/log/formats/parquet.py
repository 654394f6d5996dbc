"""Parquet files: columns by name, nested ones as ``outer.inner``; stamps become seconds since 1970."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simnav.log.delimited import rows_of
from simnav.log.files import FileSpec
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, Table


@register_reader("parquet", title="a Parquet file")
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """``time`` of the file is the column of the times, as for a table."""
    import pyarrow as pa
    from pyarrow import parquet

    if not path.is_file():
        raise FileNotFoundError
    try:
        content = parquet.read_table(path, use_threads=False)
        while any(pa.types.is_struct(field.type) for field in content.schema):
            content = content.flatten()
        names = content.column_names
    except (pa.ArrowException, OSError, MemoryError, ValueError) as error:
        raise LogError(f"{path}: it is no Parquet file, or damaged ({' '.join(str(error).split())[:100]})") from None
    columns: dict[str, NDArray[np.float64] | NDArray[np.object_]] = {}
    for name, values in zip(names, content.columns, strict=True):
        kind = values.type
        if pa.types.is_timestamp(kind):
            columns[name] = np.asarray(values.cast(pa.timestamp("us", kind.tz), safe=False).cast(pa.int64()).cast(
                pa.float64(), safe=False), dtype=np.float64) * 1e-6  # fmt: skip
        elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
            plain = values.cast(pa.int8()) if pa.types.is_boolean(kind) else values
            columns[name] = np.asarray(plain.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
        elif pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_dictionary(kind):
            try:
                columns[name] = np.array(values.to_pylist(), dtype=object)
            except UnicodeDecodeError:
                raise LogError(f"{path}: the column {name!r} is no text in UTF-8; the file is damaged") from None
    if not columns or not content.num_rows:
        raise LogError(f"{path}: there are no rows of numbers")
    return rows_of(Table(str(path), columns, np.arange(1, content.num_rows + 1)), file)
