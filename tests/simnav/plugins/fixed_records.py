"""A reader of binary logs: records of doubles, of which the first is the time."""

from __future__ import annotations

import numpy as np

from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, Table


@register_reader("fixed_records", title="a file of fixed records")
def read(path, file, sentence, talker):
    """``options.columns`` names the values of a record after its time."""
    names = file.options.get("columns")
    if not names:
        raise LogError(f"{path}: name the columns of a record, like options = {{ columns = ['x', 'y'] }}")
    values = np.fromfile(path, dtype="<f8")
    width = 1 + len(names)
    if len(values) % width:
        raise LogError(f"{path}: {len(values)} numbers are no whole number of records of {width}")
    records = values.reshape(-1, width)
    columns = {name: records[:, 1 + i].copy() for i, name in enumerate(names)}
    return Rows(Table(str(path), columns, np.arange(1, len(records) + 1)), records[:, 0], "time")
