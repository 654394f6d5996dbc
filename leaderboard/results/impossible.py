"""What no campaign can have written into the provenance of a result, whoever made it.

Commit, processor, system and confinement leave no trace in the numbers, so no repetition proves them. A value that
cannot exist is refused all the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import UTC, date, datetime, timedelta
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, requires
from typing import TYPE_CHECKING

from packaging.requirements import InvalidRequirement, Requirement
from packaging.utils import canonicalize_name
from packaging.version import InvalidVersion, Version

if TYPE_CHECKING:
    from .provenance import Provenance

__all__ = ["CONFINEMENTS", "impossible"]

#: What may have kept an estimator from the truth; empty in results of old versions.
CONFINEMENTS = ("bubblewrap", "landlock", "process", "none", "")
_ON_LINUX = ("bubblewrap", "landlock")
_LIBRARIES = ("simnav", "numpy", "numba", "scipy", "gtsam", "filterpy")
_FIRST_DAY = date(2020, 1, 1)


def impossible(made: Provenance, required: Iterable[str] = ()) -> list[str]:
    """What cannot be true of a provenance, one sentence each; an empty value is possible.

    Parameters
    ----------
    made : Provenance
        Of somebody's results.
    required : iterable of str
        Requirements of whoever submits them, as ``name[extras]specifier``. Those of simnav count as well.

    Examples
    --------
    >>> from simnav.leaderboard.results.provenance import Provenance
    >>> impossible(Provenance(commit="main", numpy="1.0", confinement="landlock", system="Windows AMD64"), ["numpy>=2"])
    ["commit 'main' is no hash", "numpy '1.0' is excluded by the requirement numpy>=2", "confinement 'landlock' does not exist on 'Windows AMD64'"]
    """  # noqa: E501
    found = []
    if made.commit and not re.fullmatch(r"[0-9a-f]{40}([0-9a-f]{24})?", made.commit):
        found.append(f"commit {_short(made.commit)} is no hash")
    wanted = [*required, *_of_simnav()]
    for name in (*_LIBRARIES, "python"):
        if fault := _fault_of_version(name, getattr(made, name), wanted):
            found.append(fault)
    for name in ("cpu", "system", "processor"):
        text = getattr(made, name)
        if not (text.isascii() and text.isprintable()):
            found.append(f"{name} {_short(text)} is no printable ASCII text")
    if made.confinement not in CONFINEMENTS:
        found.append(f"confinement {_short(made.confinement)} is none of {', '.join(CONFINEMENTS[:-1])}")
    elif made.confinement in _ON_LINUX and made.system and not made.system.startswith("Linux"):
        found.append(f"confinement {_short(made.confinement)} does not exist on {_short(made.system)}")
    if made.processor and made.system and made.processor.split(" ")[0] != made.system.split(" ")[-1]:
        found.append(f"processor {_short(made.processor)} is none of {_short(made.system)}")
    if fault := _fault_of_date(made.date):
        found.append(fault)
    return found


def _fault_of_version(name: str, text: str, required: Iterable[str]) -> str:
    if not text:
        return ""
    try:
        version = Version(text)
    except InvalidVersion:
        return f"{name} {_short(text)} is no version"
    for line in required:
        try:
            asked = Requirement(line)
        except InvalidRequirement:
            continue  # whoever opens a bundle says so
        if canonicalize_name(asked.name) == name and not asked.specifier.contains(version, prereleases=True):
            return f"{name} {_short(text)} is excluded by the requirement {line.partition(';')[0].strip():.100}"
    return ""


@lru_cache(maxsize=1)
def _of_simnav() -> tuple[str, ...]:
    """What simnav itself requires, without its extras."""
    try:
        lines = requires("simnav") or []
    except PackageNotFoundError:
        return ()
    return tuple(line for line in lines if "extra ==" not in line)


def _fault_of_date(text: str) -> str:
    if not text:
        return ""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return f"date {_short(text)} is no day, such as 2026-11-22"
    latest = datetime.now(UTC).date() + timedelta(days=2)  # clocks differ
    return "" if _FIRST_DAY <= day <= latest else f"date {_short(text)} is not between {_FIRST_DAY} and {latest}"


def _short(text: str) -> str:
    return ascii(text) if len(text) <= 60 else ascii(f"{text[:50]}...")
