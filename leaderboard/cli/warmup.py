"""``simnav warmup``: every kernel compiled ahead of its first use."""

from __future__ import annotations

import time

from simnav.compiled import kernels
from simnav.warmup import warmup

from .commands import WarmupCommand
from .console import Output

__all__ = ["show"]


def show(out: Output, request: WarmupCommand) -> None:
    """Compile every kernel, once; later starts are quick."""
    started = time.perf_counter()
    with out.progress("compiling kernels") as progress:
        warmup(progress)
    seconds, count = time.perf_counter() - started, len(kernels())
    out.document({"kernels": count, "seconds": seconds})
    out.print(f"{count} kernels ready in {seconds:.1f} s")
