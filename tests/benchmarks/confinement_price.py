"""What it costs to run estimators in processes that never held a recording, side by side with one process.

::

    python tests/benchmarks/confinement_price.py [--rounds 2]

Twenty rows run over one recording in turn, each confined and then in this process; the numbers are compared to the bit.
What is counted is processor time, of this process, the server and the estimator processes, because that is what a
campaign has too little of, and because other work on the machine changes it least. As root the script runs before all
other work.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from simnav.estimator import make
from simnav.estimator.registry import discover_own
from simnav.leaderboard.campaign.confinement.attempt import attempt
from simnav.leaderboard.campaign.confinement.cores import own_core
from simnav.leaderboard.campaign.confinement.session import EstimatorServer, Limits
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial
from simnav.warmup import warmup

ROWS = (
    "dead-reckoning", "gnss-only", "ship-ekf", "ekf", "gated-ekf", "huber-kf", "iae", "vb-akf", "student-t", "ukf",
    "inekf", "ekf-rts", "sw-fgo", "huber-fgo", "gnc-fgo", "tukey-fgo", "ship-ukf", "ship-fgo", "ekf-23", "fading-ekf",
)  # fmt: skip
_TICK = os.sysconf("SC_CLK_TCK")


def used(process: int) -> float:
    """Processor time of a process and of its children that have ended [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / _TICK


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--scenario", default="harbour-multipath")
    parser.add_argument("--confinement", default="process", choices=["process", "bubblewrap"])
    parser.add_argument("--rows", default=",".join(ROWS))
    given = parser.parse_args()
    with contextlib.suppress(OSError, AttributeError):  # where it is allowed: before all other work on the machine
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    warmup()
    discover_own()
    recording = record(load(given.scenario), 0)
    server = EstimatorServer(given.confinement)
    server.wait_until_ready()
    child = server._process.pid
    if given.confinement == "bubblewrap":  # the server is the child of bwrap
        child = int(Path(f"/proc/{child}/task/{child}/children").read_text().split()[0])
    epochs = len(recording.data.truth)

    def timed(run: Callable[[], Any]) -> tuple[float, Any]:
        before = time.process_time() + used(child)
        value = run()
        return time.process_time() + used(child) - before, value

    total = {"confined": 0.0, "here": 0.0}
    print(f"{given.scenario}, {epochs} epochs; processor time, least of {given.rounds} rounds, {server.confinement}")
    for name in given.rows.split(","):
        least = {"confined": float("inf"), "here": float("inf")}
        for _ in range(given.rounds):
            entrant, limits = Entrant(name, {}, name, False, ""), Limits(600.0, 2 << 30)
            seconds, there = timed(lambda e=entrant, limit=limits: attempt(server, e, recording, limit))
            least["confined"] = min(least["confined"], seconds)
            with own_core():
                seconds, here = timed(lambda n=name: run_trial(make(n), recording))
            least["here"] = min(least["here"], seconds)
            assert there.trial is not None, there.reason
            assert there.trial.position.tobytes() == here.position.tobytes(), f"{name}: not the same bits"
        for way, seconds in least.items():
            total[way] += seconds
        price = least["confined"] / least["here"] - 1.0
        added = 1e6 * (least["confined"] - least["here"]) / epochs
        print(f"  {name:<16} {least['here']:7.3f} s here, {least['confined']:7.3f} s confined: {100 * price:+6.1f} %, "
              f"{added:+6.1f} us an epoch", flush=True)  # fmt: skip
    price = total["confined"] / total["here"] - 1.0
    print(f"all: {total['here']:.2f} s here, {total['confined']:.2f} s confined: {100.0 * price:+.1f} %")
    server.close()


if __name__ == "__main__":
    main()
