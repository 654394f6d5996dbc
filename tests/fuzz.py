"""Broken scenario files and logs: ``python -m tests.fuzz --tomls 10000 --logs 3000``.

Files that are well are cut, doubled, and filled with extreme values. Whatever is read, or refused with one sentence, is
well; any other exception is a traceback for a user, and is counted.
"""

from __future__ import annotations

import argparse
import math
import random
import re
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import simnav.scenarios
from simnav.leaderboard.results.errors import sentence
from simnav.log.delimited import read_csv
from simnav.log.nmea import read_nmea
from simnav.scenario import parse
from simnav.scenario.draws import Template, has_draws

__all__ = ["fuzz_draws", "fuzz_logs", "fuzz_tomls"]

_VALUES = [
    "0", "-1", "1e11", "1e308", "-1e308", "5e-324", "nan", "inf", "-inf", "9" * 5000, '""', '"x"', "true", "[]", "{}",
    "[1, 2]", "1979-05-27", "[" * 500 + "]" * 500, '"' + "y" * 10_000 + '"', "'\\u0000'", "é", "",
]  # fmt: skip
_NMEA = """2014-08-01T00:00:00.5Z $GPGGA,000000.25,2230.0000,S,01745.6000,W,1,06,1.3,033.6,M,-002.6,M,,
2014-08-01T00:00:00.6Z $GPVTG,210.0,T,,M,010.0,N,,K
2014-08-01T00:00:00.7Z $HEHDT,218.53,T
2014-08-01T00:00:00.8Z $PSXN,23,0.35,-1.74,218.26,0.58
2014-08-01T00:00:00.9Z $PUHAW,UVH,-5.0,0.0,270.0
2014-08-01T00:00:01.0Z $GPZDA,000001.00,01,08,2014,00,00
2014-08-01T00:00:01.1Z $VWVBW,10.0,1.0,A,9.5,0.5,A
"""
_CSV = "time,latitude,longitude,height\n" + "".join(f"{k}.5,50.{k},-5.{k},{k}.25\n" for k in range(12))


def _mutated(text: str, chance: random.Random, separator: str) -> str:
    """One to three changes."""
    for _ in range(chance.randint(1, 3)):
        lines = text.split("\n")
        k = chance.randrange(len(lines))
        kind = chance.randrange(6)
        if kind == 0:
            del lines[k]
        elif kind == 1:
            lines.insert(k, chance.choice(lines))
        elif kind == 2:
            lines[k] = lines[k][: chance.randrange(len(lines[k]) + 1)]
        elif kind == 3:
            parts = lines[k].split(separator)
            parts[chance.randrange(len(parts))] = f" {chance.choice(_VALUES)}"
            lines[k] = separator.join(parts)
        elif kind == 4:
            lines[k] = re.sub(r"-?\d[\d.]*", lambda _: chance.choice(_VALUES), lines[k], count=1)
        else:
            at = chance.randrange(len(lines[k]) + 1)
            lines[k] = lines[k][:at] + chr(chance.choice([0, 9, 34, 91, 123, 233, 0x2028, 0x1F600])) + lines[k][at:]
        text = "\n".join(lines)
    return text


def _count(number: int, seed: int, one: Callable[[random.Random], None]) -> Counter[str]:
    """How many ended how; a traceback is named by its innermost line."""
    found: Counter[str] = Counter()
    for k in range(number):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                one(random.Random(f"{seed}/{k}"))
            found["read"] += 1
        except Exception as error:
            ours = type(error).__module__.startswith("simnav")
            if ours and len(sentence(error)) <= 1000:
                found["refused"] += 1
            else:
                place = traceback.extract_tb(error.__traceback__)[-1]
                found[
                    f"traceback: {type(error).__name__} at {Path(place.filename).name}:{place.lineno} (case {k})"
                ] += 1
    return found


def fuzz_tomls(number: int, seed: int = 0) -> Counter[str]:
    """Scenario files of the catalogue, broken: ``read``, ``refused``, or a traceback."""
    texts = [p.read_text() for p in sorted(Path(simnav.scenarios.__path__[0]).glob("*.toml"))]

    def one(chance: random.Random) -> None:
        parse(_mutated(chance.choice(texts), chance, "="), source="fuzz.toml")

    return _count(number, seed, one)


#: Keys that mean something to a draw, and some that could be taken for a path.
_KEYS = [
    "uniform", "log_uniform", "normal", "integers", "choice", "weights", "present", "draw", "times", "plus", "cases",
    "a", "b", "a.b", "a[0]", "choice[0]", "", "speed_m_s",
]  # fmt: skip
_PLAIN = [0, 1, 2, 2.5, 7, True, False]
_NUMBERS = [*_PLAIN, -1, 1e308, -1e308, 5e-324, 10**30, -(10**30), 10**400, math.inf, math.nan, "a", "x"]


def _anything(chance: random.Random, depth: int) -> Any:
    """A value of a scenario file, with draws in places where nobody puts them."""
    kind = chance.randrange(9) if depth else chance.randrange(3)
    if kind < 3:
        return chance.choice(_NUMBERS if chance.random() < 0.1 else _PLAIN)
    if kind == 3:
        return [_anything(chance, depth - 1) for _ in range(chance.randrange(4))]
    if kind == 4:
        return {chance.choice(_KEYS): _anything(chance, depth - 1) for _ in range(chance.randrange(4))}
    more = {"present": _anything(chance, depth - 1)} if chance.random() < 0.1 else {}
    if kind == 5:
        ends = [1, 3] if chance.random() < 0.8 else [chance.choice(_NUMBERS), chance.choice(_NUMBERS)]
        return {chance.choice(_KEYS[:4]): ends, **more}
    if kind == 6:
        options = [_anything(chance, depth - 1) for _ in range(chance.randrange(1, 4))]
        weights = {"weights": [chance.choice(_NUMBERS) for _ in options]} if chance.random() < 0.1 else {}
        return {"choice": options, **weights, **more}
    if kind == 7:
        return {"draw": chance.choice(_KEYS[11:]), "cases": {
            chance.choice([*_KEYS, "true", "1"]): _anything(chance, depth - 1) for _ in range(chance.randrange(4))
        }}  # fmt: skip
    form: dict[str, Any] = {"draw": chance.choice(_KEYS[11:])}
    for key in ("times", "plus"):
        if chance.random() < 0.5:
            form[key] = _anything(chance, depth - 1)
    return form | more


def fuzz_draws(number: int, seed: int = 0) -> Counter[str]:
    """Tables of random draws, one within the other: each has values at the ends of all ranges and for a seed."""

    def one(chance: random.Random) -> None:
        keys = _KEYS if chance.random() < 0.1 else _KEYS[11:]
        table = {chance.choice(keys): _anything(chance, 3) for _ in range(chance.randint(1, 2))}
        if chance.random() < 0.8:
            table["draw"] = {name: _anything(chance, 2) for name in _KEYS[11:]}
        template = Template(table, "fuzz.toml")
        for drawn in (template.middle(), template.drawn(1)[0], *(table for table, _ in template.extremes())):
            if has_draws(drawn) or "absent" in repr(drawn):
                raise RuntimeError(f"{drawn!r} still has draws")

    return _count(number, seed, one)


def fuzz_logs(number: int, seed: int = 0) -> Counter[str]:
    """CSV and NMEA logs, broken."""
    with tempfile.TemporaryDirectory() as folder:

        def one(chance: random.Random) -> None:
            nmea = chance.random() < 0.5
            path = Path(folder) / f"{chance.random()}.{'log' if nmea else 'csv'}"
            path.write_text(_mutated(_NMEA if nmea else _CSV, chance, ","), errors="replace")
            try:
                (read_nmea if nmea else read_csv)(path)
            finally:
                path.unlink()

        return _count(number, seed, one)


def main() -> int:
    """Print the counts; 1 where there was a traceback."""
    arguments = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    arguments.add_argument("--tomls", type=int, default=10_000)
    arguments.add_argument("--draws", type=int, default=10_000)
    arguments.add_argument("--logs", type=int, default=3_000)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    found = {
        "TOMLs": fuzz_tomls(given.tomls, given.seed),
        "draws": fuzz_draws(given.draws, given.seed),
        "logs": fuzz_logs(given.logs, given.seed),
    }
    for what, counts in found.items():
        print(f"{what}: {counts['read']} read, {counts['refused']} refused")
        for name, count in counts.items():
            if name.startswith("traceback"):
                print(f"  {count} x {name}")
    return int(any(name.startswith("traceback") for counts in found.values() for name in counts))


if __name__ == "__main__":
    sys.exit(main())
