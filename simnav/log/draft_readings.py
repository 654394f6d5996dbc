"""The readings of streams that are far more likely, in a draft: written if they are sure, else as comments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simnav.log.readings import ProbableReading

__all__ = ["SURE", "rewritten"]

#: Readings with a smaller probability are comments of a draft.
SURE = 0.9


def rewritten(text: str, readings: Sequence[ProbableReading]) -> str:
    """A draft with other readings of its streams, each with its probability; those that are not sure are comments.

    Parameters
    ----------
    text : str
        From `draft`.
    readings : sequence of ProbableReading
        What is far more likely than what the draft says.
    """
    lines = text.splitlines()
    for reading in readings:
        if not reading.changes:
            first = lines.index(f"[log.instruments.{reading.stream}]") + 1
            sure = f"so with probability {reading.shown}"
            lines.insert(first, f"# check: {reading.what}, {sure}: take it out")
        for table, key, value in reading.changes:
            first = lines.index(f"[{table}]") + 1
            ends = (k for k in range(first, len(lines)) if not lines[k] or lines[k].startswith("["))
            last = next(ends, len(lines))
            if reading.probability < SURE:
                said = f"# check: perhaps {key} = {value} ({reading.what}, with probability {reading.shown})"
                lines.insert(first, said)
                continue
            new = f"{key} = {value}   # check: so with probability {reading.shown}"
            at = next((k for k in range(first, last) if lines[k].partition("=")[0].strip() == key), None)
            lines[first if at is None else at : first if at is None else at + 1] = [new]
    return "\n".join(lines) + "\n"
