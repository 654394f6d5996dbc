"""What a worker and an estimator process say to each other.

The worker sends messages with a header of the size of a packet's: packets themselves, and those of `Down` with a body.
The estimator process gives one answer to each, with the header `simnav.trial.wire.ANSWER`: an estimate, or one of
`Up` with a body in JSON or in float64. The answer to a packet of several steps holds the time that each took [s], and
the answers to them one after the other, up to the first failure. Bodies to the estimator process are pickled, for they
come from the harness; those from it never are.
"""

from __future__ import annotations

import os
import struct
from enum import IntEnum
from typing import Any

from simnav.trial.wire import ANSWER, PacketDecoder

__all__ = ["LARGEST", "Down", "Up", "answer", "command", "read_message", "write_all"]

#: Bytes of one answer at most: an estimate with its diagnostics.
LARGEST = 64 << 20

_COMMAND = struct.Struct("<IIII16x")
assert _COMMAND.size == PacketDecoder.HEADER
_PIECE = 1 << 16


class Down(IntEnum):
    """To the estimator process; 0 is a packet."""

    MAKE = 1
    RESET = 2
    SMOOTH = 3
    END = 4
    DESCRIBE = 5


class Up(IntEnum):
    """From the estimator process; 1 is an estimate (`simnav.trial.wire.ESTIMATE`)."""

    DONE = 2
    FAILURE = 3
    TRAJECTORY = 4
    ANSWERS = 5


def command(kind: Down, body: bytes = b"") -> bytes:
    """A message to the estimator process."""
    return _COMMAND.pack(0, 0, len(body), kind) + body


def answer(kind: Up, body: bytes = b"") -> bytes:
    """A message from the estimator process that is no estimate."""
    return ANSWER.pack(kind, 0, 0, 0, 0, len(body), 0, 0.0) + body


def read_message(descriptor: int) -> tuple[int, bytearray] | None:
    """The next message to the estimator process, and which of `Down` it is (0: a packet); None: there will be none."""
    message = bytearray(os.read(descriptor, _PIECE))
    wanted = _COMMAND.size
    while True:
        if len(message) >= _COMMAND.size:
            _, _, size, kind = _COMMAND.unpack_from(message)
            wanted = _COMMAND.size + size if kind else PacketDecoder.size(message)
            if len(message) >= wanted:
                return kind, message
        piece = os.read(descriptor, max(_PIECE, wanted - len(message)))
        if not piece:
            return None
        message += piece


def write_all(descriptor: int, data: Any) -> None:
    """Write all of it; the descriptor blocks."""
    written = os.write(descriptor, data)
    if written < len(data):
        view = memoryview(data)[written:]
        while view:
            view = view[os.write(descriptor, view) :]
