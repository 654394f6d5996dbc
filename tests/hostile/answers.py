"""Answers that no estimator of good will gives: random messages, made from well-formed ones, to a campaign's worker.

``python -m tests.hostile.answers [NUMBER] [SEED]`` prints how the runs ended.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import struct
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from simnav.leaderboard.campaign.confinement.attempt import attempt
from simnav.leaderboard.campaign.confinement.messages import Down, Up, answer, read_message
from simnav.leaderboard.campaign.confinement.session import Limits, RemoteSession
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.worker import Unit, judged
from simnav.leaderboard.results import store
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.trial.wire import ANSWER

__all__ = ["fuzz_answers"]

_SCENARIO = Path(__file__).parent / "cheats" / "scenario.toml"
_NUMBERS = (0.0, -0.0, 1.0, -1.0, 5e-324, 1e-300, 1e300, 1.7e308, -1.7e308, float("inf"), float("nan"), 3.0, 0.9)
_SIZES = (0, 1, 2, 3, 7, 1000, 10**6, 2**31, 2**62, 2**63, 10**30, -1, True, 1.5, None, "3")
_NAMES = (
    "a",
    "b",
    "innovation.gnss",
    "nis.gnss",
    "protection_level",
    "inconsistent",
    "\ud800",
    "\0",
    "x" * 3000,
    "",
    "a",
)
_WORDS: tuple[Any, ...] = (None, 1, -1, 1e400, "", "\udfff", [], {}, [[]], [["a", []]], {"a": 1}, [1, 2, 3], ["imu"])


def fuzz_answers(number: int, seed: int) -> Counter[str]:
    """Runs with random answers; how many had which status, or raised (``raised ...``).

    Parameters
    ----------
    number : int
        How many runs, of 20 steps each at most.
    seed : int
        Of the answers.
    """
    recording, found = record(load(_SCENARIO), 0), Counter[str]()
    with tempfile.TemporaryDirectory() as name:
        folder = store.create(Path(name))
        for k in range(number):
            try:
                found[_run(recording, random.Random(f"{seed}/{k}"), folder)] += 1
            except Exception as error:
                found[f"raised {type(error).__name__}: {error}, seed {seed}, run {k}"] += 1
    return found


class _Server:
    """Stands for a server; its estimator process is a thread."""

    confinement = "process"

    def __init__(self, recording: Recording, chance: random.Random):
        self._recording, self._chance = recording, chance

    def wait_until_ready(self) -> None:
        """It always is."""

    @contextlib.contextmanager
    def session(self, _: Entrant, limits: Limits, __: int | None = None) -> Iterator[RemoteSession]:
        """A session with the thread."""
        down, write = os.pipe()
        read, up = os.pipe()
        thread = threading.Thread(target=_live, args=(down, up, self._recording, self._chance), daemon=True)
        thread.start()
        try:
            yield RemoteSession(write, read, limits)
        finally:
            os.close(write)
            os.close(read)
            thread.join(10.0)


def _live(down: int, up: int, recording: Recording, chance: random.Random) -> None:
    """Answer as an estimator does, but now and then otherwise."""
    wild = chance.choice((0.02, 0.1, 0.5))
    truth, k, shapes = recording.data.truth, 0, 1
    with contextlib.suppress(OSError):
        while (found := read_message(down)) is not None:
            kind, odd = found[0], chance.random() < wild
            if kind == Down.SMOOTH:
                reply = _trajectory(chance, recording) if chance.random() < 0.5 else answer(Up.DONE)
            elif kind:
                facts = {"name": "fuzz", "needs": []}
                if odd:
                    facts = {n: chance.choice(_WORDS) for n in ("name", "needs", "libraries")}
                reply = answer(Up.DONE, json.dumps(facts).encode())
            else:
                reply, new = _estimate(chance, odd, float(truth.time[k]), truth.position[k], shapes)
                shapes, k = shapes + new, min(k + 1, len(truth) - 1)
            if odd and chance.random() < 0.3:
                reply = _damaged(chance, reply)
            os.write(up, reply)
            if kind == Down.END:
                break
    os.close(down)
    os.close(up)


def _estimate(chance: random.Random, odd: bool, time: float, position: Any, shapes: int) -> tuple[bytes, bool]:
    """An estimate, and whether it names new diagnostics."""
    given, parts = 1, [np.asarray(position).tobytes()]
    if chance.random() < 0.3:
        given |= 2
        parts.append(struct.pack("3d", *(chance.choice(_NUMBERS) if odd else 1.0 for _ in range(3))))
    bits = 7 if given == 1 else 63
    if chance.random() < 0.5:
        covariance = np.eye(9)
        if odd:
            for _ in range(chance.randint(1, 20)):
                i, j = chance.randrange(9), chance.randrange(9)
                covariance[i, j] = covariance[j, i] = chance.choice(_NUMBERS)
        given |= 8
        parts.append(covariance.tobytes())
    shape, more = chance.randrange(shapes), {}
    if odd and chance.random() < 0.7:
        names = [[chance.choice(_NAMES), [chance.choice(_SIZES[: chance.choice((3, 16))]) for _ in range(
            chance.choice((0, 1, 1, 2, 3, 70)))]] for _ in range(chance.randint(1, 3))]  # fmt: skip
        more["shape"], shape = names, shapes
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            count = sum(int(np.prod([int(s) for s in sizes], dtype=object)) for _, sizes in names)
            parts.append(
                struct.pack(f"{count}d", *(chance.choice(_NUMBERS) for _ in range(count))) if 0 <= count < 9e4 else b""
            )
    flags = chance.choice((0, 0, 1, 3)) if odd else 0
    if flags:
        more["flagged"] = [[chance.choice(_NAMES), chance.choice(_NUMBERS)] for _ in range(flags)]
    tail = json.dumps(more).encode() if more else b""
    if shape and "shape" not in more:
        shape = 0
    body = b"".join([*parts, tail])
    return ANSWER.pack(1, given, bits, shape, flags, len(body), len(tail), time) + body, "shape" in more


def _trajectory(chance: random.Random, recording: Recording) -> bytes:
    """A smoothed trajectory, or what might be one."""
    n = len(recording.data.truth)
    sizes: list[Any] = [[n], [n, 3], [n, 3], [n, 3]]
    if chance.random() < 0.5:
        sizes[chance.randrange(4)] = chance.choice(
            ([], [n, 0], [0], [2**40, 0], [-1, 3], [1e400], "abc", None, [1] * 70)
        )
    text = json.dumps(sizes).encode()
    body = (len(text) if chance.random() < 0.9 else chance.choice((0, 2**63, 7))).to_bytes(8) + text
    values = [chance.choice(_NUMBERS) if chance.random() < 0.01 else 1.0 for _ in range(9 * n)]
    return answer(Up.TRAJECTORY, body + recording.data.truth.time.tobytes() + np.array(values).tobytes())


def _damaged(chance: random.Random, reply: bytes) -> bytes:
    """With some other bytes, cut, longer, or of another kind."""
    kind = chance.randrange(5)
    data = bytearray(reply)
    if kind == 0:
        for _ in range(chance.randint(1, 4)):
            data[chance.randrange(len(data))] = chance.randrange(256)
    elif kind == 1:
        data = data[: chance.randrange(1, len(data))] + bytes(ANSWER.size)
    elif kind == 2:
        data += bytes(chance.randrange(1, 100))
    elif kind == 3:
        reason = [
            chance.choice(("error", "unsuitable", "ok", 1)),
            chance.choice(("\ud800", "a\nb", "x" * 5000, 1, None)),
        ]
        data = bytearray(answer(Up.FAILURE, json.dumps(reason).encode()))
    else:
        data[0] = chance.choice((0, 1, 2, 3, 4, 255))
    return bytes(data[: 1 << 16])  # what a pipe takes at once


def _run(recording: Recording, chance: random.Random, folder: Path) -> str:
    """One run, to its stored result; its status."""
    entrant, limits = Entrant("fuzz", {}, "fuzz", False, ""), Limits(0.5, 1 << 30)
    unit = Unit(load(_SCENARIO), 0, ((entrant, "fuzz-0"),), "", "", folder, limits, keep_trials=True)
    made = attempt(_Server(recording, chance), entrant, recording, limits)  # type: ignore[arg-type]
    result = judged(unit, entrant, "fuzz-0", recording, made)
    store.write(folder, result)
    assert store.keys(folder)["fuzz-0"].status == result.status
    return result.status


if __name__ == "__main__":
    for what, count in fuzz_answers(*map(int, (sys.argv[1:] + ["300", "0"][len(sys.argv) - 1 :]))).most_common():
        print(f"{count:6d} {what}")
