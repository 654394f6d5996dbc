"""What keeps estimators from the truth and from each other: cheats, vandals, SIGKILLs, broken files."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from simnav.leaderboard.results import store
from tests.fuzz import fuzz_logs, fuzz_tomls
from tests.hostile.attacks import CHEATS, cheats, plain, vandals

__all__ = ["kills", "rows"]

KILLS, TOMLS, LOGS = 100, 10_000, 3_000

_CAMPAIGN = """
import sys
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.scenario import load
if __name__ == "__main__":
    scenario = load(sys.argv[1])
    requests = [EstimatorRequest(name) for name in ("gnss-only", "oracle")]
    run_campaign([scenario], requests, range(int(sys.argv[3])), sys.argv[2])
"""
_SCENARIO = Path(__file__).parents[1] / "hostile" / "cheats" / "scenario.toml"


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """What, figure, promised, kept."""
    with tempfile.TemporaryDirectory() as folder:
        gained = cheats(Path(folder))
    yield "cheats that gained", f"{len(gained)} of {len(CHEATS)}", "0", not gained
    with tempfile.TemporaryDirectory() as folder:
        harm = vandals(Path(folder))
    yield "hostile rows that touched others", f"{len(harm.touched)} by {harm.tried}", "0", not harm.touched
    yield "hostile rows without a status of their own", f"{len(harm.unnamed)} of {harm.tried}", "0", not harm.unnamed
    number, differ = kills(KILLS)
    yield "tables that differ after SIGKILLs", f"{differ} of {number}, {KILLS} kills", "0", not differ
    for what, found, count in (("TOMLs", fuzz_tomls(TOMLS), TOMLS), ("logs", fuzz_logs(LOGS), LOGS)):
        bad = sum(n for name, n in found.items() if name.startswith("traceback"))
        yield f"broken {what} that give a traceback", f"{bad} of {count}", "0", not bad


def kills(count: int) -> tuple[int, int]:
    """Kill campaigns at random moments, and start them again until they end.

    Parameters
    ----------
    count : int
        SIGKILLs.

    Returns
    -------
    campaigns, differ : int
        How many campaigns were killed, once or more, and how many tables differ from that of one that was not.
    """
    with tempfile.TemporaryDirectory() as name:
        folder, chance, differ, killed, number = Path(name), random.Random(0), 0, 0, 0
        script = folder / "campaign.py"
        script.write_text(_CAMPAIGN)

        def start(results: Path) -> subprocess.Popen[bytes]:
            command = [sys.executable, str(script), str(_SCENARIO), str(results), "6"]
            quiet = subprocess.DEVNULL
            return subprocess.Popen(command, start_new_session=True, stdout=quiet, stderr=quiet)

        def table(results: Path) -> list[object]:
            return [(r.estimator, r.seed, *plain(r)) for r in store.load(results)]

        begun = time.monotonic()
        assert start(folder / "peace").wait() == 0
        whole = time.monotonic() - begun
        while killed < count:
            number += 1
            results = folder / f"war-{number}"
            for _ in range(chance.randint(1, 4)):
                process = start(results)
                time.sleep(chance.uniform(0.3, 1.0) * whole)
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
                    killed += 1
                process.wait()
            differ += start(results).wait() != 0 or table(results) != table(folder / "peace")
    return number, differ
