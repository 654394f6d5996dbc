"""Compile every kernel in advance, so that no run has to wait for the compiler."""

from __future__ import annotations

import contextlib
import gc
import importlib.util
import multiprocessing
import os
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

from simnav.compiled import Kernel, announced, kernels, prune
from simnav.plugins import entry_points

__all__ = ["warmup"]

#: Called with the number of compiled kernels, the number of all kernels, and the name of the last compiled one.
Callback = Callable[[int, int, str], None]

_WORTH_A_PROCESS = 4  # fewer kernels than this are compiled in this process


def warmup(
    progress: Callback | None = None, *, load: bool = True, processes: int | None = None, everything: bool = True
) -> None:
    """Compile all kernels of simnav, of the estimators and of installed plug-ins that are not in the cache.

    Parameters
    ----------
    progress : callable, optional
        Called as ``progress(done, total, name)`` after each kernel.
    load : bool
        True: also load the kernels into this process.
    processes : int, optional
        Number of processes that compile at the same time; by default the number of cores, at most 4.
    everything : bool
        False: only the kernels of modules that this process has imported, as a campaign has when its rows are known.
    """
    with announced(lambda: None):  # the progress says it
        if everything:
            _import_all()
        _warm_up(progress or (lambda done, total, name: None), load, processes)


def _warm_up(report: Callback, load: bool, processes: int | None) -> None:
    every = kernels()
    missing = [k for k in every if not k.cached()]
    done = len(every) - len(missing)
    report(done, len(every), "")
    if len(missing) >= _WORTH_A_PROCESS:
        for name in _compile_beside(missing, processes or min(4, _cores())):
            done += 1
            report(done, len(every), name)
        prune()
    for kernel in every if load else missing:
        kernel.compile()  # loads it from the cache; compiles it here if there is no cache
        if kernel in missing and done < len(every):
            done += 1
            report(done, len(every), _name(kernel))


def _name(kernel: Kernel[..., Any]) -> str:
    return f"{kernel.__module__}.{kernel.__name__}"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _import_all() -> None:
    """Import every module of simnav that holds kernels, and the modules of plug-ins."""
    for package in ("simnav", "simnav.estimators"):  # the second is a link in a checkout: rglob does not follow it
        spec = importlib.util.find_spec(package)
        for folder in [] if spec is None else spec.submodule_search_locations or []:
            for path in sorted(Path(folder).rglob("*.py")):
                if b"simnav.compiled" in path.read_bytes():
                    parts = path.relative_to(folder).with_suffix("").parts
                    _try_import(".".join([package, *(p for p in parts if p != "__init__")]))
    for group in ("simnav.estimators", "simnav.instruments", "simnav.faults"):
        for point in entry_points(group):
            _try_import(point.module)


def _try_import(name: str) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            importlib.import_module(name)
    except (Exception, SystemExit) as error:
        warnings.warn(f"{name} cannot be imported, so its kernels are not compiled ahead: {error}", stacklevel=3)


def _compile_beside(missing: list[Kernel[..., Any]], processes: int) -> Iterator[str]:
    """Compile kernels in several forked processes, which store them in the cache; yield their names.

    If processes cannot be forked, or one of them dies, the caller has to compile the remaining kernels.
    """
    if processes < 2 or "fork" not in multiprocessing.get_all_start_methods():
        return
    context = multiprocessing.get_context("fork")
    _todo[:] = missing
    calls = [{k for k in kernel.tree() if k is not kernel and k in missing} for kernel in missing]
    sizes = [_size({*kernel.tree()}.difference(*(k.tree() for k in called))) for kernel, called in zip(missing, calls)]
    # The longest first, so that no process works alone at the end.
    waiting = sorted(range(len(missing)), key=sizes.__getitem__, reverse=True)
    done: set[Kernel[..., Any]] = set()
    running: dict[Future[str], int] = {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # fork beside threads
            with (
                ProcessPoolExecutor(processes, mp_context=context, initializer=_collect_seldom) as pool,
                contextlib.suppress(BrokenExecutor),
            ):
                while waiting or running:
                    # A kernel after those that it calls, which are then in the cache.
                    for i in [i for i in waiting if calls[i] <= done][: processes - len(running)]:
                        waiting.remove(i)
                        running[pool.submit(_compile, i)] = i
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        done.add(missing[running.pop(future)])
                        with contextlib.suppress(Exception):
                            yield future.result()
    finally:
        _todo.clear()


_todo: list[Kernel[..., Any]] = []


def _size(parts: Iterable[Kernel[..., Any]]) -> int:
    """The size of the code of kernels, as a measure of their compile time."""
    return sum(len(k.function.__code__.co_code) for k in parts)


def _collect_seldom() -> None:
    """Python looks seldom for unused cycles of objects, and not in what was imported.

    The compiler makes very many objects, and by default Python looks so often that a seventh of the time is lost. To
    look never would take gigabytes.
    """
    gc.freeze()
    gc.set_threshold(100_000, 5, 5)


def _compile(index: int) -> str:
    _todo[index].compile()
    return _name(_todo[index])
