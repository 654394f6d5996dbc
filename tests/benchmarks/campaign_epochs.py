"""What an epoch of a row costs a campaign in two versions of simnav: its process, the worker, and the scores.

Run with ``python tests/benchmarks/campaign_epochs.py OTHER --rows ekf,sw-fgo`` from a checkout; OTHER is the folder of
another one. Each version has a process of its own, with a server of estimators. They take turns: each row runs over the
same recording, confined as in a campaign, and is scored. What is counted is processor time of the worker, of the server
and of the estimator's process, the least of some rounds. The last line is the time of 200 seeds of 20 such rows over
6000 epochs on two cores, without the recordings (0.02 ms an epoch, once for all rows) and the start.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROWS = (
    "gnss-only", "ekf", "gated-ekf", "huber-kf", "iae", "vb-akf", "student-t", "ukf", "inekf", "iekf", "sage-husa",
    "imm", "adkf", "igg3", "mckf", "ekf-rts", "sw-fgo", "gnc-fgo", "huber-fgo", "tukey-fgo",
)  # fmt: skip
SEEDS, ROWS_OF_CAMPAIGN, EPOCHS, CORES = 200, 20, 6000, 2
_LIMIT = 900.0  # of a row [s]
_TICK = os.sysconf("SC_CLK_TCK")


def used(process: int) -> float:
    """Processor time of a process and of its children that have ended [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / _TICK


def serve(scenario: str) -> None:
    """Answer each name of a row that is read: processor time of an epoch [us], and a digest of the position."""
    from simnav.leaderboard.campaign.confinement.attempt import attempt, close_server, prepare
    from simnav.leaderboard.campaign.confinement.session import Limits
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.leaderboard.campaign.resolution import resolve
    from simnav.leaderboard.campaign.worker import Unit, judged
    from simnav.scenario import load
    from simnav.source import record
    from simnav.warmup import warmup

    warmup(load=False)
    run = load(scenario)
    recording, limits, known = record(run, 0), Limits(_LIMIT, 2 << 30), dict[str, Any]()
    epochs = len(recording.data.truth.time)
    with tempfile.TemporaryDirectory() as folder:
        unit = Unit(run, 0, (), "", "", Path(folder), limits, scoring="{}")
        server = prepare("process", ())
        server.wait_until_ready()
        for line in sys.stdin:
            name = line.strip()
            if name not in known:
                known[name] = resolve(EstimatorRequest(name), "process", ())
            begin = time.process_time() + used(server.process_id)
            made = attempt(server, known[name], recording, limits)
            judged(unit, known[name], "", recording, made)
            spent = time.process_time() + used(server.process_id) - begin
            digest = (
                "" if made.trial is None else str(hash(made.trial.position.tobytes() + made.trial.velocity.tobytes()))
            )
            print(f"{1e6 * spent / epochs} {made.peak_memory / 2**20} {made.status}:{digest}", flush=True)
        close_server()


def compare(other: str, rows: list[str], rounds: int, scenario: str) -> None:
    """Print a line for each row, and the whole."""
    here = Path(__file__).resolve().parents[2]
    versions = [
        subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve()), "--serve", "--scenario", scenario], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"},
        )
        for folder in (Path(other).resolve(), here)
    ]  # fmt: skip
    totals = [0.0, 0.0]
    for name in rows:
        found: list[list[list[str]]] = [[], []]
        for k in range(rounds + 1):  # the first one loads the kernels of the row
            for v in (0, 1) if k % 2 else (1, 0):
                pipe = versions[v]
                assert pipe.stdin is not None
                assert pipe.stdout is not None
                print(name, file=pipe.stdin, flush=True)
                found[v].append(pipe.stdout.readline().split())
        least = [min(float(answer[0]) for answer in of_version[1:]) for of_version in found]
        memory = [float(of_version[-1][1]) for of_version in found]
        same = "the same bits" if found[0][-1][2] == found[1][-1][2] else "DIFFERENT numbers"
        totals = [total + each for total, each in zip(totals, least)]
        print(
            f"{name:22} {least[0]:7.1f} -> {least[1]:7.1f} us, {least[1] / least[0]:.2f} times, "
            f"{memory[0]:.1f} -> {memory[1]:.1f} MiB, {same}", flush=True,
        )  # fmt: skip
    minutes = [total / len(rows) * 1e-6 * EPOCHS * SEEDS * ROWS_OF_CAMPAIGN / CORES / 60.0 for total in totals]
    print(f"{SEEDS} seeds of {ROWS_OF_CAMPAIGN} such rows, {CORES} cores: {minutes[0]:.1f} -> {minutes[1]:.1f} min")
    for version in versions:
        version.communicate()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", nargs="?", help="folder of the other checkout")
    parser.add_argument("--rows", default=",".join(ROWS))
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--scenario", default="coastal-voyage")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve(given.scenario)
    elif given.other is None:
        parser.error("it needs the folder of another checkout")
    else:
        compare(given.other, given.rows.split(","), given.rounds, given.scenario)
