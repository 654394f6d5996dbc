"""Golden numbers: ``python -m tests.golden compare`` says what has changed, ``record`` keeps the numbers of today.

``record`` refuses numbers that have changed without a new version of the row, the scenario, the simulator or the
benchmark. With ``--bits FILE`` both work on a file of their own with digests of all bits, to compare two commits on one
machine (`tests.golden.bits`).
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import tests.conftest  # noqa: F401 (it finds the logs beside the project)
from simnav.scenario import load, names
from tests.golden import bits
from tests.golden.cases import CASES
from tests.golden.fingerprints import FILE, in_case, in_scenarios, of_case, of_scenario, read, versions


def _case(name: str) -> dict[str, Any]:
    warnings.simplefilter("ignore")
    return of_case(CASES[name])


def _scenario(name: str) -> dict[str, Any] | None:
    warnings.simplefilter("ignore")
    return of_scenario(name)


def main() -> int:
    """The command; 1 where a new version is asked for, or something differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("--bits", type=Path, metavar="FILE", help="compare all bits with those in this file")
    parser.add_argument("--scenario", "-s", action="append", help="with --bits: one of the catalogue; default: all")
    parser.add_argument("--workers", "-j", type=int, default=1)
    given = parser.parse_args()
    if given.bits is not None:
        return bits.run(given.what, given.bits, given.scenario or names(), given.workers)
    stored = read() if FILE.exists() else {"scenarios": {}, "cases": {}, "versions": versions()}
    now = versions()
    with Pool(given.workers) as pool:
        cases = dict(zip(CASES, pool.map(_case, CASES, chunksize=1)))
        recordings = dict(zip(names(), pool.map(_scenario, names(), chunksize=4)))
    scenarios = {load(name).id: entry for name, entry in recordings.items() if entry is not None}
    asked = in_scenarios(stored, scenarios, now)
    for name, found in cases.items():
        asked += in_case(stored, name, found, now)
    if given.what == "compare" or asked.versions:
        print(asked or "all numbers are the stored ones")
        return bool(asked)
    here = {load(name).id for name, entry in recordings.items() if entry is None}  # its files are elsewhere
    kept = {name: entry for name, entry in stored["scenarios"].items() if name in here}
    content = {"versions": now, "scenarios": dict(sorted({**kept, **scenarios}.items())), "cases": cases}
    FILE.write_text(_text(content) + "\n", encoding="utf-8")
    print(f"{len(scenarios)} scenarios and {len(cases)} cases recorded")
    return 0


def _text(value: Any, depth: int = 0) -> str:
    """JSON with a line for each row and each stream, so that a change of one is a change of one line."""
    if not isinstance(value, dict) or not any(isinstance(each, (dict, list)) for each in value.values()):
        return json.dumps(value)
    inner = (f"{' ' * (depth + 1)}{json.dumps(key)}: {_text(each, depth + 1)}" for key, each in value.items())
    return "{\n" + ",\n".join(inner) + "\n" + " " * depth + "}"


if __name__ == "__main__":
    sys.exit(main())
