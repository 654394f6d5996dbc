"""Measure what the benchmark promises, and print one table: ``python -m tests.audit [SECTION ...]``, or ``make audit``.

A section is a module of this folder with a function ``rows()`` that yields (what, figure, promised, kept). Without
arguments all sections are run.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from pathlib import Path


def sections() -> list[str]:
    """The modules of this folder that measure something."""
    found = sorted(p.stem for p in Path(__file__).parent.glob("*.py") if not p.stem.startswith("_"))
    return [name for name in found if hasattr(importlib.import_module(f"tests.audit.{name}"), "rows")]


def main() -> int:
    """Print the table; 1 where a promise is not kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("section", nargs="*", help=f"what is measured: {', '.join(sections())}; default: all")
    broken = 0
    for name in parser.parse_args().section or sections():
        started = time.monotonic()
        print(f"\n{name}", flush=True)
        for what, figure, promised, kept in importlib.import_module(f"tests.audit.{name}").rows():
            broken += not kept
            print(f"  {what:<52} {figure:<26} {promised:<26} {'' if kept else 'NOT KEPT'}", flush=True)
        print(f"  ({time.monotonic() - started:.0f} s)")
    return min(broken, 1)


if __name__ == "__main__":
    sys.exit(main())
