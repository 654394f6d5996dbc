"""What an epoch of a row costs in two versions of simnav, in alternation, and whether both return the same bits.

Run with ``python tests/benchmarks/two_versions.py OTHER --rows ekf,sw-fgo`` from a checkout; OTHER is the folder of
another one. Each version has a process of its own. They take turns through the same epochs, and of each block of ten
epochs the smallest processor time counts, so that other work on the machine does not decide. With ``--together`` a row
takes 64 steps by one call, if it and its version can.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

BLOCK = 10
#: Steps that are taken by one call with ``--together``, as a campaign hands them over.
TOGETHER = 64
VECTORS = ("position", "velocity", "attitude", "covariance")


def serve(scenario: str, epochs: int, together: bool) -> None:
    """Answer each name of a row that is read: at first with a digest, then with the microseconds of each block."""
    from simnav.estimator import make
    from simnav.scenario import load
    from simnav.source import record

    recording = record(load(scenario), 0)
    steps = [step for step, _ in zip(recording.steps(), range(epochs))]
    size = TOGETHER if together else BLOCK
    rows: dict[str, Any] = {}
    for line in sys.stdin:
        name = line.strip()
        first = name not in rows
        row = rows.setdefault(name, make(name)) if first else rows[name]
        row.reset(recording.start, recording.instruments)
        found: list[Any] = []
        spent = []
        blocks = steps_together(recording, epochs) if together and hasattr(row, "update_all") else []
        for k in range(0, len(steps), size):
            begin = time.process_time()
            more = row.update_all(blocks[k // size]) if blocks else None
            found += [row.update(step) for step in steps[k : k + size]] if more is None else [more]
            spent.append(1e6 * (time.process_time() - begin))
        print(digest(found) if first else " ".join(map(str, spent)), flush=True)


def steps_together(recording: Any, epochs: int) -> list[Any]:
    """The steps of a recording as `Estimator.update_all` takes them."""
    from simnav.trial.wire import PacketDecoder, PacketEncoder

    packets = PacketEncoder(recording.data, recording.data.truth.time[:epochs])
    decode = PacketDecoder(packets.streams)
    return [decode(bytearray(b"".join(packets.of(k, min(k + TOGETHER, epochs))))) for k in range(0, epochs, TOGETHER)]


def digest(estimates: list[Any]) -> str:
    """Of states, covariances, diagnostics and flags, whether there is one for each epoch or for several."""
    from simnav.types import Estimate

    total = hashlib.sha256()
    names = sorted({name for e in estimates for name in e.diagnostics})
    flags = [flag[-2:] for e in estimates for flag in e.flagged]
    for what in VECTORS:
        for e in estimates:
            total.update(b"" if getattr(e, what) is None else np.ascontiguousarray(getattr(e, what)).tobytes())
    for name in names:
        parts = [e.diagnostics.get(name, np.nan) for e in estimates]
        if isinstance(estimates[0], Estimate) and not all(map(np.isscalar, parts)):
            continue
        count = [1 if isinstance(e, Estimate) else len(e.time) for e in estimates]
        whole = [np.broadcast_to(part, n) for part, n in zip(parts, count, strict=True)]
        total.update(name.encode() + np.concatenate(whole).astype(float).tobytes())
    total.update(repr(flags).encode())
    return total.hexdigest()


def compare(other: str, rows: list[str], rounds: int, scenario: str, epochs: int, together: bool) -> None:
    """Print a line for each row: microseconds for an epoch in the other version and in this one."""
    here = Path(__file__).resolve().parents[2]
    command = [
        sys.executable,
        str(Path(__file__).resolve()),
        "--serve",
        "--scenario",
        scenario,
        "--epochs",
        str(epochs),
        *(["--together"] if together else []),
    ]
    versions = [
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1"},
        )
        for folder in (Path(other).resolve(), here)
    ]  # fmt: skip

    def ask(version: subprocess.Popen[str], name: str) -> str:
        assert version.stdin is not None
        assert version.stdout is not None
        print(name, file=version.stdin, flush=True)
        return version.stdout.readline().strip()

    for name in rows:
        before, after = (ask(version, name) for version in versions)
        times: list[list[list[float]]] = [[], []]
        for k in range(rounds):  # each begins every other time: the second one finds the caches of the first one
            for v in (0, 1) if k % 2 else (1, 0):
                times[v].append([float(x) for x in ask(versions[v], name).split()])
        old, new = (sum(map(min, zip(*rounds_of))) / epochs for rounds_of in times)
        same = "the same bits" if before == after else "DIFFERENT numbers"
        print(f"{name:22} {old:7.1f} -> {new:7.1f} us, {new / old:.2f} times, {same}", flush=True)
    for version in versions:
        version.communicate()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", nargs="?", help="folder of the other checkout")
    parser.add_argument("--rows", default="ekf,iae,ukf,sw-fgo")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--scenario", default="open-sea")
    parser.add_argument("--epochs", type=int, default=300)
    parser.add_argument("--together", action="store_true", help="many steps by one call, where a row takes them so")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve(given.scenario, given.epochs, given.together)
    elif given.other is None:
        parser.error("it needs the folder of another checkout")
    else:
        compare(given.other, given.rows.split(","), given.rounds, given.scenario, given.epochs, given.together)
