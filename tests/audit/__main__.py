"""Measure what the benchmark promises, and print one table: ``python -m tests.audit [SECTION ...]``, or ``make audit``.

A section is a module of this folder. Its function ``parts()`` gives what is measured, by name: each part takes a few
minutes at most and gives JSON. Its function ``rows(found)`` makes of these (what, figure, promised, kept); a section
without ``parts()`` is one part, and its ``rows()`` measures. With ``--folder`` each part is a file there, and one that
is there is not measured again. ``--minutes`` ends the command early, so that a long audit can be made in pieces.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol, cast

Row = tuple[str, str, str, bool]


class Section(Protocol):
    """A module of this folder that measures something."""

    def parts(self) -> Mapping[str, Callable[[], Any]]: ...

    def rows(self, found: Mapping[str, Any]) -> Iterator[Row]: ...


def sections() -> dict[str, Section]:
    """The modules of this folder that measure something."""
    found = sorted(p.stem for p in Path(__file__).parent.glob("*.py") if not p.stem.startswith("_"))
    modules = {name: importlib.import_module(f"tests.audit.{name}") for name in found}
    return {
        name: cast(Section, module if hasattr(module, "parts") else _Whole(module))
        for name, module in modules.items()
        if hasattr(module, "rows")
    }


class _Whole:
    """A section of one part."""

    def __init__(self, module: Any):
        self._module = module

    def parts(self) -> Mapping[str, Callable[[], Any]]:
        return {"all": lambda: list(self._module.rows())}

    def rows(self, found: Mapping[str, Any]) -> Iterator[Row]:
        for row in found["all"]:
            yield tuple(row)


def measured(name: str, section: Section, folder: Path | None, deadline: float) -> dict[str, Any]:
    """The parts of a section that are there or could be measured until the deadline."""
    found = {}
    for part, measure in section.parts().items():
        file = None if folder is None else folder / f"{name}.{part}.json"
        if file is not None and file.exists():
            found[part] = json.loads(file.read_bytes())
        elif time.monotonic() < deadline:
            started = time.monotonic()
            found[part] = json.loads(json.dumps(measure()))
            print(f"  {part}: {time.monotonic() - started:.0f} s", file=sys.stderr, flush=True)
            if file is not None:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(json.dumps(found[part]))
    return found


def main() -> int:
    """Print the table; 1 where a promise is not kept, 3 where parts are missing."""
    known = sections()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("section", nargs="*", help="what is measured; default: all")
    parser.add_argument("--folder", type=Path, help="keep what was measured here, and go on from it")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no part after this time")
    given = parser.parse_args()
    broken = missing = 0
    deadline = time.monotonic() + 60.0 * given.minutes
    for name in given.section or known:
        print(f"\n{name}", flush=True)
        found = measured(name, known[name], given.folder, deadline)
        left = len(known[name].parts()) - len(found)
        missing += left
        if left:
            print(f"  {left} parts are still to be measured; run the command again")
            continue
        for what, figure, promised, kept in known[name].rows(found):
            broken += not kept
            print(f"  {what:<62} {figure:<26} {promised:<26} {'' if kept else 'NOT KEPT'}", flush=True)
    return 3 if missing else min(broken, 1)


if __name__ == "__main__":
    sys.exit(main())
