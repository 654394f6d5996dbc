"""The table of the audit: ``python -m tests.audit``; one function a line, ``--lines`` chooses.

The lines: cheats that gained, vandals that touched others, SIGKILLs after which the table differs, broken scenario
files and logs that gave a traceback, and boards of equal rows that were separated.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from simnav.leaderboard.results import store
from tests.audit.statistics import coverages, null_boards
from tests.fuzz import fuzz_logs, fuzz_tomls
from tests.hostile.attacks import CHEATS, cheats, plain, vandals

__all__ = ["LINES"]

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


def cheats_line(count: int) -> str:
    """Cheats tried, and cheats that gained."""
    with tempfile.TemporaryDirectory() as folder:
        gained = cheats(Path(folder))
    return f"cheats: {len(CHEATS)} tried, {len(gained)} gained {gained or ''}"


def vandals_line(count: int) -> str:
    """Hostile rows tried, and rows that touched others."""
    with tempfile.TemporaryDirectory() as folder:
        harm = vandals(Path(folder))
    return f"hostile rows: {harm.tried} tried, {len(harm.touched)} touched {harm.touched or ''} {harm.unnamed or ''}"


def kills_line(count: int) -> str:
    """SIGKILLs of a campaign at random moments, and tables that differ from that of a campaign at peace."""
    with tempfile.TemporaryDirectory() as name:
        folder, chance, differ, killed = Path(name), random.Random(0), 0, 0
        script = folder / "campaign.py"
        script.write_text(_CAMPAIGN)

        def start(results: Path) -> subprocess.Popen[bytes]:
            command = [sys.executable, str(script), str(_SCENARIO), str(results), "6"]
            return subprocess.Popen(
                command, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )

        def table(results: Path) -> list[object]:
            return [(r.estimator, r.seed, *plain(r)) for r in store.load(results)]

        begun = time.monotonic()
        assert start(folder / "peace").wait() == 0
        whole, number = time.monotonic() - begun, 0
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
    return f"SIGKILLs: {killed} in {number} campaigns, {differ} tables differ"


def fuzz_line(count: int) -> str:
    """Broken TOMLs and logs, and tracebacks."""
    number = 100 * count
    bad = {w: sum(n for k, n in f(number).items() if k.startswith("traceback")) for w, f in
           (("TOMLs", fuzz_tomls), ("logs", fuzz_logs))}  # fmt: skip
    return f"fuzz: {number} TOMLs and {number} logs, {bad['TOMLs']} and {bad['logs']} tracebacks"


def statistics_line(count: int) -> str:
    """Boards of equal rows that were separated, and the coverage of the intervals."""
    boards = 10 * count
    return f"statistics: separated null boards {null_boards(boards)}, coverage {coverages(boards)}"


LINES: dict[str, Callable[[int], str]] = {
    "cheats": cheats_line,
    "vandals": vandals_line,
    "kills": kills_line,
    "fuzz": fuzz_line,
    "statistics": statistics_line,
}


def main() -> None:
    """Print the lines that were asked for."""
    arguments = argparse.ArgumentParser(prog="python -m tests.audit", description=__doc__)
    arguments.add_argument("--lines", default=",".join(LINES), help="of these, separated by commas")
    arguments.add_argument(
        "--count", type=int, default=100, help="SIGKILLs; a hundredth of the files, a tenth of boards"
    )
    given = arguments.parse_args()
    for name in given.lines.split(","):
        print(LINES[name](given.count), flush=True)


if __name__ == "__main__":
    main()
