"""What an epoch of a row costs in two versions of simnav, in alternation, and whether both return the same bits.

Run with ``python tests/benchmarks/two_versions.py OTHER --rows ekf,sw-fgo`` from a checkout; OTHER is the folder of
another one. Each version has a process of its own. They take turns through the same epochs, and of each block of ten
epochs the smallest processor time counts, so that other work on the machine does not decide.
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


def serve(scenario: str, epochs: int) -> None:
    """Answer each name of a row that is read: at first with a digest, then with the microseconds of each block."""
    from simnav.estimator import make
    from simnav.scenario import load
    from simnav.source import record
    from simnav.types import Estimate

    recording = record(load(scenario), 0)
    steps = [step for step, _ in zip(recording.steps(), range(epochs))]
    rows: dict[str, Any] = {}
    for line in sys.stdin:
        name = line.strip()
        first = name not in rows
        row = rows.setdefault(name, make(name)) if first else rows[name]
        row.reset(recording.start, recording.instruments)
        found: list[Estimate] = []
        spent = []
        for k in range(0, len(steps), BLOCK):
            begin = time.process_time()
            found += [row.update(step) for step in steps[k : k + BLOCK]]
            spent.append(1e6 * (time.process_time() - begin))
        print(digest(found) if first else " ".join(map(str, spent)), flush=True)


def digest(estimates: list[Any]) -> str:
    """Of states, covariances, diagnostics and flags."""
    total = hashlib.sha256()
    for e in estimates:
        for what in (e.position, e.velocity, e.attitude, e.covariance):
            total.update(b"" if what is None else what.tobytes())
        total.update(repr(sorted((k, v) for k, v in e.diagnostics.items() if np.isscalar(v))).encode())
        total.update(repr(e.flagged).encode())
    return total.hexdigest()


def compare(other: str, rows: list[str], rounds: int, scenario: str, epochs: int) -> None:
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
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve(given.scenario, given.epochs)
    elif given.other is None:
        parser.error("it needs the folder of another checkout")
    else:
        compare(given.other, given.rows.split(","), given.rounds, given.scenario, given.epochs)
