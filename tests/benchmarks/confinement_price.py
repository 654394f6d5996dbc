"""What it costs to run estimators in processes that never held a recording, side by side with running them without.

::

    python tests/benchmarks/confinement_price.py campaign [--seeds 2]
    python tests/benchmarks/confinement_price.py epochs [--rounds 2]

``campaign``: the same small campaign of twenty rows on scenarios of the profile ``quick``, scenario by scenario and
seed by seed, once confined and once with ``confinement="none"``, where an estimator runs in a fork of the worker. Both
record, run, score and store; the scores are compared to the bit.

``epochs``: twenty rows over one recording, each confined and then in this process without any fork; the estimates are
compared to the bit.

What is counted is processor time, of this process, the server and the estimator processes, because that is what a
campaign has too little of, and because other work on the machine changes it least; ``campaign`` shows the wall time,
too. Servers are started and kernels loaded before. As root ``epochs`` runs before all other work.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from simnav.estimator import make
from simnav.estimator.registry import discover_own
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.confinement.attempt import attempt, close_server, prepare
from simnav.leaderboard.campaign.confinement.cores import own_core
from simnav.leaderboard.campaign.confinement.session import EstimatorServer, Limits
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.results import store
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial
from simnav.warmup import warmup

ROWS = (
    "dead-reckoning", "gnss-only", "ship-ekf", "ekf", "gated-ekf", "huber-kf", "iae", "vb-akf", "student-t", "ukf",
    "inekf", "ekf-rts", "sw-fgo", "huber-fgo", "gnc-fgo", "tukey-fgo", "ship-ukf", "ship-fgo", "ekf-23", "fading-ekf",
)  # fmt: skip
SCENARIOS = ("harbour-multipath", "gnss-outage", "poor-heading", "auv-soft-mud")
_TICK = os.sysconf("SC_CLK_TCK")
_WARM = 1000  # seed of the runs that are not counted


def used(process: int) -> float:
    """Processor time of a process and of its children that have ended [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / _TICK


def process_of(server: EstimatorServer) -> int:
    """The server itself; in a sandbox it is the child of ``bwrap``."""
    started = server.process_id
    if server.confinement != "bubblewrap":
        return started
    return int(Path(f"/proc/{started}/task/{started}/children").read_text().split()[0])


def timed(run: Callable[[], Any], server: EstimatorServer) -> tuple[float, float, Any]:
    """Processor time and wall time of a call [s], and what it returned."""

    def now() -> float:
        return sum(os.times()[:4]) + used(process_of(server))

    before, begun = now(), time.perf_counter()
    value = run()
    return now() - before, time.perf_counter() - begun, value


def campaign(rows: list[str], scenarios: list[str], seeds: int, confinement: str, folder: Path) -> None:
    """Campaigns of one run each, in both ways in turn."""
    ways = {"none": folder / "none", confinement: folder / confinement}
    requests = [EstimatorRequest(name) for name in rows]

    def run(way: str, scenario: str, seed: int) -> None:
        run_campaign([load(scenario)], requests, [seed], ways[way], workers=1, confinement=way)

    for way in ways:
        run(way, scenarios[0], _WARM)
    server = prepare(confinement, [ways[confinement].resolve()])
    total = {way: [0.0, 0.0] for way in ways}
    print(f"{len(rows)} rows, {seeds} seeds; processor time (wall time) of campaigns, {server.confinement}")
    for scenario in scenarios:
        sums = {way: [0.0, 0.0] for way in ways}
        for seed in range(seeds):
            for way in list(ways)[:: 1 if seed % 2 else -1]:
                seconds, wall, _ = timed(lambda w=way, n=scenario, s=seed: run(w, n, s), server)
                for kept in (sums[way], total[way]):
                    kept[0] += seconds
                    kept[1] += wall
        _tell(scenario, *sums.values())
    _tell("all", *total.values())
    kept = [{(r.scenario, r.seed, r.estimator): _numbers(r) for r in store.load(path)} for path in ways.values()]
    assert kept[0] == kept[1], "not the same bits"
    close_server()


def _numbers(result: Any) -> dict[str, str]:
    """The scores of a result, but for times and memory."""
    return {name: float(v).hex() for name, v in result.scores.items() if "second" not in name and "update" not in name}


def _tell(what: str, without: list[float], confined: list[float]) -> None:
    price, wall = (100.0 * (c / w - 1.0) for c, w in zip(confined, without, strict=True))
    times = [f"{seconds:7.2f} s ({passed:7.2f} s)" for seconds, passed in (without, confined)]
    print(f"  {what:<18} {times[0]} without, {times[1]} confined: {price:+5.1f} % ({wall:+5.1f} %)", flush=True)


def epochs(rows: list[str], scenario: str, rounds: int, confinement: str) -> None:
    """Rows over one recording, the least time of some rounds."""
    recording = record(load(scenario), 0)
    server = EstimatorServer(confinement)
    server.wait_until_ready()
    steps = len(recording.data.truth)
    total = {"confined": 0.0, "here": 0.0}
    print(f"{scenario}, {steps} epochs; processor time, least of {rounds} rounds, {server.confinement}")
    for name in rows:
        least = {"confined": float("inf"), "here": float("inf")}
        for _ in range(rounds):
            entrant, limits = Entrant(name, {}, name, False, ""), Limits(600.0, 2 << 30)
            seconds, _, there = timed(lambda e=entrant, limit=limits: attempt(server, e, recording, limit), server)
            least["confined"] = min(least["confined"], seconds)
            with own_core():
                seconds, _, here = timed(lambda n=name: run_trial(make(n), recording), server)
            least["here"] = min(least["here"], seconds)
            assert there.trial is not None, there.reason
            assert there.trial.position.tobytes() == here.position.tobytes(), f"{name}: not the same bits"
        for way, seconds in least.items():
            total[way] += seconds
        price = least["confined"] / least["here"] - 1.0
        added = 1e6 * (least["confined"] - least["here"]) / steps
        print(f"  {name:<16} {least['here']:7.3f} s here, {least['confined']:7.3f} s confined: {100 * price:+6.1f} %, "
              f"{added:+6.1f} us an epoch", flush=True)  # fmt: skip
    price = total["confined"] / total["here"] - 1.0
    added = 1e6 * (total["confined"] - total["here"]) / steps / len(rows)
    print(f"all: {total['here']:.2f} s here, {total['confined']:.2f} s confined: {100.0 * price:+.1f} %, "
          f"{added:+.1f} us an epoch")  # fmt: skip
    server.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["campaign", "epochs"])
    parser.add_argument("--seeds", type=int, default=2, help="of each scenario, for campaign")
    parser.add_argument("--rounds", type=int, default=2, help="for epochs")
    parser.add_argument("--scenarios", default="", help="names with commas; for epochs one (harbour-multipath)")
    parser.add_argument("--confinement", default="process", choices=["process", "bubblewrap"])
    parser.add_argument("--rows", default=",".join(ROWS))
    given = parser.parse_args()
    warmup()
    discover_own()
    rows = given.rows.split(",")
    if given.what == "epochs":
        with contextlib.suppress(OSError, AttributeError):  # where it is allowed: before all other work on the machine
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        epochs(rows, given.scenarios or "harbour-multipath", given.rounds, given.confinement)
        return
    with tempfile.TemporaryDirectory() as folder:
        chosen = given.scenarios.split(",") if given.scenarios else list(SCENARIOS)
        campaign(rows, chosen, given.seeds, given.confinement, Path(folder))


if __name__ == "__main__":
    main()
