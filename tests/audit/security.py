"""What keeps estimators from the truth and from each other: cheats, vandals, channels, answers, SIGKILLs, files."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.confinement import bubblewrap
from simnav.leaderboard.results import store
from tests.fuzz import fuzz_draws, fuzz_logs, fuzz_tomls
from tests.hostile.answers import fuzz_answers
from tests.hostile.attacks import CHEATS, Harm, cheats, plain, vandals
from tests.hostile.channels import told
from tests.hostile.meetings import seen

__all__ = ["kills", "parts", "rows"]

KILLS, TOMLS, DRAWS, LOGS, ANSWERS = 100, 10_000, 20_000, 3_000, 4_000
_KILLS, _TOMLS, _DRAWS, _LOGS, _ANSWERS = 10, 10, 2, 3, 10  # parts of each

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


def parts() -> dict[str, Callable[[], Any]]:
    """What is measured, by name."""
    found: dict[str, Callable[[], Any]] = {}
    for kind in confinements():
        found[f"cheats-{kind}"] = partial(_in_folder, partial(cheats, confinement=kind))
        found[f"channels-{kind}"] = partial(_in_folder, lambda folder, kind=kind: sorted(told(folder, kind)))
        found[f"meetings-{kind}"] = partial(_in_folder, lambda folder, kind=kind: sorted(seen(folder, kind)))
        found[f"vandals-{kind}"] = partial(_in_folder, lambda folder, kind=kind: asdict(vandals(folder, kind)))
    found |= {f"kills-{k}": partial(kills, KILLS // _KILLS, k) for k in range(_KILLS)}
    found |= {f"tomls-{k}": partial(_tracebacks, fuzz_tomls, TOMLS // _TOMLS, k) for k in range(_TOMLS)}
    found |= {f"draws-{k}": partial(_tracebacks, fuzz_draws, DRAWS // _DRAWS, k) for k in range(_DRAWS)}
    found |= {f"logs-{k}": partial(_tracebacks, fuzz_logs, LOGS // _LOGS, k) for k in range(_LOGS)}
    found |= {f"answers-{k}": partial(_raised, ANSWERS // _ANSWERS, k) for k in range(_ANSWERS)}
    return found


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What, figure, promised, kept."""
    for kind in confinements():
        gained, harm = found[f"cheats-{kind}"], Harm(**found[f"vandals-{kind}"])
        yield f"cheats that gained ({kind})", f"{len(gained)} of {len(CHEATS)}", "0", not gained
        yield (
            f"hostile rows that touched others ({kind})",
            f"{len(harm.touched)} by {harm.tried}",
            "0",
            not harm.touched,
        )
        what = f"hostile rows without a status of their own ({kind})"
        yield what, f"{len(harm.unnamed)} of {harm.tried}", "0", not harm.unnamed
        passed = found[f"channels-{kind}"]
        yield f"marks that a row of a sealed run finds of another ({kind})", f"{len(passed)}", "0", not passed
        passed = found[f"meetings-{kind}"]
        yield f"signs that a row sees of one that runs beside it ({kind})", f"{len(passed)}", "0", not passed
    wars = [found[f"kills-{k}"] for k in range(_KILLS)]
    killed, campaigns, differ = (sum(column) for column in zip(*wars, strict=True))
    yield f"campaigns with other results after {killed} SIGKILLs", f"{differ} of {campaigns}", "0", not differ
    raised = sum(len(found[f"answers-{k}"]) for k in range(_ANSWERS))
    yield "runs with random answers that end a campaign", f"{raised} of {ANSWERS}", "0", not raised
    for what, count, blocks in (("tomls", TOMLS, _TOMLS), ("draws", DRAWS, _DRAWS), ("logs", LOGS, _LOGS)):
        bad = sum(len(found[f"{what}-{k}"]) for k in range(blocks))
        name = {"tomls": "TOMLs", "draws": "tables of draws"}.get(what, what)
        yield f"broken {name} that give a traceback", f"{bad} of {count}", "0", not bad


def confinements() -> list[str]:
    """Those that work here."""
    return ["process"] if bubblewrap.available() else ["process", "bubblewrap"]


def _in_folder(measure: Callable[[Path], Any]) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        return measure(Path(folder))


def _tracebacks(fuzz: Callable[[int, int], Mapping[str, int]], number: int, seed: int) -> list[str]:
    return [name for name in fuzz(number, seed) if name.startswith("traceback")]


def _raised(number: int, seed: int) -> list[str]:
    return [what for what in fuzz_answers(number, seed) if what.startswith("raised")]


def kills(count: int, seed: int = 0) -> tuple[int, int, int]:
    """Kill campaigns at random moments, and start them again until they end.

    Parameters
    ----------
    count : int
        SIGKILLs, at least.
    seed : int
        Of the moments.

    Returns
    -------
    killed, campaigns, differ : int
        How many SIGKILLs there were, in how many campaigns, and how many tables differ from that of one that was not
        killed.
    """
    with tempfile.TemporaryDirectory() as name:
        folder, chance, differ, killed, number = Path(name), random.Random(seed), 0, 0, 0
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
    return killed, number, differ
