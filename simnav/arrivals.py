"""Readings that arrive later than in the block of their time of validity."""

from __future__ import annotations

from dataclasses import replace

from simnav.recording import AidStream, Block
from simnav.timing import TIME_TOLERANCE

__all__ = ["Arrivals"]


class Arrivals:
    """The readings of a run that have not arrived yet."""

    def __init__(self) -> None:
        self._waiting: dict[str, AidStream] = {}

    def of(self, block: Block) -> Block:
        """The next block of the run, with the readings that arrive within it, and no others."""
        aids = dict(block.aids)
        for name, stream in block.aids.items():
            waiting = self._waiting.get(name)
            if waiting is None and not len(stream.arrival):
                continue
            whole = stream if waiting is None else AidStream.concatenate([waiting, stream])
            late = whole.arrivals > block.end + TIME_TOLERANCE
            aids[name], self._waiting[name] = whole.rows(~late), whole.rows(late)
        return replace(block, aids=aids)
