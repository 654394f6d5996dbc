"""How long the compiler needs for the kernels, each without the kernels that it calls.

    python -m tests.benchmarks.compiling             # processor time of all kernels, and the longest
    python -m tests.benchmarks.compiling --copies    # with a copy of each kernel in its callers, as by Numba alone

It compiles into an empty cache of its own, in one process.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from simnav import compiled, kernel_files, warmup


def measure(folder: str) -> dict[str, float]:
    """Processor time of each kernel [s], by its name."""
    os.environ["SIMNAV_CACHE_DIR"] = folder
    warmup._import_all()
    inside, found = [0.0], dict[str, float]()
    jit = compiled.Kernel._jit

    def timed(self: compiled.Kernel[..., Any], directory: str | None) -> Any:
        inside.append(0.0)
        begun = time.process_time()
        done = jit(self, directory)
        took = time.process_time() - begun
        found[f"{self.__module__}.{self.__qualname__}"] = took - inside.pop()
        inside[-1] += took
        return done

    compiled.Kernel._jit = timed  # type: ignore[method-assign]
    for kernel in compiled.kernels():
        kernel.compile()
    return found


def main() -> None:
    """The command of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--copies", action="store_true", help="a kernel holds the kernels that it calls")
    if parser.parse_args().copies:
        kernel_files.call_by_symbol = lambda dispatcher, symbol: None
    with tempfile.TemporaryDirectory() as folder:
        found = measure(folder)
        size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
    print(f"{len(compiled.kernels())} kernels, {sum(found.values()):.0f} s, {size / 1e6:.0f} MB")
    for name, took in sorted(found.items(), key=lambda item: -item[1])[:15]:
        print(f"{took:6.2f} s  {name}")


if __name__ == "__main__":
    main()
