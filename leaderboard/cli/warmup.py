"""``simnav warmup``: every kernel compiled ahead of its first use."""

from __future__ import annotations

import time

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json

__all__ = ["command"]


def command(json: Json = False, debug: Debug = False) -> None:
    """Compile every kernel, once; later starts are quick."""
    with session(json, debug) as out:
        from simnav.compiled import kernels
        from simnav.warmup import warmup

        started = time.perf_counter()
        with out.progress("compiling kernels") as progress:
            warmup(progress)
        seconds, count = time.perf_counter() - started, len(kernels())
        out.document({"kernels": count, "seconds": seconds})
        out.print(f"{count} kernels ready in {seconds:.1f} s")
