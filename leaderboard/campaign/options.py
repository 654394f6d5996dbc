"""The options of everything that runs estimators on many seeds, and those of campaigns, with their checks."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Any, TypeAlias

from simnav.leaderboard.calls import finite_number, option, request, whole_number
from simnav.leaderboard.results.errors import RequestError

__all__ = ["CampaignOptions", "PathLike", "RunOptions", "part_of", "shard_of", "shared"]

PathLike: TypeAlias = "str | os.PathLike[str]"

_BACKENDS = ("loky", "dask")


def part_of(text: str) -> tuple[int, int]:
    """Which of how many parts.

    >>> part_of("2/8")
    (2, 8)
    """
    part, _, parts = text.partition("/")
    if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
        raise RequestError(f"--shard {text}: it should be K/N with K from 1 to N, like --shard 2/8")
    return int(part), int(parts)


def shard_of(given: Any) -> tuple[int, int]:
    """Which of how many parts, checked; RequestError on anything else."""
    if not (isinstance(given, Sequence) and len(given) == 2 and all(isinstance(k, int) for k in given)):
        raise RequestError(f"shard = {given!r} should be a pair (k, n): part k of n")
    part, parts = given
    if not 1 <= part <= parts:
        raise RequestError(f"shard = {part}/{parts} should be k/n, with k from 1 to n")
    return part, parts


@request
class RunOptions:
    """Processes and limits."""

    _LAST = True
    _: KW_ONLY
    workers: int = option(default=2, help="Number of processes.", least=1)
    time_limit: float | None = option(
        help="Seconds that an estimator may take for a run. Default: a fifth of real time, at least 60 s.",
        default=None,
        least=0.1,
    )
    memory_limit: float = option(
        default=2048.0, help="MiB that an estimator may take beyond the recording.", least=16, cli=int, cli_default=2048
    )

    def __post_init__(self) -> None:
        whole_number("workers", self.workers, 1)
        finite_number("memory_limit", self.memory_limit, 16.0)
        if self.time_limit is not None and not finite_number("time_limit", self.time_limit) > 0.0:
            raise RequestError(f"time_limit = {self.time_limit:g} s should be greater than 0")


@request
class CampaignOptions(RunOptions):
    """How the runs of a campaign are done."""

    _LAST = True
    _: KW_ONLY
    retry: bool = option(
        "--retry",
        default=False,
        help="Run the failed runs of the folder again.",
        more="Failed are errors, timeouts, out of memory, diverged and invalid output. A run that could not be "
        "recorded, or that ended because of a shorter time limit or a smaller memory limit, is always run again.",
    )
    force: Sequence[str] = option(
        default=(),
        metavar="NAME",
        help="Run this estimator anew; several are separated by commas.",
        more="Names or labels, even if the folder has their results.",
    )
    keep_trials: bool = option(
        "--keep-trials",
        default=False,
        help="Keep the estimates, for 'simnav campaign rescore'.",
        more="Also the covariances, diagnostics and flags: about 190 bytes an epoch and run.",
    )
    covariance_interval: float = option(
        default=0.0,
        least=0.0,
        help="Smallest number of seconds between two kept covariances. 0 keeps all.",
        more="With fewer, `rescore` does not compute scores that use the covariance.",
    )
    backend: str = option(
        default="loky",
        help="Processes of this machine (loky), or a Dask cluster (dask).",
        more="The extra ``distributed`` has Dask. Its workers need no common disk: the results travel through the "
        "scheduler.",
    )
    scheduler: str | None = option(
        default=None,
        metavar="ADDRESS",
        help="Address of the Dask scheduler, e.g. tcp://host:8786; implies dask.",
        more="Default: a cluster on this machine.",
    )
    shard: tuple[int, int] = option(
        default=(1, 1),
        metavar="K/N",
        cli=str,
        cli_default="1/1",
        read=part_of,
        help="Do part K of N of the runs; 'simnav campaign merge' puts the parts together.",
    )
    confinement: str = option(
        default="auto",
        help="How estimators are kept from the truth: auto, bubblewrap, process, none.",
        more="Default: the strongest that works here, see docs/explanation/security.md.",
    )
    minutes: float | None = option(
        default=None, least=0.0, help="Start no run after so many minutes. The same command continues."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.minutes is not None:
            finite_number("minutes", self.minutes)
        finite_number("covariance_interval", self.covariance_interval)
        shard_of(self.shard)
        if self.backend not in _BACKENDS:
            raise RequestError(f"backend = {self.backend!r} is unknown; there are 'loky' and 'dask'")
        if self.effective_backend == "dask" and importlib.util.find_spec("distributed") is None:
            raise RequestError("backend = 'dask' needs the extra 'distributed': pip install 'simnav[distributed]'")

    @property
    def effective_backend(self) -> str:
        """The backend; the address of a scheduler implies ``dask``."""
        return "dask" if self.scheduler else self.backend


def shared(request: Any, wanted: type[Any]) -> dict[str, Any]:
    """The values of a request for the options that another one has, too."""
    return {name: getattr(request, name) for name in wanted.__dataclass_fields__ if hasattr(request, name)}
