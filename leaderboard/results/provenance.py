"""Where a result comes from: the version of the benchmark, the code, the libraries, the machine and the day.

A results folder holds each distinct provenance once, as ``provenance/ID.json``; a result refers to it by its short id.
What differs from result to result stands in the result itself: digests of scenario, simulator and estimator, and the
limits of time and memory.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from functools import cached_property, lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from llvmlite.binding import get_host_cpu_name

from .errors import RequestError

__all__ = ["BENCHMARK", "Provenance", "benchmark_of", "distinct", "here", "is_commit", "numerics"]

#: Name and version of the benchmark: its scenarios, and the rules by which results are scored and ranked.
#: Raised whenever results before and after a change must not stand in one table.
BENCHMARK = "simnav-bench 1.0"

#: Fields with the versions of the libraries that change numbers: another one may change the last digits of a result.
_NUMERICAL = ("numpy", "numba", "scipy", "gtsam", "filterpy")

_LIBRARIES = ("simnav", *_NUMERICAL)
#: Fields that came later: empty ones are not in the id, so that older ids stay as they are.
_LATER = ("seal", "scipy", "filterpy", "processor")
#: What of a checkout can decide a result: not its docs, its tests or the results that it publishes.
_CODE = (
    "pyproject.toml", "simnav", "estimators", "scenarios", "leaderboard",
    ":(exclude)leaderboard/standard/results", ":(exclude)leaderboard/standard/history.csv",
    ":(exclude)leaderboard/standard/drawn", ":(exclude)leaderboard/profiles",
)  # fmt: skip


@dataclass(frozen=True)
class Provenance:
    """Where results come from; a text is empty where it is not known.

    Attributes
    ----------
    benchmark : str
        Name and version of the benchmark; empty for results that were made before it had one.
    commit : str
        Commit of the checkout of simnav; empty if simnav is installed without a checkout.
    dirty : bool or None
        Whether the code of that checkout differed from the commit; None without a checkout.
    simnav, python, numpy, numba, gtsam, scipy, filterpy : str
        Versions.
    system : str
        Operating system and architecture.
    cpu : str
        Model of the processor.
    processor : str
        Its kind, as the compiler of the kernels calls it, such as ``x86_64 skylake-avx512``: another kind rounds
        differently.
    cores : int
        Number of cores that the process may use; 0 where it is not known.
    confinement : str
        How estimators were kept apart from the recording.
    seal : str
        Hash of the key of sealed seeds; empty where seeds are public.
    date : str
        Day of the run (UTC), as ``2026-11-22``.
    identity : str
        Id that a result names, where the rest was lost.
    """

    benchmark: str = ""
    commit: str = ""
    dirty: bool | None = None
    simnav: str = ""
    python: str = ""
    numpy: str = ""
    numba: str = ""
    gtsam: str = ""
    system: str = ""
    cpu: str = ""
    cores: int = 0
    confinement: str = ""
    seal: str = ""
    date: str = ""
    scipy: str = ""
    filterpy: str = ""
    processor: str = ""
    identity: str = ""

    @cached_property
    def id(self) -> str:
        """Short id: a digest of all fields; empty where nothing is known."""
        if self.identity or self == Provenance():
            return self.identity
        return _identity(asdict(self))

    def to_dict(self) -> dict[str, Any]:
        """All fields, with the id."""
        return {"id": self.id} | {f.name: getattr(self, f.name) for f in fields(self) if f.name != "identity"}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Provenance:
        """From what `to_dict` gave; fields of a later version are left out.

        Raises
        ------
        ValueError
            If the fields do not give the id that stands beside them.
        """
        known = {f.name for f in fields(cls)}
        found = cls(**{name: value for name, value in values.items() if name in known})
        for f in fields(cls):
            _check_type(f.name, getattr(found, f.name))
        later = set(values) - known - {"id"}
        identity = _identity({k: v for k, v in values.items() if k != "id"} | {"identity": ""}) if later else found.id
        if identity != values.get("id"):
            raise ValueError(f"the id should be {identity}, and is {values.get('id')!a:.80}")
        return found


def _identity(values: Mapping[str, Any]) -> str:
    """Digest of all fields; those that came later count where they are known."""
    content = {name: value for name, value in values.items() if name not in _LATER or value}
    return hashlib.blake2b(json.dumps(content, sort_keys=True).encode(), digest_size=6).hexdigest()


def _check_type(name: str, value: object) -> None:
    """ValueError for what no provenance has: a folder of others may hold anything."""
    if name == "dirty":
        good = value is None or isinstance(value, bool)
    elif name == "cores":
        good = type(value) is int and 0 <= value < 1 << 31
    else:
        good = isinstance(value, str) and len(value) <= 300 and value.isprintable()
    if not good:
        raise ValueError(f"{name} = {value!a:.80} is no such value")


def here(confinement: str = "", seal: str = "") -> Provenance:
    """The provenance of what this process computes now.

    Parameters
    ----------
    confinement : str
        How estimators are kept apart from the recording.
    seal : str
        Hash of the key of sealed seeds.
    """
    return _on(datetime.now(UTC).strftime("%Y-%m-%d"), confinement, seal)


@lru_cache(maxsize=8)
def _on(date: str, confinement: str, seal: str) -> Provenance:
    versions = {}
    for name in _LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            versions[name] = version(name)
    commit, dirty = _checkout(Path(__file__).resolve().parents[2])
    return Provenance(
        benchmark=BENCHMARK,
        commit=commit,
        dirty=dirty,
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        cpu=_cpu(),
        processor=_processor(),
        cores=_cores(),
        confinement=confinement,
        seal=seal,
        date=date,
        **versions,
    )


def _checkout(folder: Path) -> tuple[str, bool | None]:
    """Commit of a checkout, and whether its code differs from it; ("", None) where the folder is none."""
    if not (folder / ".git").exists():
        return "", None

    def git(*words: str) -> str:
        command = ["git", "-C", str(folder), *words]
        return subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=True).stdout

    try:
        changes = git("--no-optional-locks", "status", "--porcelain", "--untracked-files=no", "--", *_CODE)
        return git("rev-parse", "HEAD").strip(), bool(changes.strip())
    except (OSError, subprocess.SubprocessError):
        return "", None


@lru_cache(maxsize=256)
def is_commit(text: str) -> bool:
    """Whether a text is a commit in the history of the checkout that runs; False without a checkout."""
    if len(text) != 40 or not set(text) <= set("0123456789abcdef"):
        return False
    command = ["git", "-C", str(Path(__file__).resolve().parents[2]), "cat-file", "-e", f"{text}^{{commit}}"]
    try:
        return subprocess.run(command, capture_output=True, timeout=20.0, check=False).returncode == 0
    except (OSError, subprocess.SubprocessError):
        return False


def _cpu() -> str:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() in ("model name", "Model", "Hardware") and value.strip():
                return " ".join(value.split())
    return platform.processor()


def numerics(provenance: Provenance | None = None, *, processor: bool = True) -> tuple[str, ...]:
    """What rounds numbers: the versions of the numerical libraries, and the kind of the processor.

    Parameters
    ----------
    provenance : Provenance, optional
        Of which results; default: of what this process computes.
    processor : bool
        False leaves the processor out.
    """
    names = (*_NUMERICAL, "processor") if processor else _NUMERICAL
    return tuple(getattr(provenance or here(), name) for name in names)


def _processor() -> str:
    chosen = os.environ.get("NUMBA_CPU_NAME", "")  # which the kernels are compiled for, in place of what is here
    return f"{platform.machine()} {chosen or get_host_cpu_name()}"


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 0


def distinct(provenances: Iterable[Provenance]) -> list[Provenance]:
    """Each once, the latest day first; those of which nothing is known are left out."""
    found = {p.id: p for p in provenances if p.id}
    return sorted(found.values(), key=lambda p: (p.date, p.id), reverse=True)


def benchmark_of(provenances: Iterable[Provenance]) -> str:
    """The one version of the benchmark that results were made with; empty where it is not known.

    A provenance that was lost but for its id does not count.

    Raises
    ------
    RequestError
        If there are several: their results must not stand in one table.
    """
    versions = sorted({p.benchmark for p in provenances if not p.identity})
    if len(versions) > 1:
        named = " and ".join(v or "of no version" for v in versions)
        raise RequestError(
            f"results of different versions of the benchmark must not be mixed ({named}); keep each version in a "
            "folder of its own, or run the older results again"
        )
    return versions[0] if versions else ""
