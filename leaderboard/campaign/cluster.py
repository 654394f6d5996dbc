"""Units of a campaign on a Dask cluster: they travel to the workers, and the files of their results travel back.

The workers need simnav, the estimators' packages, and no disk in common with the campaign. A worker that dies is
replaced by Dask, and its unit is run again by another one. A worker should have one thread (``--nthreads 1``) and as
many processes as the machine has cores: each estimator runs in a process that the worker forks.
"""

from __future__ import annotations

import atexit
import importlib
import shutil
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from simnav.leaderboard.results import store
from simnav.leaderboard.results.scratch import scratch

from .fingerprint import simulator_version
from .worker import Unit, run_unit

__all__ = ["ClusterError", "run_on_cluster"]

#: For a first worker [s].
WAIT = 60.0

_AHEAD = 3  # units a thread of the cluster that are sent before the first one is back
_RETRIES = 3  # of a unit whose worker died


class ClusterError(RuntimeError):
    """The cluster was lost, or cannot be used; the message is one sentence."""


_one_at_a_time = threading.Lock()  # a worker with several threads has one folder


@lru_cache(maxsize=1)
def _simulator() -> str:
    return simulator_version()


def _run_remotely(index: int, unit: Unit) -> tuple[int, Counter[str], dict[str, bytes]]:
    """On a worker: run a unit in a folder of its own, and return the files of its results."""
    if _simulator() != unit.simulator:
        raise ClusterError(
            f"a worker of the cluster has simnav {_simulator()}, and the campaign {unit.simulator}: install the same"
        )
    with _one_at_a_time:
        folder = _workspace()
        try:
            _, statuses = run_unit(index, replace(unit, folder=folder))
            files = [p for p in folder.rglob("*") if p.is_file() and p.parent != folder]
            return index, statuses, {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}
        finally:
            for part in store.FILES:
                shutil.rmtree(folder / part, ignore_errors=True)
            store.create(folder)


@lru_cache(maxsize=1)
def _workspace() -> Path:
    """Folder of this worker's results: one for all units, because its estimators' processes are made for one."""
    stack = ExitStack()
    home = stack.enter_context(scratch("worker"))
    atexit.register(stack.close)
    return store.create(home / "results")


def _keep(folder: Path, files: Mapping[str, bytes]) -> None:
    """Put the files of a unit where they belong, results last: a result that is there is complete."""
    for name, content in sorted(files.items(), key=lambda item: item[0].startswith("results/")):
        target = folder / name
        target.parent.mkdir(exist_ok=True)
        with store.atomic(target) as file:
            file.write(content)


def run_on_cluster(
    units: Iterator[tuple[int, Unit]], scheduler: str | None, workers: int
) -> Iterator[tuple[int, Counter[str]]]:
    """Run units on a Dask cluster, and yield the outcome of each when it ends; its results are then on disk.

    Parameters
    ----------
    units : iterator of (int, Unit)
        They are made when the cluster has room for them.
    scheduler : str or None
        Address; None starts a cluster of processes on this machine.
    workers : int
        Number of workers of a cluster on this machine.

    Raises
    ------
    ClusterError
        If no worker comes, the scheduler is lost, workers die again and again over one unit, or have another simnav.
    """
    distributed: Any = importlib.import_module("distributed")  # an extra: there or not
    killed: Any = importlib.import_module("distributed.scheduler").KilledWorker
    lost: Any = (importlib.import_module("distributed.comm").CommClosedError, OSError)
    cancelled: Any = importlib.import_module("distributed.client").FutureCancelledError
    options = {"address": scheduler} if scheduler else {"n_workers": workers, "threads_per_worker": 1}
    with ExitStack() as stack:
        try:
            client = stack.enter_context(distributed.Client(**options, timeout=WAIT, set_as_default=False))
            client.wait_for_workers(1, timeout=WAIT)
        except lost as error:
            raise ClusterError(f"the Dask scheduler {scheduler or 'here'} cannot be used: {error}") from error
        folders: dict[int, Path] = {}
        running = distributed.as_completed(loop=client.loop)

        def send(count: int) -> None:
            for _, (index, unit) in zip(range(count), units, strict=False):
                folders[index] = unit.folder
                running.add(client.submit(_run_remotely, index, unit, pure=False, retries=_RETRIES))

        send(_AHEAD * max(1, sum(client.nthreads().values())))
        try:
            for future in running:
                index, statuses, files = future.result()
                _keep(folders.pop(index), files)
                future.release()
                send(1)
                yield index, statuses
        except killed as error:
            raise ClusterError(
                "workers of the cluster died again and again over one run, as they do without memory; what is done is "
                "on disk, so start the campaign again with more memory for each worker"
            ) from error
        except ClusterError:
            raise
        except RuntimeError as error:
            if "deserialization" not in str(error):
                raise
            raise ClusterError("scheduler and workers of the cluster need the same simnav as the campaign") from error
        except (*lost, cancelled) as error:
            raise ClusterError(
                "the Dask scheduler was lost; what is done is on disk, so start the campaign again when it is back"
            ) from error
